"""`scenewright batch`: many scenes in one run, which may be killed and gone on with."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from scenewright.cli.backend_options import (
    BackendNames,
    BaseUrl,
    Lawful,
    MaxAgents,
    Record,
    TimeLimit,
    Timeout,
)
from scenewright.cli.common_options import Json, Quiet, spread_options
from scenewright.cli.console import format_one_line, is_terminal, log_line, write_json, write_stdout
from scenewright.cli.interruption import keep
from scenewright.cli.interrupts import stop_if_asked
from scenewright.cli.output_folder import try_folder
from scenewright.errors import InputError
from scenewright.time_limit import DEFAULT_LIMIT

if TYPE_CHECKING:
    from scenewright.dataset.batch.carry_out import Progress, ProgressCallback
    from scenewright.dataset.batch.run import Summary
    from scenewright.dataset.batch.worker import Options

EVERY = 5.0
"""Seconds between lines of progress where there is no terminal."""
SHOWN = 5
"""Rows that a dry run shows."""

Out = Annotated[str, typer.Option(metavar="DIR", help="Folder to write.", callback=try_folder)]
Workers = Annotated[
    int | None, typer.Option(help="Processes at work; as many as there are cores if not said.")
]
EngineName = Annotated[
    Literal["process", "ray"],
    typer.Option(help="Processes of this machine, or tasks of a Ray cluster (extra `ray`)."),
]
Refiner = Annotated[
    str | None, typer.Option(help="Learned refinement of the tracks: trajnet or none.")
]
RowTimeout = Annotated[
    float | None,
    typer.Option(metavar="S", help="Longest that one row may take [s]; half an hour if not said."),
]
AtOnce = Annotated[
    int | None,
    typer.Option(
        metavar="N", help="Questions to models at a time, over all workers; one each if not said."
    ),
]
Seed = Annotated[int, typer.Option(help="Rows without a seed get one from this and their id.")]
Place = Annotated[str, typer.Option(help="Where it happens.")]


@dataclass(frozen=True)
class SceneOptions:
    """How the scenes of a run are made, and on how many processes."""

    workers: Workers = None
    row_timeout: RowTimeout = None
    time_limit: TimeLimit = DEFAULT_LIMIT
    lawful: Lawful = False
    refiner: Refiner = None
    intersection: Place = "amsterdam_120"
    seed: Seed = 0

    def build_options(self, **others: Any) -> Options:
        """What all rows share; `others` are further fields of `Options`, or other values."""
        from scenewright.dataset.batch.answering import BUILTIN
        from scenewright.dataset.batch.worker import Options
        from scenewright.graph.run import choose_refiner, find_refiner_gap

        own = {key: each for key, each in vars(self).items() if key in Options.__annotations__}
        given = own | others
        given["backend"] = tuple(given.get("backend") or BUILTIN)
        given["refiner"] = choose_refiner(given["refiner"])
        gap = find_refiner_gap(given["intersection"], given["refiner"])
        if gap is not None:
            log_line(f"warning: {gap}")
        return Options(**given)

    def choose_work(self) -> dict[str, Any]:
        """The fields of a request or an order that say how it is worked on."""
        from scenewright.dataset.batch.run import ROW_TIMEOUT

        limit = ROW_TIMEOUT if self.row_timeout is None else self.row_timeout
        workers = count_cores() if self.workers is None else self.workers
        return {"workers": workers, "row_timeout": limit}


@dataclass(frozen=True)
class RunOptions(SceneOptions):
    """How the scenes of a dataset are made, by whom, and where."""

    engine: EngineName = "process"
    backend: BackendNames = None
    base_url: BaseUrl = None
    record: Record = None
    timeout: Timeout = None
    at_once: AtOnce = None

    def choose_work(self) -> dict[str, Any]:
        """The fields of a request or an order that say how it is worked on."""
        from scenewright.dataset.batch.answering import Asking

        record = None if self.record is None else Path(self.record)
        asking = Asking(record, self.timeout, self.at_once)
        return {**super().choose_work(), "engine": self.engine, "asking": asking}


@spread_options
def make_batch(
    *,
    rows: Annotated[
        str, typer.Argument(metavar="IN", help="Rows with `id` and `text`, or plain sentences.")
    ],
    out: Out,
    run: RunOptions,
    selection: Annotated[
        Literal["draw", "map"],
        typer.Option(help="Draw among the combinations that fit, or take the likeliest."),
    ] = "draw",
    lenient: Annotated[
        bool,
        typer.Option("--lenient", help="Leave out words that cannot be realised, and list them."),
    ] = False,
    max_agents: MaxAgents = None,
    exports: Annotated[
        list[str] | None,
        typer.Option(
            "--export", metavar="FORMAT", help="Write the scenes in a format, too; repeatable."
        ),
    ] = None,
    limit: Annotated[int | None, typer.Option(help="Only the first rows.")] = None,
    shard: Annotated[
        str, typer.Option(metavar="I/N", help="Only every N-th row, from the I-th on.")
    ] = "1/1",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Read everything, write nothing, say what is to do.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Make a scene of every row and a dataset of the scenes.

    Killed at any moment, the same command goes on where it was. Rows without a scene are kept with
    the reason and stop nothing.
    """
    from scenewright.dataset.batch.run import Request, parse_shard, predict_run, run_batch
    from scenewright.dataset.batch.scenes import EXPORTS, list_scenes
    from scenewright.graph.export import export
    from scenewright.tools.exporters import find_format

    request = Request(
        source=Path(rows),
        out=Path(out),
        options=run.build_options(selection=selection, lenient=lenient, max_agents=max_agents),
        limit=limit,
        shard=parse_shard(shard),
        **run.choose_work(),
    )
    if request.workers < 1:
        raise InputError(f"--workers is a number from 1, got {request.workers}")
    for name in exports or ():
        find_format(name)  # before hours are spent
    if dry_run:
        found = predict_run(request, shown=SHOWN)
        if as_json:
            write_json({"ok": True, "dry_run": True, **found})
            return
        lines = [f"{found['rows']} rows, {found['done']} done, {found['to_do']} to do"]
        lines += [f"{each['id']!r} -> {each['folder']}" for each in found["first"]]
        write_stdout("".join(format_one_line(line) + "\n" for line in lines))
        return
    with show_batch_progress(quiet=quiet, out=out) as log:
        summary = run_batch(request, log=log)
    for name in exports or () if summary.made else ():
        export(list_scenes(request.out), name, request.out / EXPORTS / name)
    if not quiet:
        log_summary(summary)
    if as_json:
        write_json({"ok": True, "out": out, **build_summary_object(summary)})
    else:
        write_stdout(f"{out}\n")


def count_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return max(len(os.sched_getaffinity(0)), 1)
    return os.cpu_count() or 1


def build_summary_object(summary: Summary) -> dict[str, Any]:
    """What `--json` prints of a run."""
    return {
        "rows": summary.rows,
        **{status: summary.counts.get(status, 0) for status in ("made", "refused", "failed")},
        "left": summary.counts.get("left", 0),
        "done_now": summary.now,
        "complete": summary.complete,
        "reasons": summary.codes,
        "paid": summary.paid,
    }


def log_summary(summary: Summary) -> None:
    """Two lines for people."""
    counts = ", ".join(f"{count} {status}" for status, count in summary.counts.items())
    log_line(f"{summary.rows} rows: {counts or 'none'}")
    if summary.codes:
        codes = ", ".join(f"{code} ({count})" for code, count in summary.codes.items())
        log_line(f"without a scene: {codes}; table refused has each row's reason")
    if summary.paid:
        log_line(
            ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in summary.paid.items())
        )
    if summary.counts.get("failed"):
        log_line("rows that failed are tried again by the same command")


@contextmanager
def show_batch_progress(*, quiet: bool, out: str) -> Iterator[ProgressCallback]:
    """Shows the progress of a batch: a bar on a terminal, a line every 5 s elsewhere."""
    keep(f"what is done stays in {out}, and the same command goes on from there")
    if quiet:
        yield lambda _: stop_if_asked()
    elif is_terminal(sys.stderr):
        with _show_bar() as log:
            yield log
    else:
        yield _BatchLines()


class _BatchLines:
    """Says a line now and then, and at the end."""

    def __init__(self) -> None:
        self._last = time.monotonic()

    def __call__(self, progress: Progress) -> None:
        stop_if_asked()
        now = time.monotonic()
        if now - self._last >= EVERY or (progress.done == progress.of and progress.rate):
            self._last = now
            log_line(format_progress(progress))


@contextmanager
def _show_bar() -> Iterator[ProgressCallback]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (BarColumn(bar_width=30), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=None)

        def log(progress: Any) -> None:
            stop_if_asked()
            words = format_progress(progress)
            bar.update(task, total=progress.of, completed=progress.done, description=words)

        yield log


def format_progress(progress: Progress) -> str:
    """`120 of 1000 rows (3 refused), 18.2 rows/s, 48 s left`; or of `texts` of an order."""
    unmade = [f"{n} {status}" for status, n in progress.counts.items() if status != "made"]
    counted = f" ({', '.join(unmade)})" if unmade else ""
    rate = f", {progress.rate:.3g} {progress.what}/s" if progress.rate else ""
    left = "" if progress.left is None else f", {format_duration(progress.left)} left"
    return f"{progress.done} of {progress.of} {progress.what}{counted}{rate}{left}"


def format_duration(seconds: float) -> str:
    """`48 s`, `12 min`, `3.5 h`."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
