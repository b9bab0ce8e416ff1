"""`scenewright batch`: an input of rows carried out into a folder, and made a dataset."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

from scenewright.dataset.batch.answering import PLAINLY, Asking, load_speaking_backend
from scenewright.dataset.batch.carry_out import JOURNAL, BatchFolder, ProgressCallback, Work
from scenewright.dataset.batch.finish import finish_run
from scenewright.dataset.batch.journal import Journal
from scenewright.dataset.batch.rows import RowSource, read_source
from scenewright.dataset.batch.worker import Job, Options, build_job
from scenewright.errors import InputError
from scenewright.graph.arguments import check_arguments
from scenewright.intersections import find_bundle_folder, load_map
from scenewright.scene.relations import load_patterns
from scenewright.time_limit import check_time_limit

TITLE = "Traffic scenes in plain language"
_SHARD = re.compile(r"([1-9]\d{0,5})/([1-9]\d{0,5})")


@dataclass(frozen=True)
class Request(Work):
    """What `batch` was asked for.

    Attributes:
        limit: only the first rows of the input; None: all.
        shard: (i, n): only every n-th row, from the i-th on, counted from 1.
    """

    source: Path
    out: Path
    options: Options
    limit: int | None = None
    shard: tuple[int, int] = (1, 1)


@dataclass(frozen=True)
class Summary:
    """What a run came to.

    Attributes:
        rows: this run was about; counts: of these by status; now: how many it did itself.
        codes: why there is no scene -> how many rows; complete: whether the whole input is done.
        paid: requests to models and their tokens, for all of these rows.
    """

    rows: int
    counts: dict[str, int]
    now: int
    codes: dict[str, int]
    complete: bool
    paid: dict[str, int] = field(default_factory=dict)


def parse_shard(text: str) -> tuple[int, int]:
    """(i, n) from `i/n`; InputError for anything else."""
    found = _SHARD.fullmatch(text)
    if found is None or int(found[1]) > int(found[2]):
        raise InputError(f"--shard is i/n with i from 1 to n, such as 2/4, got {text!r}")
    return int(found[1]), int(found[2])


def run_batch(request: Request, *, log: ProgressCallback = lambda _: None) -> Summary:
    """Carries out an input; what an earlier run has done is left alone.

    Raises:
        InputError: the input, an option or the folder cannot be used.
    """
    request = replace(request, asking=replace(request.asking, turns=request.out))
    check_request(request)
    source = read_source(request.source)
    header = build_batch_header(source, request.options)
    i, n = request.shard
    name = JOURNAL if n == 1 else f"journal-{i}-of-{n}.jsonl"
    ours, all_jobs = _Jobs(source, request), _Jobs(source, replace(request, **_WHOLE))
    with BatchFolder(request.out, header=header, name=name) as batch:
        now = batch.carry_out(ours, request, of=len(ours), log=log)
        with batch.lock_journals() as journal:
            summary = build_summary(ours, journal, now=now, every=all_jobs)
            finish_run(
                batch, journal, all_jobs, changed=now > 0, given=source.rows, title=TITLE,
                complete=summary.complete,
            )  # fmt: skip
            return summary


_WHOLE: dict[str, Any] = {"limit": None, "shard": (1, 1)}


def check_request(request: Request) -> None:
    """InputError where an option cannot be used, before anything is written."""
    if request.limit is not None and request.limit < 1:
        raise InputError(f"--limit is a number from 1, got {request.limit}")
    request.check_work()
    check_time_limit(request.options.time_limit)
    check_options(request.options, request.asking)


def check_options(options: Options, asking: Asking = PLAINLY) -> None:
    """InputError where an option names what does not exist."""
    load_speaking_backend(options.backend, options.base_url, asking)
    load_map(options.intersection)
    check_arguments(options.seed, options.refiner)


def build_batch_header(source: RowSource, options: Options) -> dict[str, Any]:
    """What the first line of a journal holds: all that decides what the scenes are."""
    from scenewright import __version__

    about = {"journal": 1, "scenewright": __version__, "input": source.sha256, "rows": source.rows}
    return {**about, **list_settings(options)}


def list_settings(options: Options) -> dict[str, Any]:
    """The options, and fingerprints of the files that they name: a bundle, the relations."""
    digest = hashlib.sha256()
    for pattern in load_patterns():
        digest.update(pattern.model_dump_json().encode())
    return {
        **options.list_settings(),
        "bundle": hash_bundle(options.intersection),
        "relations": digest.hexdigest()[:16],
    }


def hash_bundle(intersection: str) -> str:
    """Of a bundle's description and map; the description has the checksums of all else."""
    bundle, digest = find_bundle_folder(intersection), hashlib.sha256()
    for file in (bundle / "bundle.toml", bundle / "map.json"):
        digest.update(file.read_bytes() if file.is_file() else b"")
    return digest.hexdigest()[:16]


def build_summary(
    jobs: Iterable[Job], journal: Journal, *, now: int, every: Iterable[Job]
) -> Summary:
    """Counts over rows, from the journal."""
    counts, codes, paid, rows = Counter[str](), Counter[str](), Counter[str](), 0
    for job in jobs:
        entry = journal.get_entry(job.number)
        rows += 1
        counts[entry.status if entry else "left"] += 1
        if entry is not None and entry.code is not None:
            codes[entry.code] += 1
        paid.update({} if entry is None else entry.paid)
    entries = (journal.get_entry(job.number) for job in every)
    complete = all(entry is not None and entry.status != "failed" for entry in entries)
    return Summary(rows, dict(counts), now, dict(codes.most_common()), complete, dict(paid))


class _Jobs:
    """The jobs of a run, in the order of the input; may be gone through again."""

    def __init__(self, source: RowSource, request: Request) -> None:
        self._source, self._request = source, request

    def __iter__(self) -> Iterator[Job]:
        i, n = self._request.shard
        for named in islice(self._source, i - 1, self._request.limit, n):
            yield build_job(named, self._request.options, self._request.asking)

    def __len__(self) -> int:
        i, n = self._request.shard
        most = self._source.rows
        return len(range(i - 1, min(most, self._request.limit or most), n))


def predict_run(request: Request, *, shown: int) -> dict[str, Any]:
    """What a run would do, for `--dry-run`: nothing is written, no folder is made.

    Raises:
        InputError: as `run_batch`, as far as is known without trying.
    """
    check_request(replace(request, asking=replace(request.asking, record=None)))
    source = read_source(request.source)
    jobs, done = _Jobs(source, request), 0
    if any(request.out.glob("journal*.jsonl")):  # of an earlier run
        header = build_batch_header(source, request.options)
        with Journal(request.out, name=None, header=header) as journal:
            entries = (journal.get_entry(job.number) for job in jobs)
            done = sum(entry is not None and entry.status != "failed" for entry in entries)
    first = [{"id": job.key, "folder": job.folder, "seed": job.seed} for job in islice(jobs, shown)]
    return {"rows": len(jobs), "done": done, "to_do": len(jobs) - done, "first": first}
