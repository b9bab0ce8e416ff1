"""`scenewright planner`: check annotated instructions, and train the planner's reader on them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from scenewright.cli.console import ProgressCallback, Result
from scenewright.cli.errors import UNUSABLE
from scenewright.cli.options import Commands, argument, option
from scenewright.cli.output_folder import try_file
from scenewright.errors import InputError

planner = Commands(name="planner", help="Train the builtin planner on annotated instructions.")


@planner.command()
def check(
    files: list[Path] = argument(..., "Annotated instructions.", metavar="FILE..."),
) -> Result:
    """Check files of annotated instructions: every line that cannot be used is named."""
    from scenewright.backends.builtin.training.corpus import find_faults

    faults = [f"{path}: {fault}" for path in files for fault in find_faults(path)]
    text = "" if faults else "no faults\n"
    facts = {"ok": not faults, "faults": faults}
    return Result(facts, text, notes=faults, code=UNUSABLE if faults else 0)


@planner.command()
def train(
    *,
    files: list[Path] | None = argument(
        None, "Your annotated instructions, if any.", metavar="[FILE...]"
    ),
    out: Path = option(
        Path("planner.safetensors"), "File to write the weights to.", check=try_file
    ),
    minilm: Path | None = option(None, "Folder of all-MiniLM-L6-v2, to train from the beginning."),
    steps: int | None = option(None, "Training steps; 400 to fine-tune, 8,000 from the beginning."),
    seed: int = option(0, "The same seed, the same weights."),
    log: ProgressCallback,
) -> Result:
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
    rows = train_reader(
        [*list_package_files(), *own], own=own, out=out, minilm=minilm,
        steps=steps or (400 if minilm is None else 8000), seed=seed, log=partial(log, "training"),
    )  # fmt: skip
    return Result({"rows": rows, "out": str(out)}, f"{out}\n")
