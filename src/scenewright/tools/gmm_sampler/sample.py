"""Drawing from the priors, and how likely what was drawn is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.tools.gmm_sampler.priors import DIMENSIONS, CountPrior, Priors, WaypointPrior


def sample_waypoints(prior: WaypointPrior, rng: np.random.Generator, *, size: int) -> FloatArray:
    """[size, K, 2] draws from p_wp of a route [m] (paper Eq. 2)."""
    chosen = prior.cumulated.searchsorted(rng.random(size), side="right")
    noise = rng.standard_normal((size, DIMENSIONS))
    return _drawn(chosen, noise, prior.means, prior.cholesky).reshape(size, K, 2)


@compiled
def _drawn(
    chosen: NDArray[np.intp], noise: FloatArray, means: FloatArray, cholesky: FloatArray
) -> FloatArray:
    """[m, 20] of components chosen [m] and standard normal numbers [m, 20]."""
    drawn = np.empty((len(chosen), DIMENSIONS))
    for m in range(len(chosen)):
        c = chosen[m]
        for i in range(DIMENSIONS):
            away = 0.0
            for j in range(i + 1):
                away += cholesky[c, i, j] * noise[m, j]
            drawn[m, i] = means[c, i] + away
    return drawn


def waypoint_nll(prior: WaypointPrior, waypoints: FloatArray) -> FloatArray:
    """[m] -log p_wp of waypoints [m, K, 2] in metres [nats] (paper Eq. 4, SEMANTICS section 6)."""
    return nll_and_component(prior, waypoints)[0]


def nll_and_component(
    prior: WaypointPrior, waypoints: FloatArray
) -> tuple[FloatArray, NDArray[np.intp]]:
    """[m] -log p_wp [nats], and [m] the component that each of waypoints [m, K, 2] fits best."""
    logs = component_log_densities(prior, waypoints)
    return np.asarray(-np.logaddexp.reduce(logs, axis=1)), logs.argmax(axis=1)


def component_log_densities(prior: WaypointPrior, waypoints: FloatArray) -> FloatArray:
    """[m, C] log of weight times density of each component [nats]."""
    points = waypoints.reshape(-1, DIMENSIONS)
    return _log_densities(points, prior.means, prior.whitening, prior.log_scale)


@compiled
def _log_densities(
    points: FloatArray, means: FloatArray, whitening: FloatArray, log_scale: FloatArray
) -> FloatArray:
    logs = np.empty((len(points), len(means)))
    for m in range(len(points)):
        for c in range(len(means)):
            square = 0.0
            for i in range(DIMENSIONS):
                white = 0.0
                for j in range(i + 1):  # as the Cholesky factors, their inverses are lower
                    white += whitening[c, i, j] * (points[m, j] - means[c, j])
                square += white * white
            logs[m, c] = log_scale[c] - 0.5 * square
    return logs


def sample_count(
    priors: Priors, rng: np.random.Generator, *, hour: int, instant: bool = False
) -> tuple[int, int]:
    """How many vehicles and pedestrians a 30 s scene holds at this hour of the day (p_tod).

    With `instant`, how many are present at one moment of it.
    """
    mass = _hour(priors, hour, instant).mass
    cell = int(rng.choice(mass.size, p=mass.ravel()))
    return cell // mass.shape[1], cell % mass.shape[1]


def count_nll(
    priors: Priors, *, hour: int, vehicles: int, pedestrians: int, instant: bool = False
) -> float:
    """-log p_tod of both counts [nats]; infinite beyond six standard deviations."""
    mass = _hour(priors, hour, instant).mass
    if min(vehicles, pedestrians) < 0 or vehicles >= mass.shape[0] or pedestrians >= mass.shape[1]:
        return float("inf")
    return float(-np.log(mass[vehicles, pedestrians]))


def total_mass(priors: Priors, *, hour: int, instant: bool = False) -> FloatArray:
    """[N] probability of each total number of agents (paper 3.2), vehicles and pedestrians."""
    mass = _hour(priors, hour, instant).mass
    total = np.add.outer(np.arange(mass.shape[0]), np.arange(mass.shape[1]))
    return np.asarray(np.bincount(total.ravel(), weights=mass.ravel()), dtype=np.float64)


def _hour(priors: Priors, hour: int, instant: bool) -> CountPrior:
    hours = priors.instants if instant else priors.counts
    if not 0 <= hour < len(hours):
        raise InputError(f"an hour of the day is 0 to {len(hours) - 1}, got {hour}")
    return hours[hour]
