"""Roundabouts in maps of lanes: closed loops of lanes that turn once round in one sense."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenewright.geometry.polyline import (
    drop_doubled_points,
    measure_length,
    resample_by_spacing,
    smooth_gaussian,
)
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.map_parts import geos

ROUNDABOUT = (
    "a roundabout is one intersection: vehicles keep to its ring, and give way as they enter"
)
"""What is said of one that is imported."""
_LONGEST = 350.0
"""Round a ring [m]."""
_MOST_LANES = 40
_HALF_LANE = 1.75
"""From the middle of a ring's lane to its edge [m]."""
_BACK = math.radians(40.0)
"""How far a ring may turn back on the way round, as where it swings out to an exit."""
_LEAST_ROUNDNESS = 0.86
"""Area in squares of the way round, of a circle 1; a block of streets has less."""
_SAME_RING = 0.5
"""Of the smaller one's area that two rings of one roundabout have in common."""


@dataclass(frozen=True, eq=False)
class LaneRing:
    """A ring of lanes.

    Attributes:
        lanes: their names, in driving direction; outline: [P, 2] their middles [m].
        is_left: whether it turns left, counter-clockwise.
    """

    lanes: tuple[str, ...]
    outline: FloatArray
    is_left: bool

    def shares_ground(self, other: LaneRing) -> bool:
        """Whether both lie round the same island."""
        areas = [geos.Polygon(each.outline).buffer(0) for each in (self, other)]
        common = areas[0].intersection(areas[1]).area
        return bool(common > _SAME_RING * min(area.area for area in areas))


@dataclass(frozen=True, eq=False)
class Ring:
    """The ring of a roundabout: its rings of lanes, which lie round one island."""

    rings: tuple[LaneRing, ...]

    @property
    def lanes(self) -> frozenset[str]:
        """Names of its lanes."""
        return frozenset(name for ring in self.rings for name in ring.lanes)

    @property
    def carriageway(self) -> Any:
        """The ground of its lanes."""
        return geos.union_all([geos.LinearRing(x.outline).buffer(_HALF_LANE) for x in self.rings])

    @property
    def disc(self) -> Any:
        """Its ground with the island."""
        return geos.union_all([geos.Polygon(x.outline).buffer(_HALF_LANE) for x in self.rings])

    @property
    def refusal(self) -> str:
        """Why it cannot be represented, "" if it can."""
        if len({ring.is_left for ring in self.rings}) == 1:
            return ""
        return "the file's lanes lead both ways round its ring, and a roundabout is driven one way"


def join_rings(found: Sequence[LaneRing]) -> list[Ring]:
    """The rings of lanes that lie round one island as one."""
    groups: list[list[LaneRing]] = []
    for ring in found:
        beside = [each for each in groups if any(ring.shares_ground(other) for other in each)]
        groups = [each for each in groups if each not in beside]
        groups.append([ring, *(other for each in beside for other in each)])
    return [Ring(tuple(each)) for each in groups]


def find_rings(
    lines: Mapping[str, FloatArray], follows: Mapping[str, Sequence[str]]
) -> list[LaneRing]:
    """The rings of a map of lanes; of those through one lane the shortest.

    Args:
        lines: [P, 2] middle of every lane, by name [m].
        follows: which lanes begin where one ends.
    """
    found: list[LaneRing] = []
    ringed: set[str] = set()
    for name in sorted(lines):
        if name in ringed:
            continue
        around = min(_list_loops(name, lines, follows), key=lambda each: each[0], default=None)
        if around is not None:
            found.append(around[1])
            ringed.update(around[1].lanes)
    return found


def _list_loops(
    first: str, lines: Mapping[str, FloatArray], follows: Mapping[str, Sequence[str]]
) -> Iterator[tuple[float, LaneRing]]:
    """The loops through a lane that are rings, with their lengths [m]."""
    start = lines[first][0]
    todo: list[tuple[tuple[str, ...], float]] = [((first,), measure_length(lines[first]))]
    while todo:
        names, length = todo.pop()
        for name in follows.get(names[-1], ()):
            if name == first:
                if (ring := _build_ring(names, lines)) is not None:
                    yield length, ring
                continue
            longer = length + measure_length(lines[name])
            near = longer + math.dist(lines[name][-1], start) <= _LONGEST
            if name not in names and near and len(names) < _MOST_LANES:
                way = (*names, name)
                if _turns_one_way(way, lines):
                    todo.append((way, longer))


def _turns_one_way(names: Sequence[str], lines: Mapping[str, FloatArray]) -> bool:
    """Whether a way of lanes turns at most once round, and hardly back."""
    turned = _measure_turning(np.concatenate([lines[name] for name in names]))
    low, high = float(turned.min(initial=0.0)), float(turned.max(initial=0.0))
    back = min(
        float((np.maximum.accumulate(turned) - turned).max(initial=0.0)),
        float((turned - np.minimum.accumulate(turned)).max(initial=0.0)),
    )
    return back < _BACK and high - low < math.tau + _BACK


def _measure_turning(line: FloatArray) -> FloatArray:
    """[P] how far a line has turned, positive to the left, at steps of some metres [rad]."""
    points = smooth_gaussian(resample_by_spacing(drop_doubled_points(line), 1.0), 2.0)
    step = np.diff(points[::2], axis=0)
    return np.asarray(np.unwrap(np.arctan2(step[:, 1], step[:, 0])) - math.atan2(*step[0][::-1]))


def _build_ring(names: Sequence[str], lines: Mapping[str, FloatArray]) -> LaneRing | None:
    """A closed loop of lanes as a ring; None if it is not round."""
    outline = drop_doubled_points(np.concatenate([lines[name] for name in names]))
    ring = geos.Polygon(outline) if len(outline) > 3 else geos.Polygon()
    if not ring.is_valid or ring.is_empty:
        return None
    if 4 * math.pi * ring.area / ring.length**2 < _LEAST_ROUNDNESS:
        return None
    return LaneRing(tuple(names), outline, bool(ring.exterior.is_ccw))
