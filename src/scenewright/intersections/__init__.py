"""Intersection bundles: folders of plain data, shipped or the user's own.

A bundle is a folder with `map.json` and, where priors were fitted, `priors.npz` and
`bundle.toml`. Shipped bundles lie beside this file; a folder of further bundles is named by the
environment variable SCENEWRIGHT_INTERSECTIONS and comes first.
"""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

from pydantic import ValidationError

from scenewright.errors import InputError
from scenewright.scene.map import IntersectionMap

__all__ = ["bundle_folder", "list_intersections", "load_map"]

_SHIPPED = Path(__file__).parent


def list_intersections() -> list[str]:
    """Names of every bundle that can be loaded, sorted."""
    return sorted(_bundles())


def bundle_folder(name: str) -> Path:
    """The folder of a bundle; InputError, listing what exists, where there is none so named."""
    found = _bundles()
    if name not in found:
        shown = name if len(name) <= 40 else name[:37] + "..."
        raise InputError(f"no intersection {shown!r}; there are: {', '.join(sorted(found))}")
    return found[name]


def load_map(name: str) -> IntersectionMap:
    """The map of a bundle, read once per process; InputError where it is unknown or broken."""
    return _read_map(bundle_folder(name) / "map.json")


def _bundles() -> dict[str, Path]:
    """Bundles by name. Names are looked up here and never joined into a path."""
    return {
        entry.name: entry
        for root in reversed(_roots())
        if root.is_dir()
        for entry in root.iterdir()
        if (entry / "map.json").is_file()
    }


def _roots() -> list[Path]:
    own = os.environ.get("SCENEWRIGHT_INTERSECTIONS")
    return [Path(own), _SHIPPED] if own else [_SHIPPED]


@lru_cache(maxsize=16)
def _read_map(path: Path) -> IntersectionMap:
    try:
        return IntersectionMap.model_validate_json(path.read_bytes())
    except (OSError, ValidationError) as fault:
        reason = str(fault).splitlines()[0]
        raise InputError(f"cannot read the map of {path.parent.name!r}: {reason}") from fault
