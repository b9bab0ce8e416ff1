"""Our clamped spline against that of scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from scenewright.geometry.spline import interpolate_clamped


@pytest.mark.parametrize("count", [2, 3, 5, 20])
def test_a_clamped_spline_is_that_of_scipy(count: int) -> None:
    rng = np.random.default_rng(count)
    known, values = np.sort(rng.uniform(0.0, 10.0, count)), rng.normal(size=count)
    x = np.linspace(known[0], known[-1], 101)
    theirs = CubicSpline(known, values, bc_type="clamped")(x)
    assert interpolate_clamped(x, known, values) == pytest.approx(theirs, abs=1e-12)
