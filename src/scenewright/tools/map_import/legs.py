"""Lanes of a junction grouped into legs, and the compass names of the legs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, groupby, pairwise
from typing import NamedTuple

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.polyline import find_point, rotate_left
from scenewright.scene.base import Compass, FloatArray
from scenewright.tools.map_import.compass import COMPASS_RING, compute_bearing, name_turn
from scenewright.tools.map_import.survey import Survey, SurveyLane

LEAST_LEGS, MOST_LEGS = 3, len(COMPASS_RING)
_MOST_LANES = 16
"""Of one direction of a street; toll plazas aside, none has more."""
_SAME_LEG, _WIDEST_LEG = math.radians(24.0), math.radians(36.0)
"""Neighbouring lanes of one leg have directions that differ by less, its outermost ones, and lanes
of one street, by less than the second."""
_BEARING_RANGE = (4.0, 30.0)
"""Distances from the junction between which a lane's direction is measured [m]."""
_NEAR_OUT, _FAR_OUT = 20.0, 40.0
"""Where lanes of one direction are compared, and where legs are put in order [m]."""
WIDEST_MEDIAN, OTHER_STREET = 45.0, 22.0
"""Lanes of one street lie closer side by side; those of different names closer still [m]."""
_ISLAND = 8.0
"""Between the middles of lanes, or of streets, that an island parts, at least [m]."""
CLEARLY_STRAIGHT, CLEARLY_TURNED = math.radians(20.0), math.radians(50.0)


@dataclass(frozen=True, eq=False)
class SurveyLeg:
    """One arm of a junction: its bearing [rad] and its lanes.

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
        """Approaches, then exits."""
        return (*self.approaches, *self.exits)

    @property
    def directed_lanes(self) -> Iterator[tuple[SurveyLane, bool]]:
        """Every lane, and whether it is an approach."""
        yield from ((lane, True) for lane in self.approaches)
        yield from ((lane, False) for lane in self.exits)

    @property
    def road(self) -> str:
        """The commonest name of its lanes."""
        names = [lane.road for lane in self.lanes if lane.road]
        return max(sorted(set(names)), key=names.count) if names else ""


def orient_outwards(lane: SurveyLane, is_approach: bool) -> FloatArray:
    """[P, 2] the lane's middle from the junction outwards."""
    return np.asarray(lane.line[::-1] if is_approach else lane.line)


def find_legs(survey: Survey) -> tuple[SurveyLeg, ...]:
    """The legs, counter-clockwise by bearing.

    Raises:
        InputError: fewer than three, or more than there are compass names.
    """
    if reason := explain_refusal(legs := list_legs(survey)):
        raise InputError(f"{survey.title} cannot be imported: {reason}")
    return legs


def explain_count(count: int) -> str:
    """Why no map can be made of a junction of so many legs; "" if one can."""
    wrong = not LEAST_LEGS <= count <= MOST_LEGS
    return f"it has {count} legs; an intersection has {LEAST_LEGS} to {MOST_LEGS}" * wrong


def explain_refusal(legs: Sequence[SurveyLeg]) -> str:
    """Why no map can be made of a junction of these legs; "" if one can."""
    if reason := explain_count(len(legs)):
        return reason
    if (widest := max(len(leg.approaches) for leg in legs)) > _MOST_LANES:
        return (
            f"it has a leg of {widest} lanes in one direction; a street has at most {_MOST_LANES}, "
            "is the tag lanes right?"
        )
    return ""


def list_legs(survey: Survey) -> tuple[SurveyLeg, ...]:
    """The legs, counter-clockwise by bearing, however many."""
    lanes = [(lane, True) for lane in survey.approaches.values()]
    lanes += [(lane, False) for lane in survey.exits.values()]
    arms = [Arm(orient_outwards(*x), x[0].road, "in" if x[1] else "out") for x in lanes]
    legs = [_build_leg([lanes[i] for i in own]) for own in group_arms(arms)]
    # By where they lie: the bearings of two streets that run side by side do not order them.
    legs.sort(
        key=lambda leg: float(np.angle(complex(*leg.throat) + _FAR_OUT * np.exp(1j * leg.bearing)))
    )
    first = min(range(len(legs)), key=lambda k: legs[k].bearing, default=0)
    return (*legs[first:], *legs[:first])


class Arm(NamedTuple):
    """A lane or a street at a junction.

    Attributes:
        line: [P, 2] outwards [m]; street: its name; leads: `in`, `out`, or `in out` for both.
    """

    line: FloatArray
    street: str
    leads: str


def group_arms(arms: Sequence[Arm]) -> Iterator[list[int]]:
    """Which arms are of one leg.

    Those of one direction; apart are those that lie too far aside to be of the same street, and
    streets side by side that are both driven both ways.
    """
    bearings = [measure_bearing(arm.line) for arm in arms]
    for group in _cluster_angles(bearings, [arm.street for arm in arms]) if arms else ():
        ahead = np.array([(math.cos(bearings[i]), math.sin(bearings[i])) for i in group])
        left = rotate_left(ahead.sum(axis=0) / np.hypot(*ahead.sum(axis=0)))
        aside = {i: float(find_point(arms[i].line, _NEAR_OUT) @ left) for i in group}
        order = sorted(group, key=lambda i: (aside[i], i))
        own = [order[0]]
        for before, after in pairwise(order):
            same = arms[before].street == arms[after].street != ""
            if aside[after] - aside[before] > (WIDEST_MEDIAN if same else OTHER_STREET):
                yield from _part_streets(own, arms, aside)
                own = []
            own.append(after)
        yield from _part_streets(own, arms, aside)


def _part_streets(
    own: list[int], arms: Sequence[Arm], aside: Mapping[int, float]
) -> Iterator[list[int]]:
    """Arms beside one another, parted at the widest gap until each part may be one street.

    Across one street the driving direction changes once.
    """
    leads = [lead for i in own for lead in arms[i].leads.split()]
    runs = sum(1 for _ in groupby(leads))
    gaps = [(aside[b] - aside[a], k) for k, (a, b) in enumerate(pairwise(own), start=1)]
    widest, k = max(gaps, default=(0.0, 0))
    if runs <= 2 or widest < _ISLAND:
        yield own
    else:
        yield from _part_streets(own[:k], arms, aside)
        yield from _part_streets(own[k:], arms, aside)


def measure_bearing(line: FloatArray) -> float:
    """The direction in which a line from the junction outwards leads [rad]."""
    near, far = (find_point(line, distance) for distance in _BEARING_RANGE)
    if float(np.hypot(*(far - near))) < 1.0:
        near = line[0]
    return math.atan2(*(far - near)[::-1])


def _cluster_angles(angles: Sequence[float], streets: Sequence[str]) -> list[list[int]]:
    """Groups of neighbouring angles, split where two neighbours are far apart."""
    order = sorted(range(len(angles)), key=lambda i: angles[i])
    following = [*order[1:], order[0]]
    gaps = [
        math.remainder(angles[j] - angles[i], math.tau) % math.tau
        for i, j in zip(order, following, strict=True)
    ]
    first = max(range(len(order)), key=lambda k: gaps[k]) + 1
    groups: list[list[int]] = []
    for k in range(first, first + len(order)):
        i, gap = order[k % len(order)], gaps[(k - 1) % len(order)]
        width = abs(math.remainder(angles[i] - angles[groups[-1][0]], math.tau)) if groups else 0.0
        same = groups and streets[i] == streets[groups[-1][-1]] != ""
        if groups and gap < (_WIDEST_LEG if same else _SAME_LEG) and width < _WIDEST_LEG:
            groups[-1].append(i)
        else:
            groups.append([i])
    return groups


def _build_leg(lanes: Sequence[tuple[SurveyLane, bool]]) -> SurveyLeg:
    lines = [orient_outwards(*lane) for lane in lanes]
    ways = np.array([[math.cos(a), math.sin(a)] for a in map(measure_bearing, lines)]).sum(axis=0)
    near = np.array([find_point(line, 8.0) - line[0] for line in lines]).sum(axis=0)
    return SurveyLeg(
        bearing=math.atan2(ways[1], ways[0]),
        approaches=tuple(lane for lane, is_approach in lanes if is_approach),
        exits=tuple(lane for lane, is_approach in lanes if not is_approach),
        throat=np.mean([line[0] for line in lines], axis=0),
        outwards=near / np.hypot(*near),
    )


def name_legs(
    legs: Sequence[SurveyLeg], turns: Sequence[tuple[int, int, float]]
) -> tuple[Compass, ...]:
    """A compass name for every leg, in the order of the legs round the junction.

    The names are those under which the turn that two names imply is the turn on the map: from the
    north to the east is a left turn. Among such names the plain four win for up to four legs, and
    else the nearest.

    Args:
        turns: (entry, exit, turning angle [rad, positive to the left]) of each connection.
    """
    bearings = [leg.bearing for leg in legs]
    namings = (
        (*chosen[turn:], *chosen[:turn])
        for chosen in combinations(COMPASS_RING[::-1], len(legs))
        for turn in range(len(legs))
    )
    return min(namings, key=lambda names: _score_naming(names, bearings, turns))


def _score_naming(
    names: Sequence[Compass], bearings: Sequence[float], turns: Sequence[tuple[int, int, float]]
) -> tuple[int, float]:
    """(contradictions, deviation): the less the better."""
    wrong = 0
    for a, b, angle in turns:
        named, side = name_turn(names[a], names[b]), "left" if angle > 0 else "right"
        wrong += named != "straight" if abs(angle) < CLEARLY_STRAIGHT else False
        wrong += named != side if abs(angle) > CLEARLY_TURNED else False
    off = [
        abs(math.remainder(bearing - compute_bearing(name), math.tau))
        for name, bearing in zip(names, bearings, strict=True)
    ]
    diagonal = sum(COMPASS_RING.index(name) % 2 for name in names) * (
        8.0 if len(names) <= 4 else 1.0
    )
    far = sum(each > math.radians(67.5) for each in off)
    return far + wrong, sum(each**2 for each in off) + 0.35 * diagonal
