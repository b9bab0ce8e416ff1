"""p_wp of the rest of a path, given the part of it that was observed.

How far to the left of a component's mean curve a path runs is, to first order, linear in its
waypoints (paper Eq. 3), so a mixture of Gaussians stays one when some of it is observed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenewright.geometry.polyline import compute_normals, measure_distances
from scenewright.geometry.spline import DENSE, compute_dense_curves, compute_spline_matrix
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.tools.gmm_sampler.priors import DIMENSIONS, WaypointPrior

NOISE = 0.10
"""How far an observed position lies off a spline through waypoints [m]."""
APART = 0.5
"""Positions closer than this to the last that counts add nothing [m]: a standing agent is observed
at one place, however long."""


def condition_prior(prior: WaypointPrior, observed: FloatArray) -> WaypointPrior:
    """The prior of a route once some positions of an agent are known.

    Only how far they lie to the left of the mean curves counts: how far along they are is a matter
    of time. Positions before the first waypoint of a component or beyond its last do not count for
    any, so that all components are compared by the same.

    Args:
        observed: [n, 2] positions on the path, in the order of time [m].

    Returns:
        The same components with weights, means, covariances and mean curves updated.
    """
    used = _select_positions(prior, observed)
    updated = [_update_component(prior, c, used) for c in range(len(prior.weights))]
    means = np.array([mean for mean, _, _ in updated])
    logs = np.log(prior.weights) + np.array([evidence for _, _, evidence in updated])
    weights = np.exp(logs - logs.max())
    return replace(
        prior,
        weights=weights / weights.sum(),
        means=means,
        cholesky=np.linalg.cholesky(np.array([spread for _, spread, _ in updated])),
        base=prior.base + compute_dense_curves((means - prior.means).reshape(-1, K, 2)),
    )


def _select_positions(prior: WaypointPrior, observed: FloatArray) -> FloatArray:
    """[m, 2] the positions that lie apart and beside every component's mean curve."""
    kept: list[FloatArray] = []
    for position in observed:
        if not kept or float(np.hypot(*(position - kept[-1]))) >= APART:
            kept.append(position)
    apart = np.array(kept).reshape(-1, 2)
    nearest = np.array([_find_nearest(base, apart) for base in prior.base])
    inside = ((nearest > 0) & (nearest < DENSE - 1)).all(axis=0)
    return np.asarray(apart[inside])


def _find_nearest(base: FloatArray, positions: FloatArray) -> NDArray[np.intp]:
    """[n] the point of a curve [DENSE, 2] that is nearest to each position."""
    return np.asarray(measure_distances(positions, base).argmin(axis=1))


def _update_component(
    prior: WaypointPrior, c: int, positions: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Mean [20] and covariance [20, 20] of a component given positions, and their log density."""
    mean, spread = prior.means[c], prior.cholesky[c] @ prior.cholesky[c].T
    left, rows = _measure_offsets(prior.base[c], positions)
    if len(left) == 0:
        return mean, spread, 0.0
    between = rows @ spread @ rows.T + NOISE**2 * np.eye(len(left))
    gain = np.linalg.solve(between, rows @ spread).T
    posterior = spread - gain @ rows @ spread
    _, size = np.linalg.slogdet(between)
    square = float(left @ np.linalg.solve(between, left))
    evidence = -0.5 * (square + size + len(left) * np.log(2 * np.pi))
    return mean + gain @ left, 0.5 * (posterior + posterior.T), float(evidence)


def _measure_offsets(base: FloatArray, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Offsets of positions to the left of a mean curve [m], and [n, 20] their map from waypoints.

    Each is measured where the curve [DENSE, 2] is nearest.
    """
    nearest = _find_nearest(base, positions)
    normal = compute_normals(base)[nearest]
    left = ((positions - base[nearest]) * normal).sum(axis=1)
    rows = np.einsum("nk,nd->nkd", compute_spline_matrix()[nearest], normal)
    return left, rows.reshape(len(left), DIMENSIONS)
