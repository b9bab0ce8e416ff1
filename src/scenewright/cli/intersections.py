"""`scenewright intersections`: the bundles, how one looks, and the junctions of a map file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scenewright.cli.console import format_columns, format_one_line
from scenewright.errors import InputError
from scenewright.intersections import (
    find_bundle_folder,
    list_intersections,
    load_map,
    read_bundle_header,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.map_import import Junction, list_junctions
from scenewright.tools.map_import.compass import name_bearing
from scenewright.tools.map_import.junction_choice import find_streets


def summarize_intersections() -> list[dict[str, Any]]:
    """A few facts on every bundle; a broken one is listed with what is wrong."""
    rows: list[dict[str, Any]] = []
    for name in list_intersections():
        try:
            rows.append(_summarize_intersection(load_map(name), name))
        except InputError as error:
            rows.append({"name": name, "error": format_one_line(str(error))})
    return rows


def _summarize_intersection(intersection_map: IntersectionMap, name: str) -> dict[str, Any]:
    return {
        "name": name,
        "title": intersection_map.title,
        "legs": [leg.name for leg in intersection_map.legs],
        "signals": intersection_map.signals is not None,
        "priors": (find_bundle_folder(name) / "priors.npz").is_file(),
    }


def describe_intersection(name: str) -> dict[str, Any]:
    """What an instruction may refer to at an intersection.

    Raises:
        InputError: there is no such bundle, or it is broken.
    """
    intersection_map = load_map(name)
    facts = _summarize_intersection(intersection_map, name)
    stated = read_bundle_header(find_bundle_folder(name)).get("provenance", {}).get("priors")
    return {
        **facts,
        "priors_from": str(stated or "fitted") if facts["priors"] else "none",
        "legs": [{"name": leg.name, "road": leg.road} for leg in intersection_map.legs],
        "movements": [
            {"entry": each.entry, "exit": each.exit, "turn": each.turn}
            for each in intersection_map.movements
        ],
        "crosswalks": [each.leg for each in intersection_map.crosswalks],
        "signals": None
        if intersection_map.signals is None
        else {"cycle": intersection_map.signals.cycle},
        "extent": intersection_map.extent,
        "right_hand_traffic": not intersection_map.left_hand_traffic,
    }


def format_intersections(rows: list[dict[str, Any]]) -> str:
    """The bundles as a table."""
    titles = ("name", "title", "legs", "signals", "priors")
    cells = []
    for row in rows:
        own = [row["name"], row["error"], "", "", ""] if "error" in row else [
            row["name"], row["title"], ", ".join(row["legs"]),
            *("yes" if row[key] else "no" for key in ("signals", "priors")),
        ]  # fmt: skip
        cells.append([format_one_line(cell) for cell in own])
    return format_columns(titles, cells, right=set())


def format_intersection(facts: dict[str, Any]) -> str:
    """The facts on one intersection as lines."""
    signals = facts["signals"]
    lights = "none" if signals is None else f"cycle of {signals['cycle']:g} s"
    ways: dict[str, list[str]] = {}
    for each in facts["movements"]:
        way = f"{each['turn']} to {each['exit']}"
        if way not in ways.setdefault(each["entry"], []):
            ways[each["entry"]].append(way)
    lines = [
        f"{facts['name']}: {facts['title']}",
        f"traffic: {'right' if facts['right_hand_traffic'] else 'left'}-hand",
        f"signals: {lights}",
        f"priors: {facts['priors_from']}",
        f"crosswalks: {', '.join(facts['crosswalks']) or 'none'}",
        *(f"{leg['name']} leg: {leg['road']}" for leg in facts["legs"]),
        *(f"from {entry}: {', '.join(found)}" for entry, found in ways.items()),
    ]
    return "".join(format_one_line(line) + "\n" for line in lines)


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
