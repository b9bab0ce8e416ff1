"""A user's own bundles: an imported map with its priors and the middles of its routes."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from scenewright.arrays import read_arrays
from scenewright.errors import InputError
from scenewright.geometry.geographic import LatLon
from scenewright.intersections import (
    FORMAT,
    check_bundle,
    find_bundle_folder,
    find_custom_root,
    load_map,
    make_name,
    read_bundle_header,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.gmm_sampler.prior_files import compute_checksum, save_priors
from scenewright.tools.gmm_sampler.priors import Priors
from scenewright.tools.map_import.map_parts import RouteLines

_UNSTATED = "unstated; that of the map and the tracks it was made from"
_LINES = "ways.npz"


@dataclass(frozen=True, eq=False)
class CustomBundle:
    """An imported intersection with what a map does not hold.

    Attributes:
        route_lines: the middles of the paths that routes may take.
        header: what bundle.toml says.
    """

    folder: Path
    intersection_map: IntersectionMap
    route_lines: RouteLines
    header: Mapping[str, Any]

    @property
    def origin(self) -> LatLon | None:
        """Latitude and longitude of the map's origin [deg]."""
        found = self.header.get("frame", {}).get("origin")
        return None if found is None else (float(found[0]), float(found[1]))


def open_custom_bundle(name: str) -> CustomBundle:
    """An imported bundle.

    Raises:
        InputError: unknown, damaged, or none that was imported.
    """
    folder = find_bundle_folder(name)
    intersection_map = load_map(name)
    if not (folder / _LINES).is_file():
        raise InputError(
            f"{name!r} was not imported, so it cannot be fitted anew; import a map of your own "
            "with scenewright intersections import"
        )
    check_bundle(folder, _LINES)
    stored = read_arrays(folder / _LINES, what=f"the ways of {name!r}")
    try:
        pieces = np.split(stored["points"].astype(float), np.cumsum(stored["lengths"])[:-1])
        lines: dict[str, list[FloatArray]] = {}
        for route, piece in zip(stored["routes"], pieces, strict=True):
            lines.setdefault(str(route), []).append(piece)
    except (ValueError, KeyError, TypeError) as fault:
        raise InputError(f"cannot read the ways of {name!r}: {fault}") from None
    return CustomBundle(folder, intersection_map, lines, read_bundle_header(folder))


def write_custom_bundle(
    name: str,
    intersection_map: IntersectionMap,
    route_lines: RouteLines,
    priors: Priors,
    *,
    provenance: Mapping[str, Any],
    frame: Mapping[str, Any],
    notes: Sequence[str],
    licence: str | None = None,
    force: bool = False,
    extra: Mapping[str, bytes] | None = None,
) -> Path:
    """Write a whole bundle, or nothing: into a folder beside its place, then moved there.

    Raises:
        InputError: a name that is taken, a bundle that exists, a place that cannot be written.
    """
    root = find_custom_root()
    target = root / make_name(name)
    if target.exists() and not force:
        raise InputError(f"intersection {target.name!r} exists already; --force replaces it")
    draft = root
    try:
        root.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=root))
        (draft / "map.json").write_text(intersection_map.model_dump_json() + "\n", encoding="utf-8")
        _save_lines(draft / _LINES, route_lines)
        save_priors(draft / "priors.npz", priors)
        for file, content in (extra or {}).items():
            (draft / Path(file).name).write_bytes(content)
        _write_header(draft, intersection_map, provenance, frame, notes, licence)
        draft.chmod(0o755)
        _replace_folder(draft, target)
    except OSError as fault:
        raise InputError(f"cannot write to {root}: {fault.strerror or fault}") from None
    finally:
        if draft != root:
            shutil.rmtree(draft, ignore_errors=True)
    return target


def _replace_folder(draft: Path, target: Path) -> None:
    """The new folder in the place of the old one, which is there until the last moment."""
    old = target.with_name(f".{target.name}.old")
    shutil.rmtree(old, ignore_errors=True)
    if target.exists():
        os.replace(target, old)
    os.replace(draft, target)
    shutil.rmtree(old, ignore_errors=True)


def _save_lines(file: Path, route_lines: RouteLines) -> None:
    pairs = [(route, line) for route, lines in route_lines.items() for line in lines]
    np.savez_compressed(
        file,
        routes=np.array([route for route, _ in pairs], dtype=np.str_),
        lengths=np.array([len(line) for _, line in pairs], dtype=np.int64),
        points=np.concatenate([line for _, line in pairs]).astype(np.float32),
    )


def _write_header(
    folder: Path,
    intersection_map: IntersectionMap,
    provenance: Mapping[str, Any],
    frame: Mapping[str, Any],
    notes: Sequence[str],
    licence: str | None,
) -> None:
    """`bundle.toml`: what this is, what it was made from, where it lies, what was assumed."""
    files = sorted(each.name for each in folder.iterdir())
    made = {**provenance, "scenewright": find_version("scenewright")}
    header = {
        "name": intersection_map.name,
        "title": intersection_map.title,
        "licence": licence or _UNSTATED,
        "format": FORMAT,
        "notes": list(notes),
        "provenance": {key: value for key, value in made.items() if value is not None},
        "frame": {key: value for key, value in frame.items() if value is not None},
        "sha256": {name: compute_checksum(folder / name) for name in files},
    }
    (folder / "bundle.toml").write_bytes(tomli_w.dumps(header).encode("utf-8", "replace"))


def find_version(package: str) -> str:
    """The installed version of a package, or `unknown`."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
