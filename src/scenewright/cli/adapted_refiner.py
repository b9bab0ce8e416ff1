"""A refiner that goes on from the serving weights on the recorded tracks of `intersections fit`."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from scenewright.intersections import REFINER_WEIGHTS
from scenewright.scene.track import PEDESTRIAN, get_vehicle_shape
from scenewright.tools.track_io import RecordedAgent, Recording
from scenewright.tools.track_io.recording import Split
from scenewright.tools.track_io.track_files import FileTracks

GOES_ON = {"epochs": 6, "rate": 3e-4}
"""How a network that has been trained elsewhere goes on: briefly, in small steps."""
_TAUGHT = 0.6
"""Share of a file's time that is learned from; agents that come later are held out."""
_FEWEST = 20
"""Held-out samples of a class below which it decides nothing."""

Figures = Mapping[str, float]


def adapt_refiner(
    name: str, files: Sequence[FileTracks], log: Callable[[str, str], None]
) -> tuple[dict[str, bytes], str]:
    """Weights and card of a refiner adapted to recorded tracks, and a note of what it is worth.

    There are no files, and the note says so, where held-out agents are not predicted better than
    by the weights that serve without: jittering tracks teach jitter.
    """
    from scenewright.tools.trajnet_refiner.bundle_training import OVERLAP, compute_figures
    from scenewright.tools.trajnet_refiner.bundled import find_refiner
    from scenewright.tools.trajnet_refiner.model import Refiner
    from scenewright.tools.trajnet_refiner.supervised import RECIPE

    recordings = [each for file in files for each in _split_recordings(name, file)]
    serving = find_refiner(name)
    if serving is None or {each.split for each in recordings} != {"fit", "test"}:
        return {}, "the refiner is not adapted: too few tracks, or no weights to go on from"
    log("training", f"a refiner on {sum(len(r.agents) for r in recordings)} tracks")
    tried = [each for each in recordings if each.split == "test"]
    own = Refiner.from_weights(serving.net.config, serving.net.weights)
    before = compute_figures(own, tried, stride=OVERLAP)
    made, figures = train_to_files(
        name, recordings, recipe=RECIPE.model_copy(update=GOES_ON), start=serving.net,
        command=f"scenewright intersections fit {name} --train", stride=OVERLAP,
    )  # fmt: skip
    note, better = compare_errors(before, figures)
    return (made, f"the refiner is adapted: {note}") if better else ({}, f"not adapted: {note}")


def train_to_files(
    name: str, recordings: Sequence[Recording], **options: Any
) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Weights and card of a refiner that is trained, as files of a bundle, and what it is worth.

    Args:
        options: as of `train_bundle`.
    """
    from scenewright.tools.trajnet_refiner.bundle_training import CARD, train_bundle

    with tempfile.TemporaryDirectory() as scratch:
        about = train_bundle(name, recordings, out=Path(scratch), **options)
        files = {each: (Path(scratch) / each).read_bytes() for each in (REFINER_WEIGHTS, CARD)}
    return files, dict(about["figures"])


def _split_recordings(name: str, file: FileTracks) -> Iterator[Recording]:
    """The early agents of a file, to fit, and the late ones, to test."""
    tracks = [(kind, track) for kind, track in file.tracks if kind != "bicycle"]
    begin = min((track.start for _, track in tracks), default=0.0)
    until = begin + _TAUGHT * (max((track.end for _, track in tracks), default=0.0) - begin)
    splits: tuple[tuple[Split, bool], ...] = (("fit", True), ("test", False))
    for split, early in splits:
        own = [each for each in tracks if (each[1].start < until) == early]
        if own:
            shapes = [PEDESTRIAN if kind == "pedestrian" else get_vehicle_shape(kind)
                      for kind, _ in own]  # fmt: skip
            every = (
                RecordedAgent(track, shape, complete=False)
                for (_, track), shape in zip(own, shapes, strict=True)
            )
            agents = tuple(sorted(every, key=lambda agent: agent.track.start))
            end = max(agent.track.end for agent in agents)
            yield Recording(f"{name} {file.name}", agents[0].track.start, end, agents, split)


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
