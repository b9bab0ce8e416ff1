"""`scenewright intersections train`: the refiner of an intersection from recorded hours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenewright.cli.intersection_options import TrainOptions
    from scenewright.tools.track_io import Recording
    from scenewright.tools.track_io.recording import Split


def train_refiner(
    name: str, options: TrainOptions, *, log: Callable[[str, str], None]
) -> dict[str, Any]:
    """Trains and writes weights and model card; says where they are and what they are worth.

    Of tracks of real people on foot every fourth file is held out; going on is in smaller steps.

    Raises:
        InputError: no such intersection, no such corpus, or a place that cannot be written.
    """
    from scenewright.cli.adapted_refiner import GOES_ON
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
    from scenewright.tools.trajnet_refiner.supervised import RECIPE

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
        after_epoch=lambda epoch: log(
            "training", f"epoch {epoch.number} of {recipe.epochs}: loss {epoch.loss:.4f}"
        ),
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
    from scenewright.errors import InputError
    from scenewright.scene.track import PEDESTRIAN
    from scenewright.tools.track_io import RecordedAgent, Recording
    from scenewright.tools.track_io.track_files import read_track_files

    found: list[Recording] = []
    for file in read_track_files(paths) if paths else ():
        tracks = sorted(
            (t for kind, t in file.tracks if kind == "pedestrian"), key=lambda t: t.start
        )
        if tracks:
            agents = tuple(RecordedAgent(track, PEDESTRIAN, complete=False) for track in tracks)
            end = max(track.end for track in tracks)
            split: Split = "test" if len(found) % 4 == 3 else "fit"
            found.append(Recording(file.name, tracks[0].start, end, agents, split))
    if paths and not found:
        raise InputError(f"{', '.join(paths)[:200]}: no pedestrian")
    return found
