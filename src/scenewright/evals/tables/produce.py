"""All tables of a dataset in one go."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenewright.errors import InputError
from scenewright.evals.realism.sources import convert_scene, cut_scenes
from scenewright.evals.tables.diversity import (
    CorpusWindows,
    Spread,
    compare_events,
    compare_lateral_positions,
    compare_speeds,
    match_windows,
)
from scenewright.evals.tables.likelihood import Fidelity, compute_fidelity
from scenewright.evals.tables.nearness import (
    ReferenceDistance,
    compare_with_reference,
    isolate_agents,
    measure_motion,
    measure_scenes,
    observe_scenes,
)
from scenewright.evals.tables.reading import (
    Dataset,
    RobustnessRate,
    compute_robustness,
    find_commit,
    read_dataset,
)
from scenewright.intersections import load_map
from scenewright.tools.track_io import load_recordings
from scenewright.tools.track_io.taf_bw import read_taf_bw

MOST_WINDOWS = 150
"""Windows of a recording that are looked at, spread evenly over it."""
MOST_SCENES = 400
"""Scenes of the dataset whose encounters are looked at, spread evenly over it."""
METHODS = ("gmm", "trajnet", "reasoner")
INTENT_AT, RELATION_AT = 2.0, 4.0
"""Observed seconds at which Table 3 is measured; the paper does not state its window."""
_SAID = ("order", "input", "intersection", "backend", "refiner", "selection", "writer")
"""What the report says of the dataset."""
ROUGH = 1.0
"""Smoothing under which real positions bear an acceleration, for both sides [s]."""


@dataclass(frozen=True)
class Tables:
    """The contents of the report.

    Attributes:
        understanding: rows of Table 3, by method; empty if not evaluated.
        about: dataset, versions, commit, seed, counts.
    """

    about: Mapping[str, Any]
    fidelity: Fidelity
    robustness: Sequence[RobustnessRate]
    understanding: Mapping[str, Sequence[str]]
    nearness: Sequence[ReferenceDistance]
    diversity: Sequence[Spread]


def make_tables(
    folder: Path,
    *,
    corpus: Path | None = None,
    real: Path | None = None,
    understand: bool = True,
    draws: int = 1000,
    seed: int = 0,
    log: Callable[[str], None] = lambda _: None,
) -> Tables:
    """Every table of a dataset.

    Args:
        corpus: file of `simulate --corpus`; without it there is nothing on how scenes move.
        real: folder of real tracks (TAF-BW).
        understand: whether Table 3 is measured.
        draws: resamplings for intervals; seed: of their random numbers.

    Raises:
        InputError: no dataset, or a file that cannot be read.
    """
    from scenewright import __version__

    dataset = read_dataset(folder)
    manifest = dataset.manifest
    if not any(row.folder for row in dataset.rows):
        raise InputError(f"{folder} holds no scene, so there is nothing to measure")
    log("likelihoods")
    found = compute_fidelity(dataset, draws=draws, seed=seed)
    place = str(manifest.get("intersection"))
    log("spread across paths")
    scenes = (scene for _, scene in dataset.read_scenes(dataset.rows))
    few = min(draws, 200)
    spreads = compare_lateral_positions(scenes, bundle=place, draws=few, seed=seed)
    near: list[ReferenceDistance] = []
    if corpus is not None:
        more, beside = _compare_with_traffic(dataset, corpus, real, place, few, seed, log)
        near += beside
        spreads += more
    about = {
        "dataset": {key: manifest[key] for key in _SAID if key in manifest},
        "dataset seed": manifest.get("seed"),
        "rows": dict(manifest["rows"]),
        "complete": manifest.get("complete"),
        "made by scenewright": manifest.get("scenewright"),
        "measured by scenewright": __version__,
        "commit": find_commit(),
        "out of scope": sum(not row.scope for row in dataset.rows),
        "draws": draws,
        "seed of intervals": seed,
        "corpus": None if corpus is None else corpus.name,
    }
    table_3 = produce_table_3(folder, log=log) if understand else {}
    return Tables(about, found, compute_robustness(dataset), table_3, near, spreads)


def produce_table_3(
    folder: Path, *, log: Callable[[str], None] = lambda _: None
) -> dict[str, tuple[str, ...]]:
    """Table 3 on the test half: a row for each method that runs without a language model.

    Clips are scored; where none can be cut, whole scenes, and the log says so.
    """
    from scenewright.evals.understanding.evaluate import evaluate, load_cases

    try:
        try:
            cases = load_cases(folder, split="test", log=log)
        except InputError as error:
            log(f"Table 3 is of whole scenes: {error}")
            cases = load_cases(folder, split="test", whole=True, log=log)
    except InputError as error:
        log(f"no Table 3: {error}")
        return {}
    found = {}
    for method in METHODS:
        try:
            early, late = evaluate(cases, method, windows=(INTENT_AT, RELATION_AT), log=log).rows
        except InputError as error:
            log(f"no {method} in Table 3: {error}")
            continue
        figures = [
            *(early.intent.get(name) for name in ("pedestrian", "vehicle", "overall")),
            *(late.strict.get(name) for name in ("normal", "collision", "yielding", "macro")),
        ]
        found[method] = (
            *(
                "–" if figure is None else figure.format("{0:.2f} [{1:.1f}, {2:.1f}]")
                for figure in figures
            ),
            "–" if late.seconds is None else f"{late.seconds:.3f}",
        )
    return found


def _compare_with_traffic(
    dataset: Dataset,
    corpus: Path,
    real: Path | None,
    place: str,
    draws: int,
    seed: int,
    log: Callable[[str], None],
) -> tuple[list[Spread], list[ReferenceDistance]]:
    """What needs a corpus: how scenes move, and whether they differ enough."""
    known = load_map(place)

    recordings = load_recordings(corpus, split="test")
    if not recordings:
        raise InputError(f"{corpus} holds no test hours")
    log("encounters in the dataset")
    rows = _thin(dataset.rows, MOST_SCENES)
    scenes = [convert_scene(scene) for _, scene in dataset.read_scenes(rows)]
    ours = list(observe_scenes(scenes, intersection_map=known))
    log("encounters in the corpus")
    windows = list(cut_scenes(recordings, intersection_map=known))
    whole = list(observe_scenes(_thin(windows, MOST_WINDOWS), intersection_map=known))
    draw = {"draws": draws, "seed": seed}
    near = list(
        compare_with_reference(measure_scenes(ours), measure_scenes(whole), named="corpus", **draw)
    )
    if real is not None:
        log("encounters in real tracks")
        tracks = read_taf_bw(real).recordings
        seen = _thin(list(cut_scenes(tracks, intersection_map=known)), MOST_WINDOWS)
        theirs = list(observe_scenes(seen, intersection_map=None))
        # Real tracks are short: whole windows are few, so motion is that of every track.
        motion = measure_motion(isolate_agents(tracks), smoothing=ROUGH)
        reference, smooth = (
            {**measure_scenes(theirs), **motion},
            measure_scenes(ours, smoothing=ROUGH),
        )
        near += compare_with_reference(smooth, reference, named="TAF-BW", **draw)
    beside = match_windows(scenes, windows, least=MOST_SCENES)
    against = CorpusWindows(list(observe_scenes(beside, intersection_map=known)), whole)
    return [*compare_speeds(ours, against, **draw), *compare_events(ours, against, **draw)], near


def _thin(items: Sequence[Any], most: int) -> Any:
    """At most so many, evenly spread."""
    if len(items) <= most:
        return tuple(items)
    return tuple(items[k * len(items) // most] for k in range(most))
