"""The assumed prior of crossing outside a crosswalk, which no simulated pedestrian does.

Pedestrians cross a leg roughly straight, a little askew, 15 to 40 m from the middle, beginning and
ending about two metres inside the sidewalks. Start and end are Gaussian; the waypoints in between
lie evenly on the line between them, so the prior is a Gaussian mixture like any other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenewright.geometry.spline import DENSE
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.tools.gmm_sampler.priors import WaypointPrior

_DISTANCE_SPREAD = 1.9
_SKEW_SPREAD = 1.2
_ONTO_SIDEWALK = 2.0
_SIDEWALK_SPREAD = 0.45
_WOBBLE = 0.08


def build_jaywalking_mixture(
    route: str, kerbs: Sequence[FloatArray], outwards: FloatArray
) -> WaypointPrior:
    """p_wp of jaywalking from kerb to kerb [2, 2] at given places, equally likely."""
    ends = []
    for first, last in kerbs:
        across = (last - first) / float(np.hypot(*(last - first)))
        onto = _ONTO_SIDEWALK * across
        ends.append(np.concatenate([first - onto, last + onto]))
    along, aside = np.outer(outwards, outwards), _SIDEWALK_SPREAD**2 * np.outer(across, across)
    shared, own = _DISTANCE_SPREAD**2 * along, (_SKEW_SPREAD**2 / 2) * along + aside
    of_ends = np.block([[shared + own, shared], [shared, shared + own]])
    line = _build_interpolation(K)
    factor = np.linalg.cholesky(line @ of_ends @ line.T + _WOBBLE**2 * np.eye(2 * K))
    return WaypointPrior(
        route=route,
        weights=np.full(len(ends), 1.0 / len(ends)),
        means=np.array([line @ end for end in ends]),
        cholesky=np.repeat(factor[None], len(ends), axis=0),
        base=np.array([(_build_interpolation(DENSE) @ end).reshape(DENSE, 2) for end in ends]),
        tracks=0,
    )


def _build_interpolation(count: int) -> FloatArray:
    """[2 count, 4] points evenly between a start and an end, as a linear map of both."""
    t = np.linspace(0.0, 1.0, count)
    return np.asarray(np.kron(np.stack([1 - t, t], axis=1), np.eye(2)), dtype=np.float64)
