"""`scenewright intersections junctions`: the junctions of a map file, listed and drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from scenewright.cli.console import format_one_line
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import import Junction, list_junctions
from scenewright.tools.map_import.compass import name_bearing
from scenewright.tools.map_import.junction_choice import find_streets

_MOST_DRAWN = 400


@dataclass(frozen=True)
class JunctionRow:
    """One junction as it is listed."""

    junction: Junction

    @property
    def place(self) -> str:
        """Latitude and longitude, or x and y [m], as `--at` takes them."""
        degrees = self.junction.degrees
        if degrees is not None:
            return f"{degrees[0]:.6f},{degrees[1]:.6f}"
        return "{:.1f},{:.1f}".format(*self.junction.xy)

    @property
    def legs(self) -> list[dict[str, str]]:
        """Legs clockwise from the north: which way they lead, and their street."""
        own = zip(self.junction.bearings, self.junction.streets, strict=True)
        ordered = sorted(own, key=lambda each: (math.pi / 2 - each[0]) % math.tau)
        return [{"towards": name_bearing(bearing), "street": street} for bearing, street in ordered]

    def describe(self) -> dict[str, Any]:
        """Its facts as plain values."""
        each = self.junction
        return {
            "id": each.id,
            "at": self.place,
            "roundabout": each.is_roundabout,
            "nodes": len(each.nodes),
            "legs": self.legs,
            "refusal": each.refusal or None,
        }


def list_rows(
    file: str, streets: Sequence[str] = ()
) -> tuple[list[JunctionRow], tuple[FloatArray, ...]]:
    """The junctions of a file, those of most legs first, and its roads.

    Raises:
        InputError: the file cannot be read, or has no junction (of those streets).
    """
    from pathlib import Path

    overview = list_junctions(file)
    found: Sequence[Junction] = overview.junctions
    if streets:
        found = find_streets(found, Path(file), streets)
    if not found:
        raise InputError(f"{file} has no junction of three or more legs for vehicles")
    ordered = sorted(found, key=lambda each: (-each.legs, len(each.id), each.id))
    return [JunctionRow(each) for each in ordered], overview.roads


def format_rows(rows: Sequence[JunctionRow]) -> str:
    """A line for each junction: id, place, legs."""
    lines = []
    for row in rows:
        kind = "roundabout, " if row.junction.is_roundabout else ""
        legs = ", ".join(f"{leg['towards']} {leg['street'] or '(unnamed)'}" for leg in row.legs)
        about = f"{len(row.legs)} legs: {legs}"
        if row.junction.refusal:
            about = f"cannot be imported: {row.junction.refusal}"
        lines.append(f"{row.junction.id}  at {row.place}  {kind}{about}")
    return "".join(format_one_line(line, limit=240) + "\n" for line in lines)


def draw_list(
    file: str, rows: Sequence[JunctionRow], roads: Sequence[FloatArray], png: str
) -> None:
    """A picture of where the junctions lie, each with its id and its streets."""
    from scenewright.viz.junction_list import JunctionMark, draw_junctions

    shown = rows[:_MOST_DRAWN]
    marks = [
        JunctionMark(
            row.junction.id,
            row.junction.xy,
            tuple(zip(row.junction.bearings, row.junction.streets, strict=True)),
        )
        for row in shown
    ]
    draw_junctions(png, title=f"{file}: {len(rows)} junctions", marks=marks, roads=roads)
