"""Whether arrays that a bundle's file holds can be priors at all."""

from __future__ import annotations

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.tools.gmm_sampler.priors import DIMENSIONS, HOURS, Priors, WaypointPrior

FARTHEST = 10_000.0
"""No path of an intersection leads further from its middle [m]."""
MOST_AGENTS = 1_000.0
"""So many are never there at once."""


def check_priors(priors: Priors) -> None:
    """Raises ValueError for the first prior that cannot be one."""
    for route, waypoints in priors.waypoints.items():
        _check_waypoints(route, waypoints)
    for counts in priors.counts:
        count = len(counts.weights)
        shapes = counts.means.shape == (count, 2) and counts.covariances.shape == (count, 2, 2)
        _demand(count > 0 and shapes, "counts of agents are of other shapes")
        _check_weights("counts", counts.weights)
        positive = bool((np.linalg.eigvalsh(counts.covariances) > 0.0).all())
        _demand(positive, "spread of counts is none")
        spread = np.sqrt(np.diagonal(counts.covariances, axis1=1, axis2=2))
        most = float((np.abs(counts.means) + 6 * spread).max())
        _demand(most <= MOST_AGENTS, f"counts of {most:.3g} agents")
    hours = len(priors.counts)
    _demand(hours == HOURS, f"counts of {hours} hours, not of {HOURS}")
    for route, profile in priors.driving_profiles.items():
        parts = (profile.median, profile.spread, profile.low, profile.high)
        same = all(part.shape == (4,) for part in parts)
        _demand(same, f"profile of {route} is of another shape")
        ordered = (profile.low > 0.0) & (profile.low < profile.high) & (profile.high <= 100.0)
        fine = bool((ordered & (profile.median > 0.0) & (profile.spread > 0.0)).all())
        _demand(fine, f"speeds and accelerations of {route} cannot be")
    for route, rates in priors.frequency.items():
        _demand(rates.shape == (HOURS,), f"frequency of {route} has the shape {rates.shape}")
        _demand(bool((rates >= 0.0).all()), f"frequency of {route} is negative")
    missing = set(priors.waypoints) - set(priors.driving_profiles)
    _demand(not missing, f"no driving profile of {min(missing, default='')}")
    for shares in priors.subtypes.values():
        _demand(all(share >= 0.0 for share in shares.values()), "a share of subtypes is negative")


def _check_waypoints(route: str, prior: WaypointPrior) -> None:
    count, paths = len(prior.weights), prior.base.shape
    size = prior.means.shape[-1] if prior.means.ndim == 2 else 0
    shapes = prior.means.shape == (count, size) and prior.cholesky.shape == (count, size, size)
    _demand(
        count > 0 and size == DIMENSIONS and shapes, f"waypoints of {route} are of other shapes"
    )
    dense = len(paths) == 3 and paths[0] == count and paths[1] > 1 and paths[2] == 2
    _demand(dense, f"paths of {route} have the shape {paths}")
    _check_weights(route, prior.weights)
    far = max(np.abs(prior.means).max(), np.abs(prior.base).max())
    _demand(far <= FARTHEST, f"waypoints of {route} lie {far:.3g} m away")
    scale = np.diagonal(prior.cholesky, axis1=1, axis2=2)
    wide = float(np.abs(prior.cholesky).max())
    _demand(bool((scale > 0.0).all()) and wide <= FARTHEST, f"spread of {route} is none")


def _check_weights(name: str, weights: FloatArray) -> None:
    _demand(bool((weights >= 0.0).all()) and float(weights.sum()) > 0.0, f"weights of {name}")


def _demand(holds: bool, otherwise: str) -> None:
    if not holds:
        raise ValueError(otherwise)
