"""Fitted priors as plain arrays: p_wp, p_tod, driving profiles, frequencies of routes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from statistics import NormalDist

import numpy as np

from scenewright.scene.base import FloatArray, frozen
from scenewright.scene.candidates import K
from scenewright.scene.reaction_behavior import YieldingModel

PROFILE_FIELDS = ("speed", "acceleration", "braking", "lateral")
HOURS = 24
DIMENSIONS = 2 * K
STANDARD_NORMAL = NormalDist()


@dataclass(frozen=True, eq=False)
class WaypointPrior:
    """p_wp of one route: a Gaussian mixture over K waypoints at equal arc length (paper Eq. 2).

    Attributes:
        route: route id.
        weights: [C] of the components.
        means: [C, 20] waypoints x1, y1, x2, y2, ... [m].
        cholesky: [C, 20, 20] lower factors of the covariances, floor included [m].
        base: [C, P, 2] mean dense path of each component, through its mean waypoints [m].
        tracks: how many tracks it was fitted on; 0 where it is assumed (jaywalking).
    """

    route: str
    weights: FloatArray
    means: FloatArray
    cholesky: FloatArray
    base: FloatArray
    tracks: int

    def __post_init__(self) -> None:
        for name in ("weights", "means", "cholesky", "base"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @cached_property
    def cumulative_weights(self) -> FloatArray:
        """[C] probability of a component or one before it."""
        total = np.cumsum(self.weights / self.weights.sum())
        return np.asarray(total / total[-1])

    @cached_property
    def length(self) -> float:
        """Of the longest mean path [m]."""
        return float(np.hypot(*np.diff(self.base, axis=1).transpose(2, 0, 1)).sum(axis=1).max())

    @cached_property
    def whitening(self) -> FloatArray:
        """[C, 20, 20] inverses of the Cholesky factors [1/m]."""
        return np.asarray(np.linalg.inv(self.cholesky))

    @cached_property
    def log_scale(self) -> FloatArray:
        """[C] log weight and log normalisation of each component [nats]."""
        diagonal = np.diagonal(self.cholesky, axis1=1, axis2=2)
        norm = np.log(diagonal).sum(axis=1) + 0.5 * DIMENSIONS * np.log(2 * np.pi)
        return np.asarray(np.log(self.weights) - norm)


@dataclass(frozen=True, eq=False)
class CountPrior:
    """p_tod of one hour: a Gaussian mixture over (vehicles, pedestrians), kept to whole numbers.

    Attributes:
        weights: [C]; means: [C, 2]; covariances: [C, 2, 2].
    """

    weights: FloatArray
    means: FloatArray
    covariances: FloatArray

    def __post_init__(self) -> None:
        for name in ("weights", "means", "covariances"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @cached_property
    def mass(self) -> FloatArray:
        """[V, P] probability of each pair of counts, from (0, 0) on."""
        spread = np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))
        size = np.ceil((self.means + 6 * spread).max(axis=0)).astype(int) + 2
        grid = np.stack(np.meshgrid(*(np.arange(n) for n in size), indexing="ij"), axis=-1)
        away = grid[..., None, :] - self.means
        square = np.einsum("vpci,cij,vpcj->vpc", away, np.linalg.inv(self.covariances), away)
        scale = self.weights / np.sqrt(np.linalg.det(self.covariances))
        density = (scale * np.exp(-0.5 * square)).sum(axis=-1)
        return np.asarray(density / density.sum())


@dataclass(frozen=True, eq=False)
class DrivingProfilePrior:
    """How agents drive or walk along a free path: independent, bounded lognormals.

    Attributes:
        median, spread: [4] of speed, acceleration, braking, lateral acceleration; the spread is
            the standard deviation of the logarithm.
        low, high: [4] bounds.
        tracks: how many freely flowing tracks it was fitted on.
    """

    median: FloatArray
    spread: FloatArray
    low: FloatArray
    high: FloatArray
    tracks: int

    def __post_init__(self) -> None:
        for name in ("median", "spread", "low", "high"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @cached_property
    def tails(self) -> tuple[FloatArray, FloatArray]:
        """[4] share of the unbounded lognormal below the lower and the upper bound."""
        low, high = (
            np.array([STANDARD_NORMAL.cdf(z) for z in np.log(bound / self.median) / self.spread])
            for bound in (self.low, self.high)
        )
        return low, high


@dataclass(frozen=True, eq=False)
class Priors:
    """All priors of one intersection.

    Attributes:
        name: of the bundle.
        waypoints: p_wp by route id.
        counts: p_tod by hour, over agents present at any time of a 30 s window.
        driving_profiles: by route id.
        frequency: by route id, [24] mean trips per hour.
        subtypes: by route id of vehicles, share of each subtype.
        yielding_model: how agents yield (a file of its own, `manners.json`).
    """

    name: str
    waypoints: Mapping[str, WaypointPrior]
    counts: tuple[CountPrior, ...]
    driving_profiles: Mapping[str, DrivingProfilePrior]
    frequency: Mapping[str, FloatArray]
    subtypes: Mapping[str, Mapping[str, float]]
    yielding_model: YieldingModel = field(default_factory=dict)

    @cached_property
    def busyness(self) -> FloatArray:
        """[24] share of a day's trips by hour."""
        trips = np.sum(list(self.frequency.values()), axis=0)
        return np.asarray(trips / trips.sum())
