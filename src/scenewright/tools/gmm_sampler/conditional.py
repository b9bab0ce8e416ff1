"""p_wp of the rest of a way, given the part of it that was seen.

How far to the left of a component's mean curve a path runs is, to first order, linear in its
waypoints (paper Eq. 3), so a mixture of Gaussians stays one when some of it is seen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.tools.gmm_sampler.priors import DIMENSIONS, WaypointPrior
from scenewright.tools.gmm_sampler.spline import DENSE, dense_curves, spline_matrix, tangents

NOISE = 0.10
"""How far a position that was seen lies off a spline through waypoints [m]."""
APART = 0.5
"""Positions closer than this to the last that counts say nothing more [m]: who stands is seen at
one place, however long."""


def given(prior: WaypointPrior, seen: FloatArray) -> WaypointPrior:
    """The prior of a route once some positions of an agent are known.

    Only how far they lie to the left of the mean curves counts: how far along they are is a matter
    of when. Positions before the first waypoint of a component or beyond its last say nothing: all
    are weighed by the same.

    Args:
        seen: [n, 2] positions on the way, in the order of time [m].

    Returns:
        The same components, their weights, means, covariances and mean curves as the positions
        leave them.
    """
    telling = _telling(prior, seen)
    updated = [_component(prior, c, telling) for c in range(len(prior.weights))]
    means = np.array([mean for mean, _, _ in updated])
    logs = np.log(prior.weights) + np.array([evidence for _, _, evidence in updated])
    weights = np.exp(logs - logs.max())
    shift = (means - prior.means).reshape(-1, K, 2)
    return replace(
        prior,
        weights=weights / weights.sum(),
        means=means,
        cholesky=np.linalg.cholesky(np.array([spread for _, spread, _ in updated])),
        base=prior.base + dense_curves(shift, None),
    )


def _telling(prior: WaypointPrior, seen: FloatArray) -> FloatArray:
    """[m, 2] the positions that lie apart and beside every component's mean curve."""
    kept: list[FloatArray] = []
    for place in seen:
        if not kept or float(np.hypot(*(place - kept[-1]))) >= APART:
            kept.append(place)
    apart = np.array(kept).reshape(-1, 2)
    nearest = np.array([_nearest(base, apart) for base in prior.base])
    inside = ((nearest > 0) & (nearest < DENSE - 1)).all(axis=0)
    return np.asarray(apart[inside])


def _nearest(base: FloatArray, seen: FloatArray) -> NDArray[np.intp]:
    """[n] the point of a curve [DENSE, 2] that is nearest to each position."""
    away = np.hypot(*(seen[:, None] - base[None]).transpose(2, 0, 1))
    return np.asarray(away.argmin(axis=1))


def _component(
    prior: WaypointPrior, c: int, seen: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Mean [20] and covariance [20, 20] of a component given positions, and their log density."""
    mean, spread = prior.means[c], prior.cholesky[c] @ prior.cholesky[c].T
    left, rows = _beside(prior.base[c], seen)
    if len(left) == 0:
        return mean, spread, 0.0
    between = rows @ spread @ rows.T + NOISE**2 * np.eye(len(left))
    gain = np.linalg.solve(between, rows @ spread).T
    posterior = spread - gain @ rows @ spread
    _, size = np.linalg.slogdet(between)
    square = float(left @ np.linalg.solve(between, left))
    evidence = -0.5 * (square + size + len(left) * np.log(2 * np.pi))
    return mean + gain @ left, 0.5 * (posterior + posterior.T), float(evidence)


def _beside(base: FloatArray, seen: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far to the left of a mean curve positions lie [m], and [n, 20] what that is in waypoints.

    Each is measured where the curve [DENSE, 2] is nearest.
    """
    nearest = _nearest(base, seen)
    ahead = tangents(base)[nearest]
    normal = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    left = ((seen - base[nearest]) * normal).sum(axis=1)
    rows = np.einsum("nk,nd->nkd", spline_matrix()[nearest], normal)
    return left, rows.reshape(len(left), DIMENSIONS)
