"""`scenewright intersections train`: the refiner of an intersection from recorded hours."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenewright.tools.trajnet_refiner.train import Epoch


def train_refiner(
    name: str,
    *,
    corpus: Path,
    out: str | None,
    epochs: int | None,
    seed: int,
    tell: Callable[[str, str], None],
) -> dict[str, Any]:
    """Trains and writes weights and model card; says where they are and what they are worth.

    Raises:
        InputError: no such intersection, no such corpus, or a place that cannot be written.
    """
    from scenewright.intersections import find_bundle_folder
    from scenewright.tools.track_io import load_recordings
    from scenewright.tools.trajnet_refiner.bundle_training import out_folder, train_bundle
    from scenewright.tools.trajnet_refiner.supervised import RECIPE

    find_bundle_folder(name)
    recordings = load_recordings(corpus)
    changed: dict[str, Any] = {"seed": seed} | ({} if epochs is None else {"epochs": epochs})
    recipe = RECIPE.model_copy(update=changed)
    folder = out_folder(name, out)

    def told(epoch: Epoch) -> None:
        tell("training", f"epoch {epoch.number} of {recipe.epochs}: loss {epoch.loss:.4f}")

    about = train_bundle(
        name, recordings, out=folder, recipe=recipe, after_epoch=told,
        tell=lambda done, of: tell("training", f"{100 * done // of} %") if done % 20 == 0 else None,
    )  # fmt: skip
    return {"folder": str(folder), "figures": about["figures"]}
