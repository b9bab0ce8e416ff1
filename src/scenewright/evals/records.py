"""Records of a report as the cells of a table, whichever way it is printed."""

from __future__ import annotations

import string
from collections.abc import Iterable, Mapping
from typing import Any


class _CellFormatter(string.Formatter):
    """`str.format`, with a dash for None."""

    def format_field(self, value: Any, format_spec: str) -> Any:
        """Format a field."""
        return "–" if value is None else super().format_field(value, format_spec)


def format_records(records: Iterable[Any], columns: Mapping[str, str]) -> list[list[str]]:
    """Format the cells of records (dataclasses), one row for each.

    Args:
        columns: title -> template of `str.format` over a record's fields, such as `{nll:.2f}`; a
            field that is None is a dash.
    """
    formatter = _CellFormatter()
    return [
        [formatter.vformat(cell, (), vars(record)) for cell in columns.values()]
        for record in records
    ]
