"""Distances between oriented footprints, many at a time.

A footprint is a rectangle widened by a radius: vehicles have radius 0, pedestrians a rectangle of
no extent. One formula then covers all pairs of classes.
"""

from __future__ import annotations

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray

IntArray = np.ndarray[tuple[int, ...], np.dtype[np.intp]]
BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


def compute_corners(
    xy: FloatArray, heading: FloatArray, *, length: float, width: float
) -> FloatArray:
    """[n, 4, 2] corners of rectangles, counter-clockwise from the front left [m]."""
    cos, sin = np.cos(heading), np.sin(heading)
    along = np.stack((cos, sin), axis=-1) * (length / 2)
    across = np.stack((-sin, cos), axis=-1) * (width / 2)
    front, rear = xy + along, xy - along
    return np.stack((front + across, rear + across, rear - across, front - across), axis=-2)


def compute_angle_between(first: FloatArray, second: FloatArray) -> FloatArray:
    """Unsigned angle between directions [rad], 0 to pi."""
    return np.abs(np.remainder(first - second + np.pi, 2 * np.pi) - np.pi)


def compute_offsets(
    xy: FloatArray, origin: FloatArray, heading: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """How far ahead of a place in the direction of its heading, and to the left, others lie [m].

    Args:
        xy: [..., 2] the others; origin: [..., 2] the place and heading: [...], one or for each.
    """
    east, north = np.moveaxis(xy - origin, -1, 0)
    cos, sin = np.cos(heading), np.sin(heading)
    return east * cos + north * sin, north * cos - east * sin


# ---- as machine code: one pair of footprints at a time -------------------------------------------

Box = tuple[float, float, float]
"""Half length, half width, radius [m]."""
Pose = tuple[float, float, float, float]
"""x, y [m], cosine and sine of the heading."""
Sample = tuple[float, float, float]
"""x, y [m] and heading [rad]."""


@compiled
def compute_gaps(
    xy: FloatArray,
    heading: FloatArray,
    size: Box,
    other_xy: FloatArray,
    other_heading: FloatArray,
    other_size: Box,
) -> FloatArray:
    """[n] signed distance between two footprints, row by row [m]; <= 0 means contact.

    Two convex polygons apart from one another are nearest at a corner of one of them, so the least
    distance of the eight corners to the other rectangle is exact. Two rectangles overlap if none of
    their four side directions separates them; then the value is minus the least penetration.

    Args:
        xy, heading: [n, 2] and [n] of one; of the other [n, 2] and [n], or [1, 2] and [1].
    """
    gaps = np.empty(len(heading))
    for k in range(len(gaps)):
        j = min(k, len(other_heading) - 1)
        one = make_pose(xy[k, 0], xy[k, 1], heading[k])
        two = make_pose(other_xy[j, 0], other_xy[j, 1], other_heading[j])
        gaps[k] = compute_gap(one, size, two, other_size)
    return gaps


@compiled
def make_pose(x: float, y: float, heading: float) -> Pose:
    """A place from a position [m] and a heading [rad]."""
    return x, y, np.cos(heading), np.sin(heading)


@compiled
def get_step(xy: FloatArray, heading: FloatArray, k: int) -> tuple[Sample, Sample]:
    """A sample of positions [T, 2] and headings [T], and the next one."""
    return (xy[k, 0], xy[k, 1], heading[k]), (xy[k + 1, 0], xy[k + 1, 1], heading[k + 1])


@compiled
def interpolate_pose(part: float, step: tuple[Sample, Sample]) -> Pose:
    """The place a part of the way from one sample to the next."""
    (x, y, heading), (then_x, then_y, turned) = step
    return make_pose(
        x + part * (then_x - x), y + part * (then_y - y), heading + part * (turned - heading)
    )


@compiled
def get_box(sizes: FloatArray, k: int) -> Box:
    """One of sizes [3, n] [m]."""
    return sizes[0, k], sizes[1, k], sizes[2, k]


@compiled
def compute_gap(a: Pose, a_size: Box, b: Pose, b_size: Box) -> float:
    """`compute_gaps` of one pair of footprints [m]."""
    seen, back = _transform_to_frame(a, b), _transform_to_frame(b, a)
    apart = _compute_separation(seen, back, a_size, b_size)
    if apart >= 0.0:
        square = min(
            _compute_nearest_corner(seen, a_size, b_size),
            _compute_nearest_corner(back, b_size, a_size),
        )
        apart = np.sqrt(square)
    return apart - a_size[2] - b_size[2]


@compiled
def _transform_to_frame(a: Pose, b: Pose) -> Pose:
    """Place b in the frame of place a."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    return (
        a[2] * dx + a[3] * dy,
        a[2] * dy - a[3] * dx,
        a[2] * b[2] + a[3] * b[3],
        a[2] * b[3] - a[3] * b[2],
    )


@compiled
def _compute_separation(seen: Pose, back: Pose, one: Box, two: Box) -> float:
    """Largest gap between the shadows of two rectangles on their side directions [m]."""
    c, s = abs(seen[2]), abs(seen[3])
    return max(
        abs(seen[0]) - one[0] - (two[0] * c + two[1] * s),
        abs(seen[1]) - one[1] - (two[0] * s + two[1] * c),
        abs(back[0]) - two[0] - (one[0] * c + one[1] * s),
        abs(back[1]) - two[1] - (one[0] * s + one[1] * c),
    )


@compiled
def _compute_nearest_corner(seen: Pose, box: Box, other: Box) -> float:
    """Least squared distance to `box` of the corners of the other rectangle, as seen from it."""
    least = np.inf
    for end in (1.0, -1.0):
        for side in (1.0, -1.0):
            along, across = end * other[0], side * other[1]
            dx = max(abs(seen[0] + along * seen[2] - across * seen[3]) - box[0], 0.0)
            dy = max(abs(seen[1] + along * seen[3] + across * seen[2]) - box[1], 0.0)
            least = min(least, dx * dx + dy * dy)
    return least


@compiled
def is_in_touch(a: Pose, a_size: Box, b: Pose, b_size: Box, tolerance: float) -> bool:
    """Whether two footprints touch or come within a tolerance [m]; cheaper than `compute_gaps`.

    Exact between two rectangles in contact and between a disc and anything; for rectangles that are
    apart, corner to corner, a tolerance above 0 is met a little too generously.
    """
    near = a_size[2] + b_size[2] + tolerance
    seen, back = _transform_to_frame(a, b), _transform_to_frame(b, a)
    if _compute_separation(seen, back, a_size, b_size) > near:
        return False
    return not (
        (b_size[2] > 0.0 and _is_disc_beyond(seen, a_size, near))
        or (a_size[2] > 0.0 and _is_disc_beyond(back, b_size, near))
    )


@compiled
def _is_disc_beyond(seen: Pose, box: Box, near: float) -> bool:
    """Whether the middle of a disc, as seen from a rectangle, is further from it than `near`."""
    dx, dy = max(abs(seen[0]) - box[0], 0.0), max(abs(seen[1]) - box[1], 0.0)
    return dx * dx + dy * dy > near * near


@compiled
def meets_box(start: FloatArray, end: FloatArray, place: Pose, length: float, width: float) -> bool:
    """Whether a segment touches a rectangle: none of three directions separates the two."""
    east, north = (end[0] - start[0]) / 2, (end[1] - start[1]) / 2
    x, y = (start[0] + end[0]) / 2 - place[0], (start[1] + end[1]) / 2 - place[1]
    cos, sin = place[2], place[3]
    run, rise = cos * east + sin * north, cos * x + sin * y
    side, drift = cos * north - sin * east, cos * y - sin * x
    return bool(
        abs(rise) <= length / 2 + abs(run)
        and abs(drift) <= width / 2 + abs(side)
        and abs(run * drift - side * rise) <= length / 2 * abs(side) + width / 2 * abs(run) + 1e-12
    )
