"""`scenewright batch` and `sweep`: many scenes in one run, which may be killed and gone on with."""

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

from scenewright.cli.console import Result, format_one_line, is_terminal, log_line, show_progress
from scenewright.cli.interrupts import keep, stop_if_asked
from scenewright.cli.options import (
    DrawOptions,
    LawOptions,
    MaxAgents,
    ModelOptions,
    Quiet,
    argument,
    option,
)
from scenewright.cli.output_folder import try_folder
from scenewright.errors import InputError

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


@dataclass(frozen=True)
class SceneOptions(LawOptions):
    """How the scenes of a run are made, and on how many processes."""

    workers: Workers = None
    row_timeout: float | None = option(
        None, "Longest that one row may take [s]; half an hour if not said.", metavar="S"
    )
    refiner: str | None = option(None, "Learned refinement of the tracks: trajnet or none.")
    seed: int = option(0, "Rows without a seed get one from this and their id.")

    def build_options(self, **others: Any) -> Options:
        """What all rows share; `others` are further fields of `Options`, or other values."""
        from scenewright.dataset.batch.answering import BUILTIN
        from scenewright.dataset.batch.worker import Options
        from scenewright.graph.arguments import choose_refiner, find_refiner_gap

        given = self.pass_on(Options) | others
        given["backend"] = tuple(given.get("backend") or BUILTIN)
        given["refiner"] = choose_refiner(given["refiner"])
        gap = find_refiner_gap(given["intersection"], given["refiner"])
        if gap is not None:
            log_line(f"warning: {gap}")
        return Options(**given)

    def choose_work(self) -> dict[str, Any]:
        """The fields of a request or an order that say how it is worked on."""
        from scenewright.dataset.batch.carry_out import ROW_TIMEOUT

        limit = ROW_TIMEOUT if self.row_timeout is None else self.row_timeout
        workers = count_cores() if self.workers is None else self.workers
        return {"workers": workers, "row_timeout": limit}


@dataclass(frozen=True)
class RunOptions(SceneOptions, ModelOptions):
    """How the scenes of a dataset are made, by whom, and where."""

    engine: Literal["process", "ray"] = option(
        "process", "Processes of this machine, or tasks of a Ray cluster (extra `ray`)."
    )
    at_once: int | None = option(
        None, "Questions to models at a time, over all workers; one each if not said.", metavar="N"
    )

    def choose_work(self) -> dict[str, Any]:
        """The fields of a request or an order that say how it is worked on."""
        from scenewright.dataset.batch.answering import Asking

        record = None if self.record is None else Path(self.record)
        asking = Asking(record, self.timeout, self.at_once)
        return {**super().choose_work(), "engine": self.engine, "asking": asking}


def make_batch(
    *,
    rows: str = argument(..., "Rows with `id` and `text`, or plain sentences.", metavar="IN"),
    out: Out,
    run: RunOptions,
    drawn: DrawOptions,
    exports: list[str] | None = option(
        None, "Write the scenes in a format, too; repeatable.", "--export", metavar="FORMAT"
    ),
    limit: int | None = option(None, "Only the first rows."),
    shard: str = option("1/1", "Only every N-th row, from the I-th on.", metavar="I/N"),
    dry_run: bool = option(False, "Read everything, write nothing, say what is to do."),
    quiet: Quiet = False,
) -> Result:
    """Make a scene of every row and a dataset of the scenes.

    Killed at any moment, the same command goes on where it was. Rows without a scene are kept with
    the reason and stop nothing.
    """
    from scenewright.dataset.batch.pool import start_server

    if not dry_run and run.engine != "ray" and Path(rows).is_file():
        start_server()
    from scenewright.dataset.batch.manifest import EXPORTS, list_scenes
    from scenewright.dataset.batch.run import Request, parse_shard, predict_run, run_batch
    from scenewright.graph.export import export
    from scenewright.tools.formats import find_format

    request = Request(
        source=Path(rows),
        out=Path(out),
        options=run.build_options(**vars(drawn)),
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
        lines = [f"{found['rows']} rows, {found['done']} done, {found['to_do']} to do"]
        lines += [f"{each['id']!r} -> {each['folder']}" for each in found["first"]]
        text = "".join(format_one_line(line) + "\n" for line in lines)
        return Result({"dry_run": True, **found}, text)
    with show_batch_progress(quiet=quiet, out=out) as log:
        summary = run_batch(request, log=log)
    for name in exports or () if summary.counts.get("made") else ():
        export(list_scenes(request.out), name, request.out / EXPORTS / name)
    return show_summary(summary, {"out": out}, f"{out}\n")


def count_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return max(len(os.sched_getaffinity(0)), 1)
    return os.cpu_count() or 1


def show_summary(summary: Summary, facts: dict[str, Any], text: str) -> Result:
    """What came of a run, for machines and in a few lines for people."""
    own = {
        "rows": summary.rows,
        **{each: summary.counts.get(each, 0) for each in ("made", "refused", "failed", "left")},
        "done_now": summary.now,
        "complete": summary.complete,
        "reasons": summary.codes,
        "paid": summary.paid,
    }
    counts = ", ".join(f"{count} {status}" for status, count in summary.counts.items())
    lines = [f"{summary.rows} rows: {counts or 'none'}"]
    if summary.codes:
        codes = ", ".join(f"{code} ({count})" for code, count in summary.codes.items())
        lines += [f"without a scene: {codes}; table refused has each row's reason"]
    if summary.paid:
        paid = (f"{count} {name.replace('_', ' ')}" for name, count in summary.paid.items())
        lines += [", ".join(paid)]
    if summary.counts.get("failed"):
        lines += ["rows that failed are tried again by the same command"]
    return Result({**facts, **own}, text, summary=lines)


@contextmanager
def show_batch_progress(*, quiet: bool, out: str) -> Iterator[ProgressCallback]:
    """Shows the progress of a batch; where there is no terminal in a line every 5 s, and the last.

    Every progress is also a moment at which a batch that shall stop does.
    """
    keep(f"what is done stays in {out}, and the same command goes on from there")
    told = time.monotonic()
    with show_progress(quiet=quiet) as log:

        def tell(progress: Progress) -> None:
            nonlocal told
            stop_if_asked()
            now, ends = time.monotonic(), progress.done == progress.of and bool(progress.rate)
            if is_terminal(sys.stderr) or ends or now - told >= EVERY:
                told = now
                log("", format_progress(progress))

        yield tell


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


Sampling = Annotated[
    Literal["grid", "lhs", "sobol", "boundary"],
    typer.Option(help="How points are spread; boundary takes the corners alone."),
]


@dataclass(frozen=True)
class SweepOptions(SceneOptions):
    """Which points of a plan are made, and how."""

    n: int = option(50, "Points; a grid or its corners may be fewer.", "--n")
    sampling: Sampling = "sobol"
    seed: int = option(0, "Of the points, and of every scene.")
    draws: int = option(3, "Seeds tried for a point until one makes a scene.", min=1, max=100)
    max_agents: MaxAgents = None


def sweep(
    *,
    plan: str = argument(..., "A plan with open values.", metavar="PLAN.yaml"),
    out: Out,
    options: SweepOptions,
    quiet: Quiet = False,
) -> Result:
    """Make scenes of a plan with ranges, distributions or lists in place of values.

    points.csv has the values of each point and what became of it: that physics or the place does
    not allow it (infeasible), or that the search found no scene, is a result, with the reason.
    The same command goes on where it was.
    """
    from scenewright.dataset.batch.run import Request
    from scenewright.dataset.batch.sweep import TABLE, run_sweep
    from scenewright.scene.plan_file import read_logical_plan

    request = Request(Path(plan), Path(out), options.build_options(), **options.choose_work())
    logical = read_logical_plan(plan)
    with show_batch_progress(quiet=quiet, out=out) as log:
        summary = run_sweep(logical, request, n=options.n, sampling=options.sampling, log=log)
    table = f"{out}/{TABLE}"
    return show_summary(summary, {"out": out, "table": table}, f"{table}\n")
