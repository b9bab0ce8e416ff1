"""The command line. Results go to stdout, progress and words for people to stderr.

Exit codes: 0 done, 1 a scene is not verified or a goal not met (of what checks alone), 2 the input
or the place to write cannot be used, 3 understood but cannot be satisfied, 4 the backend failed for
good, 70 a fault in scenewright itself, 130 interrupted.
"""

from __future__ import annotations

import gc
import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import replace
from difflib import get_close_matches
from typing import Annotated, Any

import typer

from scenewright.cli.agent import run_agent
from scenewright.cli.author import author
from scenewright.cli.batch import make_batch, sweep
from scenewright.cli.catalogue import catalogue
from scenewright.cli.chat_commands import memory, open_chat, serve_mcp
from scenewright.cli.console import (
    ReaderGoneError,
    Result,
    abandon_stdout,
    log_line,
    write_json,
    write_stdout,
)
from scenewright.cli.coverage import show_coverage
from scenewright.cli.dataset import dataset, export
from scenewright.cli.drive import drive
from scenewright.cli.errors import INTERRUPTED, READER_GONE, to_cli_error
from scenewright.cli.evals import evals, score_satisfaction
from scenewright.cli.find import find
from scenewright.cli.import_commands import intersections
from scenewright.cli.interrupts import get_note, watch_signals
from scenewright.cli.make import make
from scenewright.cli.options import Commands, Json, ModelOptions, argument, option
from scenewright.cli.output_folder import try_file
from scenewright.cli.planner import planner
from scenewright.cli.serve import serve
from scenewright.cli.tables import print_tables
from scenewright.cli.understanding import score_understanding
from scenewright.cli.views import show
from scenewright.cli.warm import check_installation, warm
from scenewright.files import is_plan_file, write_atomically
from scenewright.graph.collector import HARDLY_EVER

app = Commands(
    name="scenewright",
    help="An instruction in plain language in, a verified traffic scene out.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command("batch")(make_batch)
app.command()(sweep)
app.add_typer(catalogue)
app.command("coverage")(show_coverage)
app.command("check")(check_installation)
evals.command("satisfaction")(score_satisfaction)
evals.command("tables")(print_tables)
app.command("agent")(run_agent)
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
app.command()(make)
app.command()(show)
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
def plan(
    *,
    rows: str = argument(
        "-", "Rows (.jsonl; `-` is stdin), a plan to check (.yaml), or a text.", metavar="IN"
    ),
    out: str = option("-", "File to write; `-` is stdout.", check=try_file),
    intersection: str | None = option(
        None, "Where it happens; else four legs, in right-hand traffic."
    ),
    model: ModelOptions,
    as_yaml: bool = option(False, "Write the plan of a text as a file to edit and make.", "--yaml"),
    as_osc: bool = option(
        False, "Write it in OpenSCENARIO DSL, with what it leaves open.", "--osc-dsl"
    ),
    schema: bool = option(False, "Write the JSON Schema of plan files, for editors."),
    as_json: Json = False,
) -> Result:
    """Read instructions, one JSON row each, and write what was understood, one row each.

    Or write the plan of one text as YAML, or check such a file.
    """
    from scenewright.cli import plan as planning

    def deliver(text: str, facts: dict[str, Any], *notes: str) -> Result:
        data = text.encode("utf-8", "backslashreplace")
        if out != "-":
            write_atomically(out, data)
            return Result({"out": out, **facts}, f"{out}\n" if facts else "", notes=notes)
        return Result({"out": out, **facts}, data.decode(), notes=notes)

    if as_json and out == "-" and not is_plan_file(rows):
        raise typer.BadParameter("--json needs --out FILE: stdout already carries the rows")
    backend = model.load()
    if schema:
        from scenewright.scene.plan_file import build_plan_schema

        return deliver(json.dumps(build_plan_schema(), indent=1, ensure_ascii=False) + "\n", {})
    if as_yaml or as_osc:
        return deliver(planning.format_plan_of(rows, backend, intersection, osc=as_osc), {})
    if is_plan_file(rows):
        checked = planning.check_plan_file(rows, intersection)
        return Result(checked, f"{checked['file']}: {checked['summary']}\n")
    planned, paid = planning.plan_all(planning.read_rows(rows), backend, intersection)
    refused = sum(row["refused"] for row in planned)
    cost = "".join(f", {count} {name.replace('_', ' ')}" for name, count in paid.items())
    return deliver(
        "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in planned),
        {"rows": len(planned), "refused": refused, **paid},
        f"{len(planned)} rows, {refused} refused{cost}",
    )


@app.command()
def verify(
    paths: list[str] = argument(
        ..., "scene.json, folders of them, or tracks as .csv or .ndjson.", metavar="PATH..."
    ),
    intersection: str | None = option(
        None, "Check against this map, not the one the scene names; tracks name none."
    ),
    strict: bool = option(
        False, "Demand a proof.json that names the digest of the whole scene.json."
    ),
) -> Result:
    """Check scenes: exit code 0 if all are verified, 1 if one is not, 2 if one is unusable.

    Of tracks made elsewhere, a CSV or TrajNet++ ndjson, every event is listed.
    """
    from scenewright.cli.verify import check_paths, report

    return report(check_paths(paths, intersection=intersection, strict=strict))


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
        for line in fault.reason.split("\n"):
            log_line(f"scenewright: {line}")
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
