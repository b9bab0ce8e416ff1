"""`scenewright planner`: check annotated instructions, and train the planner's reader on them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenewright.cli.common_options import Json
from scenewright.cli.console import log_line, show_progress, write_json, write_stdout
from scenewright.cli.output_folder import try_file
from scenewright.errors import InputError

planner = typer.Typer(name="planner", help="Train the builtin planner on annotated instructions.")
Files = Annotated[list[Path], typer.Argument(metavar="FILE...", help="Annotated instructions.")]


@planner.command()
def check(
    files: Files,
    as_json: Json = False,
) -> None:
    """Check files of annotated instructions: every line that cannot be used is named."""
    from scenewright.backends.builtin.training.corpus import find_faults

    faults = [f"{path}: {fault}" for path in files for fault in find_faults(path)]
    if as_json:
        write_json({"ok": not faults, "faults": faults})
    for fault in faults:
        log_line(fault)
    if faults:
        raise typer.Exit(2)
    if not as_json:
        write_stdout("no faults\n")


@planner.command()
def train(
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FILE...]", help="Your annotated instructions, if any."),
    ] = None,
    out: Annotated[
        Path, typer.Option(help="File to write the weights to.", callback=try_file)
    ] = Path("planner.safetensors"),
    minilm: Annotated[
        Path | None,
        typer.Option(help="Folder of all-MiniLM-L6-v2, to train from the beginning."),
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option(help="Training steps; 400 to fine-tune, 8,000 from the beginning."),
    ] = None,
    seed: Annotated[int, typer.Option(help="The same seed, the same weights.")] = 0,
    as_json: Json = False,
) -> None:
    """Train the planner's reader; the same command goes on with a run that was stopped.

    Beside your instructions it learns from those of the package. Use the weights with
    SCENEWRIGHT_PLANNER=FILE.
    """
    from scenewright.extras import require_extra

    require_extra("learn", "training the planner", "torch")
    from scenewright.backends.builtin.training.corpus import find_faults, list_package_files
    from scenewright.backends.builtin.training.fit import train_reader

    own = list(files or ())
    for path in own:
        for fault in find_faults(path):
            raise InputError(f"{path}: {fault}")
    with show_progress(quiet=False) as log:
        rows = train_reader(
            [*list_package_files(), *own], own=own, out=out, minilm=minilm,
            steps=steps or (400 if minilm is None else 8000), seed=seed,
            log=lambda line: log("training", line),
        )  # fmt: skip
    if as_json:
        write_json({"ok": True, "rows": rows, "out": str(out)})
    else:
        write_stdout(f"{out}\n")
