"""Positions at other times: not every recording has the network's step."""

from __future__ import annotations

import numpy as np

from scenewright.scene.base import FloatArray


def interpolate_at_times(xy: FloatArray, given: FloatArray, wanted: FloatArray) -> FloatArray:
    """Positions in between, on straight lines.

    Args:
        xy: [N, T, 2] positions [m], NaN where unseen; given: [T] their times [s], ascending.
        wanted: [W] times [s] within those given.

    Returns:
        [N, W, 2]; NaN between two positions of which one is unseen.
    """
    low = np.clip(np.searchsorted(given, wanted + 1e-9) - 1, 0, len(given) - 2)
    share = ((wanted - given[low]) / (given[low + 1] - given[low]))[:, None]
    first, second = xy[:, low], xy[:, low + 1]
    between = np.where(share < 1e-6, first, (1.0 - share) * first + share * second)
    return np.asarray(np.where(share > 1.0 - 1e-6, second, between))


def compute_times_around_now(count: int, *, before: int, step: float) -> FloatArray:
    """[count] times [s] of samples every `step`, of which sample `before` is now."""
    return np.asarray(step * (np.arange(count) - before), dtype=np.float64)
