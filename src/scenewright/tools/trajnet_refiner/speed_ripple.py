"""How drivers' speeds ripple from second to second, which neither priors nor the network show.

Progress along the path departs from a steady drive by a Gaussian process of time. Fitted on one of
two drone recordings of a crossroad (VTP-TL, Apache-2.0; DJI_0590_0, vehicles that go on at one
speed, 132 windows of 3.2 s): accelerations with a standard deviation of 0.234 m/s^2, jerks of
0.48 m/s^3. The tracking of vehicles that stand jitters by 0.015 m over 0.2 s, which alone would be
0.074 m/s^2 and 0.31 m/s^3; what remains, less what our vehicles have without it, is this process.
"""

from __future__ import annotations

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP

_SPREAD, _VARIES = 0.19, 0.3
"""Of the progress [m]: median over drivers, and how it varies between them [log]; the speed has
0.15 m/s, the acceleration 0.2 m/s^2."""
_MOST = 0.35
_LASTS = 1.28
"""Its autocorrelation is that of a Gaussian with this standard deviation [s]."""
_FULL = 4.0
"""Below this speed [m/s] it is less, in proportion."""


def draw_ripple(s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """[T] how far ahead of its progress `s` [T] every 0.1 s a vehicle is [m]."""
    steps = _LASTS / STEP
    reach = round(3 * steps)
    # A kernel narrower by the root of 2 than the autocorrelation that it brings about.
    kernel = np.exp(-np.square(np.arange(-reach, reach + 1) / steps))
    kernel /= np.sqrt(np.square(kernel).sum())
    own = min(_SPREAD * float(np.exp(_VARIES * rng.standard_normal())), _MOST)
    drawn = np.convolve(rng.standard_normal(len(s) + 2 * reach), kernel, mode="valid")
    speed = np.gradient(s, STEP) if len(s) > 1 else np.zeros(len(s))
    even = np.convolve(np.pad(speed, 10, mode="edge"), np.ones(21) / 21, mode="valid")
    return np.asarray(own * drawn * np.clip(even / _FULL, 0.0, 1.0))
