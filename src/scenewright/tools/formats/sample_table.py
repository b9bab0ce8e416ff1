"""Rows of a table of tracks by agent, each value checked when it is read."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np

from scenewright.errors import InputError
from scenewright.tools.formats.sampled_recording import AgentSamples, find_subtype

MOST_BYTES = 200_000_000
"""Larger texts are refused; a part of them can be checked."""
FARTHEST, LATEST = 1e8, 1e10
"""Positions [m] and times beyond these are none."""
MOST_HEADING = 20.0
"""Headings beyond this are degrees [rad]."""
OPTIONAL = ("heading", "length", "width")
COLUMNS = ("t", "x", "y", *OPTIONAL)


@dataclass(eq=False)
class _Rows:
    subtype: str
    lines: array[int] = field(default_factory=lambda: array("q"))
    values: array[float] = field(default_factory=lambda: array("d"))


@dataclass(eq=False)
class SampleTable:
    """The rows of a file by agent.

    Attributes:
        name: of the file; one_class: whether rows of an agent that differ in class are refused.
    """

    name: str
    one_class: bool = True
    agents: dict[str, _Rows] = field(default_factory=dict)

    def refuse(self, line: int | None, reason: str) -> NoReturn:
        """Raise InputError with the place of a row, if it has a line of its own."""
        raise InputError(f"{self.name}{'' if line is None else f', line {line}'}: {reason}")

    def add(self, line: int | None, who: str, word: str, values: Mapping[str, float]) -> None:
        """Append a row of `COLUMNS`, of which those that are optional may be missing.

        Raises:
            InputError: a value or class that is none, or an agent of two classes.
        """
        subtype = find_subtype(word)
        if subtype is None:
            self.refuse(line, f"class {crop(word)!r} is unknown; use vehicle or pedestrian, or one "
                        "of car, truck, bus, motorcycle, bicycle")  # fmt: skip
        for column, value in values.items():
            if reason := find_fault(column, value):
                self.refuse(line, reason)
        rows = self.agents.setdefault(who, _Rows(subtype))
        if rows.subtype != subtype and self.one_class:
            first = f"in line {rows.lines[0]}" if rows.lines else "elsewhere"
            self.refuse(line, f"id {crop(who)} is a {subtype} here and a {rows.subtype} {first}; "
                        "give each agent an id of its own")  # fmt: skip
        rows.lines.extend([] if line is None else [line])
        rows.values.extend(values.get(column, math.nan) for column in COLUMNS)

    def list_agents(self) -> tuple[AgentSamples, ...]:
        """All agents in order of their first rows; sizes are the medians of their rows."""
        agents = []
        for who, rows in self.agents.items():
            table = np.array(rows.values).reshape(-1, len(COLUMNS))
            length, width = (
                None if np.isnan(v).all() else round(float(np.nanmedian(v)), 4)
                for v in table[:, 4:].T
            )
            agents.append(AgentSamples(
                who, rows.subtype, table[:, 0], table[:, 1:3], table[:, 3], length, width,
                lines=np.array(rows.lines) if rows.lines else None,
            ))  # fmt: skip
        return tuple(agents)


def find_fault(column: str, value: float) -> str | None:
    """Why a number cannot be what its column says it is; None if it can."""
    if not math.isfinite(value):
        mend = "leave out the row" if column not in OPTIONAL else "leave the cell empty"
        return f"{column} is {value}; {mend} where it is unknown"
    if column in ("x", "y") and abs(value) > FARTHEST:
        return f"{column} = {value:g} is too far off; positions are metres"
    if column in ("t", "f") and abs(value) > LATEST:
        return f"{column} = {value:g} is too large; times are seconds"
    if column == "heading" and abs(value) > MOST_HEADING:
        return f"heading = {value:g} looks like degrees; headings are radians"
    if column in ("length", "width") and not 0 < value < 100:
        return f"{column} = {value:g} m is no size; leave the cell empty if unknown"
    return None


def decode_text(data: bytes, *, name: str) -> str:
    """The text of a file: UTF-8, with or without a byte order mark.

    Raises:
        InputError: too large, empty or in another encoding.
    """
    if len(data) > MOST_BYTES:
        raise InputError(describe_too_large(name, len(data)))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{name}, line {line}: this is not UTF-8; save it as UTF-8") from error
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise InputError(f"{name}, line {line}: this is not text in UTF-8; save it as UTF-8")
    if not text.strip():
        raise InputError(f"{name} is empty; it must hold tracks")
    return text


def describe_too_large(name: str, size: int) -> str:
    """What to say about a file of too many bytes."""
    return f"{name} has {size / 1e6:.0f} MB; at most {MOST_BYTES / 1e6:.0f}: check it in parts"


def crop(text: str, *, limit: int = 40) -> str:
    """A piece of a file short enough for a message."""
    return text if len(text) <= limit else text[: limit - 1] + "…"
