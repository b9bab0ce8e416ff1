"""The density of driving profiles: speeds and accelerations, apart from the path (SEMANTICS 6)."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter

import numpy as np

from scenewright.compiled import compiled
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import DrivingProfile
from scenewright.tools.gmm_sampler.priors import (
    PROFILE_FIELDS,
    STANDARD_NORMAL,
    DrivingProfilePrior,
    Priors,
)

_get_values = attrgetter(*PROFILE_FIELDS)


def sample_driving_profiles(
    priors: Priors, route: str, rng: np.random.Generator, *, size: int
) -> list[DrivingProfile]:
    """Draw driving profiles of a route's agents, within the bounds of comfortable motion."""
    prior = _get_prior(priors, route)
    low, high = prior.tails
    quantile = low + (high - low) * rng.uniform(size=(size, len(PROFILE_FIELDS)))
    safe = np.minimum(np.maximum(quantile, 1e-12), 1 - 1e-12)
    normal = [STANDARD_NORMAL.inv_cdf(q) for q in safe.ravel().tolist()]
    drawn = prior.median * np.exp(prior.spread * np.array(normal).reshape(safe.shape))
    drawn = np.minimum(np.maximum(drawn, prior.low), prior.high)
    return [DrivingProfile(*row) for row in drawn.tolist()]


def compute_profile_nll(
    priors: Priors, route: str, profiles: Sequence[DrivingProfile]
) -> FloatArray:
    """[m] -log density of driving profiles [nats]; infinite outside the bounds."""
    prior = _get_prior(priors, route)
    values = np.array([_get_values(each) for each in profiles]).reshape(-1, len(PROFILE_FIELDS))
    return _score(values, prior.median, prior.spread, prior.low, prior.high, *prior.tails)


@compiled
def _score(
    values: FloatArray,
    median: FloatArray,
    spread: FloatArray,
    low: FloatArray,
    high: FloatArray,
    below: FloatArray,
    up_to: FloatArray,
) -> FloatArray:
    nll = np.zeros(len(values))
    for m in range(len(values)):
        for k in range(len(median)):
            value = values[m, k]
            if not low[k] <= value <= high[k]:
                nll[m] = np.inf
                break
            z = np.log(value / median[k]) / spread[k]
            share = spread[k] * np.sqrt(2 * np.pi) * (up_to[k] - below[k])
            nll[m] += 0.5 * z * z + np.log(value * share)
    return nll


def _get_prior(priors: Priors, route: str) -> DrivingProfilePrior:
    if route not in priors.driving_profiles:
        raise InputError(f"no time law was fitted for route {route!r}")
    return priors.driving_profiles[route]
