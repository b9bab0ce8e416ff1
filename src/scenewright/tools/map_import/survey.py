"""What every reader finds in its file: lanes into and out of one junction, and paths between them.

Coordinates are metres, x east, y north, the origin in the middle of the junction. A survey holds
what the file says and no more; what is missing is derived later and reported.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from scenewright.geometry.geographic import LatLon
from scenewright.scene.base import Colour, FloatArray


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
    """

    approach: str
    exit: str
    line: FloatArray
    light: str | None = None


@dataclass(frozen=True, eq=False)
class SurveyCrossing:
    """A mapped crossing for pedestrians: [2, 2] its middle from kerb to kerb, and its width."""

    line: FloatArray
    width: float
    light: str | None = None


@dataclass(frozen=True, eq=False)
class Survey:
    """One junction of a file.

    Attributes:
        areas: [P, 2] outlines of mapped drivable area inside the junction.
        phases: (duration [s], colour by light) of the programme; empty where there is none.
        is_signalised: None where the file does not say.
        is_roundabout: whether its ways lead round a middle island.
        origin: of the coordinates; None where the file has none.
        offset: of the origin in the coordinates of the file [m].
        notes: what was assumed or dropped.
    """

    title: str
    approaches: Mapping[str, SurveyLane]
    exits: Mapping[str, SurveyLane]
    connections: tuple[SurveyConnection, ...]
    crossings: tuple[SurveyCrossing, ...] = ()
    areas: tuple[FloatArray, ...] = ()
    phases: tuple[tuple[float, Mapping[str, Colour]], ...] = ()
    left_hand: bool = False
    is_signalised: bool | None = None
    is_roundabout: bool = False
    origin: LatLon | None = None
    offset: tuple[float, float] = (0.0, 0.0)
    notes: list[str] = field(default_factory=list)
