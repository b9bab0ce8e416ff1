"""The road network of an intersection as OpenDRIVE 1.7: what an OpenSCENARIO scene drives on.

Every lanelet is a road of one lane, driven along the road: any map can be written so, whatever the
shape of its legs. In right-hand traffic the road's reference line is the lanelet's left edge and
its lane −1; in left-hand traffic it is the right edge and lane 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from xml.etree import ElementTree

import numpy as np

from scenewright.geometry.polyline import (
    drop_doubled_points,
    measure_arc_lengths,
    resample_to_count,
)
from scenewright.scene.base import FloatArray, Point
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Crosswalk, Lanelet
from scenewright.tools.formats.lanes import Side, list_predecessors, number_lanes
from scenewright.tools.formats.xml import add, write_bytes

JUNCTION = 1000
"""Number of the junction."""
VEHICLE_LIGHT, PEDESTRIAN_LIGHT = "1000001", "1000002"
"""Types of signals in the catalogue of OpenDRIVE."""
_STATIONS = 24
"""Points at which the curve of a bent lanelet and its width are given."""
_NODES = 8
"""At which the speed of a cubic is taken for its length."""
_SAME_SLOPE = 1e-6
"""Changes of a width's slope up to here are rounding."""


@dataclass(frozen=True, eq=False)
class Road:
    """A lanelet as a road.

    Attributes:
        line: [P, 2] reference line; width: [P] of the lane at its points [m]; lane: its number.
        tangents: [P, 2] unit direction at each point.
    """

    number: int
    lanelet: Lanelet
    line: FloatArray
    width: FloatArray
    lane: int
    tangents: FloatArray

    @cached_property
    def cubics(self) -> FloatArray:
        """[P - 1, 2, 3] of each piece the coefficients b, c, d along and across its beginning."""
        ahead, chords = self.tangents[:-1], np.diff(self.line, axis=0)
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        turn = np.stack([ahead, left], axis=1)
        lengths = np.hypot(*chords.T)[:, None]
        chord = np.einsum("nij,nj->ni", turn, chords)
        end = np.einsum("nij,nj->ni", turn, self.tangents[1:]) * lengths
        slope = lengths * [1.0, 0.0]
        return np.stack([slope, 3 * chord - 2 * slope - end, slope + end - 2 * chord], axis=2)

    @cached_property
    def s(self) -> FloatArray:
        """[P] length of the curve up to the points of the reference line [m]."""
        at, weights = np.polynomial.legendre.leggauss(_NODES)
        p = (at + 1.0) / 2
        speeds = np.hypot(*np.moveaxis(self.cubics @ [p**0, 2 * p, 3 * p**2], 1, 0))
        return np.concatenate([[0.0], (speeds @ weights / 2).cumsum()])

    def locate(self, point: Point) -> tuple[float, float, float]:
        """Where a point lies: s, t and the road's heading there."""
        offsets = np.array(point) - self.line
        k = int(np.argmin(np.hypot(*offsets.T)))
        ahead, left = self.tangents[k], np.array([-self.tangents[k][1], self.tangents[k][0]])
        s = float(np.clip(self.s[k] + offsets[k] @ ahead, 0.0, self.s[-1]))
        return s, float(offsets[k] @ left), float(np.arctan2(ahead[1], ahead[0]))


def write_opendrive(intersection_map: IntersectionMap) -> bytes:
    """The .xodr of a map: roads, lanes, the junction, crosswalks and signals."""
    roads = make_roads(intersection_map)
    root = ElementTree.Element("OpenDRIVE")
    edge = intersection_map.extent
    add(root, "header", revMajor=1, revMinor=7, name=intersection_map.name, version=1,
        north=edge, south=-edge, east=edge, west=-edge, vendor="scenewright")  # fmt: skip
    elements = {name: _add_road(root, road, roads) for name, road in roads.items()}
    for name, road in roads.items():
        _add_objects(elements[name], road, intersection_map)
    if intersection_map.signals is not None:
        ids = number_signals(intersection_map)
        for number, group in enumerate(intersection_map.signals.groups, start=2000):
            # The lights that always show the same.
            controller = add(root, "controller", id=number, name=group.id, sequence=0)
            own = [
                movement
                for movement in intersection_map.movements
                if movement.id in group.movements
            ]
            for name in sorted({each.stop_line for each in own}) + sorted(group.crosswalks):
                add(controller, "control", signalId=ids[name])
    # Every way from an approach into the junction.
    junction = add(root, "junction", id=JUNCTION, name="junction", type="default")
    number = 0
    for road in roads.values():
        inside = [roads[name] for name in road.lanelet.successors if name in roads]
        for other in inside if road.lanelet.kind == "approach" else ():
            connection = add(junction, "connection", id=number, incomingRoad=road.number,
                             connectingRoad=other.number, contactPoint="start")  # fmt: skip
            add(connection, "laneLink", from_=road.lane, to=road.lane)
            number += 1
    return write_bytes(root)


def number_signals(intersection_map: IntersectionMap) -> dict[str, int]:
    """Number of the signal of every stop line and crosswalk, by its id in the map."""
    if intersection_map.signals is None:
        return {}
    names = [line.id for line in intersection_map.stop_lines]
    names += [crosswalk.id for crosswalk in intersection_map.crosswalks]
    return {name: number for number, name in enumerate(names, start=1)}


def make_roads(intersection_map: IntersectionMap) -> dict[str, Road]:
    """The roads of a map by the ids of their lanelets."""
    lanelets = [lanelet for lanelet in intersection_map.lanelets if lanelet.kind != "parking"]
    before, lane = list_predecessors(intersection_map), -1
    sides: tuple[Side, Side] = ("left", "right")
    if intersection_map.left_hand_traffic:
        sides, lane = ("right", "left"), 1
    numbers = number_lanes(intersection_map)
    roads: dict[str, Road] = {}
    for lanelet in sorted(lanelets, key=lambda one: one.kind == "connector"):
        count = 2 if len(lanelet.left) == len(lanelet.right) == 2 else _STATIONS
        line, other = (
            resample_to_count(drop_doubled_points(np.array(getattr(lanelet, side))), count)
            for side in sides
        )
        start = next((roads[name] for name in before[lanelet.id] if name in roads), None)
        end = next((roads[name] for name in lanelet.successors if name in roads), None)
        roads[lanelet.id] = _make_road(numbers[lanelet.id], lanelet, line, other, lane, start, end)
    return {lanelet.id: roads[lanelet.id] for lanelet in lanelets}


def _make_road(
    number: int,
    lanelet: Lanelet,
    line: FloatArray,
    other: FloatArray,
    lane: int,
    start: Road | None,
    end: Road | None,
) -> Road:
    """A road that begins where another one ends, and ends where a third begins, without a gap.

    Args:
        line, other: [P, 2] its edges [m].
    """
    width = np.hypot(*(other - line).T)
    arc = measure_arc_lengths(line)
    share = arc / arc[-1]
    if start is not None:
        line = line + np.outer(1.0 - share, start.line[-1] - line[0])
        width = width + (1.0 - share) * (start.width[-1] - width[0])
    if end is not None:
        line = line + np.outer(share, end.line[0] - line[-1])
        width = width + share * (end.width[0] - width[-1])
    slope = np.gradient(
        line, measure_arc_lengths(line), axis=0, edge_order=2 if len(line) > 2 else 1
    )
    tangents = slope / np.hypot(*slope.T)[:, None]
    if len(line) > 2:
        tangents[0] = tangents[0] if start is None else start.tangents[-1]
        tangents[-1] = tangents[-1] if end is None else end.tangents[0]
    return Road(number, lanelet, line, width, lane, tangents)


def _add_road(root: ElementTree.Element, road: Road, roads: dict[str, Road]) -> ElementTree.Element:
    inside = road.lanelet.kind == "connector"
    element = add(
        root, "road", name=road.lanelet.id, length=float(road.s[-1]), id=road.number,
        junction=JUNCTION if inside else -1, rule="LHT" if road.lane > 0 else "RHT",
    )  # fmt: skip
    link = add(element, "link")
    before = [each for each in roads.values() if road.lanelet.id in each.lanelet.successors]
    after = [roads[name] for name in road.lanelet.successors if name in roads]
    if inside:
        for tag, others, contact in (("predecessor", before, "end"), ("successor", after, "start")):
            if others:
                add(link, tag, elementType="road", elementId=others[0].number, contactPoint=contact)
    elif before or after:
        tag = "successor" if road.lanelet.kind == "approach" else "predecessor"
        add(link, tag, elementType="junction", elementId=JUNCTION)
    kind = add(element, "type", s=0.0, type="town")
    add(kind, "speed", max=float(road.lanelet.speed_limit), unit="m/s")
    _add_plan(element, road)
    _add_lane(element, road, before if inside else [], after if inside else [])
    return element


def _add_plan(element: ElementTree.Element, road: Road) -> None:
    """The reference line: one straight line, or a cubic curve between every two points."""
    plan = add(element, "planView")
    for k in range(len(road.line) - 1):
        (x, y), tangent = road.line[k].tolist(), road.tangents[k]
        length = float(road.s[k + 1] - road.s[k])
        heading = float(np.arctan2(tangent[1], tangent[0]))
        piece = add(plan, "geometry", s=float(road.s[k]), x=x, y=y, hdg=heading, length=length)
        if len(road.line) == 2:
            add(piece, "line")
            continue
        u, v = road.cubics[k].tolist()
        add(piece, "paramPoly3", aU=0.0, bU=u[0], cU=u[1], dU=u[2],
            aV=0.0, bV=v[0], cV=v[1], dV=v[2], pRange="normalized")  # fmt: skip


def _add_lane(
    element: ElementTree.Element, road: Road, before: list[Road], after: list[Road]
) -> None:
    number, left_hand = road.lane, road.lane > 0
    section = add(add(element, "lanes"), "laneSection", s=0.0)
    if left_hand:
        lane = add(add(section, "left"), "lane", id=number, type="driving", level=False)
    add(add(section, "center"), "lane", id=0, type="none", level=False)
    if not left_hand:
        lane = add(add(section, "right"), "lane", id=number, type="driving", level=False)
    link = add(lane, "link")
    for tag, others in (("predecessor", before), ("successor", after)):
        if others:
            add(link, tag, id=number)
    slopes = np.diff(road.width) / np.diff(road.s)
    for k in np.flatnonzero(np.abs(np.diff(slopes, prepend=np.inf)) > _SAME_SLOPE).tolist():
        add(lane, "width", sOffset=float(road.s[k]), a=float(road.width[k]), b=float(slopes[k]),
            c=0.0, d=0.0)  # fmt: skip


def _add_objects(
    element: ElementTree.Element, road: Road, intersection_map: IntersectionMap
) -> None:
    """Crosswalks and signals, each on the first approach lane that it belongs to."""
    if road.lanelet.kind != "approach":
        return
    lanes = [lanelet for lanelet in intersection_map.lanelets if lanelet.kind == "approach"]
    first = next(lane.id for lane in lanes if lane.leg == road.lanelet.leg) == road.lanelet.id
    crosswalks = [c for c in intersection_map.crosswalks if first and c.leg == road.lanelet.leg]
    objects = add(element, "objects")
    for number, crosswalk in enumerate(crosswalks, start=1):
        _add_crosswalk(objects, road, crosswalk, 100 * road.number + number)
    signals, ids = add(element, "signals"), number_signals(intersection_map)
    lines = [s for s in intersection_map.stop_lines if s.lanelets[0] == road.lanelet.id]
    # The light of a stop line beside it, of a crosswalk at its middle.
    marks = [(line.id, VEHICLE_LIGHT, line.line) for line in lines]
    marks += [(crosswalk.id, PEDESTRIAN_LIGHT, crosswalk.centreline) for crosswalk in crosswalks]
    for name, kind, line in marks if ids else ():
        s, t, _ = road.locate(_find_middle(line))
        add(
            signals, "signal", id=ids[name], name=name, s=s, t=t, zOffset=3.0,
            dynamic="yes", orientation="+", country="OpenDRIVE", type=kind, subtype=-1, value=-1.0,
            width=0.3, height=0.9, hOffset=0.0,
        )  # fmt: skip


def _find_middle(points: Sequence[Point]) -> Point:
    x, y = np.array(points).T
    return float(x.mean()), float(y.mean())


def _add_crosswalk(
    objects: ElementTree.Element, road: Road, crosswalk: Crosswalk, number: int
) -> None:
    corners = np.array(crosswalk.polygon)
    s, t, heading = road.locate(_find_middle(crosswalk.polygon))
    at = add(objects, "object", id=number, name=crosswalk.id, type="crosswalk", s=s, t=t,
             zOffset=0.0, hdg=0.0, orientation="none", validLength=0.0)  # fmt: skip
    outline = add(add(at, "outlines"), "outline", id=0, closed=True)
    # The point at s, t of the road.
    k = int(np.argmin(np.abs(road.s - s)))
    ahead = road.tangents[k]
    origin = road.line[k] + (s - road.s[k]) * ahead + t * np.array([-ahead[1], ahead[0]])
    turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    for k, (u, v) in enumerate(((corners - origin) @ turn.T).tolist()):
        add(outline, "cornerLocal", id=k, u=u, v=v, z=0.0, height=0.0)
