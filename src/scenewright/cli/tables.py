"""`scenewright evals tables`: every table of the paper on a dataset of ours."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from scenewright.cli.console import ProgressCallback, Result, log_line
from scenewright.cli.options import argument, option
from scenewright.cli.output_folder import try_folder, write_report
from scenewright.errors import InputError

FOLDER = "evaluation"


def _find(path: Path | None) -> Path | None:
    """The path of an option that may be left out; InputError if nothing is there."""
    if path is not None and not path.exists():
        raise InputError(f"there is no {path}")
    return path


Corpus = Annotated[
    Path | None,
    typer.Option(metavar="F.npz", help="Recorded hours, of `simulate --corpus`.", callback=_find),
]
RealTracks = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Real tracks, the TAF-BW data set.", callback=_find),
]


def print_tables(
    *,
    folder: str = argument(..., "Folder of the dataset.", metavar="DIR"),
    corpus: Corpus = None,
    taf_bw: RealTracks = None,
    out: str | None = option(
        None, "Folder to write; DIR/evaluation if none is named.", check=try_folder
    ),
    understanding: bool = option(True, "Measure Table 3.", "--understanding/--no-understanding"),
    draws: int = option(1000, "Resamplings for the intervals.", min=10),
    seed: int = option(0, "Of the resamplings.", min=0),
    log: ProgressCallback,
) -> Result:
    """Print and write Tables 1 to 5 of the paper, realism and diversity, for a dataset.

    Writes tables.md and tables.json. How scenes move and differ needs recorded hours.
    """
    page, values, target = write_tables(
        Path(folder), out=out, corpus=corpus, real=taf_bw,
        understand=understanding, draws=draws, seed=seed, log=partial(log, "measuring"),
    )  # fmt: skip
    return Result({"out": str(target), **values}, page)


def write_tables(
    folder: Path, *, out: str | None = None, **options: Any
) -> tuple[str, dict[str, Any], Path]:
    """Measures a dataset and writes tables.md and tables.json; both, and their folder.

    Args:
        out: folder to write; FOLDER/evaluation if None. options: as of `make_tables`.
    """
    from scenewright.evals.tables.produce import make_tables
    from scenewright.evals.tables.report import format_markdown, to_json

    place = out or folder / FOLDER
    try_folder(place)
    found = make_tables(folder, **options)
    page, values = format_markdown(found), to_json(found)
    target = write_report(place, "tables", page, values)
    log_line(f"written: {target}/tables.md, tables.json")
    return page, values, target
