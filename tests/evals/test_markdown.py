"""Markdown tables of the reports."""

from __future__ import annotations

from scenewright.dataset.tables.markdown import format_table


def test_a_table_has_one_line_per_row_below_the_rule() -> None:
    assert format_table(("method", "n"), [("gmm", 3), ("two\nlines", "")]) == (
        "| method | n |\n|---|---|\n| gmm | 3 |\n| two lines |  |"
    )
    assert format_table(("a",), []) == "| a |\n|---|"
