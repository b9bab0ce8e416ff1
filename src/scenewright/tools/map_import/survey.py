"""What every reader finds in its file: lanes into and out of one junction, and paths between them.

Coordinates are metres, x east, y north, the origin in the middle of the junction. A survey holds
what the file says and no more; what is missing is derived later and reported.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from scenewright.geometry.geographic import LatLon
from scenewright.scene.base import Colour, FloatArray

LEARNED = "where"
"""Prefix of the source of a crossing that is known from pedestrian tracks, not from a file."""


NARROWEST = 2.0
"""What is narrower is no lane for cars [m]."""


def describe_strips(narrow: Iterable[bool]) -> Iterator[str]:
    """What is said of the lanes that were dropped for their width, if there are some."""
    if count := sum(narrow):
        yield f"{count} strips narrower than {NARROWEST:.0f} m were dropped: no lanes for cars"


@dataclass(frozen=True, eq=False)
class SurveyLane:
    """One lane outside the junction.

    Attributes:
        line: [P, 2] its middle, in driving direction; an approach ends at the junction, an exit
            begins there.
        width: [m]; speed: limit [m/s]; road: its name.
    """

    id: str
    line: FloatArray
    width: float
    speed: float
    road: str


@dataclass(frozen=True, eq=False)
class SurveyConnection:
    """One path through the junction from an approach lane to an exit lane.

    Attributes:
        line: [P, 2] its middle inside the junction, from the end of the approach to the exit.
        light: the light of the survey that controls it; None where none does.
        is_added: whether the file allows it without drawing it.
    """

    approach: str
    exit: str
    line: FloatArray
    light: str | None = None
    is_added: bool = False


@dataclass(frozen=True, eq=False)
class SurveyCrossing:
    """A mapped crossing for pedestrians.

    Attributes:
        line: [2, 2] its middle line across the road [m]; width: along the road [m].
        light: the light of the survey that controls it.
        source: what the file calls it.
        is_bounded: whether the line ends at the file's kerbs; else only its place is known.
        is_marked: whether there are marks on the road; has_island: whether an island parts it.
        is_signalised: None where the file does not say.
        limits: [2, 2] where the way over it ends, on the sidewalks; None if there is no way [m].
    """

    line: FloatArray
    width: float
    light: str | None = None
    source: str = ""
    is_bounded: bool = True
    is_marked: bool = True
    has_island: bool = False
    is_signalised: bool | None = None
    limits: FloatArray | None = None

    def move(self, shift: FloatArray) -> SurveyCrossing:
        """The crossing with the origin elsewhere."""
        limits = None if self.limits is None else self.limits + shift
        return replace(self, line=self.line + shift, limits=limits)


@dataclass(frozen=True, eq=False)
class SurveyLight:
    """A traffic light of the file for traffic into the junction.

    Attributes:
        place: [2] on the lane that it controls, at the stop line if known [m].
        group: of lights that change together in the file, such as a controller; empty if unknown.
    """

    place: FloatArray
    group: str = ""


@dataclass(frozen=True)
class DrivingSide:
    """The side, how it is known, and what speaks against it.

    Attributes:
        is_known: whether the user or the file says so; else it is assumed.
    """

    left_hand: bool
    reason: str
    is_known: bool = True
    against: str | None = None

    def describe(self) -> str:
        """One line for people."""
        side, other = ("left", "right") if self.left_hand else ("right", "left")
        line = f"traffic drives on the {side}: {self.reason}"
        if self.against:
            line += f", but {self.against}"
        return line if self.is_known else f"{line}; --{other}-hand changes it"


ASSUMED_SIDE = DrivingSide(False, "assumed, the file does not say", is_known=False)


@dataclass(frozen=True, eq=False)
class Survey:
    """One junction of a file.

    Attributes:
        areas: [P, 2] outlines of mapped drivable area inside the junction.
        walks: [P, 2] outlines of ground that people were seen to walk on.
        lights: places of lights, where the file has no programme for them.
        phases: (duration [s], colour by light) of the programme; empty where there is none.
        is_signalised: None where the file does not say.
        is_roundabout: whether its ways lead round a middle island.
        origin: of the coordinates; None where the file has none.
        offset: of the origin in the coordinates of the file [m].
        file_origin: where the file's coordinates are zero; None where it has no degrees.
        lost: how many ways or lanes of the file lead nowhere here and were dropped.
        notes: what was assumed or dropped.
        drawn: lines [P, 2] and places [2] of the file by kind, for pictures [m].
    """

    title: str
    approaches: Mapping[str, SurveyLane]
    exits: Mapping[str, SurveyLane]
    connections: tuple[SurveyConnection, ...]
    crossings: tuple[SurveyCrossing, ...] = ()
    areas: tuple[FloatArray, ...] = ()
    walks: tuple[FloatArray, ...] = ()
    lights: tuple[SurveyLight, ...] = ()
    phases: tuple[tuple[float, Mapping[str, Colour]], ...] = ()
    side: DrivingSide = ASSUMED_SIDE
    is_signalised: bool | None = None
    is_roundabout: bool = False
    origin: LatLon | None = None
    offset: tuple[float, float] = (0.0, 0.0)
    file_origin: LatLon | None = None
    lost: int = 0
    notes: list[str] = field(default_factory=list)
    drawn: Mapping[str, tuple[FloatArray, ...]] = field(default_factory=dict)


def keep_near(
    drawn: Mapping[str, Iterable[FloatArray]], middle: FloatArray
) -> Mapping[str, tuple[FloatArray, ...]]:
    """Lines and places within 130 m of a place, in metres from it."""
    return {
        kind: tuple(
            line - middle
            for line in lines
            if len(line) and np.abs(np.atleast_2d(line - middle)).max(axis=1).min() < _REACH
        )
        for kind, lines in drawn.items()
    }


_REACH = 130.0


@dataclass(frozen=True)
class ReportItem:
    """One item of the report.

    Attributes:
        state: `read`, `partly read`, `derived`, `assumed` or `none`.
        score: how much of it is the file's, from 0 to 1; None where that cannot be said.
    """

    item: str
    state: str
    score: float | None
    detail: str
