"""One's own bundles: writing an imported map with its priors, and reading its ways back."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.intersections import (
    FORMAT,
    check_bundle,
    check_name,
    find_bundle_folder,
    find_custom_root,
    load_map,
    read_bundle_header,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.gmm_sampler.priors import Priors, compute_checksum, save_priors

_UNSTATED = "unstated; that of the map and the tracks it was made from"

Ways = Mapping[str, Sequence[FloatArray]]


@dataclass(frozen=True, eq=False)
class OwnBundle:
    """An imported intersection with what a map does not hold.

    Attributes:
        ways: by route id, the middles of the ways that it may take, [P, 2] each [m].
        header: what bundle.toml says.
    """

    folder: Path
    place: IntersectionMap
    ways: Ways
    header: Mapping[str, Any]

    @property
    def origin(self) -> tuple[float, float] | None:
        """Latitude and longitude of the map's origin [deg]."""
        found = self.header.get("frame", {}).get("origin")
        return None if found is None else (float(found[0]), float(found[1]))


def open_own(name: str) -> OwnBundle:
    """An imported bundle.

    Raises:
        InputError: unknown, damaged, or none that was imported.
    """
    folder = find_bundle_folder(name)
    place = load_map(name)
    file = folder / "ways.npz"
    if not file.is_file():
        raise InputError(
            f"{name!r} was not imported, so it cannot be fitted anew; import a map of your own "
            "with scenewright intersections import"
        )
    check_bundle(folder, "ways.npz")
    try:
        with np.load(file, allow_pickle=False) as stored:
            pieces = np.split(stored["points"].astype(float), np.cumsum(stored["lengths"])[:-1])
            ways: dict[str, list[FloatArray]] = {}
            for route, piece in zip(stored["routes"], pieces, strict=True):
                ways.setdefault(str(route), []).append(piece)
    except (OSError, ValueError, KeyError) as fault:
        raise InputError(f"cannot read the ways of {name!r}: {fault}") from None
    return OwnBundle(folder, place, ways, read_bundle_header(folder))


def write_own(
    name: str,
    place: IntersectionMap,
    ways: Ways,
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
        InputError: a name that cannot be, a bundle that exists, a place that cannot be written.
    """
    root = find_custom_root()
    target = root / check_name(name)
    if target.exists() and not force:
        raise InputError(f"intersection {name!r} exists already; --force replaces it")
    try:
        root.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(prefix=f".{name}.", dir=root))
    except OSError as fault:
        raise InputError(f"cannot write to {root}: {fault.strerror or fault}") from None
    try:
        (made / "map.json").write_text(place.model_dump_json() + "\n", encoding="utf-8")
        _save_ways(made / "ways.npz", ways)
        save_priors(made / "priors.npz", priors)
        for file, content in (extra or {}).items():
            (made / Path(file).name).write_bytes(content)
        _describe(made, place, provenance, frame, notes, licence)
        made.chmod(0o755)
        _moved(made, target)
    except OSError as fault:
        raise InputError(f"cannot write to {root}: {fault.strerror or fault}") from None
    finally:
        shutil.rmtree(made, ignore_errors=True)
    return target


def _moved(made: Path, target: Path) -> None:
    """The new folder in the place of the old one, which is there until the last moment."""
    old = target.with_name(f".{target.name}.old")
    shutil.rmtree(old, ignore_errors=True)
    if target.exists():
        os.replace(target, old)
    os.replace(made, target)
    shutil.rmtree(old, ignore_errors=True)


def _save_ways(file: Path, ways: Ways) -> None:
    pairs = [(route, line) for route, lines in ways.items() for line in lines]
    save: Any = np.savez_compressed
    save(
        file,
        routes=np.array([route for route, _ in pairs], dtype=np.str_),
        lengths=np.array([len(line) for _, line in pairs], dtype=np.int64),
        points=np.concatenate([line for _, line in pairs]).astype(np.float32),
    )


def _describe(
    folder: Path,
    place: IntersectionMap,
    provenance: Mapping[str, Any],
    frame: Mapping[str, Any],
    notes: Sequence[str],
    licence: str | None,
) -> None:
    """`bundle.toml`: what this is, what it was made from, where it lies, what was assumed."""
    listed = sorted(each.name for each in folder.iterdir())
    lines = [
        f"name = {_toml(place.name)}",
        f"title = {_toml(place.title)}",
        f"licence = {_toml(licence or _UNSTATED)}",
        f"format = {FORMAT}",
        f"notes = {_toml(list(notes))}",
        "",
        "[provenance]",
        *(f"{key} = {_toml(value)}" for key, value in provenance.items() if value is not None),
        f"scenewright = {_toml(_version('scenewright'))}",
        "",
        "[frame]",
        *(f"{key} = {_toml(value)}" for key, value in frame.items() if value is not None),
        "",
        "[sha256]",
        *(f"{_toml(name)} = {_toml(compute_checksum(folder / name))}" for name in listed),
    ]
    (folder / "bundle.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _toml(value: Any) -> str:
    """A string, number or list of them; JSON's way of writing these is TOML's."""
    if isinstance(value, float):
        return repr(round(value, 7))
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(each) for each in value) + "]"
    return json.dumps(value, ensure_ascii=True)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
