"""Distances between oriented footprints, many at a time.

A footprint is a rectangle widened by a radius: vehicles have radius 0, pedestrians a rectangle of
no extent. One formula then covers all pairs of classes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.tools.relation_checker.motion import Mover

IntArray = np.ndarray[tuple[int, ...], np.dtype[np.intp]]
BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


@dataclass(frozen=True, eq=False)
class Extent:
    """Sizes of one footprint per row, or one for all rows: half length, half width, radius [m]."""

    length: FloatArray | float
    width: FloatArray | float
    radius: FloatArray | float

    def rows(self, k: IntArray) -> Extent:
        """The extents of chosen rows."""
        length, width, radius = (np.asarray(v)[k] for v in (self.length, self.width, self.radius))
        return Extent(length, width, radius)


def extent(mover: Mover) -> Extent:
    """The extent of a mover's footprint."""
    return Extent(mover.half_length, mover.half_width, mover.radius)


def extents(movers: Sequence[Mover]) -> Extent:
    """The extents of many movers, one row each."""
    table = np.array([(m.half_length, m.half_width, m.radius) for m in movers]).reshape(-1, 3)
    return Extent(table[:, 0], table[:, 1], table[:, 2])


def gap(
    xy: FloatArray,
    heading: FloatArray,
    size: Extent,
    *,
    other_xy: FloatArray,
    other_heading: FloatArray,
    other_size: Extent,
) -> FloatArray:
    """Signed distance between two footprints, row by row.

    Two convex polygons apart from one another are nearest at a corner of one of them, so the least
    distance of the eight corners to the other rectangle is exact. Two rectangles overlap if none of
    their four side directions separates them; then the value is minus the least penetration.

    Args:
        xy, other_xy: [n, 2] centres [m]; heading, other_heading: [n] [rad].

    Returns:
        [n] metres; <= 0 means contact.
    """
    a, b = pose(xy, heading, size), pose(other_xy, other_heading, other_size)
    seen, back = _in_frame(a, b), _in_frame(b, a)
    separation = _separation(a, b, seen, back)
    apart = np.minimum(
        _corner_distance(seen, size, other_size), _corner_distance(back, other_size, size)
    )
    return np.asarray(np.where(separation < 0, separation, apart) - size.radius - other_size.radius)


@dataclass(frozen=True, eq=False)
class Pose:
    """Footprints in place: centres x, y [m], direction (cos, sin) of the heading, and sizes."""

    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    size: Extent

    def rows(self, k: IntArray) -> Pose:
        """The poses of chosen rows."""
        return Pose(self.x[k], self.y[k], self.cos[k], self.sin[k], self.size.rows(k))


def pose(xy: FloatArray, heading: FloatArray, size: Extent) -> Pose:
    """Footprints at centres [..., 2] and headings [...]."""
    return Pose(xy[..., 0], xy[..., 1], np.cos(heading), np.sin(heading), size)


def touch(a: Pose, b: Pose, *, tolerance: FloatArray | float) -> BoolArray:
    """Whether two footprints touch or come within a tolerance [m]; cheaper than `gap`.

    Exact between two rectangles in contact and between a disc and anything; for rectangles that are
    apart, corner to corner, a tolerance above 0 is met a little too generously.
    """
    seen, back = _in_frame(a, b), _in_frame(b, a)
    near = a.size.radius + b.size.radius + tolerance
    apart = _separation(a, b, seen, back) > near
    for place, box, disc in ((seen, a.size, b.size), (back, b.size, a.size)):
        is_disc = np.asarray(disc.radius) > 0
        if is_disc.any():
            dx = np.maximum(np.abs(place.x) - box.length, 0)
            dy = np.maximum(np.abs(place.y) - box.width, 0)
            apart |= is_disc & (dx * dx + dy * dy > near * near)
    return np.asarray(~apart)


def _in_frame(a: Pose, b: Pose) -> Pose:
    """Pose b as seen from the frame of a."""
    dx, dy = b.x - a.x, b.y - a.y
    return Pose(
        a.cos * dx + a.sin * dy,
        a.cos * dy - a.sin * dx,
        a.cos * b.cos + a.sin * b.sin,
        a.cos * b.sin - a.sin * b.cos,
        b.size,
    )


def _separation(a: Pose, b: Pose, seen: Pose, back: Pose) -> FloatArray:
    """Largest gap between the shadows of both rectangles on their side directions."""
    c, s, one, two = np.abs(seen.cos), np.abs(seen.sin), a.size, b.size
    return np.maximum(
        np.maximum(
            np.abs(seen.x) - one.length - (two.length * c + two.width * s),
            np.abs(seen.y) - one.width - (two.length * s + two.width * c),
        ),
        np.maximum(
            np.abs(back.x) - two.length - (one.length * c + one.width * s),
            np.abs(back.y) - two.width - (one.length * s + one.width * c),
        ),
    )


def _corner_distance(seen: Pose, box: Extent, other: Extent) -> FloatArray:
    """Least distance to `box` of the corners of the other rectangle, as seen from the box."""
    cos, sin = seen.cos, seen.sin
    x = np.abs(
        seen.x
        + np.multiply.outer(_ENDS, other.length * cos)
        + np.multiply.outer(_SIDES, -other.width * sin)
    )
    y = np.abs(
        seen.y
        + np.multiply.outer(_ENDS, other.length * sin)
        + np.multiply.outer(_SIDES, other.width * cos)
    )
    square = np.square(np.maximum(x - box.length, 0.0))
    square += np.square(np.maximum(y - box.width, 0.0))
    return np.asarray(np.sqrt(square.min(axis=0)))


_ENDS, _SIDES = np.array((1.0, 1.0, -1.0, -1.0)), np.array((1.0, -1.0, 1.0, -1.0))
"""The four corners of a rectangle: front or rear, left or right."""


def corners(xy: FloatArray, heading: FloatArray, *, length: float, width: float) -> FloatArray:
    """[n, 4, 2] corners of rectangles, counter-clockwise from the front left [m]."""
    cos, sin = np.cos(heading), np.sin(heading)
    along = np.stack((cos, sin), axis=-1) * (length / 2)
    across = np.stack((-sin, cos), axis=-1) * (width / 2)
    front, rear = xy + along, xy - along
    return np.stack((front + across, rear + across, rear - across, front - across), axis=-2)


def angle_between(first: FloatArray, second: FloatArray) -> FloatArray:
    """Unsigned angle between directions [rad], 0 to pi."""
    return np.abs(np.remainder(first - second + np.pi, 2 * np.pi) - np.pi)
