"""Which route of the map a track follows, and how far beside its middle it runs.

Real tracks are partial: sensors see a part of the junction. A track is matched to the route whose
centreline it keeps to best, in distance and direction; where several fit equally well (before they
part) it belongs to none, and its entry may still be known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenewright.geometry.polyline import (
    compute_normals,
    compute_tangents,
    interpolate_points,
    measure_arc_lengths,
    measure_distances,
)
from scenewright.geometry.spline import PER_INTERVAL
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.tools.fitting.path_frame import Centreline, build_centreline
from scenewright.tools.map_import.map_parts import RouteLines

_MAX_DISTANCE = {"vehicle": 2.2, "pedestrian": 3.5}
"""Of a track from the centreline of its route, on average [m]."""
_ALIGNED = math.radians(35.0)
_CLEARLY = 0.5
"""By how much the second-best route must be worse [m], unless its line is the same so far."""
_SHORTEST = 8.0
_APART = 1.5
"""Lines closer than this over all of a track cannot be distinguished by it [m]."""


@dataclass(frozen=True, eq=False)
class Match:
    """A track on its route.

    Attributes:
        route: id; line: which of its centrelines.
        offsets: [K] how far to the left of the centreline at its ten waypoints [m]; NaN where the
            track was not observed.
        distance: mean distance from the centreline [m].
    """

    route: str
    line: int
    offsets: FloatArray
    distance: float


@dataclass(frozen=True, eq=False)
class Unmatched:
    """Why a track is on no route: `off` every route, or `open` between several; its entry."""

    reason: str
    entry: Compass | None


@dataclass(frozen=True, eq=False)
class _RouteLine:
    """One of the centrelines of a route.

    Attributes:
        number: among the route's centrelines.
    """

    route: Route
    number: int
    centreline: Centreline


class Matcher:
    """The routes of one map, prepared for matching."""

    def __init__(self, intersection_map: IntersectionMap, route_lines: RouteLines) -> None:
        self._lines = [
            _RouteLine(route, number, build_centreline(np.asarray(line)))
            for route in intersection_map.routes
            for number, line in enumerate(route_lines.get(route.id, ()))
        ]

    def compute_normals(self, match: Match) -> FloatArray:
        """[K, 2] unit vectors to the left of the matched line at its waypoints."""
        line = next(
            line.centreline
            for line in self._lines
            if (line.route.id, line.number) == (match.route, match.line)
        )
        return compute_normals(line.dense)[::PER_INTERVAL]

    def match(self, xy: FloatArray, kind: str) -> Match | Unmatched:
        """The route of a track [T, 2] of a class."""
        track = resample_track(xy)
        if len(track) < 4:
            return Unmatched("off", None)
        near = [
            (distance, line)
            for line in self._lines
            if line.route.type == kind
            and (distance := measure_mean_distance(track, line.centreline)) <= _MAX_DISTANCE[kind]
        ]
        if not near:
            return Unmatched("off", None)
        (least, best), *others = sorted(near, key=lambda pair: pair[0])
        rivals = [
            line
            for distance, line in others
            if line.route.id != best.route.id and distance < least + _CLEARLY
        ]
        if kind == "vehicle" and any(
            _run_together(track, best.centreline, rival.centreline) for rival in rivals
        ):
            entries = {line.route.entry for line in (best, *rivals)}
            return Unmatched("open", entries.pop() if len(entries) == 1 else None)
        offsets = measure_offsets(track, best.centreline)
        return Match(best.route.id, best.number, offsets, least)


def resample_track(xy: FloatArray) -> FloatArray:
    """The track every half metre of its path, standstills left out; empty if it is too short."""
    s = measure_arc_lengths(xy)
    if s[-1] < _SHORTEST:
        return np.zeros((0, 2))
    kept = np.concatenate([[True], np.hypot(*np.diff(xy, axis=0).T) > 1e-4])
    return interpolate_points(np.arange(0.0, s[-1], 0.5), s[kept], xy[kept])


def measure_mean_distance(track: FloatArray, line: Centreline) -> float:
    """Mean distance of a track from a line; infinite where it runs another way."""
    apart = measure_distances(track[::2], line.dense)
    nearest = apart.argmin(axis=1)
    # Beyond the line's ends the map says nothing.
    known = (nearest > 0) & (nearest < len(line.dense) - 1)
    if known.sum() < 4:
        return math.inf
    ahead = np.gradient(line.dense, axis=0)[nearest]
    step = np.gradient(track[::2], axis=0)
    cross = ahead[:, 0] * step[:, 1] - ahead[:, 1] * step[:, 0]
    turn = np.arctan2(cross, (ahead * step).sum(axis=1))
    if float(np.quantile(np.abs(turn[known]), 0.8)) > _ALIGNED:
        return math.inf
    return float(apart.min(axis=1)[known].mean())


def _run_together(track: FloatArray, a: Centreline, b: Centreline) -> bool:
    """Whether two lines run together wherever the track was observed."""
    nearest = [x.dense[measure_distances(track[::2], x.dense).argmin(axis=1)] for x in (a, b)]
    return float(np.hypot(*(nearest[0] - nearest[1]).T).max()) < _APART


def measure_offsets(track: FloatArray, line: Centreline) -> FloatArray:
    """[K] offset to the left at each waypoint of the line that the track passes [m]; else NaN."""
    ahead = compute_tangents(line.dense)[::PER_INTERVAL]
    offsets = np.full(K, np.nan)
    for k in range(K):
        away = track - line.knots[k]
        along, left = away @ ahead[k], ahead[k, 0] * away[:, 1] - ahead[k, 1] * away[:, 0]
        passing = np.flatnonzero((along[:-1] <= 0) & (along[1:] > 0) & (np.abs(left[:-1]) < 5.0))
        if len(passing):
            i = int(passing[0])
            share = -along[i] / (along[i + 1] - along[i])
            offsets[k] = left[i] + share * (left[i + 1] - left[i])
    return offsets
