"""Priors of a bundle in `priors.npz`: numpy arrays only, nothing pickled.

Versions, checksums and provenance stand in `bundle.toml` beside it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.arrays import read_arrays
from scenewright.errors import InputError
from scenewright.intersections import check_bundle, find_bundle_folder
from scenewright.scene.base import FloatArray
from scenewright.tools.gmm_sampler.observed_behavior import (
    load_acceleration_profiles,
    load_yielding_model,
    replace_accelerations,
)
from scenewright.tools.gmm_sampler.prior_checks import check_priors
from scenewright.tools.gmm_sampler.priors import (
    CountPrior,
    DrivingProfilePrior,
    Priors,
    WaypointPrior,
)

FORMAT = 1
"""Version of the array layout of `priors.npz`."""
_MOST_BYTES = 500_000_000
_Arrays = dict[str, NDArray[np.generic]]
_WAYPOINT_ARRAYS = ("weights", "means", "cholesky", "base")
_COUNT_ARRAYS = ("weights", "means", "covariances")


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
