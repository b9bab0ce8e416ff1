"""The intersection: a bundle's `map.json`."""

from __future__ import annotations

from functools import cached_property
from typing import Literal

from pydantic import Field

from scenewright.scene.base import Model
from scenewright.scene.map_elements import (
    ConflictZone,
    Crosswalk,
    GoalRegion,
    Lanelet,
    Leg,
    PolygonWithHoles,
    Route,
    SignalProgram,
    StopLine,
    VehicleMovement,
)
from scenewright.scene.uturns import derive_uturns, find_conflicts


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
        listed = {frozenset((zone.first, zone.second)) for zone in self.conflict_zones}
        conflicts = (
            find_conflicts(uturn, self.movements, self.crosswalks) for uturn in self.uturns
        )
        return frozenset(listed.union(*conflicts))

    @cached_property
    def uturns(self) -> tuple[VehicleMovement, ...]:
        """U-turns that there is room for and that `movements` does not list."""
        return derive_uturns(self.legs, self.lanelets, self.crosswalks, self.movements)

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
