"""Markdown tables of reports and cards."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def format_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Format a table as GitHub Markdown; a line break within a cell becomes a space."""
    lines = [f"| {' | '.join(map(str, cells))} |".replace("\n", " ") for cells in (head, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])


def escape_markdown(text: str, *, longest: int = 200) -> str:
    """Text from anywhere on one line of at most so many characters, without active markup."""
    line = " ".join(text.split())[:longest]
    return "".join(f"\\{char}" if char in "|<>[]`*_\\" else char for char in line)
