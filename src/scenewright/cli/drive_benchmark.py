"""`scenewright drive` with `--benchmark` or `--serve`, and the files for people and CI."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenewright.cli.console import (
    format_columns,
    format_one_line,
    log_line,
    show_progress,
    write_json,
    write_stdout,
)
from scenewright.cli.output_folder import fill_folder
from scenewright.errors import InputError
from scenewright.extras import require_extra
from scenewright.files import write_atomically

if TYPE_CHECKING:
    from scenewright.driving.benchmark import BenchmarkScene, Row
    from scenewright.driving.scenario import Scenario


def drive_scenes(
    scenes: Sequence[BenchmarkScene], policy: str | None, *, workers: int, step_limit: float,
    out: Path | None, quiet: bool,
) -> tuple[list[Row], dict[str, str]]:  # fmt: skip
    """As `drive_benchmark`, with one policy or `all` built-in ones; None: scenes are only made."""
    from scenewright.driving.api import load_policy
    from scenewright.driving.benchmark import drive_benchmark
    from scenewright.driving.policies import BUILT_IN

    names = [] if policy is None else [*BUILT_IN] if policy == "all" else [policy]
    for name in names:
        load_policy(name)  # what cannot be loaded is said before anything is driven
    with show_progress(quiet=quiet) as log, fill_folder(out) if out else nullcontext() as part:
        rows, lost = drive_benchmark(
            scenes, names, workers=workers, step_limit=step_limit, out=part, log=log
        )
    for why in lost.values():
        log_line(format_one_line(why))
    if len(lost) == len(scenes):
        raise InputError("none of the scenes can be used")
    return rows, lost


def serve_scenes(
    address: str, scenes: Sequence[BenchmarkScene], load: Callable[[BenchmarkScene], Scenario],
    **options: Any,
) -> list[Row]:  # fmt: skip
    """Rows of what egos at a socket drove, when the server ends (see `EgoServer`).

    Raises:
        InputError: no such address, or none can listen there.
    """
    require_extra("drive", "serving an ego", "gymnasium")
    from scenewright.driving.socket_server import EgoServer

    host, _, port = address.rpartition(":")
    try:
        server = EgoServer((host or "127.0.0.1", int(port)), scenes, load, **options)
    except (OSError, ValueError, OverflowError) as error:
        raise InputError(f"cannot listen at {address[:60]!r}, a HOST:PORT: {error}") from error
    with server:
        log_line("serving at {}:{}; Ctrl-C ends it".format(*server.server_address[:2]))
        server.serve_forever()
    return server.rows


def write_results(rows: Sequence[Row], *, junit: str | None, html: str | None) -> None:
    """Write the files that the options name."""
    from scenewright.driving.benchmark_report import build_junit, build_page

    for file, build in ((junit, build_junit), (html, build_page)):
        if file is not None:
            write_atomically(file, build(rows))


def print_rows(rows: list[Row], lost: dict[str, str], *, out: str | None, as_json: bool) -> None:
    """A line for each policy, or everything as JSON."""
    from scenewright.driving.benchmark import read_list
    from scenewright.driving.benchmark_report import summarise_policies, tabulate

    if as_json:
        write_json({
            "ok": not lost, "version": read_list()[0], "summary": summarise_policies(rows),
            "not_comparable": lost, "out": out, "drives": rows,
        })  # fmt: skip
    else:
        write_stdout(format_columns(*tabulate(rows), right=set()))
