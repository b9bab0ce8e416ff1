"""The curve of a track: evenly sampled in arc length, projected on, extended straight on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from scenewright.compiled import compiled, compiled_to_write
from scenewright.scene.base import FloatArray

SPACING = 0.5
"""Distance of path points [m]."""
FOOT = 2 * SPACING
"""The foot of a projection lies at most this far from the nearest path point [m]."""
WIDEST, STRETCH = 3 * SPACING, 8
"""Most that two neighbouring points of a path or lane are apart [m]; so many points are passed over
together."""
SHORTEST = 0.05
"""Shorter tracks have no direction of their own [m]."""
LANE_BEFORE, LANE_AFTER = 30, 50
"""Points by which a lane goes on straight before and after a path: 15 and 25 m."""

IntArray = np.ndarray[tuple[int, ...], np.dtype[np.intp]]


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

    def extend(self, *, before: float, after: float) -> TrackPath:
        """The path with straight pieces at both ends [m]."""
        back, forth = (SPACING * np.arange(1, int(d / SPACING) + 1) for d in (before, after))
        ends = self.direction[[0, -1]]
        (tail, front), way = self.xy[[0, -1]], np.stack((np.cos(ends), np.sin(ends)), axis=1)
        tail, front = tail - back[::-1, None] * way[0], front + forth[:, None] * way[1]
        return TrackPath(
            np.concatenate((self.s[0] - back[::-1], self.s, self.s[-1] + forth)),
            np.concatenate((tail, self.xy, front)),
            np.concatenate(
                (ends[:1].repeat(len(back)), self.direction, ends[1:].repeat(len(forth)))
            ),
        )


def build_paths(
    xy: FloatArray, s: FloatArray, heading: FloatArray, origin: IntArray
) -> list[TrackPath]:
    """The paths of many tracks in one pass; one point where a track is shorter than 0.05 m.

    Args:
        xy: [S, 2] positions [m], track after track; s: [S] arc length since the first position of
            the track; heading: [S]; origin: [N+1] where each track begins, the last entry being S.
    """
    even, points, direction, begin = _resample_evenly(xy, s, heading, origin)
    return [
        TrackPath(even[i:j], points[i:j], unwrap_angles(direction[i:j]))
        for i, j in pairwise(begin.tolist())
    ]


@compiled
def _resample_evenly(
    xy: FloatArray, s: FloatArray, heading: FloatArray, origin: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Arc lengths [m], points [m] and directions [rad] of all paths, and where each begins."""
    begin = np.zeros(len(origin), np.intp)
    for n in range(len(origin) - 1):
        total = s[origin[n + 1] - 1]
        count = 1 if total < SHORTEST else max(int(total / SPACING), 1) + 1
        begin[n + 1] = begin[n] + count
    even, points = np.zeros(begin[-1]), np.empty((begin[-1], 2))
    direction = np.empty(begin[-1])
    for n in range(len(origin) - 1):
        i, j, last = begin[n], begin[n + 1], begin[n + 1] - 1
        total, first = s[origin[n + 1] - 1], origin[n]
        if i == last:
            points[i, 0], points[i, 1], direction[i] = xy[first, 0], xy[first, 1], heading[first]
            continue
        for k in range(i, last):
            even[k] = (k - i) * (total / (last - i))
        even[last] = total
        _interpolate(even[i:j], xy[first : origin[n + 1]], s[first : origin[n + 1]], points[i:j])
        for k in range(i, j):
            before, after = max(k - 1, i), min(k + 1, last)
            dx, dy = points[after, 0] - points[before, 0], points[after, 1] - points[before, 1]
            direction[k] = np.arctan2(dy, dx)
    return even, points, direction, begin


@compiled_to_write
def _interpolate(even: FloatArray, xy: FloatArray, s: FloatArray, points: FloatArray) -> None:
    """Writes points at ascending arc lengths, linear between samples that differ."""
    here = there = 0
    for n in range(len(even)):
        while there < len(s) and s[there] <= even[n]:
            here = there
            there = _find_next_distinct(s, there)
        after = there if there < len(s) else here
        apart = max(s[after] - s[here], 1e-9)
        for axis in range(2):
            slope = (xy[after, axis] - xy[here, axis]) / apart
            points[n, axis] = slope * (even[n] - s[here]) + xy[here, axis]


@compiled
def _find_next_distinct(s: FloatArray, k: int) -> int:
    """The next sample more than 0.1 mm after the one before it; as many as there are if none."""
    k += 1
    while k < len(s) and not s[k] - s[k - 1] > 1e-4:
        k += 1
    return k


def build_lanes(paths: Sequence[TrackPath]) -> list[TrackPath]:
    """Every path at every second point, with straight pieces before and after it, in one pass."""
    begin = np.cumsum([0, *(len(path.s) for path in paths)])
    s, xy, direction, ends = _prolong(
        np.concatenate([path.s for path in paths]),
        np.concatenate([path.xy for path in paths]),
        np.concatenate([path.direction for path in paths]),
        begin,
    )
    return [TrackPath(s[i:j], xy[i:j], direction[i:j]) for i, j in pairwise(ends.tolist())]


@compiled
def _prolong(
    s: FloatArray, xy: FloatArray, direction: FloatArray, begin: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    ends = np.zeros(len(begin), np.intp)
    for n in range(len(begin) - 1):
        count = begin[n + 1] - begin[n]
        ends[n + 1] = ends[n] + (count + LANE_BEFORE + LANE_AFTER + 1) // 2
    along, points, facing = np.empty(ends[-1]), np.empty((ends[-1], 2)), np.empty(ends[-1])
    for n in range(len(begin) - 1):
        for row in range(ends[n], ends[n + 1]):
            k = begin[n] + 2 * (row - ends[n]) - LANE_BEFORE
            at = min(max(k, begin[n]), begin[n + 1] - 1)
            beyond = SPACING * (k - at)
            along[row], facing[row] = s[at] + beyond, direction[at]
            points[row, 0] = xy[at, 0] + beyond * np.cos(direction[at])
            points[row, 1] = xy[at, 1] + beyond * np.sin(direction[at])
    return along, points, facing, ends


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
    """Lanes of N movers side by side, padded to one length.

    Attributes:
        x, y: [N, P] points [m], inf past the end of a lane; s, direction: [N, P], see `TrackPath`.
        size: [N] points of each; low, high: [2, N] corners of the boxes round the lanes [m].
    """

    x: FloatArray
    y: FloatArray
    s: FloatArray
    direction: FloatArray
    size: IntArray
    low: FloatArray
    high: FloatArray


def build_lane_table(lanes: Sequence[TrackPath]) -> LaneTable:
    """Lanes in one table, for many projections at once."""
    sizes = np.array([len(lane.s) for lane in lanes])
    xy = np.full((2, len(lanes), sizes.max()), np.inf)
    s, direction = np.zeros((2, len(lanes), sizes.max()))
    for n, lane in enumerate(lanes):
        xy[:, n, : sizes[n]] = lane.xy.T
        s[n, : sizes[n]], direction[n, : sizes[n]] = lane.s, lane.direction
    high = np.where(np.isinf(xy), -np.inf, xy).max(axis=2)
    return LaneTable(xy[0], xy[1], s, direction, sizes, xy.min(axis=2), high)


@compiled
def project_on_lane(
    px: float, py: float, lanes: LaneTable, lane: int, within: float
) -> tuple[float, float, float]:
    """Arc length, lateral and direction of a place at the nearest point of a lane.

    Where the box of the lane excludes that it is within a distance [m], lateral inf, the rest 0.
    """
    beside = max(lanes.low[0, lane] - px, px - lanes.high[0, lane])
    beyond = max(lanes.low[1, lane] - py, py - lanes.high[1, lane])
    if max(beside, beyond) >= within + FOOT:
        return 0.0, np.inf, 0.0
    return _project_point(
        px, py, lanes.x[lane], lanes.y[lane], lanes.s[lane], lanes.direction[lane]
    )


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
