"""Contact of two placed agents: when, where, with which sides, at what speeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Literal

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray, Point
from scenewright.scene.social import CollisionKind, ImpactPoint
from scenewright.scene.track import Shape
from scenewright.tools.solver.path_conflict import (
    Half,
    compute_clearance,
    compute_distance,
    get_half_sides,
)
from scenewright.tools.solver.scheduled_agent import ScheduledAgent, get_shared_times

_LEFT, _LEFT_OF_HEAD_ON = np.radians(15.0), np.radians(25.0)
"""How far a vehicle must have turned left for its collision to count as a left turn's [rad]; the
second where the fronts meet."""

_CORNER = 0.5
"""How far from both its edges a contact still belongs to a corner [m]; at most a third."""

_SURE = 0.2
"""How far a contact may be displaced [m] and still be at the named impact point."""

_BUMPER = 0.3
"""Depth of front and rear for the kind of a collision [m] (SEMANTICS 4)."""

_STRIKES = 2.3
"""Least speed of a vehicle that strikes a pedestrian [m/s]: 2 m/s, and what is measured apart."""

_STANDS = 0.3
"""An agent slower than this [m/s] strikes no moving one."""

_UNSURE, _UNSURE_DEPTH = np.radians(3.0), 0.12
"""How far an angle [rad], and the depth of a contact [m], may be measured off the proof's."""

_CORNERS: dict[tuple[str, str], ImpactPoint] = {
    ("front", "left"): "front_left",
    ("front", "right"): "front_right",
    ("rear", "left"): "rear_left",
    ("rear", "right"): "rear_right",
}


@dataclass(frozen=True)
class FirstContact:
    """When [s], where and how two actors first touch; computed as far as it is asked for."""

    first: ScheduledAgent
    second: ScheduledAgent
    time: float
    left_hand: bool

    @property
    def pair(self) -> tuple[ScheduledAgent, ScheduledAgent]:
        """The two."""
        return self.first, self.second

    @cached_property
    def _around(self) -> tuple[FloatArray, FloatArray]:
        """[3, 3] poses of either 0.05 s before, at and after the contact."""
        around = np.array([self.time - 0.05, self.time, self.time + 0.05])
        return self.first.get_poses(around), self.second.get_poses(around)

    @cached_property
    def _spot(self) -> FloatArray:
        """[2] the middle of the contact: mean of outline points of either that lie in the other."""
        (_, a, _), (_, b, _) = self._around
        halves = (get_half_sides(agent.candidate.shape) for agent in self.pair)
        place, count = _add_up_touching(a, b, *halves)
        return place / count if count else (a[:2] + b[:2]) / 2

    @cached_property
    def _velocities(self) -> list[FloatArray]:
        return [(pose[2, :2] - pose[0, :2]) / 0.1 for pose in self._around]

    @cached_property
    def _speeds(self) -> list[float]:
        return [float(np.hypot(*velocity)) for velocity in self._velocities]

    @property
    def location(self) -> Point:
        """The middle of the contact [m]."""
        return float(self._spot[0]), float(self._spot[1])

    @cached_property
    def kind(self) -> CollisionKind | None:
        """None where it is none, or another one if measured a little apart."""
        on_wheels = [agent.candidate.shape.type != "pedestrian" for agent in self.pair]
        driven = [v for v, wheels in zip(self._speeds, on_wheels, strict=True) if wheels]
        if len(driven) < 2:
            return "pedestrian_strike" if driven and driven[0] >= _STRIKES else None
        at = [poses[1] for poses in self._around]
        turned = abs(float(np.angle(np.exp(1j * (at[0][2] - at[1][2])))))
        sign = -1.0 if self.left_hand else 1.0
        left = max(_compute_left_turn(actor, self.time, sign) for actor in self.pair)
        ends = [
            [
                _find_end(pose, of, self._spot, _BUMPER + more)
                for pose, of in zip(at, self.pair, strict=True)
            ]
            for more in (-_UNSURE_DEPTH, _UNSURE_DEPTH)
        ]
        apart = (-_UNSURE, _UNSURE)
        kinds = {
            _name_kind(turned + more, left + further, each)
            for more, further, each in product(apart, apart, ends)
        }
        return kinds.pop() if len(kinds) == 1 else None

    @property
    def closing(self) -> float:
        """Relative speed [m/s]."""
        return float(np.hypot(*(self._velocities[0] - self._velocities[1])))

    @property
    def speed(self) -> float:
        """Speed of the first actor [m/s]."""
        return self._speeds[0]

    @property
    def frontal(self) -> bool:
        """The first actor strikes with its front; where both fronts touch, it is the faster."""
        (one, two), spot = self._around, self._spot
        if _find_side(one[1], self.first, spot) != "front":
            return False
        other = _find_side(two[1], self.second, spot)
        return other != "front" or self._speeds[0] >= self._speeds[1]

    @property
    def strikes(self) -> bool:
        """The first strikes: the other stands; or it alone is touched in front; or is faster."""
        still, speeds = [speed <= _STANDS for speed in self._speeds], self._speeds
        if still[0] != still[1]:
            return still[1]
        front = [
            locate(poses[1], self._spot)[0] >= of.candidate.shape.length / 2 - _BUMPER
            for poses, of in zip(self._around, self.pair, strict=True)
        ]
        return front[0] if front[0] != front[1] else speeds[0] > speeds[1]

    @property
    def points(self) -> tuple[tuple[ImpactPoint, ...], tuple[ImpactPoint, ...]]:
        """By actor, every impact point that the contact is surely at."""
        (one, two), spot = self._around, self._spot
        return (
            _list_certain_points(one[1], self.first, spot),
            _list_certain_points(two[1], self.second, spot),
        )


def find_first_contact(
    a: ScheduledAgent, b: ScheduledAgent, *, left_hand: bool = False
) -> FirstContact | None:
    """The first contact of two placed actors, to 0.01 s; None if they never touch.

    Args:
        left_hand: people drive on the left, so that right turns lead across the others' way.
    """
    times = get_shared_times(a, b)
    if times is None:
        return None
    sides = (get_half_sides(a.candidate.shape), get_half_sides(b.candidate.shape))
    first = _find_touch(a.get_poses(times), b.get_poses(times), *sides)
    if first <= 0:
        return None
    fine = np.linspace(times[first - 1], times[first], 11)
    hit = _find_touch(a.get_poses(fine), b.get_poses(fine), *sides)
    return FirstContact(a, b, float(fine[hit]), left_hand)


def find_least_clearance(a: ScheduledAgent, b: ScheduledAgent) -> tuple[float, float, Point]:
    """Least clearance [m], when [s] and where (midway); inf if never there at once."""
    times = get_shared_times(a, b)
    if times is None:
        return float("inf"), 0.0, (0.0, 0.0)
    at_a, at_b = a.get_poses(times), b.get_poses(times)
    clearance = compute_clearance(at_a, at_b, shapes=(a.candidate.shape, b.candidate.shape))
    index = int(np.argmin(clearance))
    middle = (at_a[index, :2] + at_b[index, :2]) / 2
    return float(clearance[index]), float(times[index]), (float(middle[0]), float(middle[1]))


def _list_certain_points(
    pose: FloatArray, actor: ScheduledAgent, spot: FloatArray
) -> tuple[ImpactPoint, ...]:
    """List every impact point that a place on a vehicle certainly has; none for a pedestrian."""
    shape = actor.candidate.shape
    if shape.type == "pedestrian":
        return ()
    along, across = locate(pose, spot)
    along = float(np.clip(along, -shape.length / 2, shape.length / 2))
    across = float(np.clip(across, -shape.width / 2, shape.width / 2))
    around = [
        set(name_impact_points(along + i * _SURE, across + j * _SURE, shape=shape))
        for i, j in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    first, *others = around
    return tuple(sorted(first.intersection(*others)))


def name_impact_points(along: float, across: float, *, shape: Shape) -> tuple[ImpactPoint, ...]:
    """The names of a place on a vehicle, `along` and `across` (left) from its centre [m].

    A corner is 0.5 m deep either way, but no more than a third of the vehicle. Front and rear are
    the ends of that depth, corners included; left and right, which are sides, what lies between.
    """
    ahead = abs(along) - shape.length / 2 + min(_CORNER, shape.length / 3)
    aside = abs(across) - shape.width / 2 + min(_CORNER, shape.width / 3)
    end: Literal["front", "rear"] = "front" if along > 0 else "rear"
    side: Literal["left", "right"] = "left" if across > 0 else "right"
    if ahead >= 0.0 and aside >= 0.0:
        return (end, _CORNERS[end, side])
    at_end = ahead >= 0.0 or (aside < 0.0 and ahead >= aside)
    return (end,) if at_end else (side, "side")


def _name_kind(turned: float, left: float, ends: list[str]) -> CollisionKind:
    """Name the kind of a collision of two vehicles (SEMANTICS 4).

    Args:
        turned: between their headings [rad]; left: the larger left turn of the two [rad].
        ends: at which end of each they touch.
    """
    if turned <= np.radians(30):
        return "rear_end" if set(ends) == {"front", "rear"} else "sideswipe"
    if turned >= np.radians(135) and ends == ["front", "front"]:
        return "left_turn" if left >= _LEFT_OF_HEAD_ON else "head_on"
    return "left_turn" if left >= _LEFT else "angle"


def _find_end(pose: FloatArray, of: ScheduledAgent, spot: FloatArray, depth: float) -> str:
    """Find the end of a vehicle within which, to that depth [m], a place lies; else `side`."""
    along, _ = locate(pose, spot)
    if abs(along) < of.candidate.shape.length / 2 - depth:
        return "side"
    return "front" if along > 0 else "rear"


def _compute_left_turn(actor: ScheduledAgent, time: float, sign: float) -> float:
    """Compute its left turn (right, if the sign is negative) over its last 30 m [rad]."""
    path = actor.candidate.path
    s = actor.find_place(time)
    recent = (path.s <= s) & (path.s >= s - 30.0)
    heading = sign * path.heading[recent]
    return float(heading[-1] - heading.min()) if len(heading) else 0.0


def _find_side(pose: FloatArray, actor: ScheduledAgent, spot: FloatArray) -> str:
    along, across = locate(pose, spot)
    shape = actor.candidate.shape
    if abs(along / (shape.length / 2)) < abs(across / (shape.width / 2)):
        return "side"
    return "front" if along > 0 else "rear"


def locate(
    pose: FloatArray | Sequence[float], spot: FloatArray | Sequence[float]
) -> tuple[float, float]:
    """Locate a place (x, y) along and across (to the left) from a pose (x, y, heading) [m]."""
    dx, dy = spot[0] - pose[0], spot[1] - pose[1]
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return float(dx * cos + dy * sin), float(dy * cos - dx * sin)


# ---- as machine code: poses [N, 3] or [3] (x, y, heading), half sides as above -------------------

_ON_EDGE = 0.02
"""How far outside a point still lies in a footprint [m]."""
_PER_SIDE, _PER_DISC = 41, 32
"""Points of an outline: of each side of a rectangle, and of a disc."""


@compiled
def _find_touch(a: FloatArray, b: FloatArray, a_half: Half, b_half: Half) -> int:
    """The first index at which two footprints touch; -1 if they never do."""
    reach = np.hypot(a_half[0], a_half[1]) + np.hypot(b_half[0], b_half[1])
    for k in range(len(a)):
        dx, dy = a[k, 0] - b[k, 0], a[k, 1] - b[k, 1]
        if dx * dx + dy * dy > reach * reach:
            continue
        apart = compute_distance(
            a[k, 0], a[k, 1], np.cos(a[k, 2]), np.sin(a[k, 2]), a_half,
            b[k, 0], b[k, 1], np.cos(b[k, 2]), np.sin(b[k, 2]), b_half, 0.0,
        )  # fmt: skip
        if apart <= 0.0:
            return k
    return -1


@compiled
def _add_up_touching(
    a: FloatArray, b: FloatArray, a_half: Half, b_half: Half
) -> tuple[FloatArray, int]:
    """[2] sum of the outline points of either footprint that lie in the other, and how many."""
    total, count = np.zeros(2), 0
    for pose, half, other, within in ((a, a_half, b, b_half), (b, b_half, a, a_half)):
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        for k in range(_PER_DISC if half[0] == 0.0 else 4 * _PER_SIDE):
            if half[0] == 0.0:
                angle = 2.0 * np.pi * k / _PER_DISC
                x, y = half[1] * np.cos(angle), half[1] * np.sin(angle)
            else:
                side, edge = k // _PER_SIDE, -1.0 + 0.05 * (k % _PER_SIDE)
                sign = 1.0 if side % 2 == 0 else -1.0
                along = half[0] * (edge if side < 2 else sign)
                across = half[1] * (sign if side < 2 else edge)
                x, y = along * cos - across * sin, along * sin + across * cos
            if _holds(pose[0] + x, pose[1] + y, other, within):
                total[0] += pose[0] + x
                total[1] += pose[1] + y
                count += 1
    return total, count


@compiled
def _holds(x: float, y: float, pose: FloatArray, half: Half) -> bool:
    """Whether a footprint holds a point, its edge included."""
    dx, dy = x - pose[0], y - pose[1]
    if half[0] == 0.0:
        return bool(np.hypot(dx, dy) <= half[1] + _ON_EDGE)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    along, across = abs(dx * cos + dy * sin), abs(dy * cos - dx * sin)
    return bool(along <= half[0] + _ON_EDGE and across <= half[1] + _ON_EDGE)
