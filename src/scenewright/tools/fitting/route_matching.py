"""Which route of the map a track follows, and how far beside the middle of it, place by place.

Real tracks are partial: sensors see a part of the junction. A track is matched to the route whose
centreline it keeps to best, in distance and direction; where several fit alike (before ways part)
it belongs to none, and its entry may still be known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenewright.geometry.polyline import compute_tangents
from scenewright.geometry.spline import PER_INTERVAL
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.tools.fitting.path_frame import Centreline, centreline

NEAR = {"vehicle": 2.2, "pedestrian": 3.5}
"""On average a track is not farther from the centreline of its route [m]."""
_ALIGNED = math.radians(35.0)
_CLEARLY = 0.5
"""By how much the second-best route must be worse [m], unless its way is the same so far."""
_LEAST_WAY = 8.0
_APART = 1.5
"""Lines closer than this over all of a track cannot be told apart by it [m]."""


@dataclass(frozen=True, eq=False)
class Match:
    """A track on its route.

    Attributes:
        route: id; line: which of its centrelines.
        beside: [K] how far to the left of the centreline at its ten waypoints [m]; NaN where the
            track was not seen.
        away: mean distance from the centreline [m].
    """

    route: str
    line: int
    beside: FloatArray
    away: float


@dataclass(frozen=True, eq=False)
class Unmatched:
    """Why a track is on no route: `off` every route, or `open` between several; its entry."""

    reason: str
    entry: Compass | None


class Matcher:
    """The routes of one map, ready for tracks."""

    def __init__(self, place: IntersectionMap, ways: Mapping[str, Sequence[FloatArray]]) -> None:
        self._routes = {r.id: r for r in place.routes if r.id in ways}
        self._lines = [
            (r.id, r.type, n, centreline(np.asarray(line)))
            for r in self._routes.values()
            for n, line in enumerate(ways[r.id])
        ]

    def normals(self, match: Match) -> FloatArray:
        """[K, 2] unit vectors to the left of the matched line at its waypoints."""
        line = next(x for r, _, n, x in self._lines if (r, n) == (match.route, match.line))
        ahead = compute_tangents(line.dense)[::PER_INTERVAL]
        return np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)

    def match(self, xy: FloatArray, kind: str) -> Match | Unmatched:
        """The route of a track [T, 2] of a class."""
        even = evenly(xy)
        if len(even) < 4:
            return Unmatched("off", None)
        found = []
        for route, own_kind, number, line in self._lines:
            if own_kind == kind:
                away = distance_from(even, line)
                if away <= NEAR[kind]:
                    found.append((away, route, number, line))
        if not found:
            return Unmatched("off", None)
        found.sort(key=lambda each: each[0])
        best = found[0]
        rivals = [f for f in found[1:] if f[1] != best[1] and f[0] < best[0] + _CLEARLY]
        if kind == "vehicle" and any(_alike(even, best[3], f[3]) for f in rivals):
            entries = {self._routes[f[1]].entry for f in (best, *rivals)}
            return Unmatched("open", entries.pop() if len(entries) == 1 else None)
        return Match(best[1], best[2], beside_of(even, best[3]), best[0])


def evenly(xy: FloatArray) -> FloatArray:
    """The track every half metre of its way; standing adds nothing."""
    step = np.hypot(*np.diff(xy, axis=0).T)
    s = np.concatenate([[0.0], np.cumsum(step)])
    if s[-1] < _LEAST_WAY:
        return np.zeros((0, 2))
    kept = np.concatenate([[True], step > 1e-4])
    wanted = np.arange(0.0, s[-1], 0.5)
    return np.stack([np.interp(wanted, s[kept], xy[kept, a]) for a in (0, 1)], axis=1)


def distance_from(track: FloatArray, line: Centreline) -> float:
    """Mean distance of a track from a line; infinite where it runs another way."""
    apart = np.hypot(*(track[::2, None] - line.dense[None]).transpose(2, 0, 1))
    nearest = apart.argmin(axis=1)
    # Beyond the line's ends the map says nothing.
    known = (nearest > 0) & (nearest < len(line.dense) - 1)
    if known.sum() < 4:
        return math.inf
    ahead = np.gradient(line.dense, axis=0)[nearest]
    way = np.gradient(track[::2], axis=0)
    turn = np.arctan2(ahead[:, 0] * way[:, 1] - ahead[:, 1] * way[:, 0], (ahead * way).sum(axis=1))
    if float(np.quantile(np.abs(turn[known]), 0.8)) > _ALIGNED:
        return math.inf
    return float(apart.min(axis=1)[known].mean())


def _alike(track: FloatArray, a: Centreline, b: Centreline) -> bool:
    """Whether two lines run together wherever the track was seen."""
    places = []
    for line in (a, b):
        apart = np.hypot(*(track[::2, None] - line.dense[None]).transpose(2, 0, 1))
        places.append(line.dense[apart.argmin(axis=1)])
    return float(np.hypot(*(places[0] - places[1]).T).max()) < _APART


def beside_of(track: FloatArray, line: Centreline) -> FloatArray:
    """[K] offset to the left at each waypoint of the line that the track passes [m]."""
    ahead = compute_tangents(line.dense)[::PER_INTERVAL]
    beside = np.full(K, np.nan)
    for k in range(K):
        away = track - line.knots[k]
        along, left = away @ ahead[k], ahead[k, 0] * away[:, 1] - ahead[k, 1] * away[:, 0]
        crossing = np.flatnonzero((along[:-1] <= 0) & (along[1:] > 0) & (np.abs(left[:-1]) < 5.0))
        if len(crossing):
            i = int(crossing[0])
            share = -along[i] / (along[i + 1] - along[i])
            beside[k] = left[i] + share * (left[i + 1] - left[i])
    return beside
