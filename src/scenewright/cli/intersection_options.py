"""What `scenewright intersections import`, `fit` and `train` are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import typer

from scenewright.cli.output_folder import try_folder


@dataclass(frozen=True)
class ImportOptions:
    """Which junction of a map file is imported, and how."""

    name: Annotated[
        str,
        typer.Option(help="What to call it; commands take the short form that is shown."),
    ]
    center: Annotated[
        str | None,
        typer.Option(
            "--at",
            "--center",
            metavar="LAT,LON",
            help="Where the junction is; X,Y if the file has no degrees.",
        ),
    ] = None
    street: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A street of the junction; give two to choose one."),
    ] = None
    junction: Annotated[
        str | None, typer.Option(metavar="ID", help="Which junction, by its id in the file.")
    ] = None
    left_hand: Annotated[
        bool | None,
        typer.Option("--left-hand/--right-hand", help="Which side is driven on, if not as said."),
    ] = None
    signals: Annotated[
        Literal["keep", "assume", "none"],
        typer.Option(help="Signals: the file's, an assumed programme if it has none, or none."),
    ] = "keep"
    extent: Annotated[
        float | None, typer.Option(help="Half the side of the square that is mapped [m].")
    ] = None
    title: Annotated[str | None, typer.Option(help="Its title; else its streets' names.")] = None
    licence: Annotated[
        str | None, typer.Option(help="Licence of the map, to be kept with the bundle.")
    ] = None
    force: Annotated[bool, typer.Option("--force", help="Replace one of that name.")] = False


@dataclass(frozen=True)
class FitOptions:
    """How recorded tracks are read, and what is fitted on them."""

    columns: Annotated[
        str | None,
        typer.Option(
            metavar="MAP", help="A csv's columns: t=frame/25,id=track,class==car,x=px,y=py."
        ),
    ] = None
    origin: Annotated[
        str | None, typer.Option(metavar="LAT,LON", help="Where x = y = 0 of the tracks lies.")
    ] = None
    shift: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Added to the positions instead [m].")
    ] = None
    start: Annotated[
        str | None, typer.Option(metavar="HH:MM", help="Time of day, where the files state none.")
    ] = None
    counts: Annotated[
        str | None,
        typer.Option(metavar="CSV", help="Counts: columns hour, vehicles[, pedestrians]."),
    ] = None
    licence: Annotated[str | None, typer.Option(help="Licence of the tracks.")] = None
    named: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar="NAME",
            help="The data set they are of: sind, ind, interaction, dut, argoverse1, argoverse2...",
        ),
    ] = None
    scale: Annotated[
        float | None, typer.Option(metavar="M", help="Metres per pixel of tracks in pixels.")
    ] = None
    pool: Annotated[
        list[str] | None,
        typer.Option(metavar="TRACKS", help="Vehicles at a place without a map, for the pool."),
    ] = None
    pool_scale: Annotated[
        float | None, typer.Option(metavar="M", help="Metres per pixel of those.")
    ] = None
    train: Annotated[
        bool, typer.Option("--train", help="Adapt the refiner to the tracks, if that is better.")
    ] = False
    lights: Annotated[
        str | None,
        typer.Option(metavar="CSV", help="Recorded lights: SPaT, or columns light, t, colour."),
    ] = None
    light_legs: Annotated[
        str | None,
        typer.Option(metavar="MAP", help="Leg of each light: 1=east,13=walk_east."),
    ] = None


@dataclass(frozen=True)
class TrainOptions:
    """What a refiner is trained on, and how long."""

    corpus: Annotated[
        str, typer.Option(metavar="F", help="Recorded hours, of `simulate --corpus`.")
    ]
    out: Annotated[
        str | None,
        typer.Option(
            help="Folder to write; one's own intersection, else intersections/NAME.",
            callback=try_folder,
        ),
    ] = None
    epochs: Annotated[int | None, typer.Option(min=1, help="How often all is seen.")] = None
    walkers: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH",
            help="Tracks of real people on foot, to learn walking from; may be given again.",
        ),
    ] = None
    others: Annotated[
        list[str] | None,
        typer.Option(
            metavar="F",
            help="Tracks of another intersection, of `simulate --corpus`; may be given again.",
        ),
    ] = None
    walking: Annotated[
        float | None,
        typer.Option(
            min=0.0, max=1.0, help="Share of what is learned that changes how people walk."
        ),
    ] = None
    go_on: Annotated[
        bool, typer.Option("--go-on", help="From the weights that serve the intersection on.")
    ] = False
    most: Annotated[
        int | None, typer.Option(min=1, help="Stretches of the corpus that are learned from.")
    ] = None
    seed: Annotated[int, typer.Option(min=0, help="Seed of the training.")] = 0
