"""What `scenewright intersections import`, `fit` and `train` are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from scenewright.cli.options import option
from scenewright.cli.output_folder import try_folder


@dataclass(frozen=True)
class ImportOptions:
    """Which junction of a map file is imported, and how."""

    name: str = option(..., "What to call it; commands take the short form that is shown.")
    center: str | None = option(
        None,
        "Where the junction is; X,Y if the file has no degrees.",
        "--at",
        "--center",
        metavar="LAT,LON",
    )
    street: list[str] | None = option(
        None, "A street of the junction; give two to choose one.", metavar="NAME"
    )
    junction: str | None = option(None, "Which junction, by its id in the file.", metavar="ID")
    left_hand: bool | None = option(
        None, "Which side is driven on, if not as said.", "--left-hand/--right-hand"
    )
    signals: Literal["keep", "assume", "none"] = option(
        "keep", "Signals: the file's, an assumed programme if it has none, or none."
    )
    extent: float | None = option(None, "Half the side of the square that is mapped [m].")
    title: str | None = option(None, "Its title; else its streets' names.")
    licence: str | None = option(None, "Licence of the map, to be kept with the bundle.")
    force: bool = option(False, "Replace one of that name.")


@dataclass(frozen=True)
class FitOptions:
    """How recorded tracks are read, and what is fitted on them."""

    columns: str | None = option(
        None, "A csv's columns: t=frame/25,id=track,class==car,x=px,y=py.", metavar="MAP"
    )
    origin: str | None = option(None, "Where x = y = 0 of the tracks lies.", metavar="LAT,LON")
    shift: str | None = option(None, "Added to the positions instead [m].", metavar="X,Y")
    start: str | None = option(None, "Time of day, where the files state none.", metavar="HH:MM")
    counts: str | None = option(
        None, "Counts: columns hour, vehicles[, pedestrians].", metavar="CSV"
    )
    licence: str | None = option(None, "Licence of the tracks.")
    named: str | None = option(
        None,
        "The data set they are of: sind, ind, interaction, dut, argoverse1, argoverse2...",
        "--format",
        metavar="NAME",
    )
    scale: float | None = option(None, "Metres per pixel of tracks in pixels.", metavar="M")
    pool: list[str] | None = option(
        None, "Vehicles at a place without a map, for the pool.", metavar="TRACKS"
    )
    pool_scale: float | None = option(None, "Metres per pixel of those.", metavar="M")
    train: bool = option(False, "Adapt the refiner to the tracks, if that is better.")
    lights: str | None = option(
        None, "Recorded lights: SPaT, or columns light, t, colour.", metavar="CSV"
    )
    light_legs: str | None = option(None, "Leg of each light: 1=east,13=walk_east.", metavar="MAP")


@dataclass(frozen=True)
class TrainOptions:
    """What a refiner is trained on, and how long."""

    corpus: str = option(..., "Recorded hours, of `simulate --corpus`.", metavar="F")
    out: str | None = option(
        None, "Folder to write; one's own intersection, else intersections/NAME.", check=try_folder
    )
    epochs: int | None = option(None, "How often all is seen.", min=1)
    walkers: list[str] | None = option(
        None,
        "Tracks of real people on foot, to learn walking from; may be given again.",
        metavar="PATH",
    )
    others: list[str] | None = option(
        None,
        "Tracks of another intersection, of `simulate --corpus`; may be given again.",
        metavar="F",
    )
    walking: float | None = option(
        None, "Share of what is learned that changes how people walk.", min=0.0, max=1.0
    )
    go_on: bool = option(False, "From the weights that serve the intersection on.")
    most: int | None = option(None, "Stretches of the corpus that are learned from.", min=1)
    seed: int = option(0, "Seed of the training.", min=0)
