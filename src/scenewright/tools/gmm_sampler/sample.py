"""Samples of the priors, and their likelihood."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.errors import InputError
from scenewright.geometry.spline import build_spline_path
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K, Path
from scenewright.tools.gmm_sampler.priors import DIMENSIONS, CountPrior, Priors, WaypointPrior

Draws = tuple[FloatArray, FloatArray, NDArray[np.intp]]
"""Waypoints [m, K, 2] [m], their -log p_wp [m] and the component [m] that each fits best."""


def sample_waypoints(prior: WaypointPrior, rng: np.random.Generator, *, size: int) -> FloatArray:
    """[size, K, 2] draws from p_wp of a route [m] (paper Eq. 2)."""
    chosen = prior.cumulative_weights.searchsorted(rng.random(size), side="right")
    noise = rng.standard_normal((size, DIMENSIONS))
    return combine(chosen, noise, prior.means, prior.cholesky)


@compiled
def combine(
    chosen: NDArray[np.intp], noise: FloatArray, means: FloatArray, cholesky: FloatArray
) -> FloatArray:
    """[m, K, 2] of components chosen [m] and standard normal numbers [m, 20]."""
    drawn = np.empty((len(chosen), K, 2))
    for m in range(len(chosen)):
        c = chosen[m]
        for i in range(DIMENSIONS):
            away = 0.0
            for j in range(i + 1):
                away += cholesky[c, i, j] * noise[m, j]
            drawn[m, i // 2, i % 2] = means[c, i] + away
    return drawn


def compute_waypoint_nll(prior: WaypointPrior, waypoints: FloatArray) -> FloatArray:
    """[m] -log p_wp of waypoints [m, K, 2] in metres [nats] (paper Eq. 4, SEMANTICS section 6)."""
    return score_waypoints(prior, waypoints)[0]


def score_waypoints(
    prior: WaypointPrior, waypoints: FloatArray
) -> tuple[FloatArray, NDArray[np.intp]]:
    """[m] -log p_wp [nats], and [m] the component that each of waypoints [m, K, 2] fits best."""
    points = waypoints.reshape(-1, DIMENSIONS)
    return _score(points, prior.means, prior.whitening, prior.log_scale)


@compiled
def _score(
    points: FloatArray, means: FloatArray, whitening: FloatArray, log_scale: FloatArray
) -> tuple[FloatArray, NDArray[np.intp]]:
    nll, component = np.full(len(points), np.inf), np.empty(len(points), np.intp)
    for m in range(len(points)):
        most = -np.inf
        for c in range(len(means)):
            square = 0.0
            for i in range(DIMENSIONS):
                white = 0.0
                for j in range(i + 1):  # as the Cholesky factors, their inverses are lower
                    white += whitening[c, i, j] * (points[m, j] - means[c, j])
                square += white * white
            log = log_scale[c] - 0.5 * square
            nll[m] = -np.logaddexp(-nll[m], log)
            if log > most or c == 0:
                most, component[m] = log, c
    return nll, component


def build_paths(prior: WaypointPrior, waypoints: FloatArray) -> list[Path]:
    """The paths through waypoints [m, K, 2], each about its likeliest component's base curve."""
    _, chosen = score_waypoints(prior, waypoints)
    return [build_path(prior, each, int(c)) for each, c in zip(waypoints, chosen, strict=True)]


def build_path(
    prior: WaypointPrior, waypoints: FloatArray, component: int, aside: FloatArray | None = None
) -> Path:
    """The path through waypoints [K, 2] about the base curve of one component.

    Args:
        aside: [DENSE] offsets to the left of it between the waypoints [m].
    """
    return build_spline_path(waypoints, base=prior.base[component], aside=aside)


def sample_count(priors: Priors, rng: np.random.Generator, *, hour: int) -> tuple[int, int]:
    """Draw how many vehicles and pedestrians a 30 s scene holds at this hour of the day (p_tod)."""
    mass = _get_count_prior(priors, hour).mass
    cell = int(rng.choice(mass.size, p=mass.ravel()))
    return cell // mass.shape[1], cell % mass.shape[1]


def compute_count_nll(priors: Priors, *, hour: int, vehicles: int, pedestrians: int) -> float:
    """-log p_tod of both counts [nats]; infinite beyond six standard deviations."""
    mass = _get_count_prior(priors, hour).mass
    if min(vehicles, pedestrians) < 0 or vehicles >= mass.shape[0] or pedestrians >= mass.shape[1]:
        return float("inf")
    return float(-np.log(mass[vehicles, pedestrians]))


def compute_total_mass(priors: Priors, *, hour: int) -> FloatArray:
    """[N] probability of each total number of agents (paper 3.2), vehicles and pedestrians."""
    mass = _get_count_prior(priors, hour).mass
    total = np.add.outer(np.arange(mass.shape[0]), np.arange(mass.shape[1]))
    return np.asarray(np.bincount(total.ravel(), weights=mass.ravel()), dtype=np.float64)


def _get_count_prior(priors: Priors, hour: int) -> CountPrior:
    if not 0 <= hour < len(priors.counts):
        raise InputError(f"an hour of the day is 0 to {len(priors.counts) - 1}, got {hour}")
    return priors.counts[hour]
