"""The intersection: lanelets, crosswalks, walkable area, movements, conflict zones, signals.

Everything is in the map frame: metres, x east, y north, origin near the middle. Polygons are
lists of points, counter-clockwise, not closed. A bundle's `map.json` is one `IntersectionMap`.
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


class IntersectionMap(Model):
    """A whole intersection."""

    schema_version: Literal[1] = 1
    name: str
    map_id: int
    title: str
    extent: float = Field(description="half the side of the square that the map covers [m]")
    left_hand_traffic: bool = False
    legs: tuple[Leg, ...]
    lanelets: tuple[Lanelet, ...]
    stop_lines: tuple[StopLine, ...]
    crosswalks: tuple[Crosswalk, ...]
    road: tuple[PolygonWithHoles, ...] = Field(description="drivable area")
    walkable: tuple[PolygonWithHoles, ...] = Field(description="sidewalks, without crosswalks")
    goal_regions: tuple[GoalRegion, ...]
    movements: tuple[VehicleMovement, ...]
    conflict_zones: tuple[ConflictZone, ...]
    signals: SignalProgram | None
    routes: tuple[Route, ...]

    @cached_property
    def zone_pairs(self) -> frozenset[frozenset[str]]:
        """Ids of the movements and crosswalks whose swept areas overlap, as unordered pairs."""
        from scenewright.scene.route_table import find_conflicts

        listed = {frozenset((zone.first, zone.second)) for zone in self.conflict_zones}
        return frozenset(listed.union(*(find_conflicts(each, self) for each in self.uturns)))

    @cached_property
    def uturns(self) -> tuple[VehicleMovement, ...]:
        """U-turns that there is room for and that `movements` does not list."""
        from scenewright.scene.route_table import derive_uturns

        return derive_uturns(self)

    def find_signal_group(self, route: Route) -> str | None:
        """The signal group that controls a route; None for jaywalkers and unsignalised ways."""
        if self.signals is None or route.movement == "jaywalking":
            return None
        if (turn := next((e for e in self.uturns if e.id == route.movement_id), None)) is not None:
            return turn.signal_group
        for group in self.signals.groups:
            if route.zone_key in group.movements or route.zone_key in group.crosswalks:
                return group.id
        return None

    def find_movement(self, route: Route) -> VehicleMovement | None:
        """The vehicle movement of a route; None for pedestrians."""
        return next((e for e in (*self.movements, *self.uturns) if e.id == route.movement_id), None)
