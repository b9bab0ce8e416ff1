"""Labelled instructions by many voices, and times of day that fit a label."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any, Literal

Row = Mapping[str, Any]
_DAY = 24 * 60


def load(part: Literal["development", "test", "voices"]) -> list[dict[str, Any]]:
    """The labelled instructions of the package: {"id", "text", "previous"?, "expected"}."""
    source = files("scenewright.evals.planning").joinpath(f"{part}.jsonl").read_text("utf-8")
    return [json.loads(line) for line in source.splitlines()]


def does_time_fit(label: str | list[str] | None, time: str | list[str] | None) -> bool:
    """Whether a time of day or range lies in a label's; HH:MM or HH:MM-HH:MM, None is no time."""
    if isinstance(time, list):
        time = "-".join(time)
    if label is None or time is None:
        return label is time
    if isinstance(label, list):
        return any(does_time_fit(one, time) for one in label)
    if label == time or "-" not in label:
        return label == time
    start, length = _parse_range(label)
    first, ours = _parse_range(time)
    return (first - start) % _DAY + ours <= length


def _parse_range(text: str) -> tuple[int, int]:
    """Start [min of day] and length [min] of HH:MM or HH:MM-HH:MM."""
    ends = [int(part[:2]) * 60 + int(part[3:5]) for part in text.split("-")]
    return ends[0], (ends[-1] - ends[0]) % _DAY
