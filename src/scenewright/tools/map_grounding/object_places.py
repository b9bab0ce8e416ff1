"""Where on a map a standing object may be: at a kerb, in a lane, on a sidewalk, off crosswalks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal

import numpy as np

from scenewright.geometry.map_areas import merge_areas
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Lanelet
from scenewright.scene.objects import ObjectRecord, get_size, get_subtype, is_high
from scenewright.scene.social import STANDING_VEHICLES, ObjectNode

geos: Any = import_module("shapely")

Side = Literal["entry", "exit"]
_GAP = 0.1
"""Between the wheels and the kerb, or the lane beside [m]."""
_OFF_CROSSWALK = 0.3
_KERB_GAPS = (_GAP, 0.3, 0.5)
"""Of vehicles at the kerb, as far as their lane is wide enough [m]."""
_STEP, _FARTHEST, _BEYOND = 0.25, 30.0, 3.0
"""Places lie this far apart along the kerb [m], up to so far from the junction; and the kerb is
followed so far beyond the end of its lane, as far as it is straight."""
_WIDEST_VERGE = 4.0
_TIGHT = 0.4
"""A parked vehicle may stand out of its parking lane by so much [m]."""
_ON_ITS_GROUND = 0.97
"""Least share of a footprint on road or sidewalk."""


@dataclass(frozen=True, eq=False)
class _Roadside:
    """One side of a leg: its outermost driving lane, from the junction outwards.

    Attributes:
        edge: [N, 2] points along the outer edge of that lane, `_STEP` apart [m].
        ahead: [N] direction of travel [rad]; outward: [N, 2] unit vectors towards the kerb.
        room: from the edge to the kerb [m].
        lanes: offsets of the middles of the driving lanes from the edge [m], negative.
    """

    edge: FloatArray
    ahead: FloatArray
    outward: FloatArray
    room: float
    lanes: tuple[float, ...]


def find_places(
    node: ObjectNode, intersection_map: IntersectionMap, *, leg: Compass, side: Side
) -> tuple[ObjectRecord, ...]:
    """The places on one side of a leg where an object may stand, nearest to the junction first.

    They are clear of crosswalks, and on the ground where such an object belongs: vehicles at the
    kerb, or half on the sidewalk where a road has no room beside its lanes; double-parked ones at
    the edge of a lane, stalled ones in the middle of one; bins and boxes on the sidewalk.
    """
    roadside = _find_roadside(intersection_map, leg, side)
    if roadside is None:
        return ()
    length, width = get_size(node)
    places: list[ObjectRecord] = []
    inner = node.lane == ("right" if intersection_map.left_hand_traffic else "left")
    if inner and node.kind == "double_parked" and len(roadside.lanes) > 1:
        return ()
    for offset in _list_offsets(node, roadside, width, inner=inner):
        middle = roadside.edge + offset * roadside.outward
        boxes = _make_boxes(middle, roadside.ahead, length, width)
        fits = _check_ground(boxes, node, intersection_map, in_lane=offset < 0)
        if offset < 0:  # not beyond the stop line, where no vehicle waits
            fits &= _STEP * np.arange(len(middle)) >= _BEYOND + length / 2
        for (x, y), heading in zip(middle[fits], roadside.ahead[fits], strict=True):
            places.append(
                ObjectRecord(
                    id=node.id, kind=node.kind, subtype=get_subtype(node),
                    height="high" if is_high(node) else "low", length=length, width=width,
                    x=round(float(x), 3), y=round(float(y), 3), heading=round(float(heading), 4),
                    lane=node.lane,
                )
            )  # fmt: skip
    return tuple(places)


def _list_offsets(
    node: ObjectNode, roadside: _Roadside, width: float, *, inner: bool
) -> Iterator[float]:
    """Distances of the middle of an object from the outer edge of the driving lanes [m].

    Args:
        inner: of the lanes, it is to stand in that which is farthest from the kerb.
    """
    match node.kind:
        case "double_parked":
            yield -_GAP - width / 2
        case "stalled" if node.lane is not None:
            yield min(roadside.lanes) if inner else max(roadside.lanes)
        case "stalled":
            yield from roadside.lanes
        case "box" | "bin":
            yield roadside.room + 0.4 + width / 2
        case _ if roadside.room >= width - _TIGHT:
            inside = (gap for gap in _KERB_GAPS if gap == _GAP or roadside.room >= gap + width)
            yield from (roadside.room - gap - width / 2 for gap in inside)
        case _:
            yield 2 * _GAP + width / 2


def make_footprint(record: ObjectRecord) -> Any:
    """The footprint of an object as a polygon."""
    middle = np.array([[record.x, record.y]])
    return _make_boxes(middle, np.array([record.heading]), record.length, record.width)[0]


def _make_boxes(middle: FloatArray, heading: FloatArray, length: float, width: float) -> Any:
    """[N] rectangles around points [N, 2]."""
    along = np.stack((np.cos(heading), np.sin(heading)), axis=1) * (length / 2)
    across = np.stack((-np.sin(heading), np.cos(heading)), axis=1) * (width / 2)
    corners = (along + across, across - along, -along - across, along - across)
    return geos.polygons(np.stack([middle + corner for corner in corners], axis=1))


def _check_ground(
    boxes: Any, node: ObjectNode, intersection_map: IntersectionMap, *, in_lane: bool
) -> Any:
    """[N] whether rectangles are clear of crosswalks and lie where such an object belongs."""
    road, walkable = merge_areas(intersection_map.road), merge_areas(intersection_map.walkable)
    crosswalks = geos.union_all([geos.Polygon(c.polygon) for c in intersection_map.crosswalks])
    ground = geos.union(road, walkable) if node.kind in STANDING_VEHICLES or in_lane else walkable
    if node.kind == "container":
        ground = geos.union(road, walkable)
    share = geos.area(geos.intersection(boxes, ground)) / geos.area(boxes)
    edge = intersection_map.extent
    inside = geos.covers(geos.box(-edge, -edge, edge, edge), boxes)
    return (share >= _ON_ITS_GROUND) & inside & (geos.distance(boxes, crosswalks) > _OFF_CROSSWALK)


def _find_roadside(intersection_map: IntersectionMap, leg: Compass, side: Side) -> _Roadside | None:
    """The side of a leg by which vehicles come, or leave; None where none do."""
    kind = "approach" if side == "entry" else "exit"
    lanes = [
        lanelet
        for lanelet in intersection_map.lanelets
        if (lanelet.kind, lanelet.leg) == (kind, leg)
    ]
    if not lanes:
        return None
    left_hand = intersection_map.left_hand_traffic
    bounds = [(lane.right, lane.left)[:: -1 if left_hand else 1] for lane in lanes]
    offsets = np.array(
        [[_measure_offset(np.array(b), lanes[0], left_hand) for b in pair] for pair in bounds]
    )
    outermost = int(np.argmax(offsets[:, 0]))
    outer = np.array(bounds[outermost][0])
    points, ahead = _walk_outwards(outer, reverse=kind == "approach")
    turn = np.pi / 2 if left_hand else -np.pi / 2
    outward = np.stack((np.cos(ahead + turn), np.sin(ahead + turn)), axis=1)
    middles = offsets.mean(axis=1) - offsets[outermost, 0]
    room = _measure_room(points, outward, intersection_map)
    return _Roadside(points, ahead, outward, room, tuple(middles.tolist()))


def _measure_offset(line: FloatArray, lane: Lanelet, left_hand: bool) -> float:
    """How far a line lies on the kerb's side of a lane's centreline, near its middle [m]."""
    centre = np.array(lane.centreline)
    ahead = centre[-1] - centre[0]
    ahead = ahead / np.hypot(*ahead)
    kerbward = np.array([-ahead[1], ahead[0]]) if left_hand else np.array([ahead[1], -ahead[0]])
    middle = geos.LineString(line).interpolate(0.5, normalized=True)
    return float((np.array([middle.x, middle.y]) - centre.mean(axis=0)) @ kerbward)


def _walk_outwards(line: FloatArray, *, reverse: bool) -> tuple[FloatArray, FloatArray]:
    """Points [N, 2] along a line from the junction outwards, and the direction of travel [N]."""
    points = line[::-1] if reverse else line
    start = points[0] - points[1]
    points = np.vstack([points[0] + _BEYOND * start / np.hypot(*start), points])
    curve = geos.LineString(points)
    s = np.arange(0.0, min(curve.length, _FARTHEST + _BEYOND), _STEP)
    xy = np.array([geos.get_coordinates(curve.interpolate(each))[0] for each in s])
    steps = np.gradient(xy, axis=0)
    outwards = np.arctan2(steps[:, 1], steps[:, 0])
    return xy, outwards + np.pi if reverse else outwards


def _measure_room(
    edge: FloatArray, outward: FloatArray, intersection_map: IntersectionMap
) -> float:
    """Width of the road beside the driving lanes [m], up to the kerb: parking lane and shoulder."""
    road = merge_areas(intersection_map.road)
    reach = np.arange(0.05, _WIDEST_VERGE, 0.05)
    middle = edge[len(edge) // 3 :: 8], outward[len(edge) // 3 :: 8]
    rooms = []
    for point, way in zip(*middle, strict=True):
        inside = geos.contains_xy(road, point + reach[:, None] * way)
        rooms.append(float(reach[np.argmin(inside)]) if not inside.all() else _WIDEST_VERGE)
    return float(np.median(rooms)) if rooms and np.median(rooms) > 0.1 else 0.0
