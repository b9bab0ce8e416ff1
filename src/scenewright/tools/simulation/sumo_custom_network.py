"""The SUMO network of any map: lanelets as lanes, connectors as connections, ways of pedestrians.

Lanes are numbered as SUMO wants them, from the kerb: 0 is the sidewalk, then come driving lanes,
outer first. These get our lanelets as their shapes, prolonged straight beyond the map so that
traffic has settled when it comes into view. Crosswalks are ours; what joins them to the sidewalks
is SUMO's, so that walked tracks are moved to our walkable area afterwards.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from scenewright.geometry.polyline import (
    compute_normals,
    find_point,
    interpolate_points,
    measure_arc_lengths,
    measure_distances,
)
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Crosswalk, Lanelet, Route
from scenewright.tools.map_import.map_parts import RouteLines, geos
from scenewright.tools.simulation.sumo_network import (
    convert_network,
    format_connection,
    format_shape,
    format_signal_program,
    format_tag,
    list_lane_triples,
    name_edge,
    write_signals,
)
from scenewright.tools.simulation.sumo_run import Departure, draw_arrivals, format_pedestrian

_BEYOND = 180.0
"""How far lanes go on beyond the edge of the map [m]."""
_SIDEWALK_WIDTH = 3.0
"""Width of a derived sidewalk [m]."""


def write_custom_network(folder: Path, intersection_map: IntersectionMap) -> Path:
    """Write the network of a map; the path of the `.net.xml`, `signals.add.xml` beside it.

    Raises:
        InputError: SUMO is not installed, or does not take the network.
    """
    lanes = {leg.name: _number_lanes(intersection_map, leg.name) for leg in intersection_map.legs}
    network = convert_network(
        folder,
        *(("--lefthand", "true") if intersection_map.left_hand_traffic else ()),
        nodes=_format_nodes(intersection_map),
        edges=_format_edges(lanes, intersection_map),
        connections=[
            *(
                format_connection(
                    before,
                    inside,
                    after,
                    lanes[before.leg or "north"]["in"].index(before) + 1,
                    lanes[after.leg or "north"]["out"].index(after) + 1,
                )
                for before, inside, after in list_lane_triples(intersection_map)
            ),
            *_format_crossings(intersection_map, lanes),
        ],
    )
    write_signals(
        folder,
        []
        if intersection_map.signals is None
        else format_signal_program(network, intersection_map),
    )
    return network


_Numbered = Mapping[str, tuple[Lanelet, ...]]
"""`in` and `out`: a leg's lanes, from the kerb."""


def _number_lanes(intersection_map: IntersectionMap, leg: Compass) -> _Numbered:
    found: dict[str, tuple[Lanelet, ...]] = {}
    for side, kind in (("in", "approach"), ("out", "exit")):
        own = [x for x in intersection_map.lanelets if x.kind == kind and x.leg == leg]
        found[side] = tuple(
            sorted(own, key=lambda x: _measure_from_kerb(x, intersection_map.left_hand_traffic))
        )
    return found


def _measure_from_kerb(lane: Lanelet, left_hand: bool) -> float:
    """Grows with the distance from the kerb on the right (on the left, in left-hand traffic)."""
    line = np.array(lane.centreline)
    near = line[-1] if lane.kind == "approach" else line[0]
    ahead = line[-1] - line[0]
    left = np.array([-ahead[1], ahead[0]]) / max(float(np.hypot(*ahead)), 1e-9)
    return float(near @ left) * (-1.0 if left_hand else 1.0)


def _format_nodes(intersection_map: IntersectionMap) -> list[str]:
    kind = "priority" if intersection_map.signals is None else "traffic_light"
    more = {} if intersection_map.signals is None else {"tl": "J"}
    middle = format_tag("node", id="J", x=0, y=0, type=kind, **more)
    far = intersection_map.extent + _BEYOND
    ends = [
        format_tag(
            "node",
            id=leg.name,
            x=round(far * float(np.cos(leg.bearing)), 2),
            y=round(far * float(np.sin(leg.bearing)), 2),
            type="priority",
        )
        for leg in intersection_map.legs
    ]
    return [middle, *ends]


def _format_edges(
    lanes: Mapping[Compass, _Numbered], intersection_map: IntersectionMap
) -> Iterator[str]:
    walks = {crosswalk.leg: crosswalk for crosswalk in intersection_map.crosswalks}
    for leg, sides in lanes.items():
        for side, own in sides.items():
            if not own:
                continue
            inwards = side == "in"
            # A sidewalk ends where the crosswalk of its leg begins: none walks on to come back.
            line = np.array(_prolong(own[0], inwards))
            kerbwards = compute_normals(line) * (
                1.0 if intersection_map.left_hand_traffic else -1.0
            )
            beside = line + (own[0].width + _SIDEWALK_WIDTH) / 2 * kerbwards
            if (walk := walks.get(leg)) is not None:
                outwards = slice(None, None, -1 if inwards else 1)  # from the junction
                beside = _cut_at_crosswalk(beside[outwards], walk)[outwards]
            sidewalk = format_tag(
                "lane", index=0, width=_SIDEWALK_WIDTH, allow="pedestrian", speed=2.8,
                shape=format_shape((float(x), float(y)) for x, y in beside),
            )  # fmt: skip
            rows = [sidewalk] + [
                format_tag(
                    "lane",
                    index=i,
                    width=x.width,
                    disallow="pedestrian",
                    shape=format_shape(_prolong(x, inwards)),
                )
                for i, x in enumerate(own, start=1)
            ]
            ends = (leg, "J") if inwards else ("J", leg)
            head = format_tag(
                "edge",
                id=name_edge(leg, inwards=inwards),
                from_=ends[0],
                to=ends[1],
                numLanes=len(own) + 1,
                speed=own[0].speed_limit,
                priority=1,
                shape=format_shape(_prolong(own[0], inwards)),
            )
            yield head.replace("/>", ">") + "".join(rows) + "</edge>"


def _cut_at_crosswalk(line: FloatArray, crosswalk: Crosswalk) -> FloatArray:
    """What of a sidewalk [P, 2], from the junction outwards, lies beyond its leg's crosswalk."""
    s = measure_arc_lengths(line)
    even = np.arange(0.0, s[-1], 0.5)
    fine = interpolate_points(even, s, line)
    away = measure_distances(fine, np.array(crosswalk.centreline)).min(axis=1)
    begin = even[int(away.argmin())] + crosswalk.width / 2 + 0.5
    kept = s > begin + 0.5
    if not kept.any():
        return line
    return np.concatenate([find_point(line, begin)[None], line[kept]])


def _format_crossings(
    intersection_map: IntersectionMap, lanes: Mapping[Compass, _Numbered]
) -> Iterator[str]:
    """Our crosswalks; SUMO wants their shapes clockwise round the junction."""
    for walk in intersection_map.crosswalks:
        roads = [
            name_edge(walk.leg, inwards=s == "in") for s in ("in", "out") if lanes[walk.leg][s]
        ]
        (ax, ay), (bx, by) = walk.centreline
        clockwise = ax * by - ay * bx < 0.0
        shape = walk.centreline if clockwise else walk.centreline[::-1]
        yield format_tag(
            "crossing",
            node="J",
            edges=" ".join(roads),
            priority="true",
            width=round(walk.width, 2),
            shape=format_shape(shape),
        )


def _prolong(lane: Lanelet, inwards: bool) -> list[tuple[float, float]]:
    line = np.array(lane.centreline)
    end, before = (line[0], line[1]) if inwards else (line[-1], line[-2])
    way: FloatArray = (end - before) / max(float(np.hypot(*(end - before))), 1e-9)
    far = end + _BEYOND * way
    points = np.concatenate([far[None], line] if inwards else [line, far[None]])
    return [(float(x), float(y)) for x, y in points]


_MAX_DISTANCE = 6.0
"""A route that begins or ends farther from any sidewalk [m] is not simulated."""


@dataclass(frozen=True, eq=False)
class Sidewalk:
    """A sidewalk as SUMO has it: its road, its middle [P, 2] and its length as SUMO counts [m]."""

    road: str
    line: FloatArray
    length: float


def read_sidewalks(network: Path) -> list[Sidewalk]:
    """The sidewalks beside the roads of a network."""
    sidewalks = []
    for edge in ElementTree.parse(network).getroot().iter("edge"):
        if edge.get("function") is not None:
            continue
        lane = next((x for x in edge.iter("lane") if x.get("allow") == "pedestrian"), None)
        if lane is not None:
            points = [tuple(map(float, p.split(","))) for p in lane.attrib["shape"].split()]
            line = np.array(points)[:, :2]
            sidewalks.append(Sidewalk(edge.attrib["id"], line, float(lane.attrib["length"])))
    return sidewalks


def draw_walks(
    intersection_map: IntersectionMap,
    route_lines: RouteLines,
    rates: Mapping[str, float],
    sidewalks: Sequence[Sidewalk],
    rng: np.random.Generator,
    *,
    seconds: float,
) -> Iterator[Departure]:
    """Departures of pedestrians on the map's crossing routes.

    Args:
        rates: by route id, walks per hour.
    """
    for number, route in enumerate(intersection_map.routes):
        ends = _find_ends(route, route_lines, sidewalks)
        if ends is None:
            continue
        for count, time in enumerate(draw_arrivals(rates[route.id], rng, seconds=seconds)):
            agent = f"p_{number}_{count}"
            xml = format_pedestrian(agent, *ends, time=float(time), rng=rng)
            yield Departure(float(time), xml, agent, route.id, None)


_End = tuple[str, float]
"""A road and a position along its sidewalk [m]."""


def _find_ends(
    route: Route, route_lines: RouteLines, sidewalks: Sequence[Sidewalk]
) -> tuple[_End, _End] | None:
    if route.movement != "crossing" or not route_lines.get(route.id) or not sidewalks:
        return None
    line = np.asarray(route_lines[route.id][0])
    first, last = (_find_nearest(point, sidewalks) for point in (line[0], line[-1]))
    return None if first is None or last is None or first == last else (first, last)


def _find_nearest(point: FloatArray, sidewalks: Sequence[Sidewalk]) -> _End | None:
    """The place on the nearest sidewalk; None where even that is too far."""
    place, lines = geos.Point(point), [geos.LineString(walk.line) for walk in sidewalks]
    k = min(range(len(lines)), key=lambda each: lines[each].distance(place))
    if lines[k].distance(place) > _MAX_DISTANCE:
        return None
    walk, share = sidewalks[k], lines[k].project(place, normalized=True)
    return walk.road, round(float(np.clip(share * walk.length, 0.5, walk.length - 0.5)), 1)
