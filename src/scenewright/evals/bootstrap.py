"""Bootstrap intervals: the sampled units are drawn anew with replacement."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import FloatArray


def draw_resamples(units: int, *, draws: int, seed: int = 0) -> NDArray[np.int64]:
    """[draws, units] how often each unit is in each resample."""
    rng = np.random.default_rng(seed)
    return rng.multinomial(units, np.full(units, 1 / units), size=draws)


def compute_interval(values: FloatArray) -> tuple[float, float]:
    """Compute the central 95 % of the values of all resamples."""
    low, high = np.percentile(values, (2.5, 97.5)).tolist()
    return low, high
