"""`scenewright sweep`: a plan that leaves values open, made at many points."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from scenewright.cli.backend_options import MaxAgents
from scenewright.cli.batch import (
    Out,
    SceneOptions,
    build_summary_object,
    log_summary,
    show_batch_progress,
)
from scenewright.cli.common_options import Json, Quiet, argument, option
from scenewright.cli.console import write_result

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
    max_agents: MaxAgents = None


def sweep(
    *,
    plan: str = argument(..., "A plan with open values.", metavar="PLAN.yaml"),
    out: Out,
    options: SweepOptions,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Make scenes of a plan with ranges, distributions or lists in place of values.

    points.csv has the values of each point and what became of it: a point that physics or the
    place does not allow is a result, with the reason. The same command goes on where it was.
    """
    from scenewright.dataset.batch.run import Request
    from scenewright.dataset.batch.sweep import TABLE, run_sweep
    from scenewright.scene.plan_file import read_logical_plan

    request = Request(Path(plan), Path(out), options.build_options(), **options.choose_work())
    logical = read_logical_plan(plan)
    with show_batch_progress(quiet=quiet, out=out) as log:
        summary = run_sweep(logical, request, n=options.n, sampling=options.sampling, log=log)
    if not quiet:
        log_summary(summary)
    facts = {"out": out, "table": f"{out}/{TABLE}", **build_summary_object(summary)}
    write_result(facts, f"{out}/{TABLE}\n", as_json=as_json)
