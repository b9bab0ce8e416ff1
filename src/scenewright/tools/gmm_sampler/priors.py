"""What was fitted on the corpus, as plain arrays: p_wp, p_tod, time laws, how often routes occur.

A bundle keeps them in `priors.npz` (numpy arrays only, nothing pickled), with versions, checksums
and provenance in `bundle.toml`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from statistics import NormalDist
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError
from scenewright.intersections import check_bundle, find_bundle_folder
from scenewright.scene.base import AgentClass, FloatArray, frozen
from scenewright.scene.candidates import K
from scenewright.scene.yielding_behavior import YieldingModel
from scenewright.tools.gmm_sampler.behavior_files import BRISKEST, Paces, load_manners, load_paces

DIMENSIONS = 2 * K
FORMAT = 1
"""Version of the array layout of `priors.npz`."""
LAW_FIELDS = ("speed", "acceleration", "braking", "lateral")
HOURS = 24
_NORMAL = NormalDist()


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
    def cumulated(self) -> FloatArray:
        """[C] probability of a component or one before it."""
        total = np.cumsum(self.weights / self.weights.sum())
        return np.asarray(total / total[-1])

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
    """How agents move along a path when nothing holds them: independent, bounded lognormals.

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
            np.array([_NORMAL.cdf(z) for z in np.log(bound / self.median) / self.spread])
            for bound in (self.low, self.high)
        )
        return low, high


@dataclass(frozen=True, eq=False)
class Priors:
    """Everything fitted for one intersection.

    Attributes:
        name: of the bundle.
        waypoints: p_wp by route id.
        counts: p_tod by hour, over agents present at any time of a 30 s window.
        instants: the same over agents present at one instant.
        time_laws: by route id.
        frequency: by route id, [24] mean trips per hour.
        subtypes: by route id of vehicles, share of each subtype.
        manners: how people give way (a file of its own, `manners.json`).
    """

    name: str
    waypoints: Mapping[str, WaypointPrior]
    counts: tuple[CountPrior, ...]
    instants: tuple[CountPrior, ...]
    time_laws: Mapping[str, DrivingProfilePrior]
    frequency: Mapping[str, FloatArray]
    subtypes: Mapping[str, Mapping[str, float]]
    manners: YieldingModel = field(default_factory=dict)

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
        raise InputError(
            f"intersection {folder.name!r} has no priors: run scenewright intersections build"
        )
    return _load(folder, file.stat().st_mtime_ns)


@lru_cache(maxsize=16)
def _load(folder: Path, _changed: int) -> Priors:
    """The priors as they are now: a bundle may be written anew while a process lives."""
    check_bundle(folder, "priors.npz")
    try:
        with np.load(folder / "priors.npz", allow_pickle=False) as stored:
            priors = _unpack({key: stored[key] for key in stored.files})
    except (OSError, ValueError, KeyError) as fault:
        raise InputError(f"cannot read the priors of {folder.name!r}: {fault}") from None
    laws = paced(priors.time_laws, load_paces(folder))
    return replace(priors, manners=load_manners(folder), time_laws=laws)


def paced(laws: Mapping[str, DrivingProfilePrior], paces: Paces) -> dict[str, DrivingProfilePrior]:
    """Time laws by route id, setting off and braking as was seen of people."""
    return {route: _paced(law, route, paces) for route, law in laws.items()}


def _paced(law: DrivingProfilePrior, route: str, paces: Paces) -> DrivingProfilePrior:
    kind = cast(AgentClass, route.partition(":")[0])
    if kind not in paces:
        return law
    pace = paces[kind]
    (start, start_spread), (brake, brake_spread) = pace.starts, pace.brakes
    low, high = law.low.copy(), np.array([law.high[0], *BRISKEST[kind], law.high[3]])
    median = np.array([law.median[0], start, brake, law.median[3]])
    spread = np.array([law.spread[0], start_spread, brake_spread, law.spread[3]])
    return replace(law, median=np.clip(median, low, high), spread=spread, low=low, high=high)


def checksum(file: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def save_priors(file: Path, priors: Priors) -> None:
    """Write priors as plain arrays; the same priors give the same bytes."""
    save: Any = np.savez_compressed
    save(file, **_pack(priors))


def _pack(priors: Priors) -> dict[str, NDArray[np.generic]]:
    ways = list(priors.waypoints.values())
    laws = list(priors.time_laws.values())
    sizes = [len(way.weights) for way in ways]
    return {
        "format": np.array(FORMAT),
        "name": np.array(priors.name),
        "routes": np.array([way.route for way in ways]),
        "components": np.array(sizes),
        "tracks": np.array([way.tracks for way in ways]),
        "weights": np.concatenate([way.weights for way in ways]),
        "means": np.concatenate([way.means for way in ways]),
        "cholesky": np.concatenate([way.cholesky for way in ways]),
        "base": np.concatenate([way.base for way in ways]),
        **_pack_counts("counts", priors.counts),
        **_pack_counts("instants", priors.instants),
        "law_routes": np.array(list(priors.time_laws)),
        "law_tracks": np.array([law.tracks for law in laws]),
        "laws": np.array([[law.median, law.spread, law.low, law.high] for law in laws]),
        "frequency_routes": np.array(list(priors.frequency)),
        "frequency": np.array(list(priors.frequency.values())),
        "subtypes": np.array(json.dumps({k: dict(v) for k, v in priors.subtypes.items()})),
    }


def _pack_counts(name: str, hours: tuple[CountPrior, ...]) -> dict[str, NDArray[np.generic]]:
    return {
        f"{name}_components": np.array([len(hour.weights) for hour in hours]),
        f"{name}_weights": np.concatenate([hour.weights for hour in hours]),
        f"{name}_means": np.concatenate([hour.means for hour in hours]),
        f"{name}_covariances": np.concatenate([hour.covariances for hour in hours]),
    }


def _unpack(stored: dict[str, NDArray[np.generic]]) -> Priors:
    if int(stored["format"].item()) != FORMAT:
        raise ValueError(f"format {stored['format']} is not {FORMAT}")
    laws = np.asarray(stored["laws"], dtype=np.float64)
    law_tracks = [int(n) for n in np.asarray(stored["law_tracks"], dtype=int)]
    frequency = np.asarray(stored["frequency"], dtype=np.float64)
    return Priors(
        name=str(stored["name"]),
        waypoints={way.route: way for way in _unpack_waypoints(stored)},
        counts=_unpack_counts("counts", stored),
        instants=_unpack_counts("instants", stored),
        time_laws={
            str(route): DrivingProfilePrior(
                laws[i, 0], laws[i, 1], laws[i, 2], laws[i, 3], law_tracks[i]
            )
            for i, route in enumerate(stored["law_routes"])
        },
        frequency={str(r): frequency[i] for i, r in enumerate(stored["frequency_routes"])},
        subtypes=json.loads(str(stored["subtypes"])),
    )


def _unpack_waypoints(stored: dict[str, NDArray[np.generic]]) -> list[WaypointPrior]:
    ends = np.cumsum(np.asarray(stored["components"], dtype=int))[:-1]
    parts = {
        name: np.split(np.asarray(stored[name], dtype=np.float64), ends)
        for name in ("weights", "means", "cholesky", "base")
    }
    tracks = [int(n) for n in np.asarray(stored["tracks"], dtype=int)]
    return [
        WaypointPrior(
            str(route),
            parts["weights"][i],
            parts["means"][i],
            parts["cholesky"][i],
            parts["base"][i],
            tracks[i],
        )
        for i, route in enumerate(stored["routes"])
    ]


def _unpack_counts(name: str, stored: dict[str, NDArray[np.generic]]) -> tuple[CountPrior, ...]:
    ends = np.cumsum(np.asarray(stored[f"{name}_components"], dtype=int))[:-1]
    parts = [
        np.split(np.asarray(stored[f"{name}_{part}"], dtype=np.float64), ends)
        for part in ("weights", "means", "covariances")
    ]
    return tuple(CountPrior(*hour) for hour in zip(*parts, strict=True))
