"""The commands for intersections of one's own: import, simulate, fit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from scenewright.cli.common_options import Json, Quiet, spread_options
from scenewright.cli.console import (
    format_one_line,
    log_line,
    show_progress,
    write_json,
    write_stdout,
)
from scenewright.cli.intersection_options import FitOptions, ImportOptions
from scenewright.cli.output_folder import try_file


@spread_options
def import_map_file(
    file: Annotated[
        str, typer.Argument(help="OpenStreetMap or Lanelet2 .osm, OpenDRIVE .xodr, SUMO .net.xml.")
    ],
    options: ImportOptions,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Make an intersection of your own from a map file: scenes can be made there at once."""
    from scenewright.cli.custom_intersections import import_file, import_text

    with show_progress(quiet=quiet) as log:
        facts = import_file(file, options, log=log)
    _print_facts(facts, () if quiet else import_text(facts), as_json=as_json)


def show_junctions(
    file: Annotated[str, typer.Argument(help="A map file; see `import`.")],
    street: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only junctions of this street.")
    ] = None,
    png: Annotated[
        str | None, typer.Option(metavar="FILE", help="Draw a map of them, by their ids, to a PNG.")
    ] = None,
    as_json: Json = False,
) -> None:
    """List the junctions of a map file, to choose one for `import`."""
    from scenewright.cli.map_junctions import draw_list, format_rows, list_rows

    found, roads = list_rows(file, street or ())
    if png is not None:
        draw_list(file, found, roads, png)
    if as_json:
        write_json({"ok": True, "file": file, "junctions": [row.describe() for row in found]})
    else:
        write_stdout(format_rows(found))


def export_map(
    name: Annotated[str, typer.Argument(help="An intersection; see `list`.")],
    out: Annotated[
        str,
        typer.Argument(
            metavar="FILE", help="F.xodr (OpenDRIVE), F.osm (Lanelet2).", callback=try_file
        ),
    ],
) -> None:
    """Write an intersection's map as OpenDRIVE or Lanelet2, by the ending of FILE."""
    from scenewright.cli.map_export import write_map

    write_map(name, out)
    write_stdout(f"{out}\n")


def simulate(
    name: Annotated[str, typer.Argument(help="Its name.")],
    minutes: Annotated[int, typer.Option(min=10, max=240, help="How much traffic [min].")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the simulation.")] = 0,
    train: Annotated[
        bool, typer.Option("--train/--no-train", help="Train a refiner on it, about half a minute.")
    ] = True,
    corpus: Annotated[
        str | None,
        typer.Option(metavar="F", help="An .npz to keep the tracks in, for `train --others`."),
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Simulate traffic at an imported intersection, fit its priors, train its refiner.

    Needs the extra `simulate`.
    """
    from scenewright.cli.custom_intersections import simulate_own

    kept = None if corpus is None else Path(corpus)
    with show_progress(quiet=quiet) as log:
        facts = simulate_own(name, minutes=minutes, seed=seed, train=train, log=log, corpus=kept)
    _print_facts(facts, (), as_json=as_json)


@spread_options
def fit(
    name: Annotated[str, typer.Argument(help="Its name.")],
    tracks: Annotated[
        list[str],
        typer.Argument(
            metavar="TRACKS...",
            help="TAF-BW or inD-style csv, TrajNet++ ndjson, SUMO FCD xml, any csv; or folders.",
        ),
    ],
    options: FitOptions,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Fit an imported intersection's priors on recorded tracks, few or many."""
    from scenewright.cli.custom_intersections import fit_own, fit_text

    with show_progress(quiet=quiet) as log:
        facts = fit_own(name, tracks, options, log=log)
    _print_facts(facts, () if quiet else fit_text(facts), as_json=as_json)


def _print_facts(facts: Mapping[str, Any], lines: Iterable[str], *, as_json: bool) -> None:
    """Remarks to people; then the facts as one object, or just where the bundle is."""
    for line in lines:
        log_line(format_one_line(line))
    if as_json:
        write_json({"ok": True, **facts})
    else:
        write_stdout(f"{facts['folder']}\n")
