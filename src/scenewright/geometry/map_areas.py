"""The map's areas as prepared polygons: road, walkable area, crosswalks."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Path
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import PolygonWithHoles

geos: Any = import_module("shapely")
"""Shapely's functions carry no types; one name keeps that in one place."""


_SHORTEST = 4
"""Fewest points of a path."""


@dataclass(frozen=True)
class Visit:
    """A crosswalk under a path: its first and last point there, and how often it comes onto it."""

    crosswalk: str
    first: int
    last: int
    steps_on: int


class MapAreas:
    """Where agents may be, on one map.

    Attributes:
        intersection_map: the map.
    """

    def __init__(self, intersection_map: IntersectionMap) -> None:
        self.intersection_map = intersection_map
        crosswalks = [geos.Polygon(crosswalk.polygon) for crosswalk in intersection_map.crosswalks]
        self._crosswalks = [crosswalk.id for crosswalk in intersection_map.crosswalks]
        # Corners [M, 2] of all, where each begins and ends among them [P + 1], boxes [P, 4].
        each = [np.array(crosswalk.polygon) for crosswalk in intersection_map.crosswalks]
        self._corners: FloatArray = np.concatenate([np.empty((0, 2)), *each])
        self._ends = np.cumsum([0, *map(len, each)], dtype=np.intp)
        boxes = [(*corners.min(axis=0), *corners.max(axis=0)) for corners in each]
        self._boxes: FloatArray = np.array(boxes).reshape(-1, 4)
        self._road = merge_areas(intersection_map.road)
        self._walkable = geos.union_all([merge_areas(intersection_map.walkable), *crosswalks])
        for area in (self._road, self._walkable):
            geos.prepare(area)
            if not area.is_empty:
                # GEOS builds its index at the first question, which threads may not share.
                geos.contains_xy(area, *area.envelope.centroid.coords[0])

    def trim(self, path: Path) -> Path:
        """The path without the ends that lie beyond the edge of the map."""
        away = np.abs(path.xy)
        if away.max() <= self.intersection_map.extent:
            return path
        inside = np.nonzero(away.max(axis=1) <= self.intersection_map.extent)[0]
        if len(inside) < _SHORTEST or len(inside) == len(path.s):
            return path
        keep = slice(inside[0], inside[-1] + 1)
        s = path.s[keep] - path.s[inside[0]]
        return Path(path.xy[keep], s, path.heading[keep], path.curvature[keep])

    def compute_road_share(self, xy: FloatArray) -> float:
        """Share of points [N, 2] on the road."""
        return float(np.mean(geos.contains_xy(self._road, xy)))

    def compute_walkable_share(self, xy: FloatArray) -> float:
        """Share of points [N, 2] on walkable area or a crosswalk."""
        return float(np.mean(geos.contains_xy(self._walkable, xy)))

    def find_crosswalk_visits(self, xy: FloatArray) -> list[Visit]:
        """The crosswalks that any of the points [N, 2] of a path lies on, in the map's order."""
        visits = _find_visits(xy, self._corners, self._ends, self._boxes).tolist()
        each = zip(self._crosswalks, visits, strict=True)
        return [Visit(name, *visit) for name, visit in each if visit[0] >= 0]


@compiled
def _find_visits(
    xy: FloatArray, corners: FloatArray, ends: NDArray[np.intp], boxes: FloatArray
) -> NDArray[np.intp]:
    """[P, 3] first and last of points [N, 2] in each polygon, and how often they come into it.

    Nowhere: -1.
    """
    visits = np.full((len(boxes), 3), -1, np.intp)
    for p in range(len(boxes)):
        west, south, east, north = boxes[p, 0], boxes[p, 1], boxes[p, 2], boxes[p, 3]
        comes_in, was_inside = 0, True
        for n in range(len(xy)):
            x, y = xy[n, 0], xy[n, 1]
            inside = west <= x <= east and south <= y <= north
            inside = inside and _is_inside(corners[ends[p] : ends[p + 1]], x, y)
            if inside:
                visits[p, 0] = n if visits[p, 0] < 0 else visits[p, 0]
                visits[p, 1] = n
            comes_in += inside and not was_inside
            was_inside = inside
        visits[p, 2] = comes_in
    return visits


@compiled
def _is_inside(corners: FloatArray, x: float, y: float) -> bool:
    """Return whether a point lies in a polygon [M, 2], by ray casting."""
    inside = False
    for k in range(len(corners)):
        ax, ay = corners[k - 1, 0], corners[k - 1, 1]
        bx, by = corners[k, 0], corners[k, 1]
        if (ay > y) != (by > y):
            inside ^= x < ax + (y - ay) * (bx - ax) / (by - ay)
    return inside


def merge_areas(areas: tuple[PolygonWithHoles, ...]) -> Any:
    """The union of areas, as a shape of shapely."""
    return geos.union_all([geos.Polygon(area.exterior, area.holes) for area in areas])
