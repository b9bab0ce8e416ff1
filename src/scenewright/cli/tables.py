"""`scenewright evals tables`: every table of the paper on a dataset of ours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from scenewright.cli.common_options import Json, Quiet
from scenewright.cli.console import log_line, show_progress, write_json, write_stdout
from scenewright.cli.output_folder import try_folder
from scenewright.errors import InputError

FOLDER = "evaluation"

Corpus = Annotated[
    str | None, typer.Option(metavar="F.npz", help="Recorded hours, of `simulate --corpus`.")
]
RealTracks = Annotated[
    str | None, typer.Option(metavar="DIR", help="Real tracks, the TAF-BW data set.")
]


def print_tables(
    folder: Annotated[str, typer.Argument(metavar="DIR", help="Folder of the dataset.")],
    corpus: Corpus = None,
    taf_bw: RealTracks = None,
    out: Annotated[
        str | None,
        typer.Option(help="Folder to write; DIR/evaluation if none is named.", callback=try_folder),
    ] = None,
    understanding: Annotated[
        bool, typer.Option("--understanding/--no-understanding", help="Measure Table 3.")
    ] = True,
    draws: Annotated[int, typer.Option(min=10, help="Resamplings for the intervals.")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="Of the resamplings.")] = 0,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Print and write Tables 1 to 5 of the paper, realism and diversity, for a dataset.

    Writes tables.md and tables.json. How scenes move and differ needs recorded hours.
    """
    with show_progress(quiet=quiet) as log:
        page, values, target = write_tables(
            Path(folder),
            out=out,
            corpus=parse_path(corpus),
            real=parse_path(taf_bw),
            understand=understanding,
            draws=draws,
            seed=seed,
            log=lambda line: log("measuring", line),
        )
    if as_json:
        write_json({"ok": True, "out": str(target), **values})
    else:
        write_stdout(page)
        log_line(f"written: {target}/tables.md, tables.json")


def parse_path(name: str | None) -> Path | None:
    """The path of an option that may be left out; InputError if nothing is there."""
    if name is not None and not Path(name).exists():
        raise InputError(f"there is no {name}")
    return None if name is None else Path(name)


def write_tables(
    folder: Path, *, out: str | None = None, **options: Any
) -> tuple[str, dict[str, Any], Path]:
    """Measures a dataset and writes tables.md and tables.json; both, and their folder.

    Args:
        out: folder to write; FOLDER/evaluation if None. options: as of `make_tables`.
    """
    from scenewright.evals.tables.produce import make_tables
    from scenewright.evals.tables.report import format_markdown, to_json
    from scenewright.files import write_atomically
    from scenewright.graph.run import make_folder

    try_folder(out or folder / FOLDER)
    found = make_tables(folder, **options)
    target = make_folder(out or folder / FOLDER)
    page, values = format_markdown(found), to_json(found)
    data = json.dumps(values, ensure_ascii=False, indent=1, allow_nan=False)
    write_atomically(target / "tables.json", (data + "\n").encode("utf-8"))
    write_atomically(target / "tables.md", page.encode("utf-8"))
    return page, values, target
