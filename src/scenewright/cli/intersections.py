"""`scenewright intersections`: what bundles there are, how one looks, and building one."""

from __future__ import annotations

from typing import Any

from scenewright.cli.console import format_columns, format_one_line
from scenewright.intersections import (
    find_bundle_folder,
    list_intersections,
    load_map,
    read_bundle_header,
)
from scenewright.scene.map import IntersectionMap


def summarize_intersections() -> list[dict[str, Any]]:
    """A few facts on every bundle; a broken one is listed with what is wrong."""
    from scenewright.errors import InputError

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
