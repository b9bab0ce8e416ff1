"""`scenewright evals`: benchmarks of the parts on data of one's own."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from scenewright.cli.console import ProgressCallback, Result, format_columns, format_one_line
from scenewright.cli.interrupts import stop_if_asked
from scenewright.cli.options import BoardOptions, Commands, argument, option
from scenewright.cli.output_folder import try_folder, write_report
from scenewright.errors import InputError
from scenewright.files import write_atomically, write_files

if TYPE_CHECKING:
    from scenewright.evals.trajnet.recording import BenchmarkRecording
    from scenewright.evals.trajnet.score import Evaluated

evals = Commands(name="evals", help="Benchmarks of the parts on data of your own.")


@evals.command("trajnet")
def score_trajnet(
    *,
    files: list[str] = argument(..., "TrajNet++ recordings, .ndjson.", metavar="FILE..."),
    weights: str | None = option(
        None, "The refiner's weights, .safetensors; constant velocity alone without."
    ),
    out: str | None = option(
        None, "Folder for the predictions in the benchmark's format.", check=try_folder
    ),
    log: ProgressCallback,
) -> Result:
    """Score predicted pedestrians as TrajNet++ does: ADE, FDE, Col-I and Col-II by type of scene.

    The refiner predicts without goals, given each pedestrian's destination, and given where it is
    at the end of the scene. Files without the future are predicted but not scored.
    """
    from scenewright.evals.trajnet.recording import read_recording
    from scenewright.evals.trajnet.score import evaluate
    from scenewright.extras import require_extra

    if weights is not None:
        require_extra(
            "learn", "predicting the benchmark", "torch", otherwise="score without --weights"
        )
    recordings = [read_recording(Path(file)) for file in files]
    check_distinct(
        [recording.name for recording in recordings], "files are called", "rename one of them"
    )
    evaluated = evaluate(
        recordings,
        weights=None if weights is None else Path(weights),
        log=partial(log, "predicting"),
    )
    if out is not None:
        write_predictions(Path(out), recordings, evaluated)
    text = "".join(format_scores(each) for each in evaluated if each.rows) or f"{out or ''}\n"
    facts = {"files": files, "out": out, "results": [each.to_json() for each in evaluated]}
    none = "note: no file holds what really happened, so there is nothing to score"
    return Result(facts, text, notes=[] if evaluated[0].rows else [none])


def check_distinct(names: list[str], what: str, advice: str) -> None:
    """InputError where two of what is named have one name."""
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"two {what} {twice[0]!r}; {advice}")


def write_predictions(
    folder: Path, recordings: Iterable[BenchmarkRecording], evaluated: Iterable[Evaluated]
) -> None:
    """One folder per predictor and kind of goals, one file per recording.

    Raises:
        InputError: it cannot be written.
    """
    from scenewright.evals.trajnet.score import format_predictions

    for each in evaluated:
        name = each.predictor.replace(" ", "_")
        files = {
            f"{recording.name}.ndjson": "".join(
                line + "\n" for line in format_predictions(recording, scenes)
            ).encode()
            for recording, scenes in zip(recordings, each.predicted, strict=True)
        }
        write_files(folder / (name if each.goals == "none" else f"{name}_told_{each.goals}"), files)


def format_scores(evaluated: Evaluated) -> str:
    """A headline and one line per kind of scene, intervals in brackets."""
    from scenewright.evals.records import format_records

    given = "" if evaluated.goals == "none" else f", given the {evaluated.goals}"
    columns = {
        "scenes": "{name}", "n": "{ade.n}", "people": "{people}", "ADE [m]": "{ade:.2f}",
        "FDE [m]": "{fde:.2f}", "Col-I": "{col1:.1%}", "Col-II": "{col2:.1%}",
    }  # fmt: skip
    titles = [*columns]
    table = format_columns(titles, format_records(evaluated.rows, columns), right={*titles[1:]})
    return format_one_line(f"{evaluated.predictor}{given}") + "\n" + table


@evals.command("realism")
def score_realism(
    *,
    sets: list[str] = argument(
        ...,
        "Folders of scenes, also of a batch, or files of tracks; NAME=PATH names one.",
        metavar="SET...",
    ),
    real: list[str] | None = option(
        None, "Tracks of real traffic to compare with; may be given again.", metavar="NAME=PATH"
    ),
    corpus: str | None = option(
        None, "A corpus, whose test hours are shown, too.", metavar="F.npz"
    ),
    intersection: str | None = option(None, "The intersection that the corpus is of."),
    scale: float | None = option(None, "Metres per pixel of tracks in pixels."),
    out: str | None = option(
        None, "Folder for realism.md, realism.json and realism.png.", check=try_folder
    ),
    seed: int = option(0, "Of splits and resamplings.", min=0),
    log: ProgressCallback,
) -> Result:
    """Judge how real the motion of scenes is, against recordings of real traffic.

    A classifier's two-sample test with its floors, speeds kept, headways, companions, reactions,
    numbers of people, and a likelihood beside that of log replay.
    """
    from scenewright.extras import require_extra

    require_extra("learn", "judging realism", "sklearn")
    from scenewright.evals.realism.assessment import assess, draw_assessment
    from scenewright.evals.realism.sources import read_source
    from scenewright.intersections import load_map
    from scenewright.tools.gmm_sampler import load_priors

    judged = [read_source(each, scale=scale) for each in sets]
    beside = [read_source(each, scale=scale) for each in real or ()]
    simulated = None if corpus is None else read_source(corpus, place=intersection)
    every = (*judged, *beside, *([simulated] if simulated else []))
    names = [each.name for each in every]
    check_distinct(names, "data sets are called", "name one with NAME=PATH")
    report = assess(
        judged,
        beside,
        corpus=simulated,
        mass_of=lambda place, hour: load_priors(place).counts[hour].mass,
        ground_of=load_map,
        seed=seed,
        log=partial(log, "judging"),
    )
    page, facts = report.format_markdown(), report.to_json()
    if out is not None:
        target = write_report(out, "realism", page, facts)
        write_atomically(target / "realism.png", draw_assessment(report))
    return Result({"out": out, **facts}, page)


def score_satisfaction(
    *,
    folder: str | None = argument(
        None, "ID/scene.json, or ID.SUFFIX: tracks, for each row.", metavar="DIR"
    ),
    rows: str | None = option(
        None, "Write the instructions as rows for `batch`.", metavar="F.jsonl"
    ),
    intersection: str = option(
        "amsterdam_120", "Map of submitted tracks; a scene.json names its own."
    ),
    entry: BoardOptions,
    log: ProgressCallback,
) -> Result:
    """How many instructions of other people are satisfied by scenes of any program.

    490 labelled instructions by writers who had seen no planner. First `--rows F.jsonl` writes
    them; then DIR is judged from its tracks alone: the events that the checker finds, between
    agents that come from, go to and cross what the label says, and nothing else.
    """
    from scenewright.evals.planning import load
    from scenewright.evals.satisfaction import judge as judging

    labelled = [row for row in load("voices") if "disputed" not in row]
    if (folder is None) == (rows is None):
        raise InputError("name either a folder to judge, or --rows FILE to write the instructions")
    if rows is not None:
        own = ({"id": row["id"], "text": row["text"]} for row in labelled)
        lines = "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in own)
        write_atomically(rows, lines.encode("utf-8"))
        return Result({"rows": rows}, f"{rows}: {len(labelled)} rows\n")
    verdicts = []
    for done, row in enumerate(labelled, start=1):
        found = judging.read_submission(Path(str(folder)), row["id"], intersection=intersection)
        verdicts.append(judging.judge(row, found))
        if done % 50 == 0:
            log("judging", f"{done} of {len(labelled)} instructions")
        stop_if_asked()
    if all(verdict.outcome.endswith("refused") for verdict in verdicts):
        raise InputError(f"{folder} holds no scene for any of the instructions; see --rows")
    shares = judging.count_verdicts(verdicts, labelled)
    figures = {
        name: {"right": share.count, **share.to_share(whole=1.0)} for name, share in shares.items()
    }
    facts = {"folder": folder, **figures, "verdicts": [vars(verdict) for verdict in verdicts]}
    return Result(facts, judging.to_markdown(shares, verdicts), notes=entry.enter(figures))
