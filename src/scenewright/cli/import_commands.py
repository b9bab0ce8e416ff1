"""The commands for intersections of one's own: import, simulate, fit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from scenewright.cli.common_options import Json, Quiet
from scenewright.cli.console import (
    format_one_line,
    log_line,
    show_progress,
    write_json,
    write_stdout,
)
from scenewright.cli.output_folder import try_file


def import_map_file(
    file: Annotated[
        str, typer.Argument(help="OpenStreetMap or Lanelet2 .osm, OpenDRIVE .xodr, SUMO .net.xml.")
    ],
    name: Annotated[
        str,
        typer.Option(help="What to call it; commands take the short form that is shown."),
    ],
    center: Annotated[
        str | None,
        typer.Option(
            "--at",
            "--center",
            metavar="LAT,LON",
            help="Where the junction is; X,Y if the file has no degrees.",
        ),
    ] = None,
    street: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A street of the junction; give two to choose one."),
    ] = None,
    junction: Annotated[
        str | None, typer.Option(metavar="ID", help="Which junction, by its id in the file.")
    ] = None,
    left_hand: Annotated[
        bool | None,
        typer.Option("--left-hand/--right-hand", help="Which side is driven on, if not as said."),
    ] = None,
    signals: Annotated[
        Literal["keep", "assume", "none"],
        typer.Option(help="Signals: the file's, an assumed programme if it has none, or none."),
    ] = "keep",
    extent: Annotated[
        float | None, typer.Option(help="Half the side of the square that is mapped [m].")
    ] = None,
    title: Annotated[str | None, typer.Option(help="Its title; else its streets' names.")] = None,
    licence: Annotated[
        str | None, typer.Option(help="Licence of the map, to be kept with the bundle.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace one of that name.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Make an intersection of your own from a map file: scenes can be made there at once."""
    from scenewright.cli.custom_intersections import import_file, import_text

    with show_progress(quiet=quiet) as log:
        facts = import_file(
            file,
            name=name,
            center=center,
            streets=street or (),
            junction=junction,
            left_hand=left_hand,
            extent=extent,
            title=title,
            signals=signals,
            licence=licence,
            force=force,
            log=log,
        )
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

    with show_progress(quiet=quiet) as log:
        facts = simulate_own(
            name, minutes=minutes, seed=seed, train=train, log=log,
            corpus=None if corpus is None else Path(corpus),
        )  # fmt: skip
    _print_facts(facts, (), as_json=as_json)


def fit(
    name: Annotated[str, typer.Argument(help="Its name.")],
    tracks: Annotated[
        list[str],
        typer.Argument(
            metavar="TRACKS...",
            help="TAF-BW or inD-style csv, TrajNet++ ndjson, SUMO FCD xml, any csv; or folders.",
        ),
    ],
    columns: Annotated[
        str | None,
        typer.Option(
            metavar="MAP", help="A csv's columns: t=frame/25,id=track,class==car,x=px,y=py."
        ),
    ] = None,
    origin: Annotated[
        str | None, typer.Option(metavar="LAT,LON", help="Where x = y = 0 of the tracks lies.")
    ] = None,
    shift: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Added to the positions instead [m].")
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="HH:MM", help="Time of day, where the files state none.")
    ] = None,
    counts: Annotated[
        str | None,
        typer.Option(metavar="CSV", help="Counts: columns hour, vehicles[, pedestrians]."),
    ] = None,
    licence: Annotated[str | None, typer.Option(help="Licence of the tracks.")] = None,
    named: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar="NAME",
            help="The data set they are of: sind, ind, interaction, dut, argoverse1, argoverse2...",
        ),
    ] = None,
    scale: Annotated[
        float | None, typer.Option(metavar="M", help="Metres per pixel of tracks in pixels.")
    ] = None,
    pool: Annotated[
        list[str] | None,
        typer.Option(metavar="TRACKS", help="Vehicles at a place without a map, for the pool."),
    ] = None,
    pool_scale: Annotated[
        float | None, typer.Option(metavar="M", help="Metres per pixel of those.")
    ] = None,
    train: Annotated[
        bool, typer.Option("--train", help="Adapt the refiner to the tracks, if that is better.")
    ] = False,
    lights: Annotated[
        str | None,
        typer.Option(metavar="CSV", help="Recorded lights: SPaT, or columns light, t, colour."),
    ] = None,
    light_legs: Annotated[
        str | None,
        typer.Option(metavar="MAP", help="Leg of each light: 1=east,13=walk_east."),
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Fit an imported intersection's priors on recorded tracks, few or many."""
    from scenewright.cli.custom_intersections import fit_own, fit_text

    with show_progress(quiet=quiet) as log:
        facts = fit_own(
            name,
            tracks,
            columns=columns,
            origin=origin,
            shift=shift,
            start=start,
            counts=counts,
            licence=licence,
            log=log,
            scale=scale,
            pool=pool or (),
            pool_scale=pool_scale,
            named=named,
            train=train,
            lights=lights,
            light_legs=light_legs,
        )
    _print_facts(facts, () if quiet else fit_text(facts), as_json=as_json)


def _print_facts(facts: Mapping[str, Any], lines: Iterable[str], *, as_json: bool) -> None:
    """Remarks to people; then the facts as one object, or just where the bundle is."""
    for line in lines:
        log_line(format_one_line(line))
    if as_json:
        write_json({"ok": True, **facts})
    else:
        write_stdout(f"{facts['folder']}\n")
