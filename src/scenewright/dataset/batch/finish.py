"""What makes a folder of scenes a dataset: tables, figures, card and manifest."""

from __future__ import annotations

import os
import shutil
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from scenewright.dataset.batch.answering import label
from scenewright.dataset.batch.journal import Journal, JournalEntry
from scenewright.dataset.batch.manifest import hash_files, write_manifest
from scenewright.dataset.batch.pictures import Statistics, draw_overview, draw_statistics
from scenewright.dataset.batch.worker import Job
from scenewright.dataset.tables.card import ABSTRACT, Contents, describe_in_croissant, format_card
from scenewright.dataset.tables.coverage import Encounter, list_encounters, measure_coverage
from scenewright.dataset.tables.parquet import (
    TABLES,
    SceneFiles,
    TableWriter,
    build_event_rows,
    list_table_files,
)
from scenewright.dataset.tables.splits import choose_split
from scenewright.files import write_atomically
from scenewright.scene.events import Proof

PICTURES = ("figures/overview.png", "figures/statistics.png")
CARD, CROISSANT = "README.md", "croissant.json"


@dataclass
class _Tally:
    """What the card and the figure report of the scenes."""

    counts: Counter[str] = field(default_factory=Counter)
    tables: Counter[str] = field(default_factory=Counter)
    codes: Counter[str] = field(default_factory=Counter)
    events: Counter[tuple[str, str]] = field(default_factory=Counter)
    causes: Counter[tuple[str, str]] = field(default_factory=Counter)
    patterns: Counter[str] = field(default_factory=Counter)
    agents: Counter[int] = field(default_factory=Counter)
    places: dict[str, array[float]] = field(default_factory=dict)
    verdicts: Counter[str] = field(default_factory=Counter)
    unshown: Counter[str] = field(default_factory=Counter)
    unlawful: int = 0
    worse: int = 0
    intersections: Counter[str] = field(default_factory=Counter)
    statistics: Statistics = field(default_factory=Statistics)
    encounters: list[Encounter] = field(default_factory=list)

    def note(self, entry: JournalEntry, files: SceneFiles) -> None:
        """Counts one row."""
        self.counts[entry.status] += 1
        if entry.code is not None:
            self.codes[f"{entry.status}: {entry.code}"] += 1
        if files.scene is None:
            return
        self.statistics.note(files)
        proof = Proof.model_validate(files.proof)
        self.verdicts[proof.verdict] += 1
        if proof.verified and files.proof is not None:
            self.encounters += list_encounters(files.scene, files.proof)
        self.unshown.update(list(dict.fromkeys(e.words for e in proof.list_words("not_shown"))))
        self.unlawful += proof.unasked_red_lights > 0
        self.worse += any(event.list_worse() for event in proof.events)
        self.patterns.update((files.provenance or {}).get("patterns", ()))
        self.agents[len(files.scene["agents"])] += 1
        self.intersections[files.scene["meta"]["intersection"]] += 1
        for event in build_event_rows("", files.scene, files.proof or {}):
            kind = event["type"]
            asked = event["asked"] or kind == "normal"
            how = "incidental" if event["incidental"] else "asked for" if asked else "unasked"
            self.events[kind, how] += 1
            if event["asked"]:
                self.causes[kind, (event["cause"] or "none seen").replace("_", " ")] += 1
            if event["x"] is not None and how != "incidental":
                kept = self.places.setdefault(kind, array("d"))
                kept.extend((event["x"], event["y"], event["time"]))


def finish(
    out: Path,
    jobs: Iterable[Job],
    journal: Journal,
    *,
    about: Mapping[str, Any],
    given: int,
    title: str,
    complete: bool,
    extra: Iterable[str] = (),
) -> None:
    """Writes tables, figure, card and manifest over all rows that the journal knows.

    Each file is replaced as a whole, the manifest last; before that there is none.

    Args:
        about: further keys of the manifest; given: rows of the whole input.
        complete: whether another run would have nothing to do, or to mend.
        extra: names of further files of the dataset.
    """
    part = out / ".finish.parts"
    shutil.rmtree(part, ignore_errors=True)
    (part / "tables").mkdir(parents=True)
    (part / "figures").mkdir()
    tally = _Tally()
    with TableWriter(part / "tables") as tables:
        for job, entry in _list_done(journal, jobs):
            row = _read_files(out, job, entry)
            tally.tables.update(tables.add(row))
            tally.note(entry, row)
    overview, statistics = (part / name for name in PICTURES)
    commonest = max(sorted(tally.intersections), key=tally.intersections.__getitem__, default=None)
    draw_overview(overview, places=tally.places, agents=tally.agents, name=commonest)
    draw_statistics(statistics, tally.statistics)
    files = {name: list_table_files(part / "tables", name) for name in TABLES}
    splits = {name: [each.stem for each in found] for name, found in files.items() if found}
    croissant = describe_in_croissant(
        name=title, description=ABSTRACT, version=str(about.get("scenewright")),
        licence="https://www.apache.org/licenses/LICENSE-2.0", tables=list(splits),
    )  # fmt: skip
    (part / CROISSANT).write_bytes(croissant)
    tables_there = [each.relative_to(part).as_posix() for found in files.values() for each in found]
    names = [*tables_there, *PICTURES, CROISSANT]
    shutil.rmtree(out / "tables", ignore_errors=True)  # a split may have no rows any more
    for name in names:
        (out / name).parent.mkdir(exist_ok=True, parents=True)
        os.replace(part / name, out / name)
    shutil.rmtree(part, ignore_errors=True)
    left = given - tally.counts.total()
    text = format_card(_build_contents(tally, splits=splits, title=title, given=given, about=about))
    write_atomically(out / CARD, text.encode("utf-8"))
    counts = {status: tally.counts[status] for status in ("made", "refused", "failed")}
    manifest = {
        "schema_version": 1,
        "complete": complete,
        **about,
        "rows": {"given": given, **counts, "left": left},
        "tables": {name: tally.tables[name] for name in TABLES},
    }
    ours = hash_files(out, [CARD, *names, *extra])
    theirs = (
        (f"{row.folder}/{name}", sha256)
        for _, row in _list_done(journal, jobs)
        for name, sha256 in row.sha256.items()
    )
    write_manifest(out, manifest, chain(ours, theirs))


def _list_done(journal: Journal, jobs: Iterable[Job]) -> Iterator[tuple[Job, JournalEntry]]:
    """The rows that came to an end, in the order of the input."""
    for job in jobs:
        entry = journal.get_entry(job.number)
        if entry is not None:
            yield job, entry


def _read_files(out: Path, job: Job, entry: JournalEntry) -> SceneFiles:
    made, options = entry.status == "made", job.options
    about = {
        "row": job.key,
        "folder": entry.folder if made else None,
        "status": entry.status,
        "code": entry.code,
        "reason": entry.reason,
        "text": job.text,
        "asked": job.asked,
        "voice": job.voice,
        "split": job.split or choose_split(options.intersection, job.text, job.voice),
        "seed": job.seed,
        "intersection": options.intersection,
        "backend": label(options.backend),
        "refiner": options.refiner,
        "selection": options.selection,
        "attempts": entry.attempts,
    }
    files = SceneFiles.read(out, about)
    if files.scene is not None:
        about["seed"] = files.scene["meta"]["seed"]  # of several that were drawn, the one that did
    return files


def _build_contents(
    tally: _Tally,
    *,
    splits: Mapping[str, Sequence[str]],
    title: str,
    given: int,
    about: Mapping[str, Any],
) -> Contents:
    sizes = np.array([n for n, times in sorted(tally.agents.items()) for _ in range(times)])
    figures = {
        "instructions given": given,
        "scenes made": tally.counts["made"],
        **{f"instructions {status}": tally.counts[status] for status in ("refused", "failed")},
        **{f"scenes at {place}": n for place, n in sorted(tally.intersections.items())},
        "scenes verified": tally.verdicts["verified"],
        "scenes verified in part, without all words": tally.verdicts["partly"],
        "words not shown, those of most scenes": ", ".join(
            repr(words) for words, _ in tally.unshown.most_common(12)
        )
        or "none",
        "scenes with a red light run unasked": tally.unlawful,
        "scenes whose pair is closer or faster to a contact at another moment": tally.worse,
        "agents per scene, least, median, most": "–"
        if not len(sizes)
        else f"{sizes.min()}, {float(np.median(sizes)):g}, {sizes.max()}",
    }
    return Contents(
        title=title, figures=figures, tables=tally.tables, splits=splits, events=tally.events,
        causes=tally.causes, patterns=tally.patterns, unmade=tally.codes,
        statistics=tally.statistics.list_rows(), coverage=measure_coverage(tally.encounters),
        about=about, pictures=PICTURES,
    )  # fmt: skip
