"""The curve of a track: evenly sampled in arc length, projected on, extended straight on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.tools.relation_checker.footprints import BoolArray, IntArray

SPACING = 0.5
"""Distance of path points [m]."""
FOOT = 2 * SPACING
"""The foot of a projection lies at most this far from the nearest path point [m]."""
WIDEST, STRETCH = 3 * SPACING, 8
"""Most that two neighbouring points of a path or lane are apart [m]; so many points are passed over
together."""
SHORTEST = 0.05
"""Shorter tracks have no direction of their own [m]."""
DISTINCT = 1e-4
"""Samples no further than this after another [m] are the same point."""
LANE_BEFORE, LANE_AFTER = 30, 50
"""Points by which a lane goes on straight before and after a path: 15 and 25 m."""


@dataclass(frozen=True, eq=False)
class TrackPath:
    """The curve of an agent's whole track, evenly sampled in arc length.

    Attributes:
        s: [P] arc length [m] from the first position; negative on a straight extension.
        xy: [P, 2] points [m]; direction: [P] of travel, unwrapped [rad].
    """

    s: FloatArray
    xy: FloatArray
    direction: FloatArray

    def extend(self, distance: float) -> TrackPath:
        """The path with a straight piece at its end [m]."""
        ahead, way = SPACING * np.arange(1, int(distance / SPACING) + 1), self.direction[-1]
        front = self.xy[-1] + ahead[:, None] * np.array((np.cos(way), np.sin(way)))
        return TrackPath(
            np.append(self.s, self.s[-1] + ahead),
            np.concatenate((self.xy, front)),
            np.append(self.direction, np.full(len(ahead), way)),
        )


def build_path(xy: FloatArray, s: FloatArray, heading: FloatArray) -> TrackPath:
    """The path of a track; one point where the track is shorter than 0.05 m.

    Args:
        xy: [T, 2] positions [m]; s: [T] arc length since the first one; heading: [T] [rad].
    """
    even, points, direction = _resample_evenly(xy, s, heading)
    return TrackPath(even, points, unwrap_angles(direction))


@compiled
def _resample_evenly(
    xy: FloatArray, s: FloatArray, heading: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arc lengths [m], points [m] and directions [rad] of a path."""
    last = 0 if s[-1] < SHORTEST else max(int(s[-1] / SPACING), 1)
    even, points, direction = np.zeros(last + 1), np.empty((last + 1, 2)), np.empty(last + 1)
    if last == 0:
        points[0, 0], points[0, 1], direction[0] = xy[0, 0], xy[0, 1], heading[0]
        return even, points, direction
    for k in range(last):
        even[k] = k * (s[-1] / last)
    even[last] = s[-1]
    distinct = np.ones(len(s), np.bool_)
    distinct[1:] = s[1:] - s[:-1] > DISTINCT
    for axis in range(2):
        points[:, axis] = np.interp(even, s[distinct], xy[:, axis][distinct])
    for k in range(last + 1):
        before, after = max(k - 1, 0), min(k + 1, last)
        dx, dy = points[after, 0] - points[before, 0], points[after, 1] - points[before, 1]
        direction[k] = np.arctan2(dy, dx)
    return even, points, direction


def unwrap_angles(angles: FloatArray) -> FloatArray:
    """Angles [rad] without jumps of full turns; most have none, which is far quicker to see."""
    if (np.abs(angles[1:] - angles[:-1]) < np.pi).all():
        return angles
    return np.unwrap(angles)


def compute_curvature(path: TrackPath) -> FloatArray:
    """[P] change of direction per metre [1/m], over 2 m of path."""
    if len(path.s) < 3:
        return np.zeros(len(path.s))
    k = np.arange(len(path.s))
    low, high = np.maximum(k - 2, 0), np.minimum(k + 2, len(k) - 1)
    return np.asarray((path.direction[high] - path.direction[low]) / (path.s[high] - path.s[low]))


@dataclass(frozen=True, eq=False)
class Projection:
    """Where points lie along a path.

    Attributes:
        s: arc length of the foot [m]; lateral: distance from the path [m]; direction: of the path
            there [rad]. All have the shape of the points.
    """

    s: FloatArray
    lateral: FloatArray
    direction: FloatArray


def project(points: FloatArray, path: TrackPath) -> Projection:
    """Projects points [..., 2] on the nearest place of a path."""
    foot = _project_all(points.reshape(-1, 2), path.xy, path.s, path.direction)
    return Projection(*foot.reshape(3, *points.shape[:-1]))


@compiled
def _project_all(
    points: FloatArray, xy: FloatArray, s: FloatArray, direction: FloatArray
) -> FloatArray:
    """[3, n] arc length, lateral and direction of points [n, 2] on one path."""
    found = np.empty((3, len(points)))
    for n in range(len(points)):
        foot = _project_point(points[n, 0], points[n, 1], xy[:, 0], xy[:, 1], s, direction)
        found[0, n], found[1, n], found[2, n] = foot
    return found


@compiled
def _project_point(
    px: float, py: float, x: FloatArray, y: FloatArray, s: FloatArray, direction: FloatArray
) -> tuple[float, float, float]:
    """Arc length, lateral and direction of a place at the nearest point of a path."""
    bound = np.inf
    for m in range(0, len(x), STRETCH):
        bound = min(bound, (px - x[m]) * (px - x[m]) + (py - y[m]) * (py - y[m]))
    bound = (np.sqrt(bound) + STRETCH * WIDEST) ** 2  # beyond it no point of a stretch is nearest
    nearest, k = np.inf, 0
    for first in range(0, len(x), STRETCH):
        if (px - x[first]) * (px - x[first]) + (py - y[first]) * (py - y[first]) <= bound:
            for m in range(first, min(first + STRETCH, len(x))):
                away = (px - x[m]) * (px - x[m]) + (py - y[m]) * (py - y[m])
                if away < nearest:
                    nearest, k = away, m
    px, py, facing = px - x[k], py - y[k], direction[k]
    along = min(max(np.cos(facing) * px + np.sin(facing) * py, -FOOT), FOOT)
    return s[k] + along, np.sqrt(max(px * px + py * py - along * along, 0.0)), facing


class LaneTable(NamedTuple):
    """Lanes of N movers, one after another: every second point of a path, and straight on.

    Attributes:
        x, y: [P] points [m]; s, direction: [P], see `TrackPath`.
        begin: [N+1] where each lane begins, the last entry being P.
        low, high: [N, 2] corners of the boxes round the lanes [m].
        is_vehicle, width, nose: [N] of the movers, see `Trajectory`.
    """

    x: FloatArray
    y: FloatArray
    s: FloatArray
    direction: FloatArray
    begin: IntArray
    low: FloatArray
    high: FloatArray
    is_vehicle: BoolArray
    width: FloatArray
    nose: FloatArray


@compiled
def prolong_paths(
    s: FloatArray, xy: FloatArray, direction: FloatArray, origin: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray]:
    """What `LaneTable` holds from `x` to `high`, of paths one after another."""
    begin = np.zeros(len(origin), np.intp)
    for n in range(len(origin) - 1):
        count = origin[n + 1] - origin[n]
        begin[n + 1] = begin[n] + (count + LANE_BEFORE + LANE_AFTER + 1) // 2
    x, y = np.empty(begin[-1]), np.empty(begin[-1])
    along, facing = np.empty(begin[-1]), np.empty(begin[-1])
    low, high = np.full((len(origin) - 1, 2), np.inf), np.full((len(origin) - 1, 2), -np.inf)
    for n in range(len(origin) - 1):
        for row in range(begin[n], begin[n + 1]):
            k = origin[n] + 2 * (row - begin[n]) - LANE_BEFORE
            at = min(max(k, origin[n]), origin[n + 1] - 1)
            beyond = SPACING * (k - at)
            along[row], facing[row] = s[at] + beyond, direction[at]
            x[row] = xy[at, 0] + beyond * np.cos(direction[at])
            y[row] = xy[at, 1] + beyond * np.sin(direction[at])
            low[n, 0], low[n, 1] = min(low[n, 0], x[row]), min(low[n, 1], y[row])
            high[n, 0], high[n, 1] = max(high[n, 0], x[row]), max(high[n, 1], y[row])
    return x, y, along, facing, begin, low, high


@compiled
def project_on_lane(
    px: float, py: float, lanes: LaneTable, lane: int, within: float
) -> tuple[float, float, float]:
    """Arc length, lateral and direction of a place at the nearest point of a lane.

    Where the box of the lane excludes that it is within a distance [m], lateral inf, the rest 0.
    """
    beside = max(lanes.low[lane, 0] - px, px - lanes.high[lane, 0])
    beyond = max(lanes.low[lane, 1] - py, py - lanes.high[lane, 1])
    if max(beside, beyond) >= within + FOOT:
        return 0.0, np.inf, 0.0
    i, j = lanes.begin[lane], lanes.begin[lane + 1]
    return _project_point(px, py, lanes.x[i:j], lanes.y[i:j], lanes.s[i:j], lanes.direction[i:j])


def sample_path(path: TrackPath, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points [..., 2] and directions [...] at arc lengths, straight beyond the end of the path."""
    last = path.direction[-1]
    xy, direction = _sample_path(
        s.ravel(), path.s, path.xy, path.direction, (np.cos(last), np.sin(last))
    )
    return xy.reshape(*s.shape, 2), direction.reshape(s.shape)


@compiled
def _sample_path(
    at: FloatArray,
    s: FloatArray,
    xy: FloatArray,
    direction: FloatArray,
    onwards: tuple[float, float],
) -> tuple[FloatArray, FloatArray]:
    """Linear between the points, held before the first."""
    points, facing, last, k = np.empty((len(at), 2)), np.empty(len(at)), len(s) - 1, 0
    for n in range(len(at)):
        k = k if s[k] <= at[n] else 0
        while k < last and s[k + 1] <= at[n]:
            k += 1
        between = k < last and at[n] > s[k]
        apart, beyond = at[n] - s[k], max(at[n] - s[last], 0.0)
        for axis in range(2):
            slope = (xy[k + 1, axis] - xy[k, axis]) / (s[k + 1] - s[k]) if between else 0.0
            points[n, axis] = slope * apart + xy[k, axis] + beyond * onwards[axis]
        slope = (direction[k + 1] - direction[k]) / (s[k + 1] - s[k]) if between else 0.0
        facing[n] = slope * apart + direction[k]
    return points, facing
