"""Refiners of `scenewright intersections`: trained on hours, or adapted to the tracks of `fit`."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenewright.cli.console import ProgressCallback
from scenewright.errors import InputError
from scenewright.intersections import REFINER_WEIGHTS
from scenewright.scene.track import PEDESTRIAN, Track, get_vehicle_shape
from scenewright.tools.track_io import RecordedAgent, Recording
from scenewright.tools.track_io.recording import Split
from scenewright.tools.track_io.track_files import FileTracks

if TYPE_CHECKING:
    from scenewright.cli.options import TrainOptions

GOES_ON = {"epochs": 6, "rate": 3e-4}
"""How a network that has been trained elsewhere goes on: briefly, in small steps."""
_TAUGHT = 0.6
"""Share of a file's time that is learned from; agents that come later are held out."""
_FEWEST = 20
"""Held-out samples of a class below which it decides nothing."""

Figures = Mapping[str, float]


def adapt_refiner(
    name: str, files: Sequence[FileTracks], log: ProgressCallback
) -> tuple[dict[str, bytes], str]:
    """Weights and card of a refiner adapted to recorded tracks, and a note of what it is worth.

    There are no files, and the note says so, where held-out agents are not predicted better than
    by the weights that serve without: jittering tracks teach jitter.
    """
    from scenewright.tools.trajnet_refiner.bundle_training import OVERLAP, compute_figures
    from scenewright.tools.trajnet_refiner.bundled import find_refiner
    from scenewright.tools.trajnet_refiner.model import Refiner

    recordings = [each for file in files for each in _split_recordings(name, file)]
    serving = find_refiner(name)
    if serving is None or {recording.split for recording in recordings} != {"fit", "test"}:
        return {}, "the refiner is not adapted: too few tracks, or no weights to go on from"
    log("training", f"a refiner on {sum(len(r.agents) for r in recordings)} tracks")
    tried = [recording for recording in recordings if recording.split == "test"]
    own = Refiner.from_weights(serving.net.config, serving.net.weights)
    before = compute_figures(own, tried, stride=OVERLAP)
    made, figures = train_to_files(
        name, recordings, start=serving.net, log=log, stride=OVERLAP,
        command=f"scenewright intersections fit {name} --train",
    )  # fmt: skip
    note, better = compare_errors(before, figures)
    return (made, f"the refiner is adapted: {note}") if better else ({}, f"not adapted: {note}")


def train_to_files(
    name: str, recordings: Sequence[Recording], *, log: ProgressCallback, seed: int = 0,
    **options: Any,
) -> tuple[dict[str, bytes], dict[str, Any]]:  # fmt: skip
    """Weights and card of a refiner that goes on briefly, as files of a bundle, and its figures.

    Args:
        options: as of `train_bundle`.
    """
    from scenewright.tools.trajnet_refiner.bundle_training import CARD, train_bundle
    from scenewright.tools.trajnet_refiner.train import RECIPE

    recipe = RECIPE.model_copy(update={**GOES_ON, "seed": seed})
    with tempfile.TemporaryDirectory() as scratch:
        about = train_bundle(
            name, recordings, out=Path(scratch), recipe=recipe,
            after_epoch=_log_epochs(log, recipe.epochs), **options,
        )  # fmt: skip
        files = {each: (Path(scratch) / each).read_bytes() for each in (REFINER_WEIGHTS, CARD)}
    return files, dict(about["figures"])


def _log_epochs(log: ProgressCallback, of: int) -> Callable[[Any], None]:
    return lambda epoch: log("training", f"epoch {epoch.number} of {of}: loss {epoch.loss:.4f}")


def _split_recordings(name: str, file: FileTracks) -> Iterator[Recording]:
    """The early agents of a file, to fit, and the late ones, to test."""
    tracks = [track for track in file.tracks if track[0] != "bicycle"]
    begin = min((track.start for _, track in tracks), default=0.0)
    until = begin + _TAUGHT * (max((track.end for _, track in tracks), default=0.0) - begin)
    splits: tuple[tuple[Split, bool], ...] = (("fit", True), ("test", False))
    for split, early in splits:
        if own := [track for track in tracks if (track[1].start < until) == early]:
            yield _build_recording(f"{name} {file.name}", own, split)


def _build_recording(name: str, tracks: Sequence[tuple[str, Track]], split: Split) -> Recording:
    ordered = sorted(tracks, key=lambda each: each[1].start)
    shapes = (
        PEDESTRIAN if kind == "pedestrian" else get_vehicle_shape(kind) for kind, _ in ordered
    )
    agents = tuple(
        RecordedAgent(track, shape, complete=False)
        for (_, track), shape in zip(ordered, shapes, strict=True)
    )
    end = max(track.end for _, track in ordered)
    return Recording(name, ordered[0][1].start, end, agents, split)


def compare_errors(before: Figures, after: Figures) -> tuple[str, bool]:
    """Errors 4.8 s ahead with waypoints, in words, and whether no class is worse for it."""
    kinds = [kind for kind in ("vehicle", "pedestrian") if after[f"{kind}_n"] >= _FEWEST]
    notes = [
        f"{kind}s held out are off by {after[f'{kind}_ade_waypoints']:.3f} m, by the shipped "
        f"weights {before[f'{kind}_ade_waypoints']:.3f} m (n = {after[f'{kind}_n']:.0f})"
        for kind in kinds
    ]
    worse = [k for k in kinds if after[f"{k}_ade_waypoints"] > before[f"{k}_ade_waypoints"]]
    said = "; ".join(notes) or f"fewer than {_FEWEST} moments of held-out agents"
    return said, bool(kinds) and not worse


def train_refiner(name: str, options: TrainOptions, *, log: ProgressCallback) -> dict[str, Any]:
    """Trains and writes weights and model card; says where they are and what they are worth.

    Of tracks of real people on foot every fourth file is held out; going on is in smaller steps.

    Raises:
        InputError: no such intersection, no such corpus, or a place that cannot be written.
    """
    from scenewright.extras import require_extra

    require_extra("learn", "training a refiner", "torch")
    from scenewright.intersections import find_bundle_folder
    from scenewright.tools.track_io import load_recordings
    from scenewright.tools.trajnet_refiner.bundle_training import (
        CONFIG,
        find_out_folder,
        train_bundle,
    )
    from scenewright.tools.trajnet_refiner.bundled import find_refiner
    from scenewright.tools.trajnet_refiner.train import RECIPE

    find_bundle_folder(name)
    recordings = load_recordings(Path(options.corpus))
    changed: dict[str, Any] = {"seed": options.seed}
    if options.go_on:
        changed["rate"] = GOES_ON["rate"]
    if options.walkers:
        changed["goals"] = _WITH_GOALS
    if options.epochs is not None:
        changed["epochs"] = options.epochs
    recipe = RECIPE.model_copy(update=changed)
    serving = find_refiner(name) if options.go_on else None
    folder = find_out_folder(name, options.out)
    config = CONFIG if serving is None else serving.net.config
    if options.walking is not None:
        config = config.model_copy(update={"walking": options.walking})

    about = train_bundle(
        name, recordings, out=folder, recipe=recipe,
        after_epoch=_log_epochs(log, recipe.epochs),
        log=lambda done, of: log("training", f"{100 * done // of} %") if done % 20 == 0 else None,
        start=None if serving is None else serving.net,
        walkers=_read_walkers(options.walkers or ()),
        others=[each for file in options.others or () for each in load_recordings(Path(file))],
        most=options.most, config=config,
    )  # fmt: skip
    return {"folder": str(folder), "figures": about["figures"]}


_WITH_GOALS = 0.7
"""Share of the batches with waypoints where people are learned from: fewer, as the others are how
people walk by themselves."""


def _read_walkers(paths: Sequence[str]) -> list[Recording]:
    """The pedestrians of files of tracks, every fourth file to test.

    Raises:
        InputError: a file cannot be read, or none holds a pedestrian.
    """
    from scenewright.tools.track_io.track_files import read_track_files

    found: list[Recording] = []
    for file in read_track_files(paths) if paths else ():
        if tracks := [track for track in file.tracks if track[0] == "pedestrian"]:
            split: Split = "test" if len(found) % 4 == 3 else "fit"
            found.append(_build_recording(file.name, tracks, split))
    if paths and not found:
        raise InputError(f"{', '.join(paths)[:200]}: no pedestrian")
    return found
