"""Smoothing is that of scipy, to the last bit."""

import numpy as np
import pytest
from scipy import ndimage

from scenewright.geometry.polyline import smooth_gaussian


@pytest.mark.parametrize("count", [2, 5, 50, 333])
@pytest.mark.parametrize("sigma", [0.5, 1.5, 3.0, 7.3])
def test_smoothing_is_scipys_with_ends_held(count: int, sigma: float) -> None:
    line = np.random.default_rng(count).normal(size=(count, 2)).cumsum(axis=0)

    expected = ndimage.gaussian_filter1d(line, sigma, axis=0, mode="nearest")

    assert np.array_equal(smooth_gaussian(line, sigma), expected)
