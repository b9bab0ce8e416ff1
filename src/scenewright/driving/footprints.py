"""Whether footprints overlap: rectangles, and the discs of pedestrians."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import FloatArray


def find_overlaps(
    xy: FloatArray,
    heading: FloatArray,
    size: FloatArray,
    other_xy: FloatArray,
    other_heading: FloatArray,
    other_size: FloatArray,
    other_is_disc: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Whether one rectangle touches others.

    Args:
        xy, heading, size: [..., 2] centre, [...] direction and [2] length and width of the one.
        other_xy, other_heading: [..., 2] and [...] of the others, of the same or a shape that
            broadcasts; other_size: [..., 2]; other_is_disc: [...] discs of diameter length.

    Returns:
        [...] bool.
    """
    delta = other_xy - xy
    along, across = _turn(delta, heading)
    half, other_half = size / 2, other_size / 2
    radius = other_half[..., 0]
    outside = np.hypot(
        np.maximum(np.abs(along) - half[0], 0.0), np.maximum(np.abs(across) - half[1], 0.0)
    )
    turn = other_heading - heading
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    length, width = other_half[..., 0], other_half[..., 1]
    back, side = _turn(delta, other_heading)
    apart = (
        (np.abs(along) > half[0] + c * length + s * width)
        | (np.abs(across) > half[1] + s * length + c * width)
        | (np.abs(back) > length + c * half[0] + s * half[1])
        | (np.abs(side) > width + s * half[0] + c * half[1])
    )
    return np.asarray(np.where(other_is_disc, outside <= radius, ~apart))


def _turn(delta: FloatArray, heading: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Vectors along a direction and to the left of it."""
    c, s = np.cos(heading), np.sin(heading)
    x, y = delta[..., 0], delta[..., 1]
    return x * c + y * s, y * c - x * s
