"""`scenewright evals`: benchmarks of the parts on data of one's own."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenewright.cli.common_options import Json, Quiet
from scenewright.cli.console import (
    format_one_line,
    log_line,
    render_table,
    show_progress,
    write_json,
    write_stdout,
)
from scenewright.cli.output_folder import try_folder
from scenewright.errors import InputError

if TYPE_CHECKING:
    from scenewright.evals.realism.assessment import Assessment
    from scenewright.evals.trajnet.recording import BenchmarkRecording
    from scenewright.evals.trajnet.score import Evaluated

evals = typer.Typer(name="evals", help="Benchmarks of the parts on data of your own.")

Files = Annotated[
    list[str], typer.Argument(metavar="FILE...", help="TrajNet++ recordings, .ndjson.")
]


@evals.command("trajnet")
def score_trajnet(
    files: Files,
    weights: Annotated[
        str | None,
        typer.Option(help="The refiner's weights, .safetensors; constant velocity alone without."),
    ] = None,
    out: Annotated[
        str | None,
        typer.Option(
            help="Folder for the predictions in the benchmark's format.", callback=try_folder
        ),
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Score predicted pedestrians as TrajNet++ does: ADE, FDE, Col-I and Col-II by type of scene.

    The refiner predicts without goals, given each pedestrian's destination, and given where it is
    at the end of the scene. Files without the future are predicted but not scored.
    """
    from scenewright.evals.trajnet.score import evaluate
    from scenewright.extras import require_extra

    if weights is not None:
        require_extra(
            "learn", "predicting the benchmark", "torch", otherwise="score without --weights"
        )
    recordings = read_recordings(files)
    with show_progress(quiet=quiet) as log:
        evaluated = evaluate(
            recordings,
            weights=None if weights is None else Path(weights),
            log=lambda line: log("predicting", line),
        )
    if out is not None:
        write_predictions(Path(out), recordings, evaluated)
    if not evaluated[0].rows:
        log_line("note: no file holds what really happened, so there is nothing to score")
    if as_json:
        results = [each.to_json() for each in evaluated]
        write_json({"ok": True, "files": files, "out": out, "results": results})
    else:
        write_stdout(
            "".join(format_scores(each) for each in evaluated if each.rows) or f"{out or ''}\n"
        )


def read_recordings(files: Iterable[str]) -> list[BenchmarkRecording]:
    """Every file, in order.

    Raises:
        InputError: one is no TrajNet++ file, or two have the same name.
    """
    from scenewright.evals.trajnet.recording import read_recording

    recordings = [read_recording(Path(file)) for file in files]
    names = [recording.name for recording in recordings]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"two files are called {twice[0]}.ndjson; rename one of them")
    return recordings


def write_predictions(
    folder: Path, recordings: Iterable[BenchmarkRecording], evaluated: Iterable[Evaluated]
) -> None:
    """One folder per predictor and kind of goals, one file per recording.

    Raises:
        InputError: it cannot be written.
    """
    from scenewright.evals.trajnet.score import format_predictions
    from scenewright.files import write_atomically

    for each in evaluated:
        name = each.predictor.replace(" ", "_")
        place = folder / (name if each.goals == "none" else f"{name}_told_{each.goals}")
        try:
            place.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot write {place}: {error.strerror or error}") from error
        for recording, scenes in zip(recordings, each.predicted, strict=True):
            text = "".join(line + "\n" for line in format_predictions(recording, scenes))
            write_atomically(place / f"{recording.name}.ndjson", text.encode())


def format_scores(evaluated: Evaluated) -> str:
    """A headline and one line per kind of scene, intervals in brackets."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    given = "" if evaluated.goals == "none" else f", given the {evaluated.goals}"
    page = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    page.add_column("scenes")
    for title in ("n", "people", "ADE [m]", "FDE [m]", "Col-I [%]", "Col-II [%]"):
        page.add_column(Text(title), justify="right", no_wrap=True)
    for row in evaluated.rows:
        digits = {"ade": 2, "fde": 2, "col1": 1, "col2": 1}
        cells = [
            row.figures[measure].format(f"{{0:.{n}f}} ({{1:.{n}f}} to {{2:.{n}f}})", "none")
            for measure, n in digits.items()
        ]
        page.add_row(row.name, str(row.scenes), str(row.people), *cells)
    return format_one_line(f"{evaluated.predictor}{given}") + "\n" + render_table(page)


@evals.command("realism")
def score_realism(
    sets: Annotated[
        list[str],
        typer.Argument(
            metavar="SET...",
            help="Folders of scenes, also of a batch, or files of tracks; NAME=PATH names one.",
        ),
    ],
    real: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=PATH", help="Tracks of real traffic to compare with; may be given again."
        ),
    ] = None,
    corpus: Annotated[
        str | None, typer.Option(metavar="F.npz", help="A corpus, whose test hours are shown, too.")
    ] = None,
    intersection: Annotated[
        str | None, typer.Option(help="The intersection that the corpus is of.")
    ] = None,
    scale: Annotated[
        float | None, typer.Option(help="Metres per pixel of tracks in pixels.")
    ] = None,
    out: Annotated[
        str | None,
        typer.Option(
            help="Folder for realism.md, realism.json and realism.png.", callback=try_folder
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of splits and resamplings.")] = 0,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Judge how real the motion of scenes is, against recordings of real traffic.

    A classifier's two-sample test with its floors, speeds kept, headways, companions, reactions,
    numbers of people, and a likelihood beside that of log replay.
    """
    from scenewright.extras import require_extra

    require_extra("learn", "judging realism", "sklearn")
    from scenewright.evals.realism.assessment import assess
    from scenewright.evals.realism.sources import read_source
    from scenewright.intersections import load_map
    from scenewright.tools.gmm_sampler import load_priors

    judged = [read_source(each, scale=scale) for each in sets]
    beside = [read_source(each, scale=scale) for each in real or ()]
    simulated = None if corpus is None else read_source(corpus, place=intersection)
    check_names([each.name for each in (*judged, *beside, *([simulated] if simulated else []))])
    with show_progress(quiet=quiet) as log:
        report = assess(
            judged,
            beside,
            corpus=simulated,
            mass_of=lambda place, hour: load_priors(place).counts[hour].mass,
            ground_of=load_map,
            seed=seed,
            log=lambda line: log("judging", line),
        )
    if out is not None:
        write_assessment(Path(out), report)
    if as_json:
        write_json({"ok": True, "out": out, **report.to_json()})
    else:
        write_stdout(report.format_markdown())


def check_names(names: list[str]) -> None:
    """InputError where two data sets have one name."""
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"two data sets are called {twice[0]!r}; name one with NAME=PATH")


def write_assessment(folder: Path, report: Assessment) -> None:
    """The report as tables, JSON and a page of plots.

    Raises:
        InputError: the folder cannot be made.
    """
    import json

    from scenewright.evals.realism.assessment import draw_assessment
    from scenewright.files import write_atomically
    from scenewright.graph.run import make_folder

    target = make_folder(folder)
    text = json.dumps(report.to_json(), ensure_ascii=False, indent=1, allow_nan=False) + "\n"
    write_atomically(target / "realism.md", report.format_markdown().encode("utf-8"))
    write_atomically(target / "realism.json", text.encode("utf-8"))
    write_atomically(target / "realism.png", draw_assessment(report))
