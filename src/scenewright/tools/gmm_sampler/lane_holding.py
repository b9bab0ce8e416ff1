"""Vehicles keep to their lane on the approach, so that those in a queue stand parallel to it.

p_wp says where a path is about every 11 m. Samples of it have ramps of some degrees and lane
changes before the stop line, on which a queue would then stand. So waypoints that change lanes on
the approach are drawn anew, and a path's slope against its lane is limited there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.geometry.polyline import (
    measure_distances,
    resample_by_spacing,
    resample_to_count,
    smooth_gaussian,
)
from scenewright.geometry.spline import build_even_path
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K, Path
from scenewright.scene.map import IntersectionMap

_MOST_SLOPE = math.tan(math.radians(0.8))
"""Of a path, against its lane."""
_LAST, _MORE, _BEYOND = 1.5, 0.07, 4.0
"""From so near to the line on, where no vehicle's middle stands, slopes may grow [1/m], and how far
beyond it they are limited [m]."""
_IN_LANE = 1.1
"""A waypoint this near to a lane's middle [m] is in that lane."""
_ROUNDS = 4
_SMOOTH = 3.0
"""Over which the corners of a lane's middle are smoothed [m]."""


@dataclass(frozen=True, eq=False)
class ApproachLanes:
    """The lanes by which a vehicle's route comes, as lines [P, 2] to 4 m beyond the stop line."""

    lines: tuple[FloatArray, ...]

    def resample(self, drawn: FloatArray, draw: Callable[[int], FloatArray]) -> FloatArray:
        """Waypoints [M, K, 2], those that leave their lane on the approach drawn anew.

        Args:
            draw: gives so many waypoints.
        """
        for _ in range(_ROUNDS):
            away = np.flatnonzero(~self._find_in_lane(drawn)) if self.lines else ()
            if not len(away):
                break
            drawn = drawn.copy()
            drawn[away] = draw(len(away))
        return drawn

    def _find_in_lane(self, drawn: FloatArray) -> NDArray[np.bool_]:
        """[M] whether all waypoints before the line are in one lane."""
        inside = np.zeros(len(drawn), dtype=np.bool_)
        for line in self.lines:
            away = measure_distances(drawn.reshape(-1, 2), line)
            beyond = (away.argmin(axis=1) == len(line) - 1).reshape(-1, K)
            inside |= (beyond | (away.min(axis=1).reshape(-1, K) < _IN_LANE)).all(axis=1)
        return inside

    def hold(self, path: Path) -> tuple[Path, FloatArray] | None:
        """The path held to the lane by which it comes to the line, and its waypoints [K, 2].

        Returns:
            None where it keeps to its lane already.
        """
        if not self.lines:
            return None
        ends = measure_distances(np.array([line[-1] for line in self.lines]), path.xy).min(axis=1)
        held = _hold(path.xy, path.heading, self.lines[int(ends.argmin())], _MOST_SLOPE)
        return (build_even_path(held), resample_to_count(held, K)) if len(held) else None


def find_approach_lanes(intersection_map: IntersectionMap, movement: str | None) -> ApproachLanes:
    """The lanes by which a movement comes; none for pedestrians, who have no movement."""
    ways = (*intersection_map.movements, *intersection_map.uturns)
    own = next((each.lanelets for each in ways if each.id == movement), ())
    lines = [
        np.array(each.centreline)
        for each in intersection_map.lanelets
        if each.kind == "approach" and each.id in own
    ]
    return ApproachLanes(tuple(map(_smooth_and_extend, lines)))


def _smooth_and_extend(line: FloatArray) -> FloatArray:
    smooth = smooth_gaussian(resample_by_spacing(line, 1.0), _SMOOTH)
    ahead = line[-1] - line[-2]
    beyond = line[-1] + _BEYOND * ahead / float(np.hypot(*ahead))
    return np.vstack([smooth, line[-1], beyond])  # smoothing takes off the end


# ---- as machine code ----------------------------------------------------------------------------


@compiled
def _hold(xy: FloatArray, heading: FloatArray, lane: FloatArray, most: float) -> FloatArray:
    """[P, 2] the path moved aside where it is steeper against the lane; empty if nowhere.

    Args:
        xy: points [P, 2] of the path; heading: [P] of it [rad]; lane: [L, 2].
    """
    offset, left = _measure_offsets(xy, lane)
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
    return moved if changed else moved[:0]


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
