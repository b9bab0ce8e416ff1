"""An intersection as rows of the table `map`: one row per lane, stop line, crosswalk and area."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from scenewright.scene.base import Point
from scenewright.scene.map import IntersectionMap, PolygonWithHoles


def list_map_rows(intersection: IntersectionMap) -> list[dict[str, Any]]:
    """The rows of one intersection, in the order of its map file."""
    roads: dict[str | None, str] = {leg.name: leg.road for leg in intersection.legs}
    rows = [*_list_lines(intersection)]
    rows += _list_areas("road", intersection.road)
    rows += _list_areas("walkable", intersection.walkable)
    return [
        {"intersection": intersection.name, **row, "road": roads.get(row.get("leg"))}
        for row in rows
    ]


def _list_lines(intersection: IntersectionMap) -> Iterator[dict[str, Any]]:
    for lane in intersection.lanelets:
        yield {
            "feature": lane.id, "kind": lane.kind, "leg": lane.leg, "width": lane.width,
            "speed_limit": lane.speed_limit, "successors": list(lane.successors),
            **_split_points(lane.centreline),
        }  # fmt: skip
    for line in intersection.stop_lines:
        points = _split_points(line.line)
        yield {"feature": line.id, "kind": "stop_line", "leg": line.leg, **points}
    for walk in intersection.crosswalks:
        points = _split_points(walk.centreline)
        yield {"feature": walk.id, "kind": "crosswalk", "leg": walk.leg, "width": walk.width,
               **points}  # fmt: skip


def _list_areas(kind: str, areas: Sequence[PolygonWithHoles]) -> Iterator[dict[str, Any]]:
    """The rim of each area; holes are rows of their own, with the area's id and a number."""
    for number, area in enumerate(areas, start=1):
        name = f"{kind}-{number}"
        yield {"feature": name, "kind": kind, **_split_points(area.exterior)}
        for hole, rim in enumerate(area.holes, start=1):
            yield {"feature": f"{name}:hole-{hole}", "kind": f"{kind}_hole", **_split_points(rim)}


def _split_points(points: Sequence[Point]) -> dict[str, list[float]]:
    return {"x": [point[0] for point in points], "y": [point[1] for point in points]}
