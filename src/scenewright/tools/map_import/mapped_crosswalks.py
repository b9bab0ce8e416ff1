"""Which crossings of a file lie on which leg, and the line of a leg's crosswalk by them.

A crossing belongs to the leg whose lanes it crosses. Of several on one leg, those that cross other
lanes are stages of one crosswalk, parted by islands; the nearest to the junction that crosses most
lanes is taken, and the others are reported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenewright.geometry.polyline import measure_length, measure_turn, rotate_left
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.legs import SurveyLeg
from scenewright.tools.map_import.map_parts import geos, list_points
from scenewright.tools.map_import.survey import Survey, SurveyConnection, SurveyCrossing

_FARTHEST = 35.0
"""A crossing farther out of the junction is not the junction's [m]."""
_DEEPEST = 30.0
"""Nor is one that lies farther inside [m]."""
_LEAST_ANGLE = math.radians(35.0)
"""Between a crossing and the lanes that it crosses."""
_STEEPEST = math.radians(40.0)
"""How far the line through two stages may turn from their own direction."""
_SAME_PLACE = 4.5
"""Crossings of the same lanes that lie closer are drawn twice [m]."""
_NEXT_STAGE = 20.0
"""The middles of two stages of one crosswalk lie closer [m]."""
_LEAST_SHARE = 0.5
"""Of a leg's lanes that a crosswalk crosses."""
_LEAST_VOTES = 0.6


@dataclass(frozen=True, eq=False)
class LegCrossing:
    """A crossing of the file on a leg.

    Attributes:
        lanes: of the leg, that it crosses; distance: outwards from where they leave the junction
            [m], negative inside.
        equals: other legs that it may as well lie on, and the distance out of them.
    """

    crossing: SurveyCrossing
    leg: int
    lanes: frozenset[str]
    distance: float
    equals: tuple[tuple[int, float], ...] = ()

    @property
    def middle(self) -> FloatArray:
        """[2] its middle [m]."""
        return np.asarray(self.crossing.line.mean(axis=0))


@dataclass(frozen=True, eq=False)
class MappedCrosswalk:
    """What the file holds of a leg's crosswalk: its stages, one after the other."""

    stages: tuple[LegCrossing, ...]

    @property
    def middle(self) -> FloatArray:
        """[2] halfway between its outermost points [m]."""
        points = self._points @ self.across
        shift = (points.min() + points.max()) / 2 - self._mean @ self.across
        return np.asarray(self._mean + shift * self.across)

    @property
    def across(self) -> FloatArray:
        """[2] unit vector along it."""
        if len(self.stages) > 1:
            middles = np.array([stage.middle for stage in self.stages])
            return np.asarray(np.linalg.svd(middles - middles.mean(axis=0))[2][0])
        line = self.stages[0].crossing.line
        return np.asarray((line[1] - line[0]) / max(float(np.hypot(*(line[1] - line[0]))), 1e-9))

    @property
    def width(self) -> float:
        """[m]"""
        return float(np.median([stage.crossing.width for stage in self.stages]))

    @property
    def is_bounded(self) -> bool:
        """Whether its ends are the file's kerbs."""
        return all(stage.crossing.is_bounded for stage in self.stages)

    @property
    def ends(self) -> FloatArray:
        """[2, 2] its outermost points on its line [m]."""
        return self._find_reach(self._points)

    @property
    def limits(self) -> FloatArray | None:
        """[2, 2] where the ways over it end, seen along its line [m]; None if one has no way."""
        drawn = [stage.crossing.limits for stage in self.stages]
        known = [each for each in drawn if each is not None]
        if len(known) < len(drawn):
            return None
        return self._find_reach(np.concatenate(known))

    def _find_reach(self, points: FloatArray) -> FloatArray:
        along = (points - self.middle) @ self.across
        return np.asarray(self.middle + np.outer([along.min(), along.max()], self.across))

    @property
    def sources(self) -> tuple[str, ...]:
        """What the file calls its stages."""
        return tuple(stage.crossing.source for stage in self.stages)

    @property
    def _mean(self) -> FloatArray:
        return np.asarray(np.mean([stage.middle for stage in self.stages], axis=0))

    @property
    def _points(self) -> FloatArray:
        return np.concatenate([stage.crossing.line for stage in self.stages])


@dataclass(frozen=True, eq=False)
class CrossingChoice:
    """The file's crosswalk of each leg that has one, and the crossings that were left out.

    Attributes:
        left_out: (crossing, leg or None, why).
    """

    by_leg: Mapping[int, MappedCrosswalk]
    left_out: tuple[tuple[SurveyCrossing, int | None, str], ...]

    def leave_out(self, reasons: Mapping[int, str]) -> CrossingChoice:
        """The choice without the crosswalks of some legs; why, by leg."""
        kept = {k: each for k, each in self.by_leg.items() if k not in reasons}
        dropped = [
            (stage.crossing, k, why)
            for k, why in sorted(reasons.items())
            if k in self.by_leg
            for stage in self.by_leg[k].stages
        ]
        return CrossingChoice(kept, (*self.left_out, *dropped))


def build_area_crossing(outline: FloatArray, source: str = "") -> SurveyCrossing:
    """A crossing of an area [P, 2]: the middle line along its longer side."""
    box = np.array(geos.minimum_rotated_rectangle(geos.MultiPoint(outline)).exterior.coords)
    ahead = max(np.diff(box[:3], axis=0), key=lambda side: float(np.hypot(*side)))
    ahead = ahead / max(float(np.hypot(*ahead)), 1e-9)
    half, aside = np.ptp(outline @ ahead) / 2, np.ptp(outline @ rotate_left(ahead))
    middle = np.array(geos.MultiPoint(outline).convex_hull.centroid.coords[0])
    return SurveyCrossing(middle + np.outer([-half, half], ahead), float(aside), source=source)


def choose_crossings(survey: Survey, legs: Sequence[SurveyLeg]) -> CrossingChoice:
    """By leg, the crossings of the file that are its crosswalk."""
    leg_of_lane = {lane.id: k for k, leg in enumerate(legs) for lane in leg.lanes}
    # Ways that no file draws say little of where a crossing lies, but for lanes without another.
    drawn = {x for way in survey.connections if not way.is_added for x in (way.approach, way.exit)}
    ways = [
        _Way.join(survey, connection, leg_of_lane)
        for connection in survey.connections
        if not (connection.is_added and {connection.approach, connection.exit} <= drawn)
    ]
    found: dict[int, list[LegCrossing]] = {}
    left_out: list[tuple[SurveyCrossing, int | None, str]] = []
    known: list[LegCrossing] = []
    for crossing in survey.crossings:
        placed = _find_leg(crossing, ways)
        if isinstance(placed, str):
            left_out.append((crossing, None, placed))
        else:
            known.append(placed)
    for placed in _join_stages(known):
        found.setdefault(placed.leg, []).append(placed)
    by_leg = {}
    for k, own in sorted(found.items()):
        stages = _choose_stages(own, legs[k])
        by_leg[k] = MappedCrosswalk(tuple(stages))
        for x in (each for each in own if each not in stages):
            near = min(math.dist(x.middle, stage.middle) for stage in stages)
            why = f"a leg has one crosswalk here; this one lies {near:.0f} m from the one taken"
            if near < _SAME_PLACE:
                why = f"is drawn twice, {near:.1f} m beside the one taken"
            left_out.append((x.crossing, k, why))
    return CrossingChoice(by_leg, tuple(left_out))


@dataclass(frozen=True, eq=False)
class _Way:
    """A way through the junction; begin, end: where along it the junction begins and ends [m]."""

    line: object
    begin: float
    end: float
    lanes: tuple[str, str]
    legs: tuple[int, int]

    @classmethod
    def join(cls, survey: Survey, each: SurveyConnection, legs: Mapping[str, int]) -> _Way:
        before = _prolong(survey.approaches[each.approach].line[::-1])[::-1]
        after = _prolong(survey.exits[each.exit].line)
        points = np.concatenate([before, each.line, after])
        begin = measure_length(before)
        inner = measure_length(np.concatenate([before[-1:], each.line, after[:1]]))
        lanes = each.approach, each.exit
        return cls(
            geos.LineString(points), begin, begin + inner, lanes, (legs[lanes[0]], legs[lanes[1]])
        )

    def list_meetings(self, line: FloatArray) -> Iterator[tuple[int, str, float]]:
        """Leg, lane and distance out of the junction [m] where a line across meets the way.

        Inside the junction it meets both the leg that the way comes from and that it leads to.
        """
        for point in list_points(geos.intersection(self.line, geos.LineString(line))):
            s = float(geos.line_locate_point(self.line, point))
            a, b = (
                np.array(geos.line_interpolate_point(self.line, max(s + d, 0.0)).coords[0])
                for d in (-1.0, 1.0)
            )
            if abs(math.sin(measure_turn(line[1] - line[0], b - a))) < math.sin(_LEAST_ANGLE):
                continue
            for side, away in enumerate((self.begin - s, s - self.end)):
                other_side = s - self.end if side == 0 else self.begin - s
                if -_DEEPEST < away < _FARTHEST and other_side <= 0.0:
                    yield self.legs[side], self.lanes[side], away


def _prolong(line: FloatArray) -> FloatArray:
    """A lane that ends near the junction, straight on beyond what counts as the junction's."""
    missing = _FARTHEST + 2.0 - measure_length(line)
    step = line[-1] - line[-2]
    if missing <= 0.0 or not step.any():
        return line
    return np.concatenate([line, [line[-1] + missing * step / np.hypot(*step)]])


def _find_leg(crossing: SurveyCrossing, ways: Sequence[_Way]) -> LegCrossing | str:
    """The leg whose lanes a crossing crosses, or why there is none."""
    turned = _turn_crossing(crossing)
    for each in (crossing, *([turned] if turned is not None else [])):
        ahead = (each.line[1] - each.line[0]) / max(math.dist(*each.line), 1e-9)
        line = each.line + np.outer([-0.5, 0.5], ahead)  # marks begin beside the kerb
        met = [own for way in ways if (own := list(way.list_meetings(line)))]
        if met:
            return _count_votes(each, met)
    return "crosses no lane of this junction within 35 m"


def _count_votes(
    crossing: SurveyCrossing, met: Sequence[Sequence[tuple[int, str, float]]]
) -> LegCrossing | str:
    """The leg that most of the ways over a crossing come from or lead to; the nearest of equals.

    A pedestrian crossing the eastern leg meets all vehicles from or to the east, and no other,
    however far inside the junction it walks.
    """
    flat = [meeting for own in met for meeting in own]
    votes = {leg: sum(any(leg == x for x, _, _ in own) for own in met) for leg, _, _ in flat}
    away = {k: float(np.median([d for leg, _, d in flat if leg == k])) for k in votes}
    order = sorted(votes, key=lambda k: (-votes[k], abs(away[k]), k))
    leg = order[0]
    if votes[leg] < _LEAST_VOTES * len(met):
        return "lies across the middle of the junction"
    own = frozenset(lane for k, lane, _ in flat if k == leg)
    equals = tuple(k for k in order[1:] if votes[k] == votes[leg])
    return LegCrossing(crossing, leg, own, away[leg], tuple((k, away[k]) for k in equals))


def _join_stages(placed: Sequence[LegCrossing]) -> Iterator[LegCrossing]:
    """The crossings; one that two legs may have goes to that of the stage that it goes on from."""
    for each in placed:
        near = [
            (math.dist(each.middle, other.middle), leg, away)
            for leg, away in each.equals
            for other in placed
            if other is not each and other.leg == leg and _goes_on(each, other)
        ]
        beside = any(x is not each and x.leg == each.leg and _goes_on(each, x) for x in placed)
        if near and not beside and min(near)[0] < _NEXT_STAGE:
            _, leg, away = min(near)
            yield replace(each, leg=leg, distance=away)
        else:
            yield each


def _turn_crossing(crossing: SurveyCrossing) -> SurveyCrossing | None:
    """A drawn area seen the other way: what was taken for its width is its length."""
    if not crossing.is_bounded:
        return None
    line = crossing.line
    length = float(np.hypot(*(line[1] - line[0])))
    aside = rotate_left((line[1] - line[0]) / max(length, 1e-9))
    ends = line.mean(axis=0) + np.outer([-0.5, 0.5], crossing.width * aside)
    return replace(crossing, line=ends, width=length)


def _choose_stages(own: Sequence[LegCrossing], leg: SurveyLeg) -> list[LegCrossing]:
    groups = [_collect_stages(seed, own) for seed in own]

    def rank(group: Sequence[LegCrossing]) -> tuple[bool, bool, float]:
        crossed = len(frozenset().union(*(each.lanes for each in group)))
        away = float(np.mean([abs(each.distance) for each in group]))
        unmarked = all(not each.crossing.is_marked for each in group)
        return crossed < _LEAST_SHARE * len(leg.lanes), unmarked and away > 12.0, away

    return min(groups, key=rank)


def _collect_stages(seed: LegCrossing, own: Sequence[LegCrossing]) -> list[LegCrossing]:
    """A crossing with those of the leg's other lanes that go on in its line."""
    group = [seed]
    for other in sorted(own, key=lambda each: abs(each.distance - seed.distance)):
        # Another stage crosses other lanes, or the same ones at clearly other places.
        others = (
            each.lanes.isdisjoint(other.lanes)
            or float(np.hypot(*(each.middle - other.middle))) > _SAME_PLACE
            for each in group
        )
        if all(others) and _goes_on(seed, other):
            group.append(other)
    return group


def _goes_on(a: LegCrossing, b: LegCrossing) -> bool:
    """Whether the line from one crossing to the other is about their own direction."""
    between = b.middle - a.middle
    far = float(np.hypot(*between))
    if far < 1.0:
        return False
    lines = [each.crossing.line[1] - each.crossing.line[0] for each in (a, b)]
    cosines = [abs(float(line @ between)) / (far * float(np.hypot(*line))) for line in lines]
    return min(cosines) > math.cos(_STEEPEST)
