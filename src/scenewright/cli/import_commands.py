"""`scenewright intersections`: what there is, and how one of one's own is made."""

from __future__ import annotations

from pathlib import Path

from scenewright.cli.console import ProgressCallback, Result, write_stdout
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
    from scenewright.cli.intersections import describe, draw_list, format_rows, list_rows

    found, roads = list_rows(file, street or ())
    if png is not None:
        draw_list(file, found, roads, png)
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
    from scenewright.intersections import find_bundle_folder, load_map, read_bundle_header
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
    from scenewright.cli.intersections import format_intersections, summarize_intersections

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
    from scenewright.cli.intersections import describe_intersection, format_intersection

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
