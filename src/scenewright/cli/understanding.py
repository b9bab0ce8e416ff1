"""`scenewright evals understanding`: exits and relations of agents, predicted early."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from scenewright.cli.console import ProgressCallback, Result
from scenewright.cli.options import BoardOptions, ModelOptions, argument, option
from scenewright.cli.output_folder import try_file, try_folder, write_report
from scenewright.errors import InputError

if TYPE_CHECKING:
    from scenewright.evals.understanding.cases import Split
    from scenewright.evals.understanding.evaluate import MethodScores

ENTERED = 4.0
"""The window that the leaderboard shows [s]."""


def score_understanding(
    *,
    folder: str = argument(..., "A folder with a folder per scene.", metavar="DIR"),
    method: list[str] | None = option(
        None,
        "gmm, gmm_waypoints, trajnet, constant_velocity, reasoner, agent, oracle_seen, or a file "
        "of predictions, .jsonl; may be given again.",
        metavar="M",
    ),
    split: Literal["dev", "test", "all"] = option("test", "Which half of the scenes."),
    windows: str | None = option(
        None, "Lengths of observation [s]; 0.5 to 5 by 0.5.", metavar="S,S,..."
    ),
    write_observations: str | None = option(
        None, "Write what may be seen, without the labels.", metavar="F.jsonl", check=try_file
    ),
    out: str | None = option(
        None, "Folder for report.md, report.json and every method's predictions.", check=try_folder
    ),
    whole: bool = option(False, "Whole scenes instead of clips cut from them."),
    model: ModelOptions,
    entry: BoardOptions,
    log: ProgressCallback,
) -> Result:
    """Score how early exits and relations are predicted: accuracy and agent-level F1 by window.

    Scenes are cut to clips of 10 s that begin 2 to 6 s before a conflict can be seen coming, and to
    others like them in which nothing happens. A method sees motion, sizes and lights up to the
    window's end and nothing else. Predictions of any program can be scored; docs/understanding.md
    describes the files.
    """
    from scenewright.evals.understanding.evaluate import (
        evaluate,
        format_report,
        load_cases,
        observe_cases,
    )
    from scenewright.evals.understanding.scoring import DEFINITION, format_jsonl, format_predictions
    from scenewright.files import write_atomically

    if not method and write_observations is None:
        raise InputError("nothing to do: name a --method, or a file to --write-observations to")
    if entry.board and len(method or ()) != 1:
        raise InputError("--board goes with one --method: what is entered")
    lengths = read_windows(windows)
    named = model.load() if model.backend else None
    half: Split | None = None if split == "all" else split
    say, notes = partial(log, "understanding"), []
    cases = load_cases(Path(folder), split=half, whole=whole, log=say)
    if write_observations is not None:
        seen = format_jsonl(each.to_json() for each in observe_cases(cases, lengths))
        write_atomically(Path(write_observations), seen)
        notes += [f"{len(cases) * len(lengths)} observations written to {write_observations}"]
    found = [
        evaluate(cases, each, windows=lengths, backend=named, log=say) for each in method or ()
    ]
    if entry.board is not None:
        notes += entry.enter(_list_figures(found[0]), section="predictions")
    place = cases[0].record.meta.intersection
    text = format_report(found, scenes=len(cases), split=split, where=place) if found else ""
    result = {
        "ok": True, "folder": folder, "intersection": place, "split": split, "scenes": len(cases),
        "definition": DEFINITION, "methods": [each.to_json() for each in found],
        "observations": write_observations, "out": out,
    }  # fmt: skip
    if out is not None:
        target = write_report(out, "report", text, result)
        for each in found:
            if each.predictions:
                name = "".join(c if c.isalnum() else "_" for c in each.method)
                data = format_predictions(each.predictions)
                write_atomically(target / f"predictions_{name}.jsonl", data)
    return Result(result, text or f"{write_observations}\n", notes=notes)


def _list_figures(scores: MethodScores) -> dict[str, Any]:
    """The strict figures after 4 s, for a leaderboard."""
    rows = [row for row in scores.rows if row.window == ENTERED and row.strict]
    if not rows:
        raise InputError(f"--board takes relations after {ENTERED:g} s; there are none")
    figures = {**rows[0].strict, "exits": rows[0].intent.get("overall")}
    nothing = {"rate": None, "interval": None, "n": 0}
    return {key: nothing if each is None else each.to_share() for key, each in figures.items()}


def read_windows(text: str | None) -> tuple[float, ...]:
    """The windows that the option names [s].

    Raises:
        InputError: not numbers from 0.1 to 20.
    """
    from scenewright.evals.understanding.cases import WINDOWS

    if text is None:
        return WINDOWS
    try:
        found = tuple(sorted({round(float(each), 3) for each in text.split(",")}))
    except ValueError:
        found = ()
    if not found or not all(0.1 <= each <= 20.0 for each in found):
        raise InputError(f"--windows takes seconds from 0.1 to 20, such as 2,4; got {text[:80]!r}")
    return found
