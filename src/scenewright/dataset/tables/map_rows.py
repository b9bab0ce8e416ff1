"""An intersection as rows of the table `map`: one row per lane, stop line, crosswalk and area."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from scenewright.scene.base import Point
from scenewright.scene.map import IntersectionMap, PolygonWithHoles


def list_map_rows(intersection: IntersectionMap) -> list[dict[str, Any]]:
    """The rows of one intersection, in the order of its map file."""
    roads: dict[str | None, str] = {leg.name: leg.road for leg in intersection.legs}
    rows = [*_list_lanes(intersection), *_list_crossings(intersection)]
    rows += _list_areas("road", intersection.road)
    rows += _list_areas("walkable", intersection.walkable)
    return [
        {"intersection": intersection.name, **row, "road": roads.get(row.get("leg"))}
        for row in rows
    ]


def _list_lanes(intersection: IntersectionMap) -> Iterator[dict[str, Any]]:
    for lane in intersection.lanelets:
        yield {
            "feature": lane.id,
            "kind": lane.kind,
            "leg": lane.leg,
            "width": lane.width,
            "speed_limit": lane.speed_limit,
            "successors": list(lane.successors),
            **_split_points(lane.centreline),
        }


def _list_crossings(intersection: IntersectionMap) -> Iterator[dict[str, Any]]:
    for line in intersection.stop_lines:
        yield {
            "feature": line.id,
            "kind": "stop_line",
            "leg": line.leg,
            **_split_points(line.line),
        }
    for crosswalk in intersection.crosswalks:
        yield {
            "feature": crosswalk.id,
            "kind": "crosswalk",
            "leg": crosswalk.leg,
            "width": crosswalk.width,
            **_split_points(crosswalk.centreline),
        }


def _list_areas(kind: str, areas: Sequence[PolygonWithHoles]) -> Iterator[dict[str, Any]]:
    """The rim of each area; holes are rows of their own, with the area's id and a number."""
    for number, area in enumerate(areas, start=1):
        name = f"{kind}-{number}"
        yield {"feature": name, "kind": kind, **_split_points(area.exterior)}
        for hole, rim in enumerate(area.holes, start=1):
            yield {"feature": f"{name}:hole-{hole}", "kind": f"{kind}_hole", **_split_points(rim)}


def _split_points(points: Sequence[Point]) -> dict[str, list[float]]:
    return {"x": [point[0] for point in points], "y": [point[1] for point in points]}
