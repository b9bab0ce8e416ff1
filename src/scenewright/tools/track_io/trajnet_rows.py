"""The rows of TrajNet++ files: one JSON object a line, a scene or a row of a track."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Literal, NoReturn

Kind = Literal["scene", "track"]
_KINDS: tuple[Kind, ...] = ("scene", "track")
Predictions = Literal["refuse", "leave out", "first as tracks"]
"""What becomes of rows with a `prediction_number`: files of the benchmark hold up to three
predictions, numbered from 0, beside or in place of what was observed."""


def iterate_trajnet_rows(
    lines: Iterable[str], *, predictions: Predictions, refuse: Callable[[int, str], NoReturn]
) -> Iterator[tuple[int, Kind, dict[str, Any]]]:
    """The line, from 1, kind and values of every scene and row of a track; empty lines skipped.

    Args:
        refuse: raises the reader's error for a line and what is wrong with it.
    """
    for line, content in enumerate(lines, start=1):
        if not content.strip():
            continue
        try:
            entry = json.loads(content)
        except (ValueError, RecursionError) as error:
            refuse(line, f"no JSON: {getattr(error, 'msg', None) or 'cannot be read'}")
        if not isinstance(entry, dict):
            refuse(line, "expected one JSON object per line")
        kind = next((each for each in _KINDS if isinstance(entry.get(each), dict)), None)
        if kind is None:
            refuse(line, 'expected {"scene": {...}} or {"track": {"f", "p", "x", "y"}}')
        number = entry[kind].get("prediction_number") if kind == "track" else None
        if number is not None and predictions == "refuse":
            refuse(line, "this is a prediction; leave out tracks with a prediction_number")
        if number is None or (number == 0 and predictions == "first as tracks"):
            yield line, kind, entry[kind]
