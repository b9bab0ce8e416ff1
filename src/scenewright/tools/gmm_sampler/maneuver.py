"""Waypoints that leave their own lane for another's: lane changes and drifts over the centre.

p_wp is fitted on people who keep to their lanes; a sideswipe or a head-on needs one who does not.
The drifting candidate blends two samples of the prior along the way, so that both ends stay where
people drive; its NLL under p_wp is what it is, and is reported.
"""

from __future__ import annotations

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.tools.gmm_sampler.spline import DENSE, dense_curves

_BLEND = (0.22, 0.34)
"""Share of the way over which the lane is left."""

_BEGINS = (0.15, 0.45)


def drift(
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
        result.append(_blend(waypoints, targets[pick], rng))
    return np.stack(result)


def _blend(start: FloatArray, end: FloatArray, rng: np.random.Generator) -> FloatArray:
    fine = np.linspace(0, 1, DENSE)
    first, second = (_curve(each) for each in (start, end))
    begins, lasts = rng.uniform(*_BEGINS), rng.uniform(*_BLEND)
    x = np.clip((fine - begins) / lasts, 0.0, 1.0)
    share = (x**3 * (10 - 15 * x + 6 * x**2))[:, None]
    return _even(first * (1 - share) + second * share, len(start))


def _curve(waypoints: FloatArray) -> FloatArray:
    result: FloatArray = dense_curves(waypoints[None], None)[0]
    return result


def _even(curve: FloatArray, count: int) -> FloatArray:
    """`count` points at equal arc length on a curve [P, 2]."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=0).T))])
    s = np.linspace(0.0, length[-1], count)
    return np.column_stack([np.interp(s, length, curve[:, axis]) for axis in (0, 1)])
