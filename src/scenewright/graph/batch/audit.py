"""A dataset checked from end to end: hashes, tables against scenes, the checker over scenes."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenewright.errors import InputError
from scenewright.graph.batch.manifest import MANIFEST, hashed, read_manifest
from scenewright.graph.batch.pool import Died, spread
from scenewright.graph.batch.work import FILES
from scenewright.graph.run import verify
from scenewright.tools.exporters.tables import TABLES, SceneFiles, TableWriter, parquet

ABOUT = (
    "row", "folder", "status", "code", "reason", "text", "asked", "seed", "intersection", "backend",
    "refiner", "selection", "attempts",
)  # fmt: skip
"""Columns of `scenes` that the scenes' files do not tell, or not always."""
_ASIDE = ("journal", "evaluation")
"""How the names of files begin that are no part of a dataset."""
_MOST = 1000


@dataclass(frozen=True)
class Fault:
    """What is wrong, and with which file or row."""

    where: str
    what: str


@dataclass(frozen=True)
class Audit:
    """The result.

    Attributes:
        files, scenes: how many were looked at; verified: scenes that the checker confirms.
        complete: whether the manifest says that every row of the input came to an end.
    """

    files: int
    scenes: int
    verified: int
    complete: bool
    faults: tuple[Fault, ...]


def audit(
    folder: Path, *, workers: int = 1, tell: Callable[[int, int], None] = lambda _, __: None
) -> Audit:
    """Recomputes everything that a dataset says of itself.

    Args:
        tell: called with (scenes checked, scenes in all).

    Raises:
        InputError: there is no manifest.
    """
    manifest = read_manifest(folder)
    files: dict[str, str] = manifest["files"]
    faults = [*_hash_faults(folder, files), *_strangers(folder, files)]
    scenes = [name.removesuffix("/scene.json") for name in files if name.endswith("/scene.json")]
    if all((folder / f"tables/{name}.parquet").is_file() for name in TABLES):
        faults += _table_faults(folder, manifest)
    checked = list(_checked(folder, scenes, workers=workers, tell=tell))
    faults += [fault for fault in checked if fault is not None]
    return Audit(
        files=len(files),
        scenes=len(scenes),
        verified=sum(fault is None for fault in checked),
        complete=bool(manifest.get("complete")),
        faults=tuple(faults[:_MOST]),
    )


def _hash_faults(folder: Path, files: Mapping[str, str]) -> Iterator[Fault]:
    root = folder.resolve()
    for name, wanted in files.items():
        if not (root / name).resolve().is_relative_to(root):
            yield Fault(name, "lies outside the dataset")
            continue
        try:
            ((_, found),) = hashed(folder, [name])
        except OSError as error:
            yield Fault(name, f"cannot be read: {error.strerror or error}")
            continue
        if found != wanted:
            yield Fault(name, "is not what the manifest says: its hash differs")


def _strangers(folder: Path, files: Mapping[str, str]) -> Iterator[Fault]:
    """What lies there and is not in the manifest."""
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        aside = name.startswith((".", *_ASIDE)) or name == MANIFEST
        if path.is_file() and name not in files and not aside:
            yield Fault(name, "is not in the manifest")


def _table_faults(folder: Path, manifest: Mapping[str, Any]) -> Iterator[Fault]:
    """Where the tables do not say what the scenes say."""
    again = Path(tempfile.mkdtemp(prefix="scenewright-"))
    try:
        yield from _rebuilt(folder, again)
        for name in TABLES:
            yield from _compared(folder, again, name, manifest)
    finally:
        shutil.rmtree(again, ignore_errors=True)


def _rebuilt(folder: Path, again: Path) -> Iterator[Fault]:
    """Writes the tables anew from the scenes."""
    try:
        table = parquet().ParquetFile(folder / "tables/scenes.parquet")
        with TableWriter(again) as writer:
            for batch in table.iter_batches(batch_size=500, columns=list(ABOUT)):
                for about in batch.to_pylist():
                    writer.add(_files(folder, about))
    except (OSError, ValueError, KeyError, TypeError) as error:
        yield Fault("tables/scenes.parquet", f"cannot be compared with the scenes: {error}")


def _files(folder: Path, about: dict[str, Any]) -> SceneFiles:
    place = about["folder"]
    if place is None:
        return SceneFiles(about)
    if place in ("", ".", "..") or Path(place).name != place:
        raise ValueError(f"{place!r} is no folder of a scene")
    scene, proof, provenance = (
        json.loads((folder / place / f"{name}.json").read_bytes())
        for name in ("scene", "proof", "provenance")
    )
    return SceneFiles(about, scene, proof, provenance)


def _compared(folder: Path, again: Path, name: str, manifest: Mapping[str, Any]) -> Iterator[Fault]:
    where = f"tables/{name}.parquet"
    try:
        found = parquet().ParquetFile(folder / where)
        wanted = parquet().ParquetFile(again / f"{name}.parquet")
        rows = manifest.get("tables", {}).get(name)
        if found.metadata.num_rows != rows:
            yield Fault(where, f"has {found.metadata.num_rows} rows, the manifest says {rows}")
        groups = found.num_row_groups
        if groups != wanted.num_row_groups or not all(
            found.read_row_group(k).equals(wanted.read_row_group(k)) for k in range(groups)
        ):
            yield Fault(where, "does not say what the scenes say")
    except (OSError, ValueError) as error:
        yield Fault(where, f"is no such table: {error}")


def _checked(
    folder: Path, scenes: list[str], *, workers: int, tell: Callable[[int, int], None]
) -> Iterator[Fault | None]:
    jobs = [str(folder / scene) for scene in scenes]
    results = (
        ((job, recheck(job)) for job in jobs)
        if workers == 1
        else spread(jobs, recheck, workers=workers)
    )
    for count, (job, result) in enumerate(results, start=1):
        tell(count, len(jobs))
        what = "the checker died of it" if isinstance(result, Died) else result
        yield None if what is None else Fault(Path(job).name, what)


def recheck(place: str) -> str | None:
    """What is wrong with a scene's folder; None if the checker finds what its proof says."""
    folder = Path(place)
    if not all((folder / name).is_file() for name in FILES):
        return "lacks one of its files"
    try:
        proof = verify(folder).model_dump(mode="json", by_alias=True)
        written = json.loads((folder / "proof.json").read_bytes())
    except (InputError, OSError, ValueError) as error:
        return f"cannot be checked: {error}"
    if not proof["verified"]:
        return "is not verified by the checker"
    return None if proof == written else "has another proof than the checker's"
