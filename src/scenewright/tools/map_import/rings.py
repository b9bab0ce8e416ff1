"""Roundabouts in maps of lanes: closed ways of lanes round one island."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from scenewright.geometry.polyline import drop_doubled_points, find_point, measure_turn
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.map_parts import geos

_CLUSTERS: Any = import_module("scipy.cluster.hierarchy")  # its functions have no types
ROUNDABOUT = (
    "a roundabout is one intersection: vehicles keep to its ring, and give way as they enter"
)
"""What is said of one that is imported."""
_LONGEST = 450.0
"""Round a ring [m]."""
_HALF_LANE = 1.75
"""From the middle of a ring's lane to its edge [m]."""
_PARTED = 12.0
"""Lanes that begin together have parted after that distance [m]."""
_LARGEST_ISLAND = 1500.0
"""Of a ring that is driven both ways [m^2]."""
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
        return (
            "the file's lanes lead both ways round its ring, and a roundabout is driven one way; "
            "the same place from OpenStreetMap can be imported"
        )


def find_roundabouts(
    lines: Mapping[str, FloatArray], follows: Mapping[str, Sequence[str]]
) -> list[Ring]:
    """The roundabouts of a map of lanes: round rings of lanes about one island without lanes.

    Rings in both senses about much ground are two-way streets about a block.

    Args:
        lines: [P, 2] middle of every lane, by name [m].
        follows: which lanes begin where one ends.
    """
    rings = find_rings(lines, follows)
    if not rings:
        return []
    areas = np.array([geos.Polygon(x.outline).simplify(0.2).buffer(0) for x in rings], dtype=object)
    pairs = geos.STRtree(areas).query(areas, predicate="intersects")
    common, least = geos.area(geos.intersection(*areas[pairs])), geos.area(areas[pairs]).min(axis=0)
    joined: Any = _CLUSTERS.DisjointSet(range(len(rings)))
    for i, j in pairs[:, common > _SAME_RING * least].T.tolist():
        joined.merge(i, j)
    tree = geos.STRtree([geos.LineString(line) for line in lines.values()])
    found = []
    for own in map(sorted, joined.subsets()):
        ring = Ring(tuple(rings[k] for k in own))
        inner = min(areas[own], key=geos.area)
        is_block = ring.refusal and inner.area > _LARGEST_ISLAND
        holds_lanes = len(tree.query(inner.buffer(-2 * _HALF_LANE), predicate="intersects"))
        shapes = [geos.Polygon(each.outline) for each in ring.rings]
        is_round = all(4 * math.pi * x.area / x.length**2 >= _LEAST_ROUNDNESS for x in shapes)
        if not is_block and not holds_lanes and is_round:
            found.append(ring)
    return found


def find_rings(
    lines: Mapping[str, FloatArray], follows: Mapping[str, Sequence[str]]
) -> list[LaneRing]:
    """The closed ways on which one keeps left at every branching, or right, on one's own side."""
    found: list[LaneRing] = []
    for side in (1.0, -1.0):
        following = {
            name: after[0]
            if len(after) == 1
            else max((side * _turn(lines[name], lines[x]), x) for x in after)[1]
            for name, after in follows.items()
            if after
        }
        seen = set[str]()
        for first in sorted(lines):
            here, way = first, list[str]()
            while here in following and here not in seen:
                seen.add(here)
                way.append(here)
                here = following[here]
            if here not in way:
                continue
            way = way[way.index(here) :]
            outline = drop_doubled_points(np.concatenate([lines[name] for name in way]))
            ring = geos.Polygon(outline) if len(outline) > 3 else geos.Polygon()
            if ring.is_valid and ring.length <= _LONGEST and ring.exterior.is_ccw == (side > 0):
                found.append(LaneRing(tuple(way), outline, ring.exterior.is_ccw))
    return found


def _turn(line: FloatArray, after: FloatArray) -> float:
    """How far a lane leads to the left of the one before it [rad]."""
    return measure_turn(line[-1] - line[-2], find_point(after, _PARTED) - after[0])
