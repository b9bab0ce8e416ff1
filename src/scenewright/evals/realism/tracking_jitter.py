"""How much a recording's tracking jitters, seen on vehicles that stand, and scenes seen through it.

Vehicles of a scene stand to the millimetre. Those of a recording never do, so that a classifier
tells the two apart by their tracking. With the recording's jitter on the scene's positions it has
to go by how they drive. What distorts the tracks of moving vehicles alone is not in it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenewright.evals.realism.sources import TrackSource
from scenewright.geometry.kinematics import smooth
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker import RoadUser

_STANDS = 0.15
"""Slower than this [m/s], smoothed over `_SMOOTHED`, is standing."""
_SMOOTHED = 1.0
"""Standard deviation of the Gaussian about which positions jitter [s]."""
_LEAST, _EDGE = 40, 10
"""Samples of a standstill that counts, and of either end of it that do not."""
_FEWEST = 20
"""Standstills from which on a jitter is measured."""
_LAGS = 10


@dataclass(frozen=True)
class TrackingJitter:
    """Of positions: standard deviation [m], and that of the Gaussian that makes it smooth [s]."""

    spread: float
    lasts: float


def measure_tracking_jitter(source: TrackSource) -> TrackingJitter | None:
    """Measure how positions of standing vehicles jitter; None with too few of them."""
    found = []
    for user in (user for stretch in source.stretches for user in stretch.users):
        if user.shape.type != "vehicle" or len(user.track.xy) < _LEAST:
            continue
        even = smooth(user.track.xy, _SMOOTHED)
        stands = np.hypot(*np.gradient(even, STEP, axis=0).T) < _STANDS
        edges = np.flatnonzero(np.diff(np.concatenate(([False], stands, [False]))))
        for first, last in edges.reshape(-1, 2).tolist():
            if last - first >= _LEAST:
                inside = slice(first + _EDGE, last - _EDGE)
                away = user.track.xy[inside] - even[inside]
                away, n = away - away.mean(axis=0), len(away)
                # The mean autocovariance of both coordinates [m^2], by lag.
                found.append([(away[: n - k] * away[k:]).mean() for k in range(_LAGS)])
    if len(found) < _FEWEST:
        return None
    middle = np.median(found, axis=0)
    if middle[0] <= 0.0:
        return None
    below = np.flatnonzero(middle < 0.5 * middle[0])
    half = STEP * float(below[0] if len(below) else _LAGS)
    # An autocorrelation of one half after `half`: exp(-half^2 / (4 lasts^2)).
    return TrackingJitter(float(np.sqrt(middle[0])), half / (2.0 * np.sqrt(np.log(2.0))))


def add_jitter(source: TrackSource, jitter: TrackingJitter, *, seed: int) -> TrackSource:
    """Let the positions of a source's vehicles jitter as a recording's do."""
    rng = np.random.default_rng(seed)
    reach = max(int(np.ceil(3.0 * jitter.lasts / STEP)), 1)
    kernel = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) * STEP / jitter.lasts))
    kernel *= jitter.spread / np.sqrt(np.square(kernel).sum())

    def blur(user: RoadUser) -> RoadUser:
        if user.shape.type != "vehicle":
            return user
        white = rng.standard_normal((2, len(user.track.xy) + 2 * reach))
        away = np.stack([np.convolve(each, kernel, mode="valid") for each in white], axis=1)
        return replace(user, track=replace(user.track, xy=user.track.xy + away))

    stretches = (replace(s, users=tuple(blur(u) for u in s.users)) for s in source.stretches)
    return replace(source, stretches=tuple(stretches))
