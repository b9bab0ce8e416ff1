"""Lanes gathered into legs, and the legs' compass names."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import Compass, FloatArray
from scenewright.tools.map_import.survey import Survey, SurveyLane

RING: tuple[Compass, ...] = (
    "north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest",
)  # fmt: skip
"""Clockwise."""
MOST_LEGS = len(RING)
_APART = math.radians(24.0)
"""Lanes whose outward directions differ by less belong to one leg."""
_LOOK = (4.0, 30.0)
"""Between which distances from the junction a lane's direction is measured [m]."""
CLEARLY_STRAIGHT, CLEARLY_TURNED = math.radians(20.0), math.radians(50.0)


@dataclass(frozen=True, eq=False)
class SurveyLeg:
    """One arm: its bearing [rad], its lanes.

    Attributes:
        throat: [2] mean place at which its lanes meet the junction [m].
        outwards: [2] unit vector away from the junction there.
    """

    bearing: float
    approaches: tuple[SurveyLane, ...]
    exits: tuple[SurveyLane, ...]
    throat: FloatArray
    outwards: FloatArray

    @property
    def lanes(self) -> tuple[SurveyLane, ...]:
        """All of them."""
        return (*self.approaches, *self.exits)

    @property
    def road(self) -> str:
        """The commonest name of its lanes."""
        names = [lane.road for lane in self.lanes if lane.road]
        return max(sorted(set(names)), key=names.count) if names else ""


def outward_line(lane: SurveyLane, *, approach: bool) -> FloatArray:
    """[P, 2] the lane's middle from the junction outwards."""
    return np.asarray(lane.line[::-1] if approach else lane.line)


def legs_of(survey: Survey) -> tuple[SurveyLeg, ...]:
    """The legs, counter-clockwise by bearing.

    Raises:
        InputError: fewer than three, or more than there are compass names.
    """
    members = [(lane, True) for lane in survey.approaches.values()]
    members += [(lane, False) for lane in survey.exits.values()]
    angles = [_bearing(outward_line(lane, approach=inward)) for lane, inward in members]
    groups = _clusters(angles)
    legs = sorted((_leg([members[i] for i in group]) for group in groups), key=lambda g: g.bearing)
    if not 3 <= len(legs) <= MOST_LEGS:
        raise InputError(
            f"{survey.title} has {len(legs)} legs; an intersection has 3 to {MOST_LEGS}"
        )
    return tuple(legs)


def _bearing(line: FloatArray) -> float:
    near, far = (along(line, distance) for distance in _LOOK)
    if float(np.hypot(*(far - near))) < 1.0:
        near = line[0]
    return math.atan2(*(far - near)[::-1])


def along(line: FloatArray, distance: float) -> FloatArray:
    """[2] the place at a distance along a line, held at its end."""
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    return np.array([np.interp(distance, s, line[:, axis]) for axis in (0, 1)])


def _clusters(angles: Sequence[float]) -> list[list[int]]:
    """Groups of neighbouring angles, split where two neighbours are far apart."""
    order = sorted(range(len(angles)), key=lambda i: angles[i])
    gaps = [
        math.remainder(angles[order[(k + 1) % len(order)]] - angles[order[k]], math.tau) % math.tau
        for k in range(len(order))
    ]
    first = max(range(len(order)), key=lambda k: gaps[k]) + 1
    groups: list[list[int]] = []
    for k in range(len(order)):
        i = order[(first + k) % len(order)]
        away = gaps[(first + k - 1) % len(order)]
        wide = abs(math.remainder(angles[i] - angles[groups[-1][0]], math.tau)) if groups else 0.0
        if groups and away < _APART and wide < 1.5 * _APART:
            groups[-1].append(i)
        else:
            groups.append([i])
    return groups


def _leg(members: Sequence[tuple[SurveyLane, bool]]) -> SurveyLeg:
    lines = [outward_line(lane, approach=inward) for lane, inward in members]
    ways = np.array([[math.cos(a), math.sin(a)] for a in map(_bearing, lines)]).sum(axis=0)
    near = np.array([along(line, 8.0) - line[0] for line in lines]).sum(axis=0)
    return SurveyLeg(
        bearing=math.atan2(ways[1], ways[0]),
        approaches=tuple(lane for lane, inward in members if inward),
        exits=tuple(lane for lane, inward in members if not inward),
        throat=np.mean([line[0] for line in lines], axis=0),
        outwards=near / np.hypot(*near),
    )


def named(legs: Sequence[SurveyLeg], turns: Sequence[tuple[int, int, float]]) -> list[Compass]:
    """A compass name for every leg, in the order of the legs round the junction.

    The names are those under which what the compass says of turns is true of the map: who comes
    from the north and goes east turns left. Among such names the plain four win for up to four
    legs, and else the nearest.

    Args:
        turns: (entry, exit, turning angle [rad, positive to the left]) of each movement.
    """
    bearings = [leg.bearing for leg in legs]

    def cost(names: tuple[Compass, ...]) -> tuple[int, float]:
        return _cost(names, bearings, turns)

    best = min(_offers(len(legs)), key=cost)
    return list(best)


def _offers(count: int) -> Iterator[tuple[Compass, ...]]:
    """Ways to name legs counter-clockwise round the ring."""
    around = RING[::-1]
    for chosen in combinations(range(len(around)), count):
        for turn in range(count):
            yield tuple(around[i] for i in (*chosen[turn:], *chosen[:turn]))


def _cost(
    names: Sequence[Compass], bearings: Sequence[float], turns: Sequence[tuple[int, int, float]]
) -> tuple[int, float]:
    wrong = sum(_contradicts(names[a], names[b], angle) for a, b, angle in turns)
    off = [
        abs(math.remainder(bearing - compass_bearing(name), math.tau))
        for name, bearing in zip(names, bearings, strict=True)
    ]
    fancy = sum(RING.index(name) % 2 for name in names) * (8.0 if len(names) <= 4 else 1.0)
    far = sum(each > math.radians(67.5) for each in off)
    return far + wrong, sum(each**2 for each in off) + 0.35 * fancy


def _contradicts(entry: Compass, exit_: Compass, angle: float) -> bool:
    said = turn_by_name(entry, exit_)
    if abs(angle) < CLEARLY_STRAIGHT:
        return said != "straight"
    if abs(angle) > CLEARLY_TURNED:
        return said != ("left" if angle > 0 else "right")
    return False


def compass_bearing(name: Compass) -> float:
    """The outward direction that a compass name stands for [rad, ccw from east]."""
    return math.pi / 2 - RING.index(name) * math.pi / 4


def turn_by_name(entry: Compass, exit_: Compass) -> str:
    """What the compass says of a movement: straight, left, right or uturn.

    >>> turn_by_name("north", "east"), turn_by_name("west", "east")
    ('left', 'straight')
    """
    step = (RING.index(exit_) - RING.index(entry)) % len(RING)
    if step == 0:
        return "uturn"
    return "straight" if step == 4 else "left" if step < 4 else "right"
