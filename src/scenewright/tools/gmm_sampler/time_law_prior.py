"""The density of time laws: how fast, and how briskly, apart from where (SEMANTICS section 6)."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from statistics import NormalDist

import numpy as np

from scenewright.compiled import compiled
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import DrivingProfile
from scenewright.tools.gmm_sampler.priors import LAW_FIELDS, DrivingProfilePrior, Priors


def sample_driving_profiles(
    priors: Priors, route: str, rng: np.random.Generator, *, size: int
) -> list[DrivingProfile]:
    """Draw time laws of a route's agents, within the bounds of comfortable motion."""
    prior = _of_route(priors, route)
    low, high = prior.tails
    quantile = low + (high - low) * rng.uniform(size=(size, len(LAW_FIELDS)))
    drawn = prior.median * np.exp(prior.spread * _inverse_normal(quantile))
    drawn = np.minimum(np.maximum(drawn, prior.low), prior.high)
    return [DrivingProfile(*row) for row in drawn.tolist()]


def compute_profile_nll(priors: Priors, route: str, laws: Sequence[DrivingProfile]) -> FloatArray:
    """[m] -log density of time laws [nats]; infinite outside the bounds."""
    prior = _of_route(priors, route)
    values = np.array([_values(law) for law in laws]).reshape(-1, len(LAW_FIELDS))
    return _nll(values, prior.median, prior.spread, prior.low, prior.high, *prior.tails)


@compiled
def _nll(
    values: FloatArray,
    median: FloatArray,
    spread: FloatArray,
    low: FloatArray,
    high: FloatArray,
    below: FloatArray,
    up_to: FloatArray,
) -> FloatArray:
    """Bounded lognormals; `below` and `up_to`: their shares below the lower and upper bounds."""
    nll = np.zeros(len(values))
    for m in range(len(values)):
        for k in range(len(median)):
            value = values[m, k]
            if not low[k] <= value <= high[k]:
                nll[m] = np.inf
                break
            z = np.log(value / median[k]) / spread[k]
            share = up_to[k] - below[k]
            nll[m] += 0.5 * z * z + np.log(value * spread[k] * np.sqrt(2 * np.pi) * share)
    return nll


def _of_route(priors: Priors, route: str) -> DrivingProfilePrior:
    if route not in priors.time_laws:
        raise InputError(f"no time law was fitted for route {route!r}")
    return priors.time_laws[route]


def _inverse_normal(quantile: FloatArray) -> FloatArray:
    safe = np.minimum(np.maximum(quantile, 1e-12), 1 - 1e-12)
    return np.array([_NORMAL.inv_cdf(q) for q in safe.ravel().tolist()]).reshape(safe.shape)


_NORMAL = NormalDist()
_values = attrgetter(*LAW_FIELDS)
