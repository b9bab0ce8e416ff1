"""The command line. Results go to stdout, progress and words for people to stderr.

Exit codes: 0 done, 1 a scene is not verified (`verify` alone), 2 the input or the place to write
cannot be used, 3 understood but cannot be satisfied, 4 the backend failed for good, 70 a fault in
scenewright itself, 130 interrupted.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from scenewright.cli.agent import agent
from scenewright.cli.author import author
from scenewright.cli.backend_options import (
    BackendNames,
    BaseUrl,
    MaxAgents,
    Record,
    TimeLimit,
    Timeout,
    backend_of,
)
from scenewright.cli.batch import batch
from scenewright.cli.chat_commands import chat, mcp, memory
from scenewright.cli.console import (
    ReaderGoneError,
    abandon_stdout,
    one_line,
    progress,
    put,
    put_json,
    say,
)
from scenewright.cli.dataset import dataset
from scenewright.cli.drive import drive
from scenewright.cli.errors import (
    INTERRUPTED,
    NOT_VERIFIED,
    READER_GONE,
    UNUSABLE,
    Fault,
    fault_of,
)
from scenewright.cli.evals import evals
from scenewright.cli.export import export
from scenewright.cli.import_commands import export_map, fit, import_map_file, junctions, simulate
from scenewright.cli.interruption import forget, kept
from scenewright.cli.interrupts import watched_signals
from scenewright.cli.planner import planner
from scenewright.cli.satisfaction import satisfaction
from scenewright.cli.serve import serve
from scenewright.cli.tables import tables
from scenewright.cli.understanding import understanding
from scenewright.cli.views import ViewKind
from scenewright.time_limit import DEFAULT_LIMIT

app = typer.Typer(
    name="scenewright",
    help="An instruction in plain language in, a verified traffic scene out.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
intersections = typer.Typer(
    name="intersections", help="The intersections that scenes can be made at."
)
app.command()(batch)
evals.command("satisfaction")(satisfaction)
evals.command("tables")(tables)
app.command()(agent)
intersections.command("import")(import_map_file)
intersections.command("junctions")(junctions)
intersections.command("export")(export_map)
intersections.command("simulate")(simulate)
intersections.command("fit")(fit)
app.add_typer(intersections)
evals.command("understanding")(understanding)
app.add_typer(evals)
app.add_typer(memory)
app.command()(chat)
app.command()(mcp)
app.command()(serve)
app.command()(author)
app.add_typer(dataset)
app.command()(export)
app.command()(drive)
app.add_typer(planner)

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no summary.")]


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        import scenewright

        put(f"scenewright {scenewright.__version__}\n")
    elif context.invoked_subcommand is None:
        put(context.get_help() + "\n")


@app.command()
def make(
    text: Annotated[str, typer.Argument(help="What shall happen; `-` reads it from stdin.")],
    intersection: Annotated[str, typer.Option(help="Where it happens.")] = "amsterdam_120",
    backend: BackendNames = None,
    base_url: BaseUrl = None,
    record: Record = None,
    timeout: Timeout = None,
    time_limit: TimeLimit = DEFAULT_LIMIT,
    seed: Annotated[int, typer.Option(help="The same seed makes the same scene.")] = 0,
    refiner: Annotated[
        str,
        typer.Option(
            help="Learned refinement of the tracks, or none.", envvar="SCENEWRIGHT_REFINER"
        ),
    ] = "trajnet",
    selection: Annotated[
        Literal["draw", "map"],
        typer.Option(help="Draw among the combinations that fit, or take the likeliest."),
    ] = "draw",
    profile: Annotated[
        Literal["full", "paper"],
        typer.Option(help="Keys of scene.json: all, or those of the paper's Listing 1 alone."),
    ] = "full",
    out: Annotated[
        str | None, typer.Option(help="Folder to write; scenes/ID if none is named.")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Write into a folder that holds other files, too.")
    ] = False,
    lenient: Annotated[
        bool,
        typer.Option("--lenient", help="Leave out words that cannot be realised, and list them."),
    ] = False,
    max_agents: MaxAgents = None,
    gif: Annotated[bool, typer.Option("--gif", help="Add an animation, scene.gif.")] = False,
    html: Annotated[
        bool, typer.Option("--html", help="Add a page that plays and explains it, scene.html.")
    ] = False,
    no_picture: Annotated[bool, typer.Option("--no-picture", help="No scene.png.")] = False,
    no_recording: Annotated[bool, typer.Option("--no-recording", help="No scene.rrd.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Make a verified scene from an instruction and write it to a folder."""
    from scenewright.cli.make import Request, make_scene, read_instruction

    request = Request(
        text=read_instruction(text),
        intersection=intersection,
        backend=backend_of(backend, base_url=base_url, record=record, timeout=timeout),
        seed=seed,
        refiner=refiner,
        selection=selection,
        profile=profile,
        out=out,
        force=force,
        picture=not no_picture,
        recording=not no_recording,
        gif=gif,
        html=html,
        lenient=lenient,
        max_agents=max_agents,
        time_limit=time_limit,
    )
    with progress(quiet=quiet) as log:
        made = make_scene(request, log=log)
    for warning in made.warnings:
        say(f"warning: {warning}")
    if not quiet:
        _tell_what_was_made(made.summary())
    if as_json:
        put_json(made.to_json())
    else:
        put(f"{made.folder}\n")


def _tell_what_was_made(lines: list[str]) -> None:
    for line in lines:
        say(one_line(line) if not line.startswith(" ") else "  " + one_line(line))


@app.command()
def plan(
    rows: Annotated[str, typer.Argument(metavar="IN.jsonl", help="Rows; `-` is stdin.")],
    out: Annotated[str, typer.Option(help="File to write; `-` is stdout.")] = "-",
    intersection: Annotated[
        str | None, typer.Option(help="Where it happens; else four legs, in right-hand traffic.")
    ] = None,
    backend: BackendNames = None,
    base_url: BaseUrl = None,
    record: Record = None,
    timeout: Timeout = None,
    as_json: Json = False,
) -> None:
    """Read instructions, one JSON row each, and write what was understood, one row each."""
    from scenewright.backends import Call
    from scenewright.cli.plan import all_planned, check_out, read_rows, spent, write_rows
    from scenewright.intersections import load_map

    if as_json and out == "-":
        raise typer.BadParameter("--json needs --out FILE: stdout already carries the rows")
    check_out(out)
    speaker = backend_of(backend, base_url=base_url, record=record, timeout=timeout)
    calls: list[Call] = []
    intersection_map = None if intersection is None else load_map(intersection)
    planned = all_planned(read_rows(rows), speaker, calls, intersection_map=intersection_map)
    write_rows(out, planned)
    refused = sum(row["refused"] for row in planned)
    paid = spent(calls)
    cost = "".join(f", {count} {name.replace('_', ' ')}" for name, count in paid.items())
    say(f"{len(planned)} rows, {refused} refused{cost}")
    if as_json:
        put_json({"ok": True, "rows": len(planned), "refused": refused, "out": out, **paid})
    elif out != "-":
        put(f"{out}\n")


@app.command()
def verify(
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="PATH...", help="scene.json, folders of them, or tracks as .csv or .ndjson."
        ),
    ],
    intersection: Annotated[
        str | None,
        typer.Option(help="Check against this map, not the one the scene names; tracks name none."),
    ] = None,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict", help="Demand a proof.json that names the digest of the whole scene.json."
        ),
    ] = False,
    as_json: Json = False,
) -> None:
    """Check scenes: exit code 0 if all are verified, 1 if one is not, 2 if one is unusable.

    Of tracks made elsewhere, a CSV or TrajNet++ ndjson, every event is listed.
    """
    from scenewright.cli.verify import Checked, as_object, check_paths, is_good, notes, report

    checked = check_paths(paths, intersection=intersection, strict=strict)
    unusable = [each for each in checked if isinstance(each, Checked) and each.error is not None]
    good = all(is_good(each) for each in checked)
    if as_json:
        put_json(as_object(checked))
    elif len(unusable) < len(checked):
        put(report(checked))
    for note in notes(checked):
        say(f"note: {note}")
    for each in unusable:
        say(f"scenewright: {each.error}")
    if not good:
        raise typer.Exit(UNUSABLE if unusable else NOT_VERIFIED)


@app.command()
def show(
    scene: Annotated[str, typer.Argument(help="A scene's folder, or its scene.rrd.")],
    html: Annotated[
        str | None,
        typer.Option(metavar="F", help="Write a page that plays and explains it, to share."),
    ] = None,
    gif: Annotated[str | None, typer.Option(metavar="F", help="Write an animation.")] = None,
    mp4: Annotated[
        str | None, typer.Option(metavar="F", help="Write a video (extra `video`, or ffmpeg).")
    ] = None,
    whole: Annotated[
        bool, typer.Option("--whole", help="Animations go on to the end of the scene.")
    ] = False,
) -> None:
    """Open a scene's recording in the rerun viewer, or write its views to files."""
    asked: dict[ViewKind, str | None] = {"html": html, "gif": gif, "mp4": mp4}
    wanted = {kind: name for kind, name in asked.items() if name is not None}
    if wanted:
        from scenewright.cli.show import write_views

        write_views(scene, wanted, whole=whole)
        put("".join(f"{name}\n" for name in wanted.values()))
        return
    from scenewright.viz.recording import open_recording

    open_recording(scene)


@intersections.command("list")
def list_all(as_json: Json = False) -> None:
    """List the intersections there are."""
    from scenewright.cli.intersections import overview, overview_table

    rows = overview()
    if as_json:
        put_json({"ok": True, "intersections": rows})
    else:
        put(overview_table(rows))


@intersections.command("show")
def show_one(
    name: Annotated[str, typer.Argument(help="Its name.")],
    png: Annotated[str | None, typer.Option(metavar="F", help="Draw the map to this file.")] = None,
    rrd: Annotated[
        str | None, typer.Option(metavar="F", help="Write it as a recording for the rerun viewer.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Say what an intersection has: legs, movements, crosswalks, signals."""
    from scenewright.cli.intersections import details, details_text

    facts = details(name)
    if png is not None:
        from scenewright.cli.custom_intersections import draw_own

        draw_own(png, name)
        facts = {**facts, "png": png}
    if rrd is not None:
        from scenewright.cli.custom_intersections import record_own

        record_own(rrd, name)
        facts = {**facts, "rrd": rrd}
    if as_json:
        put_json({"ok": True, **facts})
    else:
        put(details_text(facts))


@intersections.command("build")
def build(
    name: Annotated[str, typer.Argument(help="Its name.")],
    out: Annotated[
        str | None, typer.Option(help="Folder to write; intersections/NAME if none is named.")
    ] = None,
    counts: Annotated[
        str | None, typer.Option(help="Folder of raw counts to derive the demand from.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the simulation.")] = 0,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Simulate an intersection's traffic and fit its priors (needs the extra `simulate`)."""
    from scenewright.tools.fitting.build_bundle import build_bundle

    if seed < 0:
        raise typer.BadParameter(f"a seed is a whole number from 0, got {seed}")
    with progress(quiet=quiet) as log:
        folder = build_bundle(
            name,
            # A name that there is no plan for is refused before anything is written.
            out=Path(out or Path("intersections") / name),
            counts=None if counts is None else Path(counts),
            seed=seed,
            progress=lambda line: log("building", line),
        )
    if as_json:
        put_json({"ok": True, "name": name, "folder": str(folder)})
    else:
        put(f"{folder}\n")


@intersections.command("corpus")
def corpus(
    name: Annotated[str, typer.Argument(help="Its name.")],
    out: Annotated[str, typer.Option(metavar="F", help="File to write, an .npz.")],
    hours: Annotated[int, typer.Option(help="How many hours, spread over the day.")] = 15,
    seed: Annotated[int, typer.Option(help="Seed of the simulation.")] = 0,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Simulate hours of traffic and keep everybody's tracks (needs the extra `simulate`)."""
    from scenewright.tools.simulation.corpus_recordings import record_traffic

    if seed < 0:
        raise typer.BadParameter(f"a seed is a whole number from 0, got {seed}")
    with progress(quiet=quiet) as log:
        made = record_traffic(
            name,
            out=Path(out),
            hours=hours,
            seed=seed,
            progress=lambda line: log("recording", line),
        )
    if as_json:
        agents = sum(len(each.agents) for each in made)
        put_json({"ok": True, "name": name, "file": out, "hours": len(made), "agents": agents})
    else:
        put(f"{out}\n")


@intersections.command("train")
def train(
    name: Annotated[str, typer.Argument(help="Its name.")],
    corpus: Annotated[str, typer.Option(metavar="F", help="Recorded hours, of `corpus`.")],
    out: Annotated[
        str | None,
        typer.Option(help="Folder to write; one's own intersection, else intersections/NAME."),
    ] = None,
    epochs: Annotated[int | None, typer.Option(min=1, help="How often all is seen.")] = None,
    walkers: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH",
            help="Tracks of real people on foot, to learn walking from; may be given again.",
        ),
    ] = None,
    go_on: Annotated[
        bool, typer.Option("--go-on", help="From the weights that serve the intersection on.")
    ] = False,
    most: Annotated[
        int | None, typer.Option(min=1, help="Stretches of the corpus that are learned from.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the training.")] = 0,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Train an intersection's refiner; started again after a kill, it goes on where it was."""
    from scenewright.cli.train import train_refiner

    with progress(quiet=quiet) as log:
        made = train_refiner(
            name, corpus=Path(corpus), out=out, epochs=epochs, seed=seed, log=log,
            walkers=walkers or (), go_on=go_on, most=most,
        )  # fmt: skip
    if as_json:
        put_json({"ok": True, "name": name, **made})
    else:
        put(f"{made['folder']}\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; no exception but a bug's, if asked for.

    Args:
        argv: the words after the program's name; None takes the process's own.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    forget()
    with watched_signals(), _collect_garbage_rarely() if argv is None else nullcontext():
        return _run(words)


@contextmanager
def _collect_garbage_rarely() -> Iterator[None]:
    """Spare a process of one run the search for cyclic garbage in half a million lasting objects.

    The libraries' objects stay until the end; the search takes a third of a run, half of that
    when the interpreter ends.
    """
    gc.set_threshold(100_000, 50, 50)
    try:
        yield
    finally:
        gc.freeze()


def _run(words: list[str]) -> int:
    try:
        code = typer.main.get_command(app).main(words, "scenewright", standalone_mode=False)
        if code == INTERRUPTED:
            raise KeyboardInterrupt
        _flush()
        return code or 0
    except ReaderGoneError:
        return READER_GONE
    except (Exception, KeyboardInterrupt) as error:
        return _report(_with_what_is_kept(fault_of(error)), error, as_json="--json" in words)


def _flush() -> None:
    """Whatever typer printed must be out, or the interpreter complains at its end."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        abandon_stdout()
        raise


def _with_what_is_kept(fault: Fault) -> Fault:
    word = kept()
    if fault.code != "interrupted" or word is None:
        return fault
    return replace(fault, reason=f"interrupted; {word}")


def _report(fault: Fault, error: BaseException, *, as_json: bool) -> int:
    if fault.code == "internal_error" and os.environ.get("SCENEWRIGHT_TRACEBACK"):
        raise error
    say(f"scenewright: {fault.reason}")
    if as_json:
        try:
            put_json(fault.to_json())
        except (OSError, ReaderGoneError):
            return fault.exit_code
    return fault.exit_code
