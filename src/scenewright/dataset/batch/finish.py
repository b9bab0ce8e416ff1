"""What makes a folder of scenes a dataset: tables, figures, card and manifest."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from scenewright.dataset.batch.carry_out import JOURNAL, BatchFolder, is_whole, publish
from scenewright.dataset.batch.journal import Journal, lock_journal
from scenewright.dataset.batch.manifest import MANIFEST, hash_files, read_manifest, write_manifest
from scenewright.dataset.batch.pictures import draw_overview, draw_statistics
from scenewright.dataset.batch.worker import FILES, Job
from scenewright.dataset.tables.card import describe_in_croissant, format_card
from scenewright.dataset.tables.parquet import (
    TABLES,
    SceneFiles,
    TableWriter,
    list_table_files,
    read_table,
)
from scenewright.dataset.tables.splits import choose_split
from scenewright.dataset.tables.tally import Tally
from scenewright.errors import InputError
from scenewright.files import format_json_line, write_atomically

PICTURES = ("figures/overview.png", "figures/statistics.png")
CARD, CROISSANT = "README.md", "croissant.json"
JOINED = "joined.jsonl"
"""The rows that came from other datasets, one a line."""
ABOUT = (
    "row", "folder", "status", "code", "reason", "text", "asked", "voice", "split", "seed",
    "intersection", "backend", "refiner", "selection", "attempts",
)  # fmt: skip
"""Columns of `scenes` and `refused` that the scenes' files lack, always or at times."""
FinishedRow = tuple[Mapping[str, Any], Mapping[str, str]]
"""What is known of a row without its files, by `ABOUT`; and its files' hashes, by name."""


def finish(
    out: Path,
    list_rows: Callable[[], Iterable[FinishedRow]],
    *,
    about: Mapping[str, Any],
    given: int,
    title: str,
    complete: bool,
    extra: Iterable[str] = (),
) -> None:
    """Writes tables, figures, card and manifest over a folder's own rows and those that joined it.

    Each file is replaced as a whole, the manifest last; before that there is none.

    Args:
        list_rows: the own rows that came to an end, in order.
        about: further keys of the manifest; given: own rows, those without an end included.
        complete: whether another run would have nothing to do, or to mend.
        extra: names of further files of the dataset.
    """
    part = out / ".finish.parts"
    shutil.rmtree(part, ignore_errors=True)
    (part / "tables").mkdir(parents=True)
    (part / "figures").mkdir()
    joined, tally = read_joined(out), Tally()
    given += len(joined)
    with TableWriter(part / "tables") as tables:
        for row, _ in chain(list_rows(), joined):
            files = SceneFiles.read(out, row)
            if files.scene is not None:  # of several seeds that were drawn, the one that did
                files = replace(files, about={**row, "seed": files.scene["meta"]["seed"]})
            tally.note(files, tables.add(files))
    overview, statistics = (part / name for name in PICTURES)
    commonest = max(sorted(tally.intersections), key=tally.intersections.__getitem__, default=None)
    draw_overview(overview, places=tally.places, agents=tally.agents, name=commonest)
    draw_statistics(statistics, tally.figures)
    written = {name: list_table_files(part / "tables", name) for name in TABLES}
    splits = {name: [each.stem for each in found] for name, found in written.items() if found}
    croissant = describe_in_croissant(
        name=title, version=str(about.get("scenewright")), tables=list(splits)
    )
    (part / CROISSANT).write_bytes(croissant)
    names = [each.relative_to(part).as_posix() for found in written.values() for each in found]
    names += [*PICTURES, CROISSANT]
    shutil.rmtree(out / "tables", ignore_errors=True)  # a split may have no rows any more
    for name in names:
        (out / name).parent.mkdir(exist_ok=True, parents=True)
        os.replace(part / name, out / name)
    shutil.rmtree(part, ignore_errors=True)
    text = format_card(
        tally, title=title, given=given, splits=splits, about=about, pictures=PICTURES
    )
    write_atomically(out / CARD, text.encode("utf-8"))
    counts = {status: tally.statuses[status] for status in ("made", "refused", "failed")}
    manifest = {
        "schema_version": 1,
        "complete": complete,
        **about,
        "rows": {"given": given, **counts, "left": given - tally.statuses.total()},
        "tables": {name: tally.tables[name] for name in TABLES},
    }
    ours = hash_files(out, [CARD, *names, *([JOINED] if joined else []), *extra])
    theirs = (
        (f"{row['folder']}/{name}", sha256)
        for row, hashes in chain(list_rows(), joined)
        for name, sha256 in hashes.items()
    )
    write_manifest(out, manifest, chain(ours, theirs))


def finish_run(
    batch: BatchFolder, journal: Journal, jobs: Iterable[Job], *, changed: bool, **more: Any
) -> None:
    """Finishes a folder where a run has changed what is in it, or nothing was written over it yet.

    Args:
        jobs: of all rows of the folder; more: as `finish` has them.
    """
    if changed or not (batch.out / MANIFEST).exists():
        about = {key: each for key, each in batch.header.items() if key not in ("journal", "rows")}
        finish(batch.out, partial(list_journal_rows, journal, jobs), about=about, **more)


def list_journal_rows(journal: Journal, jobs: Iterable[Job]) -> Iterator[FinishedRow]:
    """The rows that came to an end, in the order of the input."""
    for job in jobs:
        entry, options = journal.get_entry(job.number), job.options
        if entry is not None:
            split = job.split or choose_split(options.intersection, job.text, job.voice)
            about = {
                "row": job.key, "folder": entry.folder if entry.status == "made" else None,
                "split": split, "backend": ", ".join(options.backend),
                **{key: getattr(entry, key) for key in ("status", "code", "reason", "attempts")},
                **{key: getattr(job, key) for key in ("text", "asked", "voice", "seed")},
                **{key: getattr(options, key) for key in ("intersection", "refiner", "selection")},
            }  # fmt: skip
            yield about, entry.sha256


def read_joined(out: Path) -> list[FinishedRow]:
    """The rows that came from other datasets."""
    if not (out / JOINED).exists():
        return []
    lines = (out / JOINED).read_text("utf-8").splitlines()
    return [(each["about"], each["sha256"]) for each in map(json.loads, lines)]


def join_dataset(out: Path, other: Path) -> int:
    """Adds another dataset's rows to one, scenes and refusals; how many they are.

    The command that made the dataset goes on with it as before.

    Raises:
        InputError: one of them is no finished dataset, a row is in both, or a scene is damaged.
    """
    manifest, theirs = read_manifest(out), list(_read_rows(other))
    with lock_journal(out, JOURNAL), lock_journal(out, "finish", patient=True):
        joined = read_joined(out)
        away = {row["row"] for row, _ in joined}
        ours = [row for row in _read_rows(out) if row[0]["row"] not in away]
        for key in ("row", "folder"):
            known = {row[key] for row, _ in (*ours, *joined)} - {None}
            if twice := sorted(row[key] for row, _ in theirs if row[key] in known):
                raise InputError(f"{out} and {other} both have the {key} {twice[0]!r}")
        for row, hashes in theirs:
            if not is_whole(other / (row["folder"] or ""), hashes):
                raise InputError(f"{other / row['folder']} is damaged: a hash differs")
            if hashes:
                files = {name: (other / row["folder"] / name).read_bytes() for name in hashes}
                publish(files, out / row["folder"], parts=out / f".{JOURNAL}.parts")
        lines = [{"about": row, "sha256": hashes} for row, hashes in (*joined, *theirs)]
        write_atomically(out / JOINED, b"".join(map(format_json_line, lines)))
        ends = {"schema_version", "complete", "rows", "tables", "files", "manifest"}
        finish(
            out, lambda: ours, given=manifest["rows"]["given"] - len(joined),
            about={key: each for key, each in manifest.items() if key not in ends},
            title=json.loads((out / CROISSANT).read_bytes())["name"],
            complete=manifest["complete"],
            extra=[name for name in manifest["files"]
                   if "/" not in name and name not in (CARD, CROISSANT, JOINED)],
        )  # fmt: skip
    return len(theirs)


def _read_rows(folder: Path) -> Iterator[FinishedRow]:
    """The rows of a finished dataset, from its tables."""
    hashes = read_manifest(folder)["files"]
    for table in ("scenes", "refused"):
        for row in read_table(folder / "tables", table, ABOUT):
            made = table == "scenes"
            yield (
                dict.fromkeys(ABOUT) | {"status": "made"} | row,
                {name: hashes[f"{row['folder']}/{name}"] for name in FILES if made},
            )
