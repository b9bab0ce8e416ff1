"""`scenewright agent` and `scenewright dataset paper`: orders filled by the agent."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenewright.cli.batch import Out, RunOptions, show_batch_progress
from scenewright.cli.console import Result, show_progress, tell
from scenewright.cli.dataset import dataset
from scenewright.cli.options import UNASKED, Quiet, argument, option
from scenewright.cli.tables import Corpus, RealTracks, write_tables
from scenewright.errors import BackendFault, InputError, Unsatisfiable

if TYPE_CHECKING:
    from scenewright.dataset.orders.agent import Order

_SHOWN = 8


@dataclass(frozen=True)
class OrderOptions(RunOptions):
    """How an order is filled."""

    lawful: bool = option(True, UNASKED, "--lawful/--no-lawful")
    seed: int = option(0, "The same seed, the same dataset.", min=0)
    writer: str = option(
        "builtin", "Writer of the instructions: builtin, or a backend with a model."
    )


@dataclass(frozen=True)
class PaperOptions(OrderOptions):
    """The same for the paper's composition, which has a share for each backend."""

    backend: list[str] | None = option(
        None, "Planner and reasoner; may be given again. builtin if not given."
    )


def run_agent(
    *,
    order: str = argument(..., "How many scenes of which kinds."),
    out: Out,
    options: OrderOptions,
    intersections: str | None = option(
        None,
        "Several places in turn; the later half is held out as the test split.",
        metavar="A,B,...",
    ),
    budget: int | None = option(
        None, "Instructions at most; twice the scenes and 20 if not said.", min=1
    ),
    dry_run: bool = option(False, "Say what was understood, write nothing."),
    quiet: Quiet = False,
) -> Result:
    """Fill an order such as `40 collisions and 50 yields at rush hour`.

    Writes instructions in the manner of many writers, evenly over patterns, places and hours, has
    the scenes made, and words anew or replaces what is refused, within the budget. Killed, the
    same command goes on. Exit code 3 if the order could not be filled; what there is stays.
    """
    from scenewright.dataset.orders.agent import Order
    from scenewright.dataset.orders.order_spec import read_order

    wish = read_order(order)
    places = tuple(dict.fromkeys(filter(None, map(str.strip, (intersections or "").split(",")))))
    if intersections is not None and len(places) < 2:
        raise InputError("--intersections names two or more, as in a,b,c; one is --intersection")
    if dry_run:
        facts = {"dry_run": True, "understood": wish.lines()}
        return Result(facts, "".join(f"{line}\n" for line in wish.lines()))
    wanted = Order(
        text=order,
        wish=wish,
        out=Path(out),
        options=options.build_options(intersection=[*places, options.intersection][0]),
        places=places,
        writer=options.writer,
        budget=budget,
        **options.choose_work(),
    )
    return fill_and_tell(wanted, out, quiet=quiet)


@dataset.command("paper")
def make_paper_dataset(
    *,
    out: Out,
    options: PaperOptions,
    scale: float = option(1.0, "Of all counts, for a small one to try.", min=0.01, max=100.0),
    tables: bool = option(False, "Then measure Tables 1 to 5, as `evals tables` does."),
    corpus: Corpus = None,
    taf_bw: RealTracks = None,
    quiet: Quiet = False,
) -> Result:
    """Make a dataset composed as the paper's.

    100 normal scenes, and for each backend 40 collisions and 50 yields: two agents in the
    foreground, medium density (5 to 10 more), from varied instructions. Killed, the same command
    goes on. With --tables the paper's tables are measured on it in the same run.
    """
    from scenewright.dataset.orders.agent import Order
    from scenewright.dataset.orders.run import build_paper_order

    if not tables and (corpus or taf_bw):
        raise InputError("--corpus and --taf-bw are for the tables: say --tables as well")
    backends = list(dict.fromkeys(options.backend or ["builtin"]))
    wanted = Order(
        text=f"the paper's composition x {scale:g}: {', '.join(backends)}",
        wish=build_paper_order(backends, scale=scale),
        out=Path(out),
        options=options.build_options(backend=backends[:1]),
        writer=options.writer,
        title="The paper's composition",
        **options.choose_work(),
    )
    result = fill_and_tell(wanted, out, quiet=quiet)
    if tables:
        with show_progress(quiet=quiet) as log:
            page, _, _ = write_tables(
                wanted.out, corpus=corpus, real=taf_bw, log=partial(log, "measuring")
            )
        return replace(result, text=f"{result.text}{page}")
    return result


def fill_and_tell(order: Order, out: str, *, quiet: bool) -> Result:
    """Fills an order and says what came of it.

    Raises:
        BackendFault: a backend could not be reached for some of it.
        Unsatisfiable: not all of it could be filled.
    """
    from scenewright.dataset.orders.run import fill

    if not quiet:
        tell(f"understood: {line}" for line in order.wish.lines())
    with show_batch_progress(quiet=quiet, out=out) as log:
        report = fill(order, log=log)
    if not quiet:
        tell(_describe_report(report, writer=order.writer))
    if report["waiting"]:
        raise BackendFault(
            f"the backend failed for {report['waiting']} of {order.wish.count} scenes; table "
            f"refused in {out} says how, and the same command goes on",
            final=True,
        )
    if not report["filled"]:
        missing = order.wish.count - report["scenes"]
        raise Unsatisfiable(
            f"{missing} of {order.wish.count} scenes could not be made within "
            f"{report['instructions']} instructions; {out} holds the others, report.json says why"
        )
    return Result({"out": out, **report}, f"{out}\n")


def _describe_report(report: dict[str, Any], *, writer: str) -> Iterator[str]:
    if writer != "builtin" and report["by the builtin writer"]:
        yield (
            f"{report['by the builtin writer']} of {report['instructions']} instructions are the "
            "builtin writer's: the model described other stories"
        )
    for quota in report["quotas"]:
        planner = f" by {quota['backend']}" if quota["backend"] else ""
        counts, coverage = list(quota["patterns"].values()), "no pattern"
        if counts:
            coverage = f"{sum(n > 0 for n in counts)} of {len(counts)} patterns"
            coverage += f", {min(counts)}-{max(counts)} each"
        yield (
            f"{quota['name']}{planner}: {quota['filled']} of {quota['wanted']} in "
            f"{quota['attempts']} attempts, {coverage}"
        )
        for reason, count in list(quota["refused"].items())[:_SHOWN]:
            yield f"  refused {count}x {reason}"
