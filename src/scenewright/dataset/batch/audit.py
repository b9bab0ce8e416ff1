"""A dataset checked from end to end: hashes, tables against scenes, the checker over scenes."""

from __future__ import annotations

import json
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenewright.dataset.batch.finish import ABOUT
from scenewright.dataset.batch.manifest import MANIFEST, hash_files, is_as_written, read_manifest
from scenewright.dataset.batch.pool import Died, Overdue, spread
from scenewright.dataset.batch.worker import FILES
from scenewright.dataset.tables.parquet import (
    TABLES,
    SceneFiles,
    TableWriter,
    import_parquet,
    list_table_files,
    read_table,
    require_tables,
)
from scenewright.errors import InputError
from scenewright.graph.verify import verify

_ASIDE = re.compile(
    r"\..*|(evaluation|exports)/.*|journal(-\d+-of-\d+)?\.jsonl|"
    r"manifest\.json\.minisig"
)
"""Names of files that are no part of a dataset."""
_MOST = 1000


_OUTSIDE = "lies outside the dataset"


@dataclass(frozen=True)
class AuditFault:
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
    faults: tuple[AuditFault, ...]


def audit_dataset(
    folder: Path, *, workers: int = 1, log: Callable[[int, int], None] = lambda _, __: None
) -> Audit:
    """Recomputes everything that a dataset says of itself.

    Args:
        log: called with (scenes checked, scenes in all).

    Raises:
        InputError: there is no manifest.
    """
    require_tables()
    manifest = read_manifest(folder)
    files: dict[str, str] = manifest["files"]
    faults = [] if is_as_written(folder) else [AuditFault(MANIFEST, "is not as it was written")]
    faults += [*_hash_faults(folder, files), *_find_strangers(folder, files)]
    outside = {fault.where for fault in faults if fault.what == _OUTSIDE}
    scenes = [
        name.removesuffix("/scene.json")
        for name in files
        if name.endswith("/scene.json") and name not in outside
    ]
    faults += _find_table_faults(folder, manifest)
    jobs, verified = [str(folder / scene) for scene in scenes], 0
    one = ((job, check_again(job)) for job in jobs)
    results = one if workers == 1 else spread(jobs, check_again, workers=workers)
    for count, (job, result) in enumerate(results, start=1):
        log(count, len(jobs))
        verified += result is None
        if result is not None:
            what = "the checker died of it" if isinstance(result, Died | Overdue) else result
            faults.append(AuditFault(Path(job).name, what))
    complete = bool(manifest.get("complete"))
    return Audit(len(files), len(scenes), verified, complete, tuple(faults[:_MOST]))


def _hash_faults(folder: Path, files: Mapping[str, str]) -> Iterator[AuditFault]:
    root = folder.resolve()
    for name, wanted in files.items():
        try:
            if not (root / name).resolve().is_relative_to(root):
                yield AuditFault(name, _OUTSIDE)
                continue
            ((_, found),) = hash_files(folder, [name])
        except (OSError, RuntimeError, ValueError) as error:
            yield AuditFault(name, f"cannot be read: {getattr(error, 'strerror', None) or error}")
            continue
        if found != wanted:
            yield AuditFault(name, "is not what the manifest says: its hash differs")


def _find_strangers(folder: Path, files: Mapping[str, str]) -> Iterator[AuditFault]:
    """What lies there and is not in the manifest."""
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if _ASIDE.fullmatch(name):
            continue
        if path.is_symlink():
            yield AuditFault(name, "is a link, which a copy of the dataset may lose")
        elif not path.is_dir() and name not in files and name != MANIFEST:
            yield AuditFault(name, "is not in the manifest")


def _find_table_faults(folder: Path, manifest: Mapping[str, Any]) -> Iterator[AuditFault]:
    """Differences between tables and scenes; a missing table is found by its hash instead.

    Datasets of earlier versions have fewer tables, and fewer columns.
    """
    with tempfile.TemporaryDirectory(prefix="scenewright-", ignore_cleanup_errors=True) as again:
        try:
            yield from _compare_rebuilt(folder, Path(again), manifest)
        except (OSError, ValueError, KeyError, TypeError) as error:
            yield AuditFault("tables/scenes", f"cannot be compared with the scenes: {error}")
        for name in TABLES:
            if list_table_files(folder / "tables", name):
                yield from _compare_tables(folder, Path(again), name, manifest)


def _compare_rebuilt(
    folder: Path, again: Path, manifest: Mapping[str, Any]
) -> Iterator[AuditFault]:
    """Writes the tables anew from the scenes."""
    counts = Counter[str]()
    with TableWriter(again) as writer:
        for name in ("scenes", "refused"):
            for row in read_table(folder / "tables", name, ABOUT):
                place = row.get("folder")
                if place is not None and (place in ("", "..") or Path(place).name != place):
                    raise ValueError(f"{place!r} is no folder of a scene")
                found = SceneFiles.read(folder, row)
                writer.add(found)
                counts[row.get("status", "made")] += 1
                if found.scene is None or found.provenance is None:
                    continue
                meta, own = found.scene["meta"], found.provenance["row"]
                held = {"text": meta["user_prompt"], "seed": meta["seed"], "row": own}
                if others := [key for key, value in held.items() if value != row[key]]:
                    what = f"is the scene of another row: its {others[0]} differs"
                    yield AuditFault(str(place), what)
    for status in ("made", "refused", "failed"):
        stated, there = manifest["rows"].get(status), counts[status]
        if stated != there:
            what = f"counts {stated} rows {status}, the table scenes has {there}"
            yield AuditFault(MANIFEST, what)


def _compare_tables(
    folder: Path, again: Path, name: str, manifest: Mapping[str, Any]
) -> Iterator[AuditFault]:
    counted = 0
    for path in list_table_files(folder / "tables", name):
        where = path.relative_to(folder).as_posix()
        try:
            found = import_parquet().ParquetFile(path)
            wanted = import_parquet().ParquetFile(again / name / path.name)
            counted += found.metadata.num_rows
            groups, columns = found.num_row_groups, found.schema_arrow.names
            if groups != wanted.num_row_groups or not all(
                found.read_row_group(k).equals(wanted.read_row_group(k, columns=columns))
                for k in range(groups)
            ):
                yield AuditFault(where, "does not say what the scenes say")
        except (OSError, ValueError) as error:
            yield AuditFault(where, f"is no such table: {error}")
    stated = manifest.get("tables", {}).get(name)
    if counted != stated:
        yield AuditFault(f"tables/{name}", f"has {counted} rows, the manifest says {stated}")


def check_again(place: str) -> str | None:
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
    return None if _says_the_same(written, proof) else "has another proof than the checker's"


_LATER = {"scene_digest", "measures", "when", "worst"}
"""What proofs of earlier versions do not say."""


def _says_the_same(written: Any, found: Any) -> bool:
    """Whether two proofs are alike but for what an earlier version did not write."""
    if isinstance(written, dict) and isinstance(found, dict):
        lacks = found.keys() - written.keys()
        return lacks <= _LATER and all(
            key in found and _says_the_same(value, found[key]) for key, value in written.items()
        )
    if isinstance(written, list) and isinstance(found, list):
        return len(written) == len(found) and all(map(_says_the_same, written, found))
    return bool(written == found)
