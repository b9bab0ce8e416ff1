"""Who moved how, read from the tracks of a scene: speeds, stops, who is first, how far apart."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from scenewright.geometry.map_areas import geos
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord

STANDS = 0.3
"""Speed [m/s] up to which an agent stands (SEMANTICS section 4)."""
_BRAKES = 0.5
"""Deceleration [m/s^2] from which an agent counts as slowing."""


@dataclass(frozen=True, eq=False)
class Motion:
    """One agent over time; `step` is the time between samples [s]."""

    agent: AgentRecord
    step: float

    @cached_property
    def xy(self) -> FloatArray:
        """[T, 2] places [m]."""
        return np.array(self.agent.trajectory, dtype=np.float64)

    @cached_property
    def times(self) -> FloatArray:
        """[T] times of the samples [s]."""
        return np.asarray(self.agent.spawn_time + self.step * np.arange(len(self.xy)))

    @cached_property
    def speed(self) -> FloatArray:
        """[T] speed [m/s]."""
        if len(self.xy) < 2:
            return np.zeros(len(self.xy))
        return np.asarray(np.linalg.norm(np.gradient(self.xy, self.step, axis=0), axis=1))

    @cached_property
    def slowing(self) -> FloatArray:
        """[T] deceleration over half a second [m/s^2], positive while it slows."""
        if len(self.speed) < 7:
            return np.zeros(len(self.speed))
        change = (self.speed[6:] - self.speed[:-6]) / (6 * self.step)
        return np.asarray(-np.pad(change, 3, mode="edge"))

    def index(self, time: float) -> int | None:
        """The sample at a time; None where the agent is not there then."""
        at = round((time - self.agent.spawn_time) / self.step)
        return at if 0 <= at < len(self.xy) else None

    def find_braking_start(self) -> float | None:
        """When the braking begins that holds the hardest slowing [s]; None without any."""
        at = int(self.slowing.argmax())
        if self.slowing[at] < _BRAKES:
            return None
        while at > 0 and self.slowing[at - 1] >= _BRAKES:
            at -= 1
        return float(self.times[at])

    def list_stops(self) -> list[tuple[float, float]]:
        """From when to when the agent stands [s]."""
        still = np.concatenate(([False], self.speed <= STANDS, [False]))
        edges = np.flatnonzero(still[1:] != still[:-1])
        spans = [(self.times[a], self.times[b - 1]) for a, b in edges.reshape(-1, 2)]
        return [(float(a), float(b)) for a, b in spans if b - a >= 0.3]

    def find_visit(self, intersection_map: IntersectionMap) -> tuple[float, float] | None:
        """When the agent comes onto the junction or its crosswalk, and when it leaves it [s]."""
        points = geos.points(self.xy)
        if self.agent.type != "vehicle" and self.agent.crosswalk is not None:
            walk = next(e for e in intersection_map.crosswalks if e.leg == self.agent.crosswalk)
            inside = geos.contains(geos.polygons(walk.polygon), points)
        else:
            corners = [spot for line in intersection_map.stop_lines for spot in line.line]
            if len(corners) < 3:
                return None
            inside = geos.contains(geos.convex_hull(geos.multipoints(corners)), points)
        at = np.flatnonzero(inside)
        return (float(self.times[at[0]]), float(self.times[at[-1]])) if len(at) else None

    def outline(self, at: int) -> Any:
        """The agent's rectangle at a sample."""
        heading = self.agent.heading[at]
        along = np.array([np.cos(heading), np.sin(heading)]) * self.agent.length / 2
        across = np.array([-np.sin(heading), np.cos(heading)]) * self.agent.width / 2
        corners = [along + across, along - across, -along - across, across - along]
        return geos.polygons(self.xy[at] + np.array(corners))


def measure_distance(one: Motion, other: Motion, time: float) -> float | None:
    """Metres between the outlines of two agents at a time; None where one is not there."""
    first, second = one.index(time), other.index(time)
    if first is None or second is None:
        return None
    return float(geos.distance(one.outline(first), other.outline(second)))


def find_closest(one: Motion, other: Motion) -> tuple[float, float] | None:
    """When two agents are nearest [s], and by how many metres between their outlines."""
    start = max(one.times[0], other.times[0])
    end = min(one.times[-1], other.times[-1])
    found = [
        (distance, float(time))
        for time in np.arange(start, end + one.step / 2, one.step)
        if (distance := measure_distance(one, other, time)) is not None
    ]
    return (min(found)[1], min(found)[0]) if found else None


def describe_side(one: Motion, other: Motion, time: float) -> str | None:
    """Where the other is as seen by one: "ahead on the left"; None where one is not there."""
    first, second = one.index(time), other.index(time)
    if first is None or second is None:
        return None
    away = other.xy[second] - one.xy[first]
    angle = np.arctan2(away[1], away[0]) - one.agent.heading[first]
    turned = float(np.degrees((angle + np.pi) % (2 * np.pi) - np.pi))
    side = "left" if turned > 0 else "right"
    if abs(turned) < 20:
        return "straight ahead"
    if abs(turned) > 160:
        return "straight behind"
    if abs(turned) < 70:
        return f"ahead on the {side}"
    return f"on the {side}" if abs(turned) <= 110 else f"behind on the {side}"
