"""Conflicts of two paths: clearances, and the offsets at which the agents meet.

For two motions a and b that enter the map at scene times o_a and o_b, let delta = o_b - o_a. They
come within clearance c iff delta lies in

    C(c) = {t_a - t_b : clearance(a(t_a), b(t_b)) <= c},

a union of intervals. They collide iff delta is in C(0); their PET is the distance of delta from
C(0); "no interaction" keeps delta clear of both. Geometry (which nodes of the two paths are close)
is independent of time and computed once per pair of paths.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.geometry.driving_profile import Motion
from scenewright.geometry.spline import sample_nodes, sample_poses, to_cosines
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Path
from scenewright.scene.track import STEP, Shape
from scenewright.work_limit import count_work

FOREVER = 1e4
"""Longer than any scene [s]: how long a wreck stays."""

_JOIN = 0.3
"""Intervals closer than this [s] are one meeting seen through two nodes."""

_RESTS = 1e-4
"""Less distance than this in one step [m] is standing."""

SLACK = 0.01
"""Extra distance [m] of the search for nodes: no rounding loses a pair."""

IntArray = NDArray[np.intp]
Half = tuple[float, float]
"""Half length and half width of a rectangle [m]."""
Intervals = FloatArray
"""[N, 2] disjoint closed intervals [s], ascending."""


@dataclass(frozen=True, eq=False)
class PathConflict:
    """Pairs of nodes of two paths whose footprints come close.

    Attributes:
        s_a, s_b: [A], [B] nodes of the paths [m].
        i, j: [N] node indices of close pairs.
        clearance: [N] distance of the footprints there [m]; negative where they overlap.
    """

    s_a: FloatArray
    s_b: FloatArray
    i: IntArray
    j: IntArray
    clearance: FloatArray

    @cached_property
    def touching(self) -> NDArray[np.bool_]:
        """[A + 1, B + 1] whether the footprints touch at two nodes; False beyond the last."""
        touch = np.zeros((len(self.s_a) + 1, len(self.s_b) + 1), dtype=np.bool_)
        meet = self.clearance <= 0.0
        touch[self.i[meet], self.j[meet]] = True
        return touch

    @property
    def touches(self) -> bool:
        """Whether the swept paths overlap at all."""
        return bool(len(self.clearance) and self.clearance.min() <= 0.0)

    def keep_first_metres(self, metres: float) -> PathConflict:
        """Keep only the start of a shared stretch: a merge conflicts where it begins (SEMANTICS
        4)."""
        if not len(self.i):
            return self
        near = self.s_a[self.i] <= self.s_a[self.i].min() + metres
        near &= self.s_b[self.j] <= self.s_b[self.j].min() + metres
        return PathConflict(self.s_a, self.s_b, self.i[near], self.j[near], self.clearance[near])


def find_path_conflict(
    a: Path,
    b: Path,
    *,
    shapes: tuple[Shape, Shape],
    reach: float,
    spacing: tuple[float, float] = (0.5, 0.5),
) -> PathConflict:
    """Find all node pairs of two paths whose footprints come within `reach` metres.

    Args:
        spacing: distance between nodes of a and of b [m]; a PET wants less than a certificate.
    """
    s_a, s_b = sample_nodes(a, spacing[0]), sample_nodes(b, spacing[1])
    pose_a, pose_b = sample_poses(a, s_a), sample_poses(b, s_b)
    radius = sum(np.hypot(shape.length, shape.width) / 2 for shape in shapes)
    i, j = find_close_nodes(
        pose_a.T, pose_b.T, float(radius + reach), (float(s_a[1]), float(s_b[1]))
    )
    halves = get_half_sides(shapes[0]), get_half_sides(shapes[1])
    clearance = _compute_distances(to_cosines(pose_a), to_cosines(pose_b), i, j, *halves, reach)
    near = clearance <= reach
    return PathConflict(s_a, s_b, i[near], j[near], clearance[near])


@compiled
def find_close_nodes(
    a: FloatArray, b: FloatArray, radius: float, spacing: tuple[float, float]
) -> tuple[IntArray, IntArray]:
    """Find pairs (i, j), ascending, of nodes of two paths that lie within a radius of one another.

    Args:
        a, b: [2+, N], [2+, M] x and y of nodes [m]; spacing: of the nodes of a and of b [m].
        radius: [m]; a few pairs up to 1 cm further apart are given, too.
    """
    i, j = np.empty(64, np.intp), np.empty(64, np.intp)
    count = p = 0
    while p < a.shape[1]:
        nearest, q = np.inf, 0
        while q < b.shape[1]:
            dx, dy = a[0, p] - b[0, q], a[1, p] - b[1, q]
            beyond = max(np.sqrt(dx * dx + dy * dy) - radius - SLACK, 0.0)
            if beyond == 0.0:
                if count == len(i):
                    i, j = _double_capacity(i), _double_capacity(j)
                i[count], j[count] = p, q
                count += 1
            # A path comes nearer no faster than it goes on: half of the distance may be skipped on
            # this one, and as much on the other.
            nearest = min(nearest, 0.5 * beyond)
            q += 1 + int(0.5 * beyond / spacing[1])
        p += 1 + int(nearest / spacing[0])
    return i[:count], j[:count]


@compiled
def _double_capacity(found: IntArray) -> IntArray:
    """Double the capacity of the array."""
    more = np.empty(2 * len(found), np.intp)
    for k in range(len(found)):
        more[k] = found[k]
    return more


@compiled
def compute_axis_gap(
    ax: float, ay: float, a_cos: float, a_sin: float, a_half: Half,
    bx: float, by: float, b_cos: float, b_sin: float, b_half: Half,
) -> float:  # fmt: skip
    """Compute the largest gap of two rectangles along the axes of either [m]; negative = overlap.

    The true clearance is never less, and more only where two corners are nearest.

    Args:
        ax, ay, a_cos, a_sin: centre [m] and direction of a; a_half: half length and width [m].
    """
    dx, dy = ax - bx, ay - by
    cos, sin = abs(a_cos * b_cos + a_sin * b_sin), abs(a_cos * b_sin - a_sin * b_cos)
    gap = abs(dx * a_cos + dy * a_sin) - a_half[0] - b_half[0] * cos - b_half[1] * sin
    gap = max(gap, abs(dy * a_cos - dx * a_sin) - a_half[1] - b_half[0] * sin - b_half[1] * cos)
    gap = max(gap, abs(dx * b_cos + dy * b_sin) - b_half[0] - a_half[0] * cos - a_half[1] * sin)
    return max(gap, abs(dy * b_cos - dx * b_sin) - b_half[1] - a_half[0] * sin - a_half[1] * cos)


@compiled
def compute_distance(
    ax: float, ay: float, a_cos: float, a_sin: float, a_half: Half,
    bx: float, by: float, b_cos: float, b_sin: float, b_half: Half, reach: float,
) -> float:  # fmt: skip
    """Compute the distance of two footprints [m]; negative = overlap.

    Two convex shapes that do not overlap are nearest at a corner of one of them; whether they
    overlap is decided by separating axes. Discs are corners with a radius.

    Args:
        a_half, b_half: see `get_half_sides`; reach: beyond it, the distance may be more [m].
    """
    if a_half[0] == 0.0 and b_half[0] == 0.0:
        return float(np.hypot(ax - bx, ay - by)) - a_half[1] - b_half[1]
    if a_half[0] == 0.0:
        return _compute_point_distance(ax, ay, bx, by, b_cos, b_sin, b_half) - a_half[1]
    if b_half[0] == 0.0:
        return _compute_point_distance(bx, by, ax, ay, a_cos, a_sin, a_half) - b_half[1]
    gap = compute_axis_gap(ax, ay, a_cos, a_sin, a_half, bx, by, b_cos, b_sin, b_half)
    if gap <= 0.0 or gap > reach:
        return gap
    nearest = np.inf
    for n in range(4):
        along, across = 1.0 - 2.0 * (n % 2), 1.0 - 2.0 * (n // 2)
        u, v = along * a_half[0], across * a_half[1]
        x, y = ax + u * a_cos - v * a_sin, ay + u * a_sin + v * a_cos
        nearest = min(nearest, _compute_point_distance(x, y, bx, by, b_cos, b_sin, b_half))
        u, v = along * b_half[0], across * b_half[1]
        x, y = bx + u * b_cos - v * b_sin, by + u * b_sin + v * b_cos
        nearest = min(nearest, _compute_point_distance(x, y, ax, ay, a_cos, a_sin, a_half))
    return max(nearest, 0.0)


@compiled
def _compute_point_distance(
    x: float, y: float, bx: float, by: float, cos: float, sin: float, half: Half
) -> float:
    """Compute how far a point lies outside a rectangle [m]; negative inside."""
    dx, dy = x - bx, y - by
    along, across = abs(dx * cos + dy * sin) - half[0], abs(dy * cos - dx * sin) - half[1]
    outside = np.hypot(max(along, 0.0), max(across, 0.0))
    return float(outside + min(max(along, across), 0.0))


@compiled
def _compute_distances(
    a: FloatArray, b: FloatArray, i: IntArray, j: IntArray, a_half: Half, b_half: Half, reach: float
) -> FloatArray:
    """[N] `compute_distance` of pairs of nodes; a, b: [4, ...] x, y, cosine and sine of heading."""
    apart = np.empty(len(i))
    for k in range(len(i)):
        p, q = i[k], j[k]
        apart[k] = compute_distance(a[0, p], a[1, p], a[2, p], a[3, p], a_half,
                          b[0, q], b[1, q], b[2, q], b[3, q], b_half, reach)  # fmt: skip
    return apart


def get_half_sides(shape: Shape) -> Half:
    """Half length and half width [m]; a disc has the length 0 and its radius."""
    walks = shape.type == "pedestrian"
    return 0.0 if walks else shape.length / 2, shape.width / 2


def compute_clearance(a: FloatArray, b: FloatArray, *, shapes: tuple[Shape, Shape]) -> FloatArray:
    """Compute distances [N] [m] between footprints at poses [N, 3] (x, y, heading); negative =
    overlap."""
    every = np.arange(len(a))
    halves = get_half_sides(shapes[0]), get_half_sides(shapes[1])
    return _compute_distances(to_cosines(a), to_cosines(b), every, every, *halves, np.inf)


def find_conflict_intervals(
    pair: PathConflict, a: Motion, b: Motion, *, c: float = 0.0, exact: bool = True
) -> Intervals:
    """Find C(c) as disjoint intervals of delta = o_b - o_a [s].

    Args:
        exact: nodes count as points (for measuring a PET); else as the stretch around them,
            which never misses a meeting between nodes.
    """
    count_work()
    return _list_intervals(
        pair.s_a, pair.s_b, pair.i, pair.j, pair.clearance, c, a.s, a.ended, b.s, b.ended, exact
    )


def compute_gap(intervals: Intervals, delta: float) -> float:
    """Compute the distance [s] of delta from intervals: the PET if they are C(0); inf if empty."""
    if not len(intervals):
        return float("inf")
    outside = np.maximum(intervals[:, 0] - delta, delta - intervals[:, 1])
    return float(np.maximum(outside, 0.0).min())


@compiled
def _list_intervals(
    s_a: FloatArray,
    s_b: FloatArray,
    i: IntArray,
    j: IntArray,
    clearance: FloatArray,
    c: float,
    moved_a: FloatArray,
    ended_a: bool,
    moved_b: FloatArray,
    ended_b: bool,
    exact: bool,
) -> Intervals:
    """List the intervals at which two motions [T] are at nodes no further apart than c, merged."""
    a_in, a_out = _compute_occupancy(s_a, moved_a, ended_a, exact)
    b_in, b_out = _compute_occupancy(s_b, moved_b, ended_b, exact)
    low, high, count = np.empty(len(i)), np.empty(len(i)), 0
    for k in range(len(i)):
        if clearance[k] <= c and a_in[i[k]] < np.inf and b_in[j[k]] < np.inf:
            low[count], high[count] = a_in[i[k]] - b_out[j[k]], a_out[i[k]] - b_in[j[k]]
            count += 1
    merged, last = np.empty((count, 2)), -1
    for k in np.argsort(low[:count], kind="mergesort"):
        if last >= 0 and low[k] <= merged[last, 1] + _JOIN:
            merged[last, 1] = max(merged[last, 1], high[k])
        else:
            last += 1
            merged[last, 0], merged[last, 1] = low[k], high[k]
    return merged[: last + 1]


@compiled
def _compute_occupancy(
    s: FloatArray, moved: FloatArray, ended: bool, exact: bool
) -> tuple[FloatArray, FloatArray]:
    """Compute times [s] at which the centre enters and leaves each node's stretch; inf = never."""
    spacing = s[1] - s[0]
    come, leave = compute_passing_times(s, moved, 0.0 if exact else 0.5 * spacing, ended)
    for k in range(len(moved) - 1 if exact else 0):
        if moved[k + 1] - moved[k] < _RESTS:  # it may rest between two nodes: at the nearest
            node = min(int(np.rint(moved[k] / spacing)), len(s) - 1)
            until = STEP * (k + 1)
            leave[node] = max(leave[node], until) if come[node] < np.inf else until
            come[node] = min(come[node], STEP * k)
    return come, leave


@compiled
def compute_passing_times(
    s: FloatArray, moved: FloatArray, reach: float, ended: bool
) -> tuple[FloatArray, FloatArray]:
    """Compute times [s] at which it comes within `reach` [m] of each of ascending places, and
    leaves."""
    # Ties in arc length are a standstill: the tiny slope makes its start and end distinct.
    way = moved + 1e-7 * np.arange(len(moved))
    come, leave = (
        _compute_times_at(s - reach, way, np.inf),
        _compute_times_at(s + reach, way, STEP * (len(way) - 1)),
    )
    for k in range(len(s)):
        if come[k] == np.inf:
            leave[k] = np.inf
        elif ended and s[k] + reach >= way[-1] - 1e-3:
            leave[k] = FOREVER
    return come, leave


@compiled
def _compute_times_at(places: FloatArray, way: FloatArray, beyond: float) -> FloatArray:
    """Compute times [s] at which ascending places are passed; 0 before the path begins."""
    times = np.empty(len(places))
    k = 0
    for n in range(len(places)):
        while k < len(way) and way[k] <= places[n]:
            k += 1
        if k == 0:
            times[n] = 0.0
        elif k == len(way):
            times[n] = STEP * (k - 1) if places[n] == way[k - 1] else beyond
        else:
            slope = (STEP * k - STEP * (k - 1)) / (way[k] - way[k - 1])
            times[n] = slope * (places[n] - way[k - 1]) + STEP * (k - 1)
    return times
