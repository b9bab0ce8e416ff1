"""Point in polygon for whole scenes: most points are decided by a raster of 1 m cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenewright.scene.base import AgentClass, Compass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Crosswalk, PolygonWithHoles
from scenewright.tools.relation_checker.footprints import BoolArray
from scenewright.tools.relation_checker.planar import Area, geos

CELL = 1.0
LANE_SPACING = 1.0
"""Distance of the points along the middle of a lane [m]."""
KERB = 0.1
"""Walkable areas and crosswalks are widened by this [m], to close the seams between them."""

Bounds = tuple[float, float, float, float]
LanePoints = tuple[FloatArray, FloatArray, tuple[str, ...]]
"""Middles of a map's lanes on legs: points [P, 2] [m], headings [P] [rad] and legs [P]."""


@dataclass(frozen=True, eq=False)
class RasterizedArea:
    """An area that answers for many points at once.

    Attributes:
        area: the exact geometry; origin: south-west corner of the raster [m].
        cells: [rows, columns] 0 outside, 1 inside, 2 cut by the boundary.
    """

    area: Area
    origin: FloatArray
    cells: np.ndarray[tuple[int, ...], np.dtype[np.int8]]

    def contains(self, xy: FloatArray) -> BoolArray:
        """Which points [n, 2] lie in the area, its edge included."""
        column, row = np.floor((xy - self.origin) / CELL).astype(np.intp).T
        inside = (column >= 0) & (column < self.cells.shape[1])
        inside &= (row >= 0) & (row < self.cells.shape[0])
        state = np.zeros(len(xy), dtype=np.int8)
        state[inside] = self.cells[row[inside], column[inside]]
        cut = np.flatnonzero(state == 2)
        result = state == 1
        result[cut] = geos.intersects_xy(self.area, xy[cut, 0], xy[cut, 1])
        return np.asarray(result)


@dataclass(frozen=True, eq=False)
class CrosswalkArea:
    """A crosswalk with its polygon.

    Attributes:
        bounds: its west, south, east and north end [m]; across: [2] unit vector over the street.
    """

    crosswalk: Crosswalk
    area: Area
    bounds: Bounds
    across: FloatArray


@dataclass(frozen=True, eq=False)
class GroundRaster:
    """Where vehicles and pedestrians belong: road, walkable (with crosswalks), and both.

    Attributes:
        crosswalks: each on its own, in the order of the map.
        routes: class, entry, exit, movement and crosswalk by id of the route.
        goals: class, leg and bounds (west, south, east, north [m]) of every goal region.
        lanes: the middles of the lanes on legs, by their kind, approach or exit.
    """

    road: RasterizedArea
    walkable: RasterizedArea
    anywhere: RasterizedArea
    crosswalks: tuple[CrosswalkArea, ...]
    routes: Mapping[str, tuple[str | None, ...]]
    goals: tuple[tuple[AgentClass, Compass, Bounds], ...]
    lanes: Mapping[str, LanePoints]


def rasterize_area(area: Area) -> RasterizedArea:
    """Prepares an area for many questions."""
    geos.prepare(area)
    if area.is_empty:
        return RasterizedArea(area, np.zeros(2), np.zeros((0, 0), dtype=np.int8))
    west, south, east, north = (float(v) for v in area.bounds)
    # An edge on a whole metre is in the next cell.
    x = np.arange(np.floor(west), np.floor(east) + CELL, CELL)
    y = np.arange(np.floor(south), np.floor(north) + CELL, CELL)
    boxes = geos.box(x, y[:, None], x + CELL, y[:, None] + CELL)
    cells = np.where(geos.intersects(area, boxes), 2, 0).astype(np.int8)
    cells[geos.contains_properly(area, boxes)] = 1
    # GEOS builds the index of points at the first question, which threads may not share.
    geos.intersects_xy(area, (west + east) / 2, (south + north) / 2)
    return RasterizedArea(area, np.array((x[0], y[0])), cells)


_prepared: list[tuple[IntersectionMap, GroundRaster]] = []


def get_ground_raster(intersection_map: IntersectionMap) -> GroundRaster:
    """The prepared areas of a map; the last four maps are remembered by identity."""
    for known, ground in _prepared:
        if known is intersection_map:
            return ground
    road = geos.union_all([_build_polygon(p) for p in intersection_map.road])
    walks = tuple(_build_crosswalk(crosswalk) for crosswalk in intersection_map.crosswalks)
    footways = [_build_polygon(p) for p in intersection_map.walkable]
    walkable = geos.union_all([*footways, *(walk.area for walk in walks)])
    walkable = walkable.buffer(KERB, quad_segs=2)
    routes = {
        r.id: (r.type, r.entry, r.exit, r.movement, r.crosswalk) for r in intersection_map.routes
    }
    for leg in {lane.leg for lane in intersection_map.lanelets if lane.kind == "exit"}:
        if leg is not None:  # a U-turn is of the leg that it comes from and goes back to
            routes.setdefault(f"vehicle:{leg}>{leg}:uturn", ("vehicle", leg, leg, "uturn", None))
    goals = tuple(
        (g.type, g.leg, geos.Polygon(g.polygon).bounds) for g in intersection_map.goal_regions
    )
    anywhere = rasterize_area(road.union(walkable))
    lanes = {kind: _list_lane_points(intersection_map, kind) for kind in ("approach", "exit")}
    ground = GroundRaster(
        rasterize_area(road), rasterize_area(walkable), anywhere, walks, routes, goals, lanes
    )
    _prepared[:] = [(intersection_map, ground), *_prepared[:3]]
    return ground


def _build_crosswalk(crosswalk: Crosswalk) -> CrosswalkArea:
    # Not prepared: threads share it, and what GEOS prepares for lines and polygons is not for that.
    area = geos.Polygon(crosswalk.polygon)
    way = np.subtract(*np.array(crosswalk.centreline)[::-1])
    return CrosswalkArea(crosswalk, area, area.bounds, way / max(float(np.hypot(*way)), 1e-9))


def _build_polygon(area: PolygonWithHoles) -> Area:
    return geos.Polygon(area.exterior, area.holes)


def _list_lane_points(intersection_map: IntersectionMap, kind: str) -> LanePoints:
    parts, legs = [np.zeros((0, 3))], list[str]()
    for lane in intersection_map.lanelets:
        if lane.kind == kind and lane.leg is not None:
            line = np.array(lane.centreline)
            step = np.diff(line, axis=0)
            s = np.concatenate([[0.0], np.cumsum(np.hypot(*step.T))])
            at = np.linspace(0.0, s[-1], max(2, round(float(s[-1]) / LANE_SPACING) + 1))
            piece = np.clip(np.searchsorted(s, at, side="right") - 1, 0, len(step) - 1)
            course = np.arctan2(step[:, 1], step[:, 0])[piece]
            x, y = (np.interp(at, s, line[:, axis]) for axis in (0, 1))
            parts.append(np.stack([x, y, course], axis=1))
            legs += [lane.leg] * len(at)
    points = np.concatenate(parts)
    return points[:, :2], points[:, 2], tuple(legs)
