"""The command line. Results go to stdout, progress and words for people to stderr.

Exit codes: 0 done, 1 a scene is not verified or a goal not met (of what checks alone), 2 the input
or the place to write cannot be used, 3 understood but cannot be satisfied, 4 the backend failed for
good, 70 a fault in scenewright itself, 130 interrupted.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import replace
from difflib import get_close_matches
from typing import Annotated

import typer

from scenewright.cli.agent import run_agent
from scenewright.cli.author import author
from scenewright.cli.backend_options import ModelOptions
from scenewright.cli.batch import make_batch
from scenewright.cli.catalogue import catalogue
from scenewright.cli.chat_commands import memory, open_chat, serve_mcp
from scenewright.cli.check import check_installation
from scenewright.cli.common_options import Json, Quiet, spread_options
from scenewright.cli.console import (
    ReaderGoneError,
    abandon_stdout,
    format_one_line,
    log_line,
    show_progress,
    write_json,
    write_stdout,
)
from scenewright.cli.coverage import show_coverage
from scenewright.cli.dataset import dataset
from scenewright.cli.drive import drive
from scenewright.cli.errors import (
    INTERRUPTED,
    NOT_VERIFIED,
    READER_GONE,
    UNUSABLE,
    to_cli_error,
)
from scenewright.cli.evals import evals
from scenewright.cli.export import export
from scenewright.cli.find import find
from scenewright.cli.import_commands import (
    export_map,
    fit,
    import_map_file,
    show_junctions,
    simulate,
)
from scenewright.cli.interruption import forget, get_note
from scenewright.cli.interrupts import watch_signals
from scenewright.cli.intersection_options import TrainOptions
from scenewright.cli.make import MakeOptions, make_scene, read_request
from scenewright.cli.output_folder import try_file
from scenewright.cli.planner import planner
from scenewright.cli.satisfaction import score_satisfaction
from scenewright.cli.serve import serve
from scenewright.cli.sweep import sweep
from scenewright.cli.tables import print_tables
from scenewright.cli.understanding import score_understanding
from scenewright.cli.views import ViewKind
from scenewright.cli.warm import warm
from scenewright.errors import InputError
from scenewright.files import is_plan_file
from scenewright.graph.collector import HARDLY_EVER

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
app.command("batch")(make_batch)
app.command()(sweep)
app.add_typer(catalogue)
app.command("coverage")(show_coverage)
app.command("check")(check_installation)
evals.command("satisfaction")(score_satisfaction)
evals.command("tables")(print_tables)
app.command("agent")(run_agent)
intersections.command("import")(import_map_file)
intersections.command("junctions")(show_junctions)
intersections.command("export")(export_map)
intersections.command("simulate")(simulate)
intersections.command("fit")(fit)
app.add_typer(intersections)
evals.command("understanding")(score_understanding)
app.add_typer(evals)
app.add_typer(memory)
app.command("chat")(open_chat)
app.command("mcp")(serve_mcp)
app.command()(serve)
app.command()(author)
app.add_typer(dataset)
app.command()(export)
app.command()(find)
app.command()(drive)
app.command()(warm)
app.add_typer(planner)


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        import scenewright

        write_stdout(f"scenewright {scenewright.__version__}\n")
    elif context.invoked_subcommand is None:
        write_stdout(context.get_help() + "\n")


@app.command()
@spread_options
def make(
    text: Annotated[
        str, typer.Argument(help="What shall happen, or a plan as a .yaml file; `-` is stdin.")
    ],
    options: MakeOptions,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Make a verified scene from an instruction or a plan and write it to a folder."""
    asked, backend = read_request(text), options.model.load()
    with show_progress(quiet=quiet) as log:
        made = make_scene(
            asked, options, backend, log=log, answer=(lambda _: None) if quiet else _log_summary
        )
    for warning in made.warnings:
        log_line(f"warning: {warning}")
    if not quiet:
        _log_summary([f"  {made.folder}: {', '.join(made.files)}"])
    if as_json:
        write_json(made.to_json())
    else:
        write_stdout(f"{made.folder}\n")


def _log_summary(lines: list[str]) -> None:
    for line in lines:
        log_line(
            format_one_line(line) if not line.startswith(" ") else "  " + format_one_line(line)
        )


@app.command()
@spread_options
def plan(
    *,
    rows: Annotated[
        str,
        typer.Argument(
            metavar="IN", help="Rows (.jsonl; `-` is stdin), a plan to check (.yaml), or a text."
        ),
    ] = "-",
    out: Annotated[
        str, typer.Option(help="File to write; `-` is stdout.", callback=try_file)
    ] = "-",
    intersection: Annotated[
        str | None, typer.Option(help="Where it happens; else four legs, in right-hand traffic.")
    ] = None,
    model: ModelOptions,
    as_yaml: Annotated[
        bool, typer.Option("--yaml", help="Write the plan of a text as a file to edit and make.")
    ] = False,
    as_osc: Annotated[
        bool,
        typer.Option("--osc-dsl", help="Write it in OpenSCENARIO DSL, with what it leaves open."),
    ] = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="Write the JSON Schema of plan files, for editors.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Read instructions, one JSON row each, and write what was understood, one row each.

    Or write the plan of one text as YAML, or check such a file.
    """
    from scenewright.backends import Call
    from scenewright.cli.plan import (
        check_plan_file,
        format_osc_dsl,
        format_plan_of_text,
        format_plan_schema,
        plan_all,
        read_rows,
        sum_costs,
        write_rows,
        write_text,
    )
    from scenewright.intersections import load_map

    if as_json and out == "-" and not is_plan_file(rows):
        raise typer.BadParameter("--json needs --out FILE: stdout already carries the rows")
    backend = model.load()
    if schema or as_yaml or as_osc:
        write = format_osc_dsl if as_osc else format_plan_of_text
        write_text(out, format_plan_schema() if schema else write(rows, backend, intersection))
        return
    if is_plan_file(rows):
        checked = check_plan_file(rows, intersection)
        if as_json:
            write_json({"ok": True, **checked})
        else:
            write_stdout(f"{checked['file']}: {checked['summary']}\n")
        return
    calls: list[Call] = []
    intersection_map = None if intersection is None else load_map(intersection)
    planned = plan_all(read_rows(rows), backend, calls, intersection_map=intersection_map)
    write_rows(out, planned)
    refused = sum(row["refused"] for row in planned)
    paid = sum_costs(calls)
    cost = "".join(f", {count} {name.replace('_', ' ')}" for name, count in paid.items())
    log_line(f"{len(planned)} rows, {refused} refused{cost}")
    if as_json:
        write_json({"ok": True, "rows": len(planned), "refused": refused, "out": out, **paid})
    elif out != "-":
        write_stdout(f"{out}\n")


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
    from scenewright.cli.verify import (
        Checked,
        build_object,
        check_paths,
        is_good,
        list_notes,
        report,
    )

    checked = check_paths(paths, intersection=intersection, strict=strict)
    unusable = [each for each in checked if isinstance(each, Checked) and each.error is not None]
    good = all(is_good(each) for each in checked)
    if as_json:
        write_json(build_object(checked))
    elif len(unusable) < len(checked):
        write_stdout(report(checked))
    for note in list_notes(checked):
        log_line(f"note: {note}")
    for each in unusable:
        log_line(f"scenewright: {each.error}")
    if not good:
        raise typer.Exit(UNUSABLE if unusable else NOT_VERIFIED)


@app.command()
def show(
    scenes: Annotated[
        list[str],
        typer.Argument(
            metavar="SCENE...",
            help="A scene's folder, or its scene.rrd; several, or a dataset's folder, with --png.",
        ),
    ],
    png: Annotated[
        str | None,
        typer.Option(metavar="F", help="Write a picture; of several scenes contact sheets."),
    ] = None,
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
    asked: dict[ViewKind, str | None] = {"png": png, "html": html, "gif": gif, "mp4": mp4}
    wanted = {kind: name for kind, name in asked.items() if name is not None}
    if wanted:
        from scenewright.cli.show import write_views

        written = write_views(scenes, wanted, whole=whole)
        write_stdout("".join(f"{name}\n" for name in written))
        return
    from scenewright.viz.recording import open_recording

    if len(scenes) > 1:
        raise InputError("one recording is opened at a time; --png F draws several scenes")
    open_recording(scenes[0])


@intersections.command("list")
def list_all(as_json: Json = False) -> None:
    """List the intersections there are."""
    from scenewright.cli.intersections import format_intersections, summarize_intersections

    rows = summarize_intersections()
    if as_json:
        write_json({"ok": True, "intersections": rows})
    else:
        write_stdout(format_intersections(rows))


@intersections.command("show")
def show_one(
    name: Annotated[str, typer.Argument(help="Its name.")],
    png: Annotated[str | None, typer.Option(metavar="F", help="Draw the map to this file.")] = None,
    samples: Annotated[
        bool, typer.Option("--samples", help="In the picture, paths drawn from the priors too.")
    ] = False,
    rrd: Annotated[
        str | None, typer.Option(metavar="F", help="Write it as a recording for the rerun viewer.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Say what an intersection has: legs, movements, crosswalks, signals."""
    from scenewright.cli.intersections import describe_intersection, format_intersection

    facts = describe_intersection(name)
    if png is not None:
        from scenewright.cli.custom_intersections import draw_own

        draw_own(png, name, with_samples=samples)
        facts = {**facts, "png": png}
    if rrd is not None:
        from scenewright.cli.custom_intersections import record_own

        record_own(rrd, name)
        facts = {**facts, "rrd": rrd}
    if as_json:
        write_json({"ok": True, **facts})
    else:
        write_stdout(format_intersection(facts))


@intersections.command("train")
@spread_options
def train(
    name: Annotated[str, typer.Argument(help="Its name.")],
    options: TrainOptions,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Train an intersection's refiner; started again after a kill, it goes on where it was."""
    from scenewright.cli.train import train_refiner

    with show_progress(quiet=quiet) as log:
        made = train_refiner(name, options, log=log)
    if as_json:
        write_json({"ok": True, "name": name, **made})
    else:
        write_stdout(f"{made['folder']}\n")


_PREFIX = "SCENEWRIGHT_"
_VARIABLES = (
    *("API_KEY", "DATA", "INTERSECTIONS", "MAX_AGENTS"),
    *("PLANNER", "REFINER", "RELATIONS", "TRACEBACK"),
)
"""What the environment can set, by what follows the prefix."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; no exception but a bug's, if asked for.

    Args:
        argv: the words after the program's name; None takes the process's own.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    forget()
    for name in sorted(os.environ):
        rest = name.removeprefix(_PREFIX)
        if rest != name and rest not in _VARIABLES:
            for meant in get_close_matches(rest, _VARIABLES, 1, 0.75):
                log_line(f"note: {name} is not used; is {_PREFIX}{meant} meant?")
    with watch_signals(), _collect_garbage_rarely() if argv is None else nullcontext():
        return _run(words)


@contextmanager
def _collect_garbage_rarely() -> Iterator[None]:
    """Spare a process of one run the search for cyclic garbage in half a million lasting objects.

    The libraries' objects stay until the end; the search takes a third of a run, half of that
    when the interpreter ends.
    """
    gc.set_threshold(*HARDLY_EVER)
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
        fault, note = to_cli_error(error), get_note()
        if fault.code == "internal_error" and os.environ.get("SCENEWRIGHT_TRACEBACK"):
            raise
        if fault.code == "interrupted" and note is not None:
            fault = replace(fault, reason=f"interrupted; {note}")
        log_line(f"scenewright: {fault.reason}")
        if "--json" in words:
            with suppress(OSError, ReaderGoneError):
                write_json(fault.to_json())
        return fault.exit_code


def _flush() -> None:
    """Whatever typer printed must be out, or the interpreter complains at its end."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        abandon_stdout()
        raise
