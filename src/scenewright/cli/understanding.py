"""`scenewright evals understanding`: exits and relations of agents, predicted early."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from scenewright.cli.backend_options import ModelOptions
from scenewright.cli.common_options import BoardFile, BoardName, Json, Quiet, spread_options
from scenewright.cli.console import log_line, show_progress, write_json, write_stdout
from scenewright.cli.output_folder import try_file, try_folder
from scenewright.errors import InputError

if TYPE_CHECKING:
    from scenewright.evals.understanding.cases import SceneCase, Split
    from scenewright.evals.understanding.evaluate import MethodScores, ProgressLog

ENTERED = 4.0
"""The window that the leaderboard shows [s]."""
Folder = Annotated[str, typer.Argument(metavar="DIR", help="A folder with a folder per scene.")]


@spread_options
def score_understanding(
    *,
    folder: Folder,
    method: Annotated[
        list[str] | None,
        typer.Option(
            metavar="M",
            help="gmm, gmm_waypoints, trajnet, constant_velocity, reasoner, agent, "
            "oracle_seen, or a file of predictions, .jsonl; may be given again.",
        ),
    ] = None,
    split: Annotated[
        Literal["dev", "test", "all"], typer.Option(help="Which half of the scenes.")
    ] = "test",
    windows: Annotated[
        str | None,
        typer.Option(metavar="S,S,...", help="Lengths of observation [s]; 0.5 to 5 by 0.5."),
    ] = None,
    write_observations: Annotated[
        str | None,
        typer.Option(
            metavar="F.jsonl",
            help="Write what may be seen, without the labels.",
            callback=try_file,
        ),
    ] = None,
    out: Annotated[
        str | None,
        typer.Option(
            help="Folder for report.md, report.json and every method's predictions.",
            callback=try_folder,
        ),
    ] = None,
    whole: Annotated[
        bool, typer.Option("--whole", help="Whole scenes instead of clips cut from them.")
    ] = False,
    model: ModelOptions,
    board: BoardFile = None,
    name: BoardName = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Score how early exits and relations are predicted: accuracy and agent-level F1 by window.

    Scenes are cut to clips of 10 s that begin 2 to 6 s before a conflict can be seen coming, and to
    others like them in which nothing happens. A method sees motion, sizes and lights up to the
    window's end and nothing else. Predictions of any program can be scored; docs/understanding.md
    describes the files.
    """
    from scenewright.evals.understanding.evaluate import evaluate, load_cases, observe_cases
    from scenewright.evals.understanding.predictions import format_jsonl
    from scenewright.files import write_atomically

    if not method and write_observations is None:
        raise InputError("nothing to do: name a --method, or a file to --write-observations to")
    if (board is None) != (name is None) or (board and len(method or ()) != 1):
        raise InputError("--board and --name go together, with one --method: what is entered")
    lengths = read_windows(windows)
    named = model.load() if model.backend else None
    with show_progress(quiet=quiet) as log_stage:
        log: ProgressLog = lambda line: log_stage("understanding", line)  # noqa: E731
        half: Split | None = None if split == "all" else split
        cases = load_cases(Path(folder), split=half, whole=whole, log=log)
        if write_observations is not None:
            seen = format_jsonl(each.to_json() for each in observe_cases(cases, lengths))
            write_atomically(Path(write_observations), seen)
            count = len(cases) * len(lengths)
            log_line(f"{count} observations written to {write_observations}")
        found = [
            evaluate(cases, each, windows=lengths, backend=named, log=log) for each in method or ()
        ]
    if board is not None:
        log_line(f"written: {board}, {_enter(found[0], Path(board), str(name))}")
    _hand_out(found, cases, split=split, folder=folder, out=out, as_json=as_json,
              observations=write_observations)  # fmt: skip


def _enter(scores: MethodScores, board: Path, name: str) -> Path:
    """Enter the strict figures after 4 s; the page."""
    from scenewright.evals.leaderboard import enter_leaderboard

    rows = [row for row in scores.rows if row.window == ENTERED and row.strict]
    if not rows:
        raise InputError(f"--board takes relations after {ENTERED:g} s; there are none")
    figures = {**rows[0].strict, "exits": rows[0].intent.get("overall")}
    shares = {key: None if each is None else each.to_share() for key, each in figures.items()}
    nothing = {"rate": None, "interval": None, "n": 0}
    entry = {key: each or nothing for key, each in shares.items()}
    return enter_leaderboard(board, name, entry, section="predictions")


def _hand_out(
    found: list[MethodScores],
    cases: list[SceneCase],
    *,
    split: str,
    folder: str,
    out: str | None,
    as_json: bool,
    observations: str | None,
) -> None:
    from scenewright.evals.understanding.evaluate import format_report
    from scenewright.evals.understanding.scoring import DEFINITION

    name = cases[0].record.meta.intersection
    text = format_report(found, scenes=len(cases), split=split, where=name) if found else ""
    result = {
        "ok": True,
        "folder": folder,
        "intersection": name,
        "split": split,
        "scenes": len(cases),
        "definition": DEFINITION,
        "methods": [each.to_json() for each in found],
        "observations": observations,
        "out": out,
    }
    if out is not None:
        _write_report(Path(out), text, result, found)
    if as_json:
        write_json(result)
    else:
        write_stdout(text or f"{observations}\n")


def read_windows(text: str | None) -> tuple[float, ...]:
    """The windows that the option names [s].

    Raises:
        InputError: not numbers from 0.1 to 20.
    """
    from scenewright.evals.understanding.observation import WINDOWS

    if text is None:
        return WINDOWS
    try:
        found = tuple(sorted({round(float(each), 3) for each in text.split(",")}))
    except ValueError:
        found = ()
    if not found or not all(0.1 <= each <= 20.0 for each in found):
        raise InputError(f"--windows takes seconds from 0.1 to 20, such as 2,4; got {text[:80]!r}")
    return found


def _write_report(
    folder: Path, text: str, result: dict[str, object], found: list[MethodScores]
) -> None:
    import json

    from scenewright.evals.understanding.predictions import format_predictions
    from scenewright.files import write_atomically
    from scenewright.graph.run import make_folder

    target = make_folder(folder)
    for each in found:
        if each.predictions:
            name = "".join(c if c.isalnum() else "_" for c in each.method)
            data = format_predictions(each.predictions)
            write_atomically(target / f"predictions_{name}.jsonl", data)
    page = json.dumps(result, allow_nan=False, indent=1).encode("utf-8", "backslashreplace")
    write_atomically(target / "report.json", page + b"\n")
    write_atomically(target / "report.md", text.encode("utf-8", "backslashreplace"))
