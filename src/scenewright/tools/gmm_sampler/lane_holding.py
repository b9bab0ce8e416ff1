"""Vehicles keep to their lane on the approach, parallel to it, or leave it where that is asked.

p_wp says where a path is about every 11 m. Samples of it have ramps of some degrees and lane
changes before the stop line, on which a queue would then stand. So waypoints that change lanes on
the approach are drawn anew, and a path's slope against its lane is limited there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.geometry.polyline import (
    resample_by_spacing,
    resample_to_count,
    smooth_gaussian,
)
from scenewright.geometry.spline import (
    DENSE,
    build_even_path,
    compute_dense_curves,
    find_nearest_point,
    resample_points,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K, Path
from scenewright.scene.map import IntersectionMap
from scenewright.tools.gmm_sampler.priors import DIMENSIONS, WaypointPrior
from scenewright.tools.gmm_sampler.sample import Draws, combine, score_waypoints

_MOST_SLOPE = math.tan(math.radians(0.8))
"""Of a path, against its lane."""
_LAST, _MORE, _BEYOND = 1.5, 0.07, 4.0
"""From so near to the line on, where no vehicle's middle stands, slopes may grow [1/m], and how far
beyond it they are limited [m]."""
_IN_LANE = 1.1
"""A waypoint this near to a lane's middle [m] is in that lane."""
_ROUNDS = 5
_SMOOTH = 3.0
"""Over which the corners of a lane's middle are smoothed [m]."""


@dataclass(frozen=True, eq=False)
class ApproachLanes:
    """The lanes by which a vehicle's route comes, as lines [P, 2] to 4 m beyond the stop line."""

    lines: tuple[FloatArray, ...]

    @cached_property
    def _points(self) -> tuple[FloatArray, NDArray[np.intp]]:
        """Points [P, 2] of all lines, and where each line begins and ends among them [L + 1]."""
        ends = np.cumsum([0, *map(len, self.lines)], dtype=np.intp)
        return np.concatenate([np.empty((0, 2)), *self.lines]), ends

    def draw(self, prior: WaypointPrior, rng: np.random.Generator, *, size: int) -> Draws:
        """Draw from p_wp, those that leave their lane on the approach up to five times."""
        rounds = _ROUNDS if self.lines else 1
        chosen = prior.cumulative_weights.searchsorted(rng.random((rounds, size)), side="right")
        noise = rng.standard_normal((rounds, size, DIMENSIONS))
        drawn = _draw(chosen, noise, prior.means, prior.cholesky, *self._points)
        return drawn, *score_waypoints(prior, drawn)

    def hold(self, path: Path) -> tuple[Path, FloatArray] | None:
        """The path held to the lane by which it comes to the line, and its waypoints [K, 2].

        Returns:
            None where it keeps to its lane already.
        """
        if not self.lines:
            return None
        held, waypoints = _hold(path.xy, path.heading, *self._points, _MOST_SLOPE)
        return (build_even_path(held), waypoints) if len(held) else None


def find_approach_lanes(intersection_map: IntersectionMap, movement: str | None) -> ApproachLanes:
    """The lanes by which a movement comes; none for pedestrians, who have no movement."""
    ways = (*intersection_map.movements, *intersection_map.uturns)
    own = next((way.lanelets for way in ways if way.id == movement), ())
    lines = []
    for lane in intersection_map.lanelets:
        if lane.kind == "approach" and lane.id in own:
            line = np.array(lane.centreline)
            smooth = smooth_gaussian(resample_by_spacing(line, 1.0), _SMOOTH)
            ahead = line[-1] - line[-2]
            beyond = line[-1] + _BEYOND * ahead / float(np.hypot(*ahead))
            lines.append(np.vstack([smooth, line[-1], beyond]))  # smoothing takes off the end
    return ApproachLanes(tuple(lines))


# ---- as machine code ----------------------------------------------------------------------------


@compiled
def _draw(
    chosen: NDArray[np.intp],
    noise: FloatArray,
    means: FloatArray,
    cholesky: FloatArray,
    points: FloatArray,
    ends: NDArray[np.intp],
) -> FloatArray:
    """Waypoints [M, K, 2] of components chosen [R, M] and standard normal numbers [R, M, 20]."""
    drawn = np.empty((chosen.shape[1], K, 2))
    for m in range(len(drawn)):
        for n in range(len(chosen)):
            drawn[m] = combine(chosen[n, m : m + 1], noise[n, m : m + 1], means, cholesky)[0]
            if _keeps_lane(drawn[m], points, ends):
                break
    return drawn


@compiled
def _keeps_lane(waypoints: FloatArray, points: FloatArray, ends: NDArray[np.intp]) -> bool:
    """Whether all waypoints [K, 2] before the line are in one lane."""
    for lane in range(len(ends) - 1):
        line, kept = points[ends[lane] : ends[lane + 1]], 0
        for k in range(len(waypoints)):
            node, away = find_nearest_point(line, waypoints[k, 0], waypoints[k, 1])
            kept += node == len(line) - 1 or away < _IN_LANE
        if kept == len(waypoints):
            return True
    return len(ends) == 1


@compiled
def _hold(
    xy: FloatArray, heading: FloatArray, points: FloatArray, ends: NDArray[np.intp], most: float
) -> tuple[FloatArray, FloatArray]:
    """Points [P, 2] moved aside where steeper against the lane, waypoints [K, 2]; empty if nowhere.

    Args:
        xy: points [P, 2] of the path; heading: [P] of it [rad]; points, ends: of the lanes.
    """
    own, least = 0, np.inf
    for each in range(len(ends) - 1):
        last = points[ends[each + 1] - 1]
        _, away = find_nearest_point(xy, last[0], last[1])
        if away < least:
            own, least = each, away
    offset, left = _measure_offsets(xy, points[ends[own] : ends[own + 1]])
    moved, changed, more = xy.copy(), False, 0.0
    for i in range(len(offset) - 2, -1, -1):
        step = np.hypot(xy[i + 1, 0] - xy[i, 0], xy[i + 1, 1] - xy[i, 1])
        allowed = (most + max(_LAST + _BEYOND - left[i], 0.0) * _MORE) * step
        rise = offset[i] - offset[i + 1]
        kept = min(max(rise, -allowed), allowed)
        more += kept - rise
        changed = changed or kept != rise
        moved[i, 0] -= more * np.sin(heading[i])
        moved[i, 1] += more * np.cos(heading[i])
    return (moved, resample_points(moved, K)[0]) if changed else (moved[:0], moved[:0])


@compiled
def _measure_offsets(xy: FloatArray, lane: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Offsets [n] of the first points to the left of the lane, and [n] way to its end [m]."""
    ahead = np.zeros(len(lane))
    for k in range(len(lane) - 2, -1, -1):
        ahead[k] = ahead[k + 1] + np.hypot(lane[k + 1, 0] - lane[k, 0], lane[k + 1, 1] - lane[k, 1])
    offset, left, k = np.empty(len(xy)), np.empty(len(xy)), 0
    for i in range(len(xy)):
        while True:
            dx, dy = lane[k + 1, 0] - lane[k, 0], lane[k + 1, 1] - lane[k, 1]
            px, py, long = xy[i, 0] - lane[k, 0], xy[i, 1] - lane[k, 1], np.hypot(dx, dy)
            share = (px * dx + py * dy) / long
            if share <= long:
                break
            if k == len(lane) - 2:
                return offset[:i], left[:i]
            k += 1
        offset[i], left[i] = (dx * py - dy * px) / long, ahead[k] - share
    return offset, left


_BEGIN, _SPAN = (0.15, 0.45), (0.22, 0.34)
"""Where the lane is left, and over how much of the path [share of the path]."""


def sample_lane_departures(
    own: FloatArray, other: FloatArray, rng: np.random.Generator, *, reverse: bool
) -> FloatArray:
    """Waypoints [M, K, 2] that start on `own` and go over to `other` (driven backwards if asked).

    Candidates whose two samples lie on the same lane (less than 2 m apart) are paired with the
    farthest sample of the other instead.
    """
    targets = other[:, ::-1] if reverse else other
    result = []
    for waypoints in own:
        apart = np.abs(targets - waypoints).sum(axis=2)[:, 3:7].mean(axis=1)
        wide = np.nonzero(apart > 2.0)[0]
        pick = int(rng.choice(wide)) if len(wide) else int(np.argmax(apart))
        first, second = (compute_dense_curves(each[None])[0] for each in (waypoints, targets[pick]))
        begin, span = rng.uniform(*_BEGIN), rng.uniform(*_SPAN)
        x = np.clip((np.linspace(0, 1, DENSE) - begin) / span, 0.0, 1.0)
        share = (x**3 * (10 - 15 * x + 6 * x**2))[:, None]
        blended = first * (1 - share) + second * share
        result.append(resample_to_count(blended, len(waypoints)))
    return np.stack(result)
