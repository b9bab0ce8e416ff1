"""Speed, acceleration and jerk of tracks, by one definition for every source.

As SEMANTICS section 5 has it: at 0.1 s, velocity is the central difference of positions over 0.2 s
and speed its length; acceleration is the central difference of speed, averaged over 0.3 s. Jerk,
which section 5 does not know, is the same derivative of acceleration. Written apart from the
checker, which must not share code with what it checks; a test holds both to the same figures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.geometry.polyline import smooth_gaussian
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP

EDGE = 5
"""Samples at either end of a track without a full window for the jerk: 1 + 2 + 2."""


@dataclass(frozen=True, eq=False)
class Kinematics:
    """What one agent did at the samples that have full windows.

    Attributes:
        first: sample of the track that entry 0 belongs to.
        speed: [T'] [m/s]; acceleration: [T'] of the speed [m/s^2]; jerk: [T'] [m/s^3].
    """

    first: int
    speed: FloatArray
    acceleration: FloatArray
    jerk: FloatArray

    def __len__(self) -> int:
        return len(self.speed)


def compute_kinematics(xy: FloatArray, *, smoothing: float = 0.0) -> Kinematics:
    """Speed, acceleration and jerk of positions [T, 2] every 0.1 s; T' = max(T - 10, 0).

    Args:
        smoothing: standard deviation of a Gaussian over time that goes over the positions first
            [s]; 0 for none. Two of them more are left out at either end where it is used.
    """
    xy, cut = smooth(xy, smoothing), count_edge_samples(smoothing)
    speed = np.hypot(*((xy[2:] - xy[:-2]) / (2 * STEP)).T)
    acceleration = _rate(speed)
    jerk = _rate(acceleration)
    kept = max(len(jerk) - 2 * cut, 0)
    return Kinematics(
        EDGE + cut,
        speed[4:-4][cut : cut + kept],
        acceleration[2:-2][cut : cut + kept],
        jerk[cut : cut + kept],
    )


def count_edge_samples(smoothing: float) -> int:
    """Samples at either end that lack half their smoothing."""
    return max(int(np.ceil(2 * smoothing / STEP - 1e-9)), 0)


def _rate(values: FloatArray) -> FloatArray:
    """[T - 4] central difference averaged over 0.3 s, where the window is full.

    The mean of three neighbouring central differences is (x[2] + x[1] - x[-1] - x[-2]) / 0.6 s.
    """
    if len(values) < 5:
        return np.zeros(0)
    return np.asarray((values[4:] + values[3:-1] - values[1:-3] - values[:-4]) / (6 * STEP))


def smooth(xy: FloatArray, smoothing: float) -> FloatArray:
    """Positions under a Gaussian; beyond the ends the way goes on as it was (odd reflection).

    Args:
        smoothing: its standard deviation over time [s]; 0 leaves the positions as they are.
    """
    width = count_edge_samples(smoothing) * 2
    if smoothing <= 0 or len(xy) < 2:
        return xy
    padded = np.pad(xy, ((width, width), (0, 0)), mode="reflect", reflect_type="odd")
    even = smooth_gaussian(padded, smoothing / STEP)
    return np.asarray(even[width : width + len(xy)])


def differentiate(values: FloatArray, step: float) -> FloatArray:
    """The rate of change [T, 2] of samples [T, 2] `step` seconds apart, by central differences.

    A single sample has the rate 0.
    """
    if len(values) < 2:
        return np.zeros_like(values)
    return np.asarray(np.gradient(values, step, axis=0))
