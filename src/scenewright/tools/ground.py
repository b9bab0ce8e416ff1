"""The map's areas as prepared polygons: road, walkable area, crosswalks."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
        crosswalks = {each.id: geos.Polygon(each.polygon) for each in on.crosswalks}
        self._crosswalks = list(crosswalks.items())
        bounds = np.array([area.bounds for area in crosswalks.values()]).reshape(-1, 4)
        self._west, self._south, self._east, self._north = bounds.T[..., None]
        self._road = _union(on.road)
        self._walkable = geos.union_all([_union(on.walkable), *crosswalks.values()])
        for area in (self._road, self._walkable, *crosswalks.values()):
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
        x, y = xy[:, 0], xy[:, 1]
        near = (x >= self._west) & (x <= self._east) & (y >= self._south) & (y <= self._north)
        found = {}
        for k in near.any(axis=1).nonzero()[0].tolist():
            name, area = self._crosswalks[k]
            inside = near[k]
            inside[inside] = geos.contains_xy(area, xy[inside])
            if inside.any():
                found[name] = inside
        return found


def _union(areas: tuple[PolygonWithHoles, ...]) -> Any:
    return geos.union_all([geos.Polygon(area.exterior, area.holes) for area in areas])
