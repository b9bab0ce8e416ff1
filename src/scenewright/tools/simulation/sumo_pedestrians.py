"""People on foot in SUMO on any map: along a sidewalk, over a crosswalk, along a sidewalk.

SUMO is told the sidewalks on which a walk begins and ends and finds the crosswalk by itself: the
nearest one. Where somebody sets out and arrives is what the map's routes say.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap, Route
from scenewright.tools.simulation.sumo_run import Departure, arrivals, walker_lines

FARTHEST = 6.0
"""A route that begins or ends farther from any sidewalk [m] is not simulated."""


@dataclass(frozen=True, eq=False)
class Sidewalk:
    """A sidewalk as SUMO has it: its road, its middle [P, 2] and its length as SUMO counts [m]."""

    road: str
    line: FloatArray
    length: float


def sidewalks_of(network: Path) -> list[Sidewalk]:
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


def walkers(
    place: IntersectionMap,
    lines: Mapping[str, Sequence[FloatArray]],
    rates: Mapping[str, float],
    sidewalks: Sequence[Sidewalk],
    rng: np.random.Generator,
    *,
    seconds: float,
) -> Iterator[Departure]:
    """Everybody who sets out on foot on the map's crossing routes.

    Args:
        lines: by route id, the middles of its ways [m].
        rates: by route id, walks per hour.
    """
    for number, route in enumerate(place.routes):
        ends = _ends(route, lines, sidewalks)
        if ends is None:
            continue
        for count, time in enumerate(arrivals(rates[route.id], rng, seconds=seconds)):
            agent = f"p_{number}_{count}"
            text = walker_lines(agent, *ends, time=float(time), rng=rng)
            yield Departure(float(time), text, agent, route.id, None)


_End = tuple[str, float]
"""A road and a position along its sidewalk [m]."""


def _ends(
    route: Route, lines: Mapping[str, Sequence[FloatArray]], sidewalks: Sequence[Sidewalk]
) -> tuple[_End, _End] | None:
    if route.movement != "crossing" or not lines.get(route.id) or not sidewalks:
        return None
    line = np.asarray(lines[route.id][0])
    first, last = (_nearest(point, sidewalks) for point in (line[0], line[-1]))
    return None if first is None or last is None or first == last else (first, last)


def _nearest(point: FloatArray, sidewalks: Sequence[Sidewalk]) -> _End | None:
    best: tuple[float, _End] | None = None
    for walk in sidewalks:
        away, share = _foot(point, walk.line)
        at = float(np.clip(share * walk.length, 0.5, walk.length - 0.5))
        if away <= FARTHEST and (best is None or away < best[0]):
            best = (away, (walk.road, round(at, 1)))
    return None if best is None else best[1]


def _foot(point: FloatArray, line: FloatArray) -> tuple[float, float]:
    """How far a point is from a line [m], and at what share of its length it is nearest."""
    step = np.diff(line, axis=0)
    length = np.maximum(np.hypot(*step.T), 1e-9)
    along = np.clip(((point - line[:-1]) * step).sum(axis=1) / length, 0.0, length)
    feet = line[:-1] + step * (along / length)[:, None]
    away = np.hypot(*(feet - point).T)
    i = int(away.argmin())
    return float(away[i]), float((length[:i].sum() + along[i]) / length.sum())
