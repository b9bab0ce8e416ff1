"""The refiner that a bundle ships: its weights, and how they are known."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from scenewright.errors import InputError
from scenewright.intersections import REFINER_WEIGHTS, bundle_folder
from scenewright.tools.trajnet_refiner.model import Refiner
from scenewright.tools.trajnet_refiner.store import load_refiner


@dataclass(frozen=True, eq=False)
class Learned:
    """A trained network and the first digits of its file's SHA-256."""

    net: Refiner
    digest: str


def bundled_refiner(name: str) -> Learned | None:
    """The refiner of a bundle, read once per process; None if it ships none.

    Raises:
        InputError: no such bundle, or the file is damaged.
    """
    file = bundle_folder(name) / REFINER_WEIGHTS
    return _read(file) if file.is_file() else None


@lru_cache(maxsize=4)
def _read(file: Path) -> Learned:
    try:
        digest = hashlib.sha256(file.read_bytes()).hexdigest()[:16]
        return Learned(load_refiner(file), digest)
    except OSError as fault:
        raise InputError(f"cannot read {file}: {fault.strerror or fault}") from fault
