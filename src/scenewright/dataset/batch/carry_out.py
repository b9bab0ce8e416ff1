"""Jobs carried out into a folder: what is done is left alone, what is damaged is done again.

A row's folder is there whole, or not at all.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any, Literal, Self, TypeVar

from scenewright.dataset.batch.answering import PLAINLY, Asking
from scenewright.dataset.batch.journal import Journal, JournalEntry, lock_journal
from scenewright.dataset.batch.manifest import MANIFEST
from scenewright.dataset.batch.pool import TRIES, WARM_UP, Died, Overdue, spread
from scenewright.dataset.batch.worker import FILES, Job, Outcome, work
from scenewright.dataset.tables.parquet import require_tables
from scenewright.errors import InputError
from scenewright.extras import require_extra
from scenewright.files import make_folder
from scenewright.time_limit import raise_after

JobT = TypeVar("JobT")
ResultT = TypeVar("ResultT")

SHARD = 8
"""Jobs of one Ray task: few enough to lose with a worker, enough to pay for the task."""
AHEAD = 2
"""Tasks in flight for each worker, so that none waits for the driver."""
_WARM: list[bool] = []
"""Not empty where this process has done a job."""


def spread_on_ray(
    jobs: Iterable[JobT],
    task: Callable[[JobT], ResultT],
    *,
    workers: int,
    limit: float | None = None,
) -> Iterator[tuple[JobT, ResultT | Died | Overdue]]:
    """(job, result) as tasks of a Ray cluster come to an end.

    Joins the cluster that RAY_ADDRESS names, else starts one on this machine with `workers` CPUs.
    A task whose worker dies is run again by Ray, at most TRIES times in all; then each of its jobs
    gets a task of its own, so that a job that kills its worker costs no other.

    Args:
        limit: longest that one job may take [s].

    Raises:
        InputError: Ray is not installed.
    """
    require_extra("ray", "--engine ray", "ray")
    ray = import_module("ray")
    started = not ray.is_initialized()
    if started:
        address = os.environ.get("RAY_ADDRESS")
        local = {} if address else {"num_cpus": workers, "include_dashboard": False}
        ray.init(address=address, log_to_driver=False, logging_level="ERROR", **local)
    remote = ray.remote(num_cpus=1, max_retries=TRIES - 1)(_run_shard)
    fresh, alone = iter(jobs), deque[JobT]()
    flying: dict[Any, list[JobT]] = {}
    try:
        while True:
            while len(flying) < AHEAD * workers:
                shard = [alone.popleft()] if alone else list(islice(fresh, SHARD))
                if not shard:
                    break
                flying[remote.remote(task, shard, limit)] = shard
            if not flying:
                return
            done, _ = ray.wait(list(flying), num_returns=1, timeout=1.0)
            for each in done:
                shard = flying.pop(each)
                try:
                    results = ray.get(each)
                except ray.exceptions.RayTaskError:
                    raise
                except ray.exceptions.RayError:  # every worker that had it died
                    if len(shard) > 1:
                        alone.extend(shard)
                        continue
                    results = [Died(None)]
                yield from zip(shard, results, strict=True)
    finally:
        if started:
            ray.shutdown()


def _run_shard(task: Callable[[Any], Any], jobs: list[Any], limit: float | None) -> list[Any]:
    return [run_within(limit, task, job) for job in jobs]


class _TimeIsUp(BaseException):
    """Raised in the midst of a job; a base exception, so that no job takes it for its own."""


def run_within(limit: float | None, task: Callable[[Any], Any], job: Any) -> Any:
    """A job's result, or `Overdue` when the time is up."""
    if limit is None:
        return task(job)
    try:
        with raise_after(limit if _WARM else limit + WARM_UP, _TimeIsUp()):
            return task(job)
    except _TimeIsUp:
        return Overdue(limit)
    finally:
        _WARM[:] = [True]


Engine = Literal["process", "ray"]
ROW_TIMEOUT, MOST_ROW_TIMEOUT = 1800.0, 86400.0
"""Default of the longest that one row may take [s], and the largest value allowed."""
MOST_WORKERS, MOST_AT_ONCE = 1024, 256
JOURNAL = "journal.jsonl"
_OUT_OF_MEMORY = -9
RECENT = 50
"""Rows whose pace tells how long the others will take."""


@dataclass(frozen=True, kw_only=True)
class Work:
    """How jobs are worked on. It changes no scene, so it may change from run to run.

    Attributes:
        workers: processes; row_timeout: longest that one row may take [s].
        asking: how questions are put.
    """

    workers: int = 1
    engine: Engine = "process"
    row_timeout: float = ROW_TIMEOUT
    asking: Asking = PLAINLY

    def check_work(self) -> None:
        """InputError where an option cannot be used."""
        at_once = self.asking.at_once
        if not 1 <= self.workers <= MOST_WORKERS:
            raise InputError(f"--workers is a number from 1 to {MOST_WORKERS}, got {self.workers}")
        if not 1.0 <= self.row_timeout <= MOST_ROW_TIMEOUT:
            span = f"1 to {MOST_ROW_TIMEOUT:g} seconds for one row"
            raise InputError(f"--row-timeout is {span}, got {self.row_timeout:g}")
        if at_once is not None and not 1 <= at_once <= MOST_AT_ONCE:
            raise InputError(f"--at-once is a number from 1 to {MOST_AT_ONCE}, got {at_once}")
        for name, value in (("--record", self.asking.record), ("--at-once", at_once)):
            if self.engine == "ray" and value is not None:
                raise InputError(f"{name} works on one machine: leave it out with --engine ray")
        require_tables()


class Progress:
    """How far a run is, counted as its rows come to an end.

    Attributes:
        of: rows in all; counts: rows that came to an end by status, earlier runs' included.
        now: how many came to an end in this run; what: what is counted, rows or texts of an order.
    """

    def __init__(self, of: int, log: Callable[[Progress], None], *, what: str = "rows") -> None:
        self.of, self.what, self.counts, self.now = of, what, Counter[str](), 0
        self._log, self._ended = log, deque[float](maxlen=RECENT)

    def log_end(self, status: str, *, now: bool) -> None:
        """Count a row and report; `now` tells it from one of an earlier run."""
        self.counts[status] += 1
        if now:
            self.now += 1
            self._ended.append(time.monotonic())
        self._log(self)

    @property
    def done(self) -> int:
        """Rows that came to an end."""
        return self.counts.total()

    @property
    def rate(self) -> float:
        """Rows a second of the last ones: what workers need to start says nothing."""
        if len(self._ended) < 2:
            return 0.0
        return (len(self._ended) - 1) / max(self._ended[-1] - self._ended[0], 1e-6)

    @property
    def left(self) -> float | None:
        """Seconds to go, if known."""
        return (self.of - self.done) / self.rate if self.rate else None


ProgressCallback = Callable[[Progress], None]


class BatchFolder:
    """A folder that jobs are carried out into, by this process alone."""

    def __init__(self, out: Path, *, header: Mapping[str, Any], name: str = JOURNAL) -> None:
        """Nothing is read or written before the `with` block begins."""
        self.out, self.header, self._name = out, header, name
        self._parts = out / f".{name}.parts"
        self._stack = ExitStack()
        self.journal: Journal

    def __enter__(self) -> Self:
        make_folder(self.out)
        with ExitStack() as stack:
            try:
                if not any(self.out.glob("journal*.jsonl")) and not all(
                    entry.name.startswith((".journal", ".finish")) for entry in self.out.iterdir()
                ):
                    raise InputError(f"{self.out} holds other files; choose another --out")
                stack.enter_context(lock_journal(self.out, self._name))
                self._discard_leftovers()
                self.journal = Journal(self.out, name=self._name, header=self.header)
            except OSError as error:
                reason = error.strerror or error
                raise InputError(f"cannot write {self.out}: {reason}") from error
            stack.callback(self.journal.close)
            stack.callback(self._discard_leftovers)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def carry_out(self, jobs: Iterable[Job], how: Work, *, of: int, log: ProgressCallback) -> int:
        """Does every job that is not done; how many those were.

        Args:
            of: how many jobs there are, for the progress; log: called after every row.

        Raises:
            InputError: the folder cannot be written any more; what is done stays.
        """
        progress = Progress(of, log)
        todo = self._list_due(jobs, progress)
        workers, limit = how.workers, how.row_timeout
        if how.engine == "process":
            results = spread(todo, work, workers=workers, limit=limit)
        else:
            results = spread_on_ray(todo, work, workers=workers, limit=limit)
        for job, result in results:
            if not progress.now:
                # From here on it would not list what is there.
                (self.out / MANIFEST).unlink(missing_ok=True)
            outcome = result if isinstance(result, Outcome) else _build_failure(result)
            hashes = {}
            if outcome.status == "made":
                hashes = publish(outcome.files, self.out / job.folder, parts=self._parts)
            own = {name: each for name, each in vars(outcome).items() if name != "files"}
            self.journal.append(JournalEntry(job.number, job.key, job.folder, sha256=hashes, **own))
            progress.log_end(outcome.status, now=True)
        return progress.now

    @contextmanager
    def lock_journals(self) -> Iterator[Journal]:
        """The journals of all runs into this folder as they are; no other finishes meanwhile."""
        with (
            lock_journal(self.out, "finish", patient=True),
            Journal(self.out, name=None, header=self.header) as journal,
        ):
            yield journal

    def _list_due(self, jobs: Iterable[Job], progress: Progress) -> Iterator[Job]:
        """Jobs but those that came to an end that another try would not change, and are whole."""
        for job in jobs:
            entry = self.journal.get_entry(job.number)
            if entry is None or entry.status == "failed":
                yield job
                continue
            if entry.key != job.key:
                raise InputError(f"{self.out}: row {job.number} is {entry.key!r}, not {job.key!r}")
            if entry.status == "made" and not is_whole(self.out / entry.folder, entry.sha256):
                yield job
            else:
                progress.log_end(entry.status, now=False)

    def _discard_leftovers(self) -> None:
        """Removes what a killed run of this journal had not finished."""
        shutil.rmtree(self._parts, ignore_errors=True)


def _build_failure(result: Died | Overdue) -> Outcome:
    """What became of a row whose worker died or took too long."""
    if isinstance(result, Overdue):
        reason = f"took longer than the {result.limit:g} s that a row may take (--row-timeout)"
        return Outcome("failed", "overdue", reason, seconds=result.limit)
    cause = "" if result.code is None else f", the last with code {result.code}"
    if result.code == _OUT_OF_MEMORY:
        cause = ", the last killed from outside, as a machine does that runs out of memory"
    return Outcome("failed", "worker_died", f"{TRIES} workers died of this row{cause}")


def publish(files: Mapping[str, bytes], folder: Path, *, parts: Path) -> dict[str, str]:
    """Writes a row's files into `parts` and moves them to `folder` at once; name -> sha256.

    Raises:
        InputError: it cannot be written, or something else stands there.
    """
    part = parts / secrets.token_hex(8)
    try:
        part.mkdir(parents=True)
        for name, data in files.items():
            (part / name).write_bytes(data)
        if folder.exists():  # of a row that no journal knows; never anything that is no scene's
            names = {entry.name for entry in folder.iterdir()} if folder.is_dir() else {""}
            if not names <= set(FILES):
                raise InputError(f"{folder} is in the way: it holds other things than a scene")
            shutil.rmtree(folder)
        os.rename(part, folder)
    except OSError as error:
        shutil.rmtree(part, ignore_errors=True)
        raise InputError(f"cannot write {folder}: {error.strerror or error}") from error
    return {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}


def is_whole(folder: Path, sha256: Mapping[str, str]) -> bool:
    """Whether a folder's files are there, as they were written."""
    try:
        return all(
            hashlib.sha256((folder / name).read_bytes()).hexdigest() == wanted
            for name, wanted in sha256.items()
        )
    except OSError:
        return False
