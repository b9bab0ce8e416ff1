"""`scenewright intersections`: what there is, and how one of one's own is made."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scenewright.cli.console import (
    ProgressCallback,
    Result,
    format_columns,
    format_one_line,
    write_stdout,
)
from scenewright.cli.options import (
    Commands,
    FitOptions,
    ImportOptions,
    TrainOptions,
    argument,
    option,
)
from scenewright.cli.output_folder import try_file
from scenewright.errors import InputError
from scenewright.files import write_atomically
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
            {"entry": movement.entry, "exit": movement.exit, "turn": movement.turn}
            for movement in intersection_map.movements
        ],
        "crosswalks": [crosswalk.leg for crosswalk in intersection_map.crosswalks],
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
    for fact in facts["movements"]:
        way = f"{fact['turn']} to {fact['exit']}"
        if way not in ways.setdefault(fact["entry"], []):
            ways[fact["entry"]].append(way)
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


intersections = Commands(name="intersections", help="The intersections that scenes can be made at.")


@intersections.command("import")
def import_map_file(
    *,
    file: str = argument(..., "OpenStreetMap or Lanelet2 .osm, OpenDRIVE .xodr, SUMO .net.xml."),
    options: ImportOptions,
    log: ProgressCallback,
) -> Result:
    """Make an intersection of your own from a map file: scenes can be made there at once."""
    from scenewright.cli.custom_intersections import import_file, import_text

    facts = import_file(file, options, log=log)
    return Result(facts, f"{facts['folder']}\n", summary=import_text(facts))


@intersections.command("junctions")
def show_junctions(
    file: str = argument(..., "A map file; see `import`."),
    street: list[str] | None = option(None, "Only junctions of this street.", metavar="NAME"),
    png: str | None = option(None, "Draw a map of them, by their ids, to a PNG.", metavar="FILE"),
) -> Result:
    """List the junctions of a map file, to choose one for `import`."""

    found, roads = list_rows(file, street or ())
    if png is not None:
        from scenewright.viz.junction_list import JunctionMark, draw_junctions

        marks = [
            JunctionMark(each.id, each.xy, tuple(zip(each.bearings, each.streets, strict=True)))
            for each in found[:_MOST_DRAWN]
        ]
        draw_junctions(png, title=f"{file}: {len(found)} junctions", marks=marks, roads=roads)
    facts = {"file": file, "junctions": list(map(describe, found))}
    return Result(facts, format_rows(found))


@intersections.command("export")
def export_map(
    name: str = argument(..., "An intersection; see `list`."),
    out: str = argument(
        ..., "F.xodr (OpenDRIVE), F.osm (Lanelet2).", metavar="FILE", check=try_file
    ),
) -> None:
    """Write an intersection's map as OpenDRIVE or Lanelet2, by the ending of FILE."""
    from scenewright.tools.formats.lanelet2 import write_lanelet2
    from scenewright.tools.formats.opendrive import write_opendrive

    place = load_map(name)
    match Path(out).suffix.lower():
        case ".xodr":
            data = write_opendrive(place)
        case ".osm":
            origin = read_bundle_header(find_bundle_folder(name)).get("frame", {}).get("origin")
            data = write_lanelet2(place, tuple(origin) if origin else None)
        case other:
            raise InputError(f"a map is written as .xodr or .osm, not {other or out!r}")
    write_atomically(out, data)
    write_stdout(f"{out}\n")


@intersections.command("simulate")
def simulate(
    *,
    name: str = argument(..., "Its name."),
    minutes: int = option(20, "How much traffic [min].", min=10, max=240),
    seed: int = option(0, "Seed of the simulation.", min=0),
    train: bool = option(True, "Train a refiner on it, about half a minute.", "--train/--no-train"),
    corpus: str | None = option(
        None, "An .npz to keep the tracks in, for `train --others`.", metavar="F"
    ),
    log: ProgressCallback,
) -> Result:
    """Simulate traffic at an imported intersection, fit its priors, train its refiner.

    Needs the extra `simulate`.
    """
    from scenewright.cli.custom_intersections import simulate_own

    facts = simulate_own(name, minutes=minutes, seed=seed, train=train, log=log, corpus=corpus)
    return Result(facts, f"{facts['folder']}\n")


@intersections.command("fit")
def fit(
    *,
    name: str = argument(..., "Its name."),
    tracks: list[str] = argument(
        ...,
        "TAF-BW or inD-style csv, TrajNet++ ndjson, SUMO FCD xml, any csv; or folders.",
        metavar="TRACKS...",
    ),
    options: FitOptions,
    log: ProgressCallback,
) -> Result:
    """Fit an imported intersection's priors on recorded tracks, few or many."""
    from scenewright.cli.custom_intersections import fit_own, fit_text

    facts = fit_own(name, tracks, options, log=log)
    return Result(facts, f"{facts['folder']}\n", summary=fit_text(facts))


@intersections.command("list")
def list_all() -> Result:
    """List the intersections there are."""

    rows = summarize_intersections()
    return Result({"intersections": rows}, format_intersections(rows))


@intersections.command("show")
def show_one(
    name: str = argument(..., "Its name."),
    png: str | None = option(None, "Draw the map to this file.", metavar="F"),
    samples: bool = option(False, "In the picture, paths drawn from the priors too."),
    rrd: str | None = option(None, "Write it as a recording for the rerun viewer.", metavar="F"),
) -> Result:
    """Say what an intersection has: legs, movements, crosswalks, signals."""

    facts = describe_intersection(name)
    if png is not None or rrd is not None:
        from scenewright.cli.custom_intersections import draw_own, record_own

        if png is not None:
            draw_own(png, name, with_samples=samples)
            facts["png"] = png
        if rrd is not None:
            record_own(rrd, name)
            facts["rrd"] = rrd
    return Result(facts, format_intersection(facts))


@intersections.command("train")
def train(
    *,
    name: str = argument(..., "Its name."),
    options: TrainOptions,
    log: ProgressCallback,
) -> Result:
    """Train an intersection's refiner; started again after a kill, it goes on where it was."""
    from scenewright.cli.refiners import train_refiner

    made = train_refiner(name, options, log=log)
    return Result({"name": name, **made}, f"{made['folder']}\n")
