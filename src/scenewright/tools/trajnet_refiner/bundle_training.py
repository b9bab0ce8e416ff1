"""The refiner of a bundle: from recorded hours to weights with a model card beside them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from scenewright.errors import InputError
from scenewright.geometry.polyline import smooth_gaussian
from scenewright.intersections import (
    REFINER_WEIGHTS,
    find_bundle_folder,
    read_bundle_header,
    sign_bundle,
)
from scenewright.tools.track_io import Recording
from scenewright.tools.trajnet_refiner.config import CLASSES, RefinerConfig, list_shapes
from scenewright.tools.trajnet_refiner.model import Refiner, predict
from scenewright.tools.trajnet_refiner.network import RefinerNetwork
from scenewright.tools.trajnet_refiner.store import save_refiner
from scenewright.tools.trajnet_refiner.train import (
    RECIPE,
    Epoch,
    ProgressCallback,
    Recipe,
    build_supervised_batches,
    compute_negative_log_density,
    cut_recorded_windows,
    reverse_windows,
    train,
)
from scenewright.tools.trajnet_refiner.windows import Variation, Window

CARD = "refiner.md"
CONFIG = RefinerConfig(
    hidden=128, embedding=48, pooled=96, neighbours=8, stride=2, mirrored=False, apart=None
)
"""Small enough that a scene is refined in a tenth of a second."""
_CLASSES = ("pedestrian", "vehicle")
"""By the number that the network knows a class by."""

_TRIED = 4096
_SIMULATED = 0.1
"""Weight of simulated pedestrians beside real ones."""
_SWAY = 4.0
"""Width of the Gaussian that takes the sway of each step out of walkers' tracks [samples]."""
OVERLAP = 4
"""Network steps from one stretch of a recording to the next where there are few."""


def train_bundle(
    name: str,
    recordings: Sequence[Recording],
    *,
    out: Path,
    recipe: Recipe = RECIPE,
    config: RefinerConfig | None = None,
    log: ProgressCallback | None = None,
    after_epoch: Callable[[Epoch], None] | None = None,
    start: RefinerNetwork | None = None,
    command: str | None = None,
    walkers: Sequence[Recording] = (),
    others: Sequence[Recording] = (),
    stride: int | None = None,
    most: int | None = None,
) -> Mapping[str, Any]:
    """Trains the refiner of an intersection and writes weights and model card to a folder.

    Trained on the processor, one thread, so that the same recordings and seed give the same
    weights. The state is kept beside the weights after every epoch: started again after a kill,
    it goes on. Where the folder holds a `bundle.toml`, the checksums in it are brought up to date.

    Args:
        recordings: of all splits; those to fit are trained on, those to test give the figures.
        config: of the network; that of `start` if None, and `CONFIG` without one.
        start: the network to start from, of the same sizes; None draws the weights.
        command: that made the recordings, for the card.
        walkers: recordings of real people on foot: how pedestrians move is then learned from those
            to fit, and simulated ones count a tenth; those to test give figures of their own.
        others: recordings of other intersections; those to fit are learned from as well, those to
            test give figures for each place.
        stride: network steps from one stretch of a recording to the next, `OVERLAP` where there
            are few; None for stretches that do not overlap in what is predicted.
        most: stretches of the recordings that are learned from, drawn by the recipe's seed; None
            for all.

    Returns:
        What is kept with the weights: data, recipe, losses, figures.

    Raises:
        InputError: there are no hours to fit, or the folder cannot be written.
    """
    config = config or (CONFIG if start is None else start.config)
    by_split = {
        split: [recording for recording in recordings if recording.split == split]
        for split in ("fit", "validation", "test")
    }
    if not by_split["fit"]:
        raise InputError("the corpus holds no hours to fit; make one with `simulate --corpus`")
    foreign = [
        recording.name for recording in recordings if not recording.name.startswith(f"{name} ")
    ]
    if foreign:
        raise InputError(f"the corpus is of another intersection: {foreign[0]!r}, not {name!r}")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise InputError(f"cannot make folder {out}: {fault.strerror or fault}") from fault
    own = _cut_windows(by_split["fit"], config, stride)
    order = np.random.default_rng(recipe.seed).permutation(len(own))[:most]
    windows = [own[k] for k in np.sort(order)]
    windows += _cut_windows([each for each in others if each.split == "fit"], config, stride)
    walkers = [_smooth_steps(walker) for walker in walkers]
    taught = [walker for walker in walkers if walker.split == "fit"]
    if taught:
        walking = _cut_windows(taught, config, OVERLAP)
        backwards = reverse_windows(walking, observed=config.observed)
        windows = [*map(_weigh_down_pedestrians, windows), *walking, *backwards]
    losses: list[float] = []

    def keep(epoch: Epoch) -> None:
        losses.append(round(epoch.loss, 4))
        if after_epoch is not None:
            after_epoch(epoch)

    state = out / f"{REFINER_WEIGHTS}.training"
    first = None if start is None else Refiner.from_weights(start.config, start.weights)
    with _use_one_thread():
        net = train(
            windows, config=config, recipe=recipe, checkpoint=state, device="cpu", log=log,
            after_epoch=keep, make=build_supervised_batches, start=first,
        )  # fmt: skip
        about = {
            "intersection": name,
            "hours": {split: [each.name for each in some] for split, some in by_split.items()},
            "windows": len(windows),
            "recipe": recipe.model_dump(mode="json"),
            "losses": losses,
            "command": command or "python -m lab.bundle.record_corpus",
            "started": start is not None,
            "figures": compute_figures(net, by_split["test"] or by_split["fit"], stride=stride),
        }
        if others:
            about["others"] = {
                place: compute_figures(
                    net,
                    [o for o in others if o.split == "test" and o.name.partition(" ")[0] == place],
                    stride=stride,
                )
                for place in dict.fromkeys(each.name.partition(" ")[0] for each in others)
            }
        if walkers:
            about["walkers"] = {split: [walker.name for walker in walkers if walker.split == split]
                                for split in ("fit", "test")}  # fmt: skip
            tried = [walker for walker in walkers if walker.split == "test"]
            about["walkers_figures"] = compute_figures(net, tried, stride=OVERLAP)
    save_refiner(net.config, net.list_weights(), out / REFINER_WEIGHTS, about=about)
    (out / CARD).write_text(format_card(net.config, about), encoding="utf-8")
    sign_bundle(out, REFINER_WEIGHTS, CARD)
    state.unlink(missing_ok=True)
    return about


def find_out_folder(name: str, out: str | None) -> Path:
    """Find the folder for a bundle's refiner: `out` if given, else the user's own bundle.

    Raises:
        InputError: no such intersection.
    """
    folder = find_bundle_folder(name)
    if out is not None:
        return Path(out)
    shipped = folder.is_relative_to(Path(__file__).parents[2])
    return Path("intersections") / name if shipped else folder


def compute_figures(
    net: Refiner, recordings: Sequence[Recording], *, stride: int | None = None
) -> dict[str, float]:
    """How well the network predicts hours that it never saw, 4.8 s ahead, mean over agents.

    Waypoints lie on the agent's way, two to twelve steps apart, the last moment's place not always
    left out. Beside the network stands constant velocity, which has no use for them. The density
    is that of the first 0.8 s. Of a class without test agents there is its number, 0, alone.
    """
    windows = _cut_windows(recordings, net.config, stride)
    rng = np.random.default_rng(0)
    order = rng.permutation(len(windows))[:_TRIED]
    exactly = Variation(stretch=0.0, noise=0.0, unseen=0.0, goals=1.0)
    sums = dict.fromkeys((f"{label}_n" for label in _CLASSES), 0.0)
    for scenes, future, _ in build_supervised_batches(
        [windows[i] for i in order], observed=net.config.observed, agents=2048,
        variation=exactly, rng=rng,
    ):  # fmt: skip
        steps = torch.arange(1, future.shape[2] + 1)
        move = scenes.xy[:, :, -1] - scenes.xy[:, :, -2]
        even = scenes.xy[:, :, -1:] + move[:, :, None] * steps[:, None]
        made = predict(net, scenes)
        alone = predict(net, scenes._replace(goal=None, due=None))
        for kind, label in enumerate(_CLASSES):
            here = (scenes.classes == kind) & ~future.isnan().flatten(2).any(-1)
            here &= ~move.isnan().any(-1)
            _add(sums, f"{label}_n", here.sum())
            for how, xy in (("waypoints", made.xy), ("alone", alone.xy), ("even", even)):
                off = (xy - future).norm(dim=-1)[here]
                _add(sums, f"{label}_ade_{how}", off.mean(-1).sum())
                _add(sums, f"{label}_fde_{how}", off[:, -1].sum())
            surprise = compute_negative_log_density(made, future)[here]
            _add(sums, f"{label}_nll_first", surprise[:, : net.config.stride].mean(-1).sum())
    return {
        key: round(
            value if key.endswith("_n") else value / max(sums[f"{key.split('_')[0]}_n"], 1), 4
        )
        for key, value in sums.items()
    }


def _add(sums: dict[str, float], key: str, value: torch.Tensor) -> None:
    sums[key] = sums.get(key, 0.0) + float(value.nan_to_num())


def format_card(config: RefinerConfig, about: Mapping[str, Any]) -> str:
    """The model card, as Markdown."""
    found, recipe, name = about["figures"], about["recipe"], about["intersection"]
    licence = read_bundle_header(find_bundle_folder(name)).get("licence", "that of the bundle")
    hours = about["hours"]
    count = sum(math.prod(shape) for shape in list_shapes(config).values())
    rows = "\n".join(_format_row(kind, found) for kind in reversed(_CLASSES))
    start = "From the weights of the shipped intersection on, " if about["started"] else ""
    tested = "those that it was fitted on, as there are no others"
    if test := hours["test"]:
        tested = f"{len(test)} recordings that nothing was fitted to: {_format_hours(test)}"
    return f"""# Refiner of {name}

- **What it is.** An interaction-aware LSTM of the TrajNet++ family with
  {count} weights (`tools/trajnet_refiner/model.py`). It moves
  the agents of a scene from one waypoint of their edited priors to the next.
- **Data.** Simulated traffic of this intersection (`{about["command"]}`){_format_walking(about)}.
  {_format_others(about)}Fitted on {len(hours["fit"])} recordings:
  {_format_hours(hours["fit"])}. Figures from
  {tested}.
- **Training.** {start}{about["windows"]} windows of
  {config.observed} + {config.predicted} steps of {config.step} s,
  {recipe["epochs"]} epochs, seed {recipe["seed"]}.
  Losses: {", ".join(map(str, about["losses"]))}.
- **Licence.** {licence}, as the bundle.
- **Use.** Inside the pipeline, behind the kinematic layer and before the verifier. It knows neither
  the map nor the lights: edited priors define where to be and when. What it learnt is how the
  simulator's drivers and walkers speed up, slow down and waver, not a real street's.

Errors in metres 4.8 s ahead (mean / at the end) where all positions before are known, and nats per
position of the first 0.8 s. Waypoints are places on the true way, 0.8 to 4.8 s apart:

| class | n | with waypoints | without | constant velocity | -log density |
|---|---|---|---|---|---|
{rows}
"""


def _format_row(kind: str, found: Mapping[str, float]) -> str:
    """Format a class' figures; dashes without test agents."""
    if not found[f"{kind}_n"]:
        return f"| {kind} | 0 | – | – | – | – |"
    errors = " | ".join(
        f"{found[f'{kind}_ade_{how}']:.2f} / {found[f'{kind}_fde_{how}']:.2f}"
        for how in ("waypoints", "alone", "even")
    )
    return f"| {kind} | {found[f'{kind}_n']:.0f} | {errors} | {found[f'{kind}_nll_first']:.2f} |"


def _format_walking(about: Mapping[str, Any]) -> str:
    """Whose walking was learned, and what it is worth on people that nothing was fitted to."""
    if "walkers" not in about:
        return ", no recorded\n  person"
    names, found = about["walkers"], about["walkers_figures"]
    fit, test = (", ".join(names[split]) for split in ("fit", "test"))
    tried = f"{found['pedestrian_n']:.0f} in {test}" if test else "none"
    row = _format_row("pedestrian", found).split("|")[3:-1]
    return (
        f" for vehicles; pedestrians are\n  learned from real walkers: {fit}. Held out: {tried}; "
        f"with waypoints{row[0]}m, without{row[1]}m,\n  constant velocity{row[2]}m"
    )


def _format_others(about: Mapping[str, Any]) -> str:
    """The other intersections that were learned from, and how far off vehicles are there."""
    if not about.get("others"):
        return ""
    rows = []
    for place, found in about["others"].items():
        errors = "none"
        if found["vehicle_n"]:
            errors = (
                f"{found['vehicle_ade_waypoints']:.2f} m with waypoints, constant velocity "
                f"{found['vehicle_ade_even']:.2f} m"
            )
        rows.append(f"{place} ({found['vehicle_n']:.0f} vehicles held out: {errors})")
    return f"Other intersections learned from as well: {', '.join(rows)}.\n  "


def _format_hours(names: Sequence[str]) -> str:
    """The names without the intersection's, which is that of all."""
    return ", ".join(name.partition(" ")[2] for name in names)


def _cut_windows(
    recordings: Sequence[Recording], config: RefinerConfig, stride: int | None = None
) -> list[Window]:
    return cut_recorded_windows(
        recordings, observed=config.observed, predicted=config.predicted, stride=stride
    )


def _weigh_down_pedestrians(window: Window) -> Window:
    """A simulated window in which pedestrians count little: real ones show how people walk."""
    on_foot = window.classes == CLASSES.index("pedestrian")
    return replace(window, weight=np.where(on_foot, _SIMULATED * window.weight, window.weight))


def _smooth_steps(recording: Recording) -> Recording:
    """A recording without the sway of steps: heads are tracked, and predicted is where one goes."""
    agents = [
        replace(agent, track=replace(agent.track, xy=smooth_gaussian(agent.track.xy, _SWAY)))
        for agent in recording.agents
    ]
    return replace(recording, agents=tuple(agents))


@contextmanager
def _use_one_thread() -> Iterator[None]:
    """Sums come out alike on however many processors."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
