"""Road markings and positions of lights, as plain curves and points."""

from __future__ import annotations

from math import ceil

import numpy as np

from scenewright.scene.base import FloatArray, Point
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Crosswalk


def find_painted_bounds(intersection: IntersectionMap) -> dict[str, list[FloatArray]]:
    """Painted lane bounds by kind: `median`, `divider` of one direction, or `edge`.

    Bounds on the kerb and those inside the junction carry no paint and are left out.
    """
    kerbs = [np.array(ring) for area in intersection.road for ring in (area.exterior, *area.holes)]
    closed = [np.vstack([ring, ring[:1]]) for ring in kerbs]
    bounds = [
        (lane, np.array(bound, dtype=float))
        for lane in intersection.lanelets
        if lane.kind in ("approach", "exit")
        for bound in (lane.left, lane.right)
    ]
    painted_bounds: dict[str, list[FloatArray]] = {"median": [], "divider": [], "edge": []}
    for lane, line in bounds:
        middle = find_midpoint(line)
        others = [
            other.kind for other, its in bounds
            if other.leg == lane.leg and other is not lane and _measure_distance(middle, its) < 0.4
        ]  # fmt: skip
        if others:
            painted_bounds["divider" if lane.kind in others else "median"].append(line)
        elif all(_measure_distance(middle, ring) >= 0.6 for ring in closed):
            painted_bounds["edge"].append(line)
    return {kind: _drop_repeats(lines) for kind, lines in painted_bounds.items()}


def find_midpoint(line: FloatArray) -> FloatArray:
    """[2] the point half way along a polyline [m]."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return np.array([np.interp(s[-1] / 2, s, line[:, i]) for i in (0, 1)])


def _measure_distance(point: FloatArray, line: FloatArray) -> float:
    """Distance of a point from a polyline [m]."""
    start, along = line[:-1], np.diff(line, axis=0)
    share = np.sum((point - start) * along, axis=1) / np.maximum(np.sum(along**2, axis=1), 1e-12)
    foot = start + np.clip(share, 0, 1)[:, None] * along
    return float(np.min(np.linalg.norm(point - foot, axis=1)))


def _drop_repeats(lines: list[FloatArray]) -> list[FloatArray]:
    kept: list[FloatArray] = []
    for line in sorted(lines, key=lambda item: -len(item)):
        if all(_measure_distance(find_midpoint(line), other) > 0.4 for other in kept):
            kept.append(line)
    return kept


def split_into_dashes(line: FloatArray, *, length: float = 2.0) -> list[FloatArray]:
    """A polyline as dashes with gaps as long as they are, [2, 2] each [m]."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    begins = np.arange(0.0, max(s[-1] - length / 2, 0.0), 2 * length)
    return [
        np.array([[np.interp(at, s, line[:, i]) for i in (0, 1)] for at in (b, b + length)])
        for b in begins
    ]


def build_crosswalk_bars(crosswalk: Crosswalk, *, bar: float = 0.5, gap: float = 0.7) -> FloatArray:
    """[N, 4, 2] corners of the painted bars, across the walking direction [m]."""
    start, end = np.array(crosswalk.centreline, dtype=float)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / max(length, 1e-9)
    across = np.array([-along[1], along[0]]) * crosswalk.width / 2
    count = max(1, ceil((length - bar) / (bar + gap)))
    begin = start + along * (length - count * bar - (count - 1) * gap) / 2
    first = begin + np.arange(count)[:, None] * along * (bar + gap)
    last = first + along * bar
    return np.stack([first - across, last - across, last + across, first + across], axis=1)


def find_light_positions(intersection: IntersectionMap) -> dict[str, list[Point]]:
    """Where the light of a stop line or crosswalk is drawn: beside the kerb, at both ends [m]."""
    places: dict[str, list[Point]] = {}
    for line in intersection.stop_lines:
        first, last = np.array(line.line, dtype=float)
        outer = max((first, last), key=lambda p: _measure_offset(p, intersection, line.leg))
        inner = first if outer is last else last
        away = (outer - inner) / max(float(np.linalg.norm(outer - inner)), 1e-9)
        places[line.id] = [_to_point(outer + 0.9 * away)]
    for walk in intersection.crosswalks:
        start, end = np.array(walk.centreline, dtype=float)
        along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
        places[walk.id] = [_to_point(start - 0.9 * along), _to_point(end + 0.9 * along)]
    return places


def _measure_offset(point: FloatArray, intersection: IntersectionMap, leg: str) -> float:
    """Distance from the middle line of a leg [m]."""
    bearing = next((item.bearing for item in intersection.legs if item.name == leg), 0.0)
    return float(abs(-np.sin(bearing) * point[0] + np.cos(bearing) * point[1]))


def _to_point(array: FloatArray) -> Point:
    return float(array[0]), float(array[1])
