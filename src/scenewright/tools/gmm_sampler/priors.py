"""Fitted priors as plain arrays: p_wp, p_tod, driving profiles, frequencies of routes.

A bundle keeps them in `priors.npz` (numpy arrays only, nothing pickled), with versions, checksums
and provenance in `bundle.toml`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from statistics import NormalDist
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from scenewright.arrays import read_arrays
from scenewright.errors import InputError
from scenewright.intersections import SHIPPED, check_bundle, find_bundle_folder
from scenewright.scene.base import AgentClass, FloatArray, frozen
from scenewright.scene.candidates import K
from scenewright.scene.reaction_behavior import LEVELS, YieldingBehavior, YieldingModel
from scenewright.tools.gmm_sampler.prior_checks import check_priors

FILE = "manners.json"
_TO = " to "
MAX_ACCELERATIONS = {"vehicle": (2.5, 3.0), "pedestrian": (2.5, 2.5)}
"""Strongest start and braking that are drawn [m/s^2], well inside SEMANTICS section 5."""


@dataclass(frozen=True)
class AccelerationProfile:
    """How agents of a class start and brake.

    Attributes:
        starts, brakes: median [m/s^2], and standard deviation of the logarithm.
    """

    starts: tuple[float, float]
    brakes: tuple[float, float]


AccelerationProfiles = Mapping[AgentClass, AccelerationProfile]
_Model = TypeAdapter(dict[str, YieldingBehavior])
_Profiles = TypeAdapter(dict[AgentClass, AccelerationProfile])


def load_yielding_model(folder: Path) -> YieldingModel:
    """The yielding behaviour of a bundle, or the one it borrows.

    Raises:
        InputError: damaged, or of another form.
    """
    source = folder if (folder / FILE).is_file() else find_bundle_folder(SHIPPED)
    stored = _read_entries(source, _Model, pairs=True)
    for behavior in stored.values():
        for name, values in asdict(behavior).items():
            if name != "rolls" and (len(values) != len(LEVELS) or list(values) != sorted(values)):
                raise InputError(
                    f"{FILE} of {source.name!r}: {name} needs {len(LEVELS)} ascending quantiles"
                )
    pairs = (name.partition(_TO) for name in stored)
    keys = [(cast(AgentClass, giving), cast(AgentClass, other)) for giving, _, other in pairs]
    return dict(zip(keys, stored.values(), strict=True))


def load_acceleration_profiles(folder: Path) -> AccelerationProfiles:
    """How agents start and brake, by class; empty if the bundle does not say.

    Raises:
        InputError: damaged, or of another form.
    """
    stored: AccelerationProfiles = _read_entries(folder, _Profiles, pairs=False)
    for name, profile in stored.items():
        if min(*profile.starts, *profile.brakes) <= 0.0:
            raise InputError(
                f"{FILE} of {folder.name!r}: {name} needs a positive median and spread of starts "
                "and of brakes"
            )
    return stored


def _read_entries(folder: Path, form: TypeAdapter[Any], *, pairs: bool) -> Any:
    """The entries of the file about pairs of classes, or those about a class; {} without a file."""
    if not (folder / FILE).is_file():
        return {}
    check_bundle(folder, FILE)
    try:
        stored = json.loads((folder / FILE).read_bytes())
        if not isinstance(stored, dict):
            raise ValueError("it holds no object")
        chosen = {name: entry for name, entry in stored.items() if (_TO in name) == pairs}
        return form.validate_json(json.dumps(chosen))
    except (OSError, ValueError) as fault:
        reason = " ".join(str(fault).split())
        raise InputError(f"cannot read {FILE} of {folder.name!r}: {reason}") from None


DIMENSIONS = 2 * K
FORMAT = 1
"""Version of the array layout of `priors.npz`."""
PROFILE_FIELDS = ("speed", "acceleration", "braking", "lateral")
HOURS = 24
_MOST_BYTES = 500_000_000
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


def load_priors(name: str | Path) -> Priors:
    """The priors of a bundle, by its name or its folder; read once per process.

    Raises:
        InputError: unknown bundle, none fitted, damaged, or of another format.
    """
    folder = name if isinstance(name, Path) else find_bundle_folder(name)
    file = folder / "priors.npz"
    if not file.is_file():
        raise InputError(f"intersection {folder.name!r} has no priors: import its map again")
    return _load_bundle(folder, file.stat().st_mtime_ns)


@lru_cache(maxsize=16)
def _load_bundle(folder: Path, _changed: int) -> Priors:
    """The priors as they are now: a bundle may be written anew while a process lives."""
    check_bundle(folder, "priors.npz")
    what = f"the priors of {folder.name!r}"
    stored = read_arrays(folder / "priors.npz", what=what, most_bytes=_MOST_BYTES)
    try:
        priors = _unpack(stored)
        check_priors(priors)
    except (ValueError, KeyError, TypeError, IndexError, OverflowError) as fault:
        raise InputError(f"cannot read {what}: {fault}") from None
    accelerations = load_acceleration_profiles(folder)
    return replace(
        priors,
        yielding_model=load_yielding_model(folder),
        driving_profiles=replace_accelerations(priors.driving_profiles, accelerations),
    )


def replace_accelerations(
    profiles: Mapping[str, DrivingProfilePrior], observed: AccelerationProfiles
) -> dict[str, DrivingProfilePrior]:
    """Driving profiles by route id, with acceleration and braking as observed by class."""
    found = dict(profiles)
    for route, prior in profiles.items():
        kind = cast(AgentClass, route.partition(":")[0])
        if kind in observed:
            own, low = observed[kind], prior.low
            (start, start_spread), (brake, brake_spread) = own.starts, own.brakes
            high = np.array([prior.high[0], *MAX_ACCELERATIONS[kind], prior.high[3]])
            median = np.array([prior.median[0], start, brake, prior.median[3]])
            spread = np.array([prior.spread[0], start_spread, brake_spread, prior.spread[3]])
            found[route] = replace(
                prior, median=np.clip(median, low, high), spread=spread, high=high
            )
    return found


def compute_checksum(file: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def save_priors(file: Path, priors: Priors) -> None:
    """Write priors as plain arrays; the same priors give the same bytes."""
    waypoints = list(priors.waypoints.values())
    profiles = list(priors.driving_profiles.values())
    arrays: _Arrays = {
        "format": np.array(FORMAT),
        "name": np.array(priors.name),
        "routes": np.array([prior.route for prior in waypoints]),
        "components": np.array([len(prior.weights) for prior in waypoints]),
        "tracks": np.array([prior.tracks for prior in waypoints]),
        **_join(waypoints, _WAYPOINT_ARRAYS),
        "counts_components": np.array([len(hour.weights) for hour in priors.counts]),
        **_join(priors.counts, _COUNT_ARRAYS, "counts_"),
        "law_routes": np.array(list(priors.driving_profiles)),
        "law_tracks": np.array([prior.tracks for prior in profiles]),
        "laws": np.array([[p.median, p.spread, p.low, p.high] for p in profiles]),
        "frequency_routes": np.array(list(priors.frequency)),
        "frequency": np.array(list(priors.frequency.values())),
        "subtypes": np.array(json.dumps({k: dict(v) for k, v in priors.subtypes.items()})),
    }
    save: Any = np.savez_compressed
    save(file, **arrays)


_Arrays = dict[str, NDArray[np.generic]]
_WAYPOINT_ARRAYS = ("weights", "means", "cholesky", "base")
_COUNT_ARRAYS = ("weights", "means", "covariances")


def _join(priors: Sequence[object], names: Sequence[str], prefix: str = "") -> _Arrays:
    return {
        prefix + name: np.concatenate([getattr(prior, name) for prior in priors]) for name in names
    }


def _unpack(stored: _Arrays) -> Priors:
    if int(stored["format"].item()) != FORMAT:
        raise ValueError(f"format {stored['format']} is not {FORMAT}")
    routes = [str(route) for route in stored["routes"]]
    waypoints = zip(routes, stored["tracks"], _split(stored, _WAYPOINT_ARRAYS), strict=True)
    laws = np.asarray(stored["laws"], dtype=np.float64)
    profiles = zip(stored["law_routes"], stored["law_tracks"], laws, strict=True)
    rates = np.asarray(stored["frequency"], dtype=np.float64)
    return Priors(
        name=str(stored["name"]),
        waypoints={r: WaypointPrior(route=r, tracks=int(n), **own) for r, n, own in waypoints},
        counts=tuple(CountPrior(**own) for own in _split(stored, _COUNT_ARRAYS, "counts_")),
        driving_profiles={
            str(route): DrivingProfilePrior(law[0], law[1], law[2], law[3], int(n))
            for route, n, law in profiles
        },
        frequency=dict(zip(map(str, stored["frequency_routes"]), rates, strict=True)),
        subtypes=json.loads(str(stored["subtypes"])),
    )


def _split(
    stored: _Arrays, names: Sequence[str], prefix: str = ""
) -> Iterator[dict[str, FloatArray]]:
    """For each mixture, its own parts of joined arrays."""
    ends = np.cumsum(np.asarray(stored[f"{prefix}components"], dtype=int))[:-1]
    arrays = [np.asarray(stored[prefix + name], dtype=np.float64) for name in names]
    for parts in zip(*(np.split(array, ends) for array in arrays), strict=True):
        yield dict(zip(names, parts, strict=True))
