"""A smooth path from waypoints (paper Eq. 3), a cubic spline through them all; poses along it.

Ten waypoints lie about 10 m apart, too far for a plain spline to hold a tight turn. Where a base
curve is given (the mean path of the mixture component that the waypoints come from), the spline
therefore runs through the *deviations* from it, which are small and slow. It still passes exactly
through the waypoints.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray, frozen
from scenewright.scene.candidates import K, Path, sample_evenly

PER_INTERVAL = 24
"""Points of a base curve between two waypoints."""
DENSE = (K - 1) * PER_INTERVAL + 1
"""Points of a base curve."""
SPACING = 0.5
"""Between points of a path [m], to the nearest that divides its length."""
_NOTHING = np.empty((0, 2))
_CURVATURE_WINDOW = 2.0
"""Over which curvature is smoothed [m]."""


def build_spline_path(
    waypoints: FloatArray, *, base: FloatArray | None = None, aside: FloatArray | None = None
) -> Path:
    """The path through waypoints [K, 2], about a base curve [DENSE, 2] where one is given.

    Args:
        aside: [DENSE] offsets to the left of that path [m]; 0 at the waypoints.
    """
    matrix = compute_spline_matrix()
    line, offsets = _NOTHING if base is None else base, _NOTHING[:, 0] if aside is None else aside
    return build_even_path(_bend(waypoints, matrix, line, offsets))


def compute_dense_curves(waypoints: FloatArray) -> FloatArray:
    """[m, DENSE, 2] splines through waypoints [m, K, 2]."""
    return np.asarray(np.einsum("pk,mkd->mpd", compute_spline_matrix(), waypoints))


@lru_cache(maxsize=1)
def compute_spline_matrix() -> FloatArray:
    """[DENSE, K] natural cubic spline as a linear map: values at the knots to values between."""
    second = np.zeros((K, K))
    inner = np.arange(1, K - 1)
    system = np.eye(K) * 4.0 + np.eye(K, k=1) + np.eye(K, k=-1)
    system[0], system[-1] = np.eye(K)[0], np.eye(K)[-1]
    second[inner, inner - 1], second[inner, inner], second[inner, inner + 1] = 6.0, -12.0, 6.0
    bend = np.linalg.solve(system, second)
    at = np.linspace(0.0, K - 1.0, DENSE)
    knot = np.minimum(at.astype(int), K - 2)
    t = (at - knot)[:, None]
    straight = (1 - t) * np.eye(K)[knot] + t * np.eye(K)[knot + 1]
    bent = ((1 - t) ** 3 - (1 - t)) * bend[knot] + (t**3 - t) * bend[knot + 1]
    return frozen(straight + bent / 6.0)


def build_even_path(curve: FloatArray) -> Path:
    """A curve [P, 2] as a path with even spacing, heading and smoothed curvature."""
    return Path(*_resample_evenly(curve))


# ---- as machine code ----------------------------------------------------------------------------


@compiled
def _bend(
    waypoints: FloatArray, matrix: FloatArray, base: FloatArray, aside: FloatArray
) -> FloatArray:
    """The curve [DENSE, 2] through waypoints; base, aside: as in `build_spline_path`, or empty."""
    curve, away = np.zeros((len(matrix), 2)), waypoints.copy()
    if len(base) > 0:
        curve[:] = base
        away -= base[::PER_INTERVAL]
    for n in range(len(matrix)):
        for k in range(len(away)):
            curve[n, 0] += matrix[n, k] * away[k, 0]
            curve[n, 1] += matrix[n, k] * away[k, 1]
    if len(aside) == 0:
        return curve
    moved, last = curve.copy(), len(curve) - 1
    for n in range(len(curve)):
        before, after = max(n - 1, 0), min(n + 1, last)
        dx, dy = curve[after, 0] - curve[before, 0], curve[after, 1] - curve[before, 1]
        long = max(np.hypot(dx, dy), 1e-9)
        moved[n, 0] -= aside[n] * dy / long
        moved[n, 1] += aside[n] * dx / long
    return moved


@compiled
def _resample_evenly(curve: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Points [N, 2] [m], arc length [m], heading [rad] and curvature [1/m] of an even path."""
    total = _measure_arc_lengths(curve)[-1]
    xy, s = resample_points(curve, max(int(np.rint(total / SPACING)), 2) + 1)
    heading, turning = _measure_directions(xy, s[1])
    return xy, s, heading, _average(turning, max(int(np.rint(_CURVATURE_WINDOW / s[1] / 2)), 1))


@compiled
def resample_points(curve: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """So many points of a curve at equal arc length, both ends included, and it [m]."""
    length = _measure_arc_lengths(curve)
    s = np.arange(count) * (length[-1] / (count - 1))
    s[-1] = length[-1]
    xy = np.empty((count, 2))
    k = 0
    for n in range(count):
        while k < len(length) - 2 and length[k + 1] <= s[n]:
            k += 1
        # A curve whose last points coincide ends with a step of no length.
        ends = s[n] >= length[-1]
        share = 1.0 if ends else (s[n] - length[k]) / (length[k + 1] - length[k])
        for axis in range(2):
            xy[n, axis] = curve[k, axis] + share * (curve[k + 1, axis] - curve[k, axis])
    return xy, s


@compiled
def _measure_arc_lengths(curve: FloatArray) -> FloatArray:
    """[P] arc length of the points of a curve [m]."""
    length = np.zeros(len(curve))
    for k in range(1, len(curve)):
        step = np.hypot(curve[k, 0] - curve[k - 1, 0], curve[k, 1] - curve[k - 1, 1])
        length[k] = length[k - 1] + step
    return length


@compiled
def _measure_directions(xy: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    """Heading [rad] and curvature [1/m] at points; headings are the first one and the turns since.

    Without jumps by construction.
    """
    heading, turning = np.empty(len(xy)), np.zeros(len(xy))
    dx, dy = xy[1, 0] - xy[0, 0], xy[1, 1] - xy[0, 1]
    now = heading[0] = np.arctan2(dy, dx)
    for k in range(1, len(xy) - 1):
        further_x, further_y = xy[k + 1, 0] - xy[k, 0], xy[k + 1, 1] - xy[k, 1]
        cross, dot = dx * further_y - dy * further_x, dx * further_x + dy * further_y
        turn = np.arctan2(cross, dot)
        heading[k], turning[k] = now + 0.5 * turn, turn / spacing
        now += turn
        dx, dy = further_x, further_y
    heading[-1] = now
    return heading, turning


@compiled
def _average(values: FloatArray, half: int) -> FloatArray:
    """A moving mean over 2 half + 1 values; the ends hold theirs."""
    out, last = np.empty(len(values)), len(values) - 1
    for k in range(len(values)):
        total = 0.0
        for n in range(k - half, k + half + 1):
            total += values[min(max(n, 0), last)]
        out[k] = total / (2 * half + 1)
    return out


def interpolate_clamped(x: FloatArray, known: FloatArray, values: FloatArray) -> FloatArray:
    """[N] the cubic spline through values at known places [P], level at both ends, at x [N].

    As `scipy.interpolate.CubicSpline(known, values, bc_type="clamped")`, which takes half a second
    to import.
    """
    step, rise = np.diff(known), np.diff(values) / np.diff(known)
    system = np.diag(np.concatenate([[1.0], 2.0 * (step[1:] + step[:-1]), [1.0]]))
    inner = np.arange(1, len(known) - 1)
    system[inner, inner - 1], system[inner, inner + 1] = step[1:], step[:-1]
    right = 3.0 * (step[1:] * rise[:-1] + step[:-1] * rise[1:])
    slope = np.linalg.solve(system, np.concatenate([[0.0], right, [0.0]]))
    k = np.clip(np.searchsorted(known, x, side="right") - 1, 0, len(step) - 1)
    t = (x - known[k]) / step[k]
    along = t * t * (3.0 - 2.0 * t)
    start, end = t * (1.0 - t) ** 2, t * t * (t - 1.0)
    bent = step[k] * (start * slope[k] + end * slope[k + 1])
    return np.asarray(values[k] + along * (values[k + 1] - values[k]) + bent)


def sample_poses(path: Path, s: FloatArray) -> FloatArray:
    """[N, 3] x, y [m] and heading [rad] at arc lengths [m], in any order; held at both ends."""
    return _interpolate_poses(s, path.s, path.xy, path.heading)


def sample_nodes(path: Path, spacing: float) -> FloatArray:
    """[N] arc lengths [m] from 0 to the very end, about `spacing` apart."""
    return sample_evenly(path.length, max(2, round(path.length / spacing) + 1))


@compiled
def to_cosines(poses: FloatArray) -> FloatArray:
    """[4, N] x, y, cosine and sine of the heading of poses [N, 3]."""
    rows = np.empty((4, len(poses)))
    for n in range(len(poses)):
        rows[0, n], rows[1, n] = poses[n, 0], poses[n, 1]
        rows[2, n], rows[3, n] = np.cos(poses[n, 2]), np.sin(poses[n, 2])
    return rows


@compiled
def _interpolate_poses(
    s: FloatArray, nodes: FloatArray, xy: FloatArray, heading: FloatArray
) -> FloatArray:
    poses, last, k = np.empty((len(s), 3)), len(nodes) - 1, 0
    step = nodes[last] / last
    for n in range(len(s)):
        at = min(max(s[n], nodes[0]), nodes[last])
        # Nodes lie evenly but for rounding.
        k = min(int(at / step), last - 1)
        while k < last - 1 and nodes[k + 1] <= at:
            k += 1
        while k > 0 and nodes[k] > at:
            k -= 1
        into, apart = at - nodes[k], nodes[k + 1] - nodes[k]
        poses[n, 0] = (xy[k + 1, 0] - xy[k, 0]) / apart * into + xy[k, 0]
        poses[n, 1] = (xy[k + 1, 1] - xy[k, 1]) / apart * into + xy[k, 1]
        poses[n, 2] = (heading[k + 1] - heading[k]) / apart * into + heading[k]
        if at == nodes[last]:
            poses[n, 0], poses[n, 1], poses[n, 2] = xy[last, 0], xy[last, 1], heading[last]
    return poses


@compiled
def find_nearest_point(xy: FloatArray, x: float, y: float) -> tuple[int, float]:
    """Find the point [N, 2] nearest to (x, y), and its distance [m]."""
    away = np.hypot(xy[:, 0] - x, xy[:, 1] - y)
    node = int(np.argmin(away))
    return node, float(away[node])
