"""The refiner trained on TrajNet++ recordings, with the recipe that the benchmark reports.

`python -m lab.trajnet.training FILE... --out W.safetensors`; started again after a kill, it goes
on where it was.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lab.trajnet.windows import BENDING, cut_training_windows
from scenewright.errors import InputError
from scenewright.evals.trajnet.recording import OBSERVED, PREDICTED, BenchmarkRecording

if TYPE_CHECKING:
    from scenewright.tools.trajnet_refiner.config import RefinerConfig
    from scenewright.tools.trajnet_refiner.train import Epoch, ProgressCallback, Recipe

TEST_RECORDINGS = ("biwi_eth", "crowds_zara02", "crowds_uni_examples", "uni_examples")
"""The official test scenes come from these; they must never be trained on."""


def train_on(
    recordings: Sequence[BenchmarkRecording],
    *,
    out: Path,
    held_out: Sequence[BenchmarkRecording] = (),
    config: RefinerConfig | None = None,
    recipe: Recipe | None = None,
    polish: bool = True,
    device: str | None = None,
    log: ProgressCallback | None = None,
    after_epoch: Callable[[Epoch], None] | None = None,
) -> dict[str, Any]:
    """Train a refiner and write it to `out`, together with the training's settings.

    Half of the windows run backwards in time. First all agents have similar weights; then those
    that do not simply keep going weigh most (`build_polishing_recipe`). While it runs, its state is
    kept next to `out` in files ending in .training and .polishing, from which a restart goes on;
    in the end they are removed.

    Args:
        held_out: recordings to validate on; the error is that of all their agents.
        config, recipe: the benchmark's own if None.
        polish: whether there is the second part.

    Returns:
        What is kept beside the weights: recordings, recipe, losses.

    Raises:
        InputError: a recording is one of the benchmark's test recordings, or is held out, too.
    """
    from scenewright.tools.trajnet_refiner.config import RefinerConfig
    from scenewright.tools.trajnet_refiner.store import save_refiner
    from scenewright.tools.trajnet_refiner.train import train

    check_split([r.name for r in recordings], [r.name for r in held_out])
    config = config or RefinerConfig(observed=OBSERVED, predicted=PREDICTED)
    recipe = recipe or build_own_recipe()
    losses: list[float] = []

    def keep(epoch: Epoch, before: int = 0) -> None:
        losses.append(round(epoch.loss, 4))
        if after_epoch is not None:
            after_epoch(epoch._replace(number=before + epoch.number))

    states = [out.with_name(out.name + ending) for ending in (".training", ".polishing")]
    how: dict[str, Any] = {
        "config": config, "device": device, "log": log,
        "held_out": cut_training_windows(held_out),
    }  # fmt: skip
    net = train(
        cut_training_windows(recordings, both_ways=True), recipe=recipe, checkpoint=states[0],
        after_epoch=keep, **how,
    )  # fmt: skip
    if polish:
        windows = cut_training_windows(recordings, weights=BENDING, both_ways=True)
        net = train(
            windows, recipe=build_polishing_recipe(recipe), checkpoint=states[1], start=net,
            after_epoch=lambda epoch: keep(epoch, recipe.epochs), **how,
        )  # fmt: skip
    about = {
        "trained_on": [r.name for r in recordings],
        "recipe": recipe.model_dump(mode="json"),
        "losses": losses,
    }
    if polish:
        about["polished"] = build_polishing_recipe(recipe).model_dump(mode="json")
    save_refiner(net.config, net.list_weights(), out, about=about)
    for state in states:
        state.unlink(missing_ok=True)
    return about


def build_own_recipe(*, epochs: int = 18, seed: int = 0) -> Recipe:
    """The first part of the benchmark's recipe; an epoch sees half of all windows of both ways."""
    from scenewright.tools.trajnet_refiner.train import Recipe

    return Recipe(epochs=epochs, share=0.5, apart=1.0, seed=seed)


def build_polishing_recipe(recipe: Recipe) -> Recipe:
    """The second part of a training: 4/9 of the epochs, at half the rate, half the goals."""
    return recipe.model_copy(
        update={
            "epochs": math.ceil(recipe.epochs * 4 / 9),
            "rate": recipe.rate / 2,
            "goals": recipe.goals / 2,
        }
    )


def check_split(trained_on: Sequence[str], held_out: Sequence[str]) -> None:
    """Refuses what would make a score worthless.

    Raises:
        InputError: a recording of the official test is to be trained on, or one is on both sides.
    """
    for name in trained_on:
        if name.lower() in TEST_RECORDINGS:
            raise InputError(f"{name} is a test recording of TrajNet++; it is not trained on")
        if name in held_out:
            raise InputError(f"{name} cannot be trained on and held out at once")


def main(argv: Sequence[str] | None = None) -> int:
    """Train on files and write the weights."""
    from scenewright.evals.trajnet.recording import read_recording

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path, help="TrajNet++ recordings, .ndjson")
    parser.add_argument("--out", required=True, type=Path, help="file for the weights")
    parser.add_argument("--epochs", type=int, default=18)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)
    try:
        train_on(
            [read_recording(each) for each in given.files],
            out=given.out,
            recipe=build_own_recipe(epochs=given.epochs, seed=given.seed),
            after_epoch=lambda each: print(
                f"epoch {each.number}: loss {each.loss:.3f}, {each.seconds:.0f} s", file=sys.stderr
            ),
        )
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    print(given.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
