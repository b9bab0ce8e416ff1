"""Waypoints that leave their own lane for another's: lane changes and drifts over the centre.

p_wp is fitted on agents that keep to their lanes; a sideswipe or a head-on needs one that does not.
The candidate blends two samples of the prior along the path, so that both ends lie where traffic
drives; its NLL under p_wp is what it is, and is reported.
"""

from __future__ import annotations

import numpy as np

from scenewright.geometry.polyline import resample_to_count
from scenewright.geometry.spline import DENSE, compute_dense_curves
from scenewright.scene.base import FloatArray

_BEGIN, _SPAN = (0.15, 0.45), (0.22, 0.34)
"""Where the lane is left, and over how much of the path [share of the path]."""


def sample_lane_departures(
    own: FloatArray, other: FloatArray, rng: np.random.Generator, *, reverse: bool
) -> FloatArray:
    """Waypoints [M, K, 2] that start on `own` and go over to `other` (driven backwards if asked).

    Candidates whose two samples lie on the same lane (less than 2 m apart) are paired with the
    farthest sample of the other instead.
    """
    targets = other[:, ::-1] if reverse else other
    result = []
    for waypoints in own:
        apart = np.abs(targets - waypoints).sum(axis=2)[:, 3:7].mean(axis=1)
        wide = np.nonzero(apart > 2.0)[0]
        pick = int(rng.choice(wide)) if len(wide) else int(np.argmax(apart))
        first, second = (compute_dense_curves(each[None])[0] for each in (waypoints, targets[pick]))
        begin, span = rng.uniform(*_BEGIN), rng.uniform(*_SPAN)
        x = np.clip((np.linspace(0, 1, DENSE) - begin) / span, 0.0, 1.0)
        share = (x**3 * (10 - 15 * x + 6 * x**2))[:, None]
        blended = first * (1 - share) + second * share
        result.append(resample_to_count(blended, len(waypoints)))
    return np.stack(result)
