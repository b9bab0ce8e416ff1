"""The refiner that a bundle ships: its weights, and how they are known."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from scenewright.errors import InputError
from scenewright.intersections import (
    REFINER_WEIGHTS,
    SHIPPED,
    check_bundle,
    find_bundle_folder,
    ships_refiner,
)
from scenewright.tools.trajnet_refiner.network import RefinerNetwork
from scenewright.tools.trajnet_refiner.store import load_refiner, read_about


@dataclass(frozen=True, eq=False)
class BundledRefiner:
    """A trained network.

    Attributes:
        digest: first digits of its file's SHA-256.
        place: the intersection that its bundle is of; empty where it is of none.
        walks: it may move pedestrians: of real ones held out it predicted the ways no worse than
            constant velocity does.
    """

    net: RefinerNetwork
    digest: str
    place: str = ""
    walks: bool = True


def find_refiner(name: str) -> BundledRefiner | None:
    """The refiner that serves an intersection: its own, else the shipped one; None without any.

    The network sees agents and waypoints and no map, so that one learned elsewhere can be used.

    Raises:
        InputError: as `load_bundled_refiner`.
    """
    serving = next((place for place in (name, SHIPPED) if ships_refiner(place)), None)
    return None if serving is None else load_bundled_refiner(serving)


def load_bundled_refiner(name: str) -> BundledRefiner | None:
    """The refiner of a bundle, read once per process and again when it changes; None without one.

    Raises:
        InputError: no such bundle, or the file is damaged or not the one that the bundle lists.
    """
    folder = find_bundle_folder(name)
    file = folder / REFINER_WEIGHTS
    if not file.is_file():
        return None
    try:
        # The files that say which weights are the bundle's, as far as there are.
        stats = [f.stat() for f in (file, folder / "bundle.toml") if f.is_file()]
        return _read(folder, tuple((stat.st_mtime_ns, stat.st_size) for stat in stats))
    except OSError as fault:
        raise InputError(f"cannot read {file}: {fault.strerror or fault}") from fault


@lru_cache(maxsize=4)
def _read(folder: Path, _changed: tuple[tuple[int, int], ...]) -> BundledRefiner:
    """The weights as they are now: a bundle may be trained anew while a process lives."""
    check_bundle(folder, REFINER_WEIGHTS)
    file = folder / REFINER_WEIGHTS
    digest = hashlib.sha256(file.read_bytes()).hexdigest()[:16]
    net, about = load_refiner(file), read_about(file)
    recorded = str(about.get("command", "")).startswith("scenewright intersections fit")
    figures = about.get("walkers_figures") or (about.get("figures") if recorded else None) or {}
    # Real pedestrians held out were predicted no worse than by constant velocity.
    walks = bool(figures.get("pedestrian_n")) and bool(
        figures["pedestrian_ade_alone"] <= figures["pedestrian_ade_even"]
    )
    return BundledRefiner(net, digest, folder.name, walks)
