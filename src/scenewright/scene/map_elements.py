"""What an intersection consists of: lanelets, crosswalks, movements, conflict zones, signals.

Everything is in the map frame: metres, x east, y north, origin near the middle. Polygons are
lists of points, counter-clockwise, not closed.
"""

from __future__ import annotations

from functools import cached_property
from typing import Literal

from pydantic import Field

from scenewright.scene.base import AgentClass, Colour, Compass, Model, Movement, Point

Polyline = tuple[Point, ...]


class PolygonWithHoles(Model):
    """An area: one exterior ring and any holes."""

    exterior: Polyline
    holes: tuple[Polyline, ...] = ()


class Leg(Model):
    """One arm of the intersection. `bearing` is the outward direction [rad, ccw from east]."""

    name: Compass
    road: str
    bearing: float


class Lanelet(Model):
    """One lane of an approach, an exit or inside the junction, in driving direction."""

    id: str
    kind: Literal["approach", "exit", "connector", "parking"]
    leg: Compass | None = Field(description="the leg it lies on; None inside the junction")
    left: Polyline
    right: Polyline
    centreline: Polyline
    width: float
    speed_limit: float = Field(description="[m/s]")
    successors: tuple[str, ...] = ()


class StopLine(Model):
    """Where the front bumper of waiting traffic on `leg` stays."""

    id: str
    leg: Compass
    lanelets: tuple[str, ...]
    line: tuple[Point, Point]


class Crosswalk(Model):
    """A marked crossing of `leg`.

    Attributes:
        centreline: from one kerb to the other.
        sides: compass side of the first and of the last point of the centreline.
    """

    id: str
    leg: Compass
    polygon: Polyline
    centreline: tuple[Point, Point]
    sides: tuple[Compass, Compass]
    width: float


class GoalRegion(Model):
    """Where agents of a class leave the map on `leg`."""

    id: str
    type: AgentClass
    leg: Compass
    polygon: Polyline


class VehicleMovement(Model):
    """A way through the junction for vehicles.

    Attributes:
        centreline: from map edge to map edge through the middle of the lanes used.
        signal_group: group that controls it; None where unsignalised.
    """

    id: str
    entry: Compass
    exit: Compass
    turn: Literal["straight", "left", "right", "uturn"]
    lanelets: tuple[str, ...]
    stop_line: str
    centreline: Polyline
    signal_group: str | None


class ConflictZone(Model):
    """Where two movements (or a movement and a crosswalk) overlap."""

    id: str
    first: str
    second: str
    polygon: Polyline


class SignalGroup(Model):
    """Stop lines and crosswalks that share their lights."""

    id: str
    movements: tuple[str, ...] = ()
    crosswalks: tuple[str, ...] = ()


class SignalPhase(Model):
    """One step of the programme: how long [s] and the colour of every group."""

    duration: float = Field(gt=0)
    colours: dict[str, Colour]


class SignalProgram(Model):
    """The fixed-time programme; a scene chooses its offset."""

    groups: tuple[SignalGroup, ...]
    phases: tuple[SignalPhase, ...]

    @cached_property
    def cycle(self) -> float:
        """Length of the cycle [s]."""
        return sum(phase.duration for phase in self.phases)


class Route(Model):
    """What p_wp is conditioned on: class, entry, exit, and for pedestrians crosswalk and side.

    Attributes:
        id: stable name, e.g. `vehicle:north>east:left`, `pedestrian:north:east>west:straight`.
        crosswalk: leg whose crosswalk (or, when jaywalking, whose roadway) is crossed.
        side: for pedestrians the pair of sidewalks used, e.g. `along>along`; None for vehicles.
        movement_id: the vehicle movement; None for pedestrians.
    """

    id: str
    type: AgentClass
    entry: Compass
    exit: Compass
    movement: Movement
    crosswalk: Compass | None = None
    side: str | None = None
    movement_id: str | None = None

    @property
    def zone_key(self) -> str:
        """How conflict zones and signal groups name the route: its movement, or its crosswalk."""
        return self.movement_id or f"{self.crosswalk}:crosswalk"
