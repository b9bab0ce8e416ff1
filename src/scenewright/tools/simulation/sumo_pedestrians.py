"""Pedestrians in SUMO on any map: along a sidewalk, over a crosswalk, along a sidewalk.

SUMO is given the sidewalks on which a walk begins and ends and finds the crosswalk by itself: the
nearest one. Where walks begin and end follows from the map's routes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap, Route
from scenewright.tools.map_import.map_parts import RouteLines, geos
from scenewright.tools.simulation.sumo_run import Departure, draw_arrivals, format_pedestrian

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
    found = []
    for edge in ElementTree.parse(network).getroot().iter("edge"):
        if edge.get("function") is not None:
            continue
        lane = next((x for x in edge.iter("lane") if x.get("allow") == "pedestrian"), None)
        if lane is not None:
            points = [tuple(map(float, p.split(","))) for p in lane.attrib["shape"].split()]
            line = np.array(points)[:, :2]
            found.append(Sidewalk(edge.attrib["id"], line, float(lane.attrib["length"])))
    return found


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
