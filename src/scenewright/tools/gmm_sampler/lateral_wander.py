"""How walkers sway about their way, between the waypoints that p_wp draws.

The offset to the side is a smooth Gaussian process over arc length, less its spline through the
waypoints, so that a path still passes through them. Fitted on pedestrians who walk straight for
8 s in recordings (biwi_hotel, crowds_zara01 and 03, 250 tracks; research data without a licence of
its own, of which only these numbers are kept): about their course over 2 s their offset has a
spread of 0.07 to 0.09 m, which varies between people as below, and an autocorrelation of 0.76
after 0.8 s and 0.2 after 1.6 s. 12 pedestrians of TAF-BW's K729 have 0.09 m.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from scenewright.geometry.spline import DENSE, PER_INTERVAL, compute_spline_matrix
from scenewright.scene.base import FloatArray
from scenewright.tools.gmm_sampler.speed_wander import build_smoother, smooth_noise

_SPREAD, _VARIES, _MOST = 0.22, 0.45, 0.35
"""Of the offset before its spline is taken off: median over people [m] and how that varies between
them [log]; what is left of it is no more than the last [m]."""
_LENGTH = 2.2
"""Over which offsets are alike [m]."""


def sample_lateral_wander(
    length: float, rng: np.random.Generator, *, size: int
) -> Callable[[int], FloatArray]:
    """Draw courses [DENSE] of the offset to the left [m] over a way of this length, by index."""
    spread = _SPREAD * np.exp(_VARIES * rng.standard_normal(size))
    smoother = build_smoother(round(_LENGTH / max(length, 5.0) * (DENSE - 1), 1))
    noise = rng.standard_normal((size, DENSE + len(smoother) - 1))

    def compute(m: int) -> FloatArray:
        offset = spread[m] * smooth_noise(smoother, noise[m])
        aside = offset - compute_spline_matrix() @ offset[::PER_INTERVAL]
        return np.asarray(aside * min(1.0, _MOST / np.abs(aside).max()))

    return compute
