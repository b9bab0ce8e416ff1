"""Random variation of an agent's speed about its free speed, and of walkers about their way.

The logarithm of the speed is a smooth Gaussian process over arc length. How much it wanders differs
between people. Fitted on pedestrians that never stand in five of the TrajNet++ training recordings
(biwi_hotel, crowds_students001 and 003, crowds_zara01 and 03: 550 tracks at 2.5 frames/s; research
data without a licence of its own, of which only these numbers are kept): spread 0.08 to 0.21, mean
0.15 about the mean of a track; autocorrelation in zara 0.88, 0.71, 0.52, 0.34 after 0.4, 0.8, 1.2,
1.6 s, which is that of `_LENGTH` at 1.3 m/s. In metres a second, and over seconds, slow walkers
wander as much as fast ones: within 3 s the speed has a range of 0.12 to 0.20 m/s in the median, at
any mean speed (zara, hotel, K729). Of vehicles and riders the spread is assumed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from scenewright.geometry.spline import DENSE, PER_INTERVAL, compute_spline_matrix
from scenewright.scene.base import RIDERS, FloatArray
from scenewright.scene.candidates import PACE_STEP

_SPREAD = {"pedestrian": (0.13, 0.45), "rider": (0.06, 0.3), "vehicle": (0.05, 0.3)}
"""Of the logarithm of the speed: median over people, and how that varies between them [log]."""
_MOST_SPREAD = 0.25
_WALK, _SLOWER = 1.3, (0.75, 1.7)
"""Speed of which the figures of walkers are [m/s], and how much more often and further, of their
speed, slower ones wander."""
_LENGTH = {"pedestrian": 1.4, "rider": 8.0, "vehicle": 14.0}
"""Over which speeds are alike [m]: about 1.1 s of walking, 1.5 s of riding and driving."""


def sample_pace(
    kind: str, length: float, rng: np.random.Generator, *, speeds: FloatArray
) -> Callable[[int], tuple[float, ...]]:
    """Draw a course of the share of the free speed, every `PACE_STEP` over a way [m], by index.

    Args:
        speeds: [size] free speeds [m/s].
    """
    group, size = "rider" if kind in RIDERS else kind, len(speeds)
    slower = np.clip(_WALK / speeds, *_SLOWER) if kind == "pedestrian" else np.ones(size)
    median, varies = _SPREAD[group]
    spread = np.minimum(median * np.exp(varies * rng.standard_normal(size)), _MOST_SPREAD)
    count = int(length / PACE_STEP) + 2
    smoother = build_smoother(_LENGTH[group] / PACE_STEP)
    noise = rng.standard_normal((size, int(count * slower.max()) + len(smoother)))

    def compute(m: int) -> tuple[float, ...]:
        wander = smooth_noise(smoother, noise[m])
        places = slower[m] * np.arange(count)
        pace = np.exp(slower[m] * spread[m] * np.interp(places, np.arange(len(wander)), wander))
        return tuple(pace.round(4).tolist())

    return compute


def smooth_noise(smoother: FloatArray, noise: FloatArray) -> FloatArray:
    """Compute the process [m - w + 1] that white noise [m] becomes, within two of its spreads."""
    wander = np.convolve(noise, smoother, mode="valid")
    return np.minimum(np.maximum(wander, -2.0), 2.0)


@lru_cache(maxsize=64)
def build_smoother(length: float) -> FloatArray:
    """[w] takes white noise to a process of variance 1 that is alike over so many steps."""
    reach = int(np.ceil(3.0 * length))
    # A kernel narrower by the root of 2 than the autocorrelation that it brings about.
    kernel = np.exp(-np.square(np.arange(-reach, reach + 1) / length))
    return np.asarray(kernel / np.sqrt(np.square(kernel).sum()))


_ASIDE_SPREAD, _VARIES, _MOST = 0.22, 0.45, 0.35
"""Of the offset before its spline is taken off: median over people [m] and how that varies between
them [log]; what is left of it is no more than the last [m]."""
_ASIDE_LENGTH = 2.2
"""Over which offsets are alike [m]."""


def sample_lateral_wander(
    length: float, rng: np.random.Generator, *, size: int
) -> Callable[[int], FloatArray]:
    """Draw courses [DENSE] of the offset to the left [m] over a way of this length, by index."""
    spread = _ASIDE_SPREAD * np.exp(_VARIES * rng.standard_normal(size))
    smoother = build_smoother(round(_ASIDE_LENGTH / max(length, 5.0) * (DENSE - 1), 1))
    noise = rng.standard_normal((size, DENSE + len(smoother) - 1))

    def compute(m: int) -> FloatArray:
        offset = spread[m] * smooth_noise(smoother, noise[m])
        aside = offset - compute_spline_matrix() @ offset[::PER_INTERVAL]
        return np.asarray(aside * min(1.0, _MOST / np.abs(aside).max()))

    return compute
