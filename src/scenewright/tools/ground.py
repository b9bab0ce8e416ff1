"""The map's areas as prepared polygons: road, walkable area, crosswalks."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Path
from scenewright.scene.map import IntersectionMap, PolygonWithHoles

geos: Any = import_module("shapely")
"""Shapely's functions carry no types; one name keeps that in one place."""


_SHORTEST = 4
"""Fewest points of a path."""


class Ground:
    """Where agents may be, on one map.

    Attributes:
        on: the map.
    """

    def __init__(self, on: IntersectionMap) -> None:
        self.on = on
        crosswalks = [geos.Polygon(each.polygon) for each in on.crosswalks]
        self._crosswalks = [(each.id, np.array(each.polygon)) for each in on.crosswalks]
        self._road = _union(on.road)
        self._walkable = geos.union_all([_union(on.walkable), *crosswalks])
        for area in (self._road, self._walkable):
            geos.prepare(area)

    def trimmed(self, path: Path) -> Path:
        """The path without the ends that lie beyond the edge of the map."""
        away = np.abs(path.xy)
        if away.max() <= self.on.extent:
            return path
        inside = np.nonzero(away.max(axis=1) <= self.on.extent)[0]
        if len(inside) < _SHORTEST or len(inside) == len(path.s):
            return path
        keep = slice(inside[0], inside[-1] + 1)
        s = path.s[keep] - path.s[inside[0]]
        return Path(path.xy[keep], s, path.heading[keep], path.curvature[keep])

    def road_share(self, xy: FloatArray) -> float:
        """Share of points [N, 2] on the road."""
        return float(geos.contains_xy(self._road, xy).mean())

    def walkable_share(self, xy: FloatArray) -> float:
        """Share of points [N, 2] on walkable area or a crosswalk."""
        return float(geos.contains_xy(self._walkable, xy).mean())

    def on_crosswalks(self, xy: FloatArray) -> dict[str, NDArray[np.bool_]]:
        """[N] per crosswalk that any of the points [N, 2] lies on: which do."""
        each = ((name, _inside(corners, xy)) for name, corners in self._crosswalks)
        return {name: inside for name, inside in each if inside.any()}


@compiled
def _inside(corners: FloatArray, xy: FloatArray) -> NDArray[np.bool_]:
    """[N] which points lie in a polygon [M, 2]: a ray from them crosses its sides an odd time."""
    inside = np.zeros(len(xy), np.bool_)
    for k in range(len(corners)):
        ax, ay = corners[k - 1, 0], corners[k - 1, 1]
        bx, by = corners[k, 0], corners[k, 1]
        for n in range(len(xy)):
            between = (ay > xy[n, 1]) != (by > xy[n, 1])
            if between and xy[n, 0] < ax + (xy[n, 1] - ay) * (bx - ax) / (by - ay):
                inside[n] = not inside[n]
    return inside


def _union(areas: tuple[PolygonWithHoles, ...]) -> Any:
    return geos.union_all([geos.Polygon(area.exterior, area.holes) for area in areas])
