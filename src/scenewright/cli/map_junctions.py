"""`scenewright intersections junctions`: the junctions of a map file, listed and drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scenewright.cli.console import format_one_line
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import import Junction, list_junctions
from scenewright.tools.map_import.compass import name_bearing
from scenewright.tools.map_import.junction_choice import find_streets

_MOST_DRAWN = 400


def find_place(junction: Junction) -> str:
    """Latitude and longitude, or x and y [m], as `--at` takes them."""
    if junction.degrees is not None:
        return "{:.6f},{:.6f}".format(*junction.degrees)
    return "{:.1f},{:.1f}".format(*junction.xy)


def list_legs(junction: Junction) -> list[dict[str, str]]:
    """Legs clockwise from the north: which way they lead, and their street."""
    own = zip(junction.bearings, junction.streets, strict=True)
    ordered = sorted(own, key=lambda each: (math.pi / 2 - each[0]) % math.tau)
    return [{"towards": name_bearing(bearing), "street": street} for bearing, street in ordered]


def describe(each: Junction) -> dict[str, Any]:
    """Its facts as plain values."""
    return {
        "id": each.id, "at": find_place(each), "roundabout": each.is_roundabout,
        "nodes": len(each.nodes), "legs": list_legs(each), "refusal": each.refusal or None,
    }  # fmt: skip


def list_rows(
    file: str, streets: Sequence[str] = ()
) -> tuple[list[Junction], tuple[FloatArray, ...]]:
    """The junctions of a file, those of most legs first, and its roads.

    Raises:
        InputError: the file cannot be read, or has no junction (of those streets).
    """
    overview = list_junctions(file)
    found: Sequence[Junction] = overview.junctions
    if streets:
        found = find_streets(found, Path(file), streets)
    if not found:
        raise InputError(f"{file} has no junction of three or more legs for vehicles")
    return sorted(found, key=lambda each: (-each.legs, len(each.id), each.id)), overview.roads


def format_rows(rows: Sequence[Junction]) -> str:
    """A line for each junction: id, place, legs."""
    lines = []
    for row in rows:
        kind, own = "roundabout, " if row.is_roundabout else "", list_legs(row)
        legs = ", ".join(f"{leg['towards']} {leg['street'] or '(unnamed)'}" for leg in own)
        about = f"{len(own)} legs: {legs}"
        if row.refusal:
            about = f"cannot be imported: {row.refusal}"
        lines.append(f"{row.id}  at {find_place(row)}  {kind}{about}")
    return "".join(format_one_line(line, limit=240) + "\n" for line in lines)


def draw_list(file: str, rows: Sequence[Junction], roads: Sequence[FloatArray], png: str) -> None:
    """A picture of where the junctions lie, each with its id and its streets."""
    from scenewright.viz.junction_list import JunctionMark, draw_junctions

    marks = [
        JunctionMark(row.id, row.xy, tuple(zip(row.bearings, row.streets, strict=True)))
        for row in rows[:_MOST_DRAWN]
    ]
    draw_junctions(png, title=f"{file}: {len(rows)} junctions", marks=marks, roads=roads)
