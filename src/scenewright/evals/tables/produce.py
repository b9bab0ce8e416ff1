"""All tables of a dataset in one go."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenewright.errors import InputError
from scenewright.evals.realism.scenes import convert_scene, cut_scenes
from scenewright.evals.tables.beside import match_windows
from scenewright.evals.tables.diversity import (
    CorpusWindows,
    Spread,
    compare_events,
    compare_lateral_positions,
    compare_speeds,
)
from scenewright.evals.tables.fidelity_tables import Fidelity, compute_fidelity
from scenewright.evals.tables.nearness import (
    ReferenceDistance,
    compare_with_reference,
    isolate_agents,
    measure_motion,
    measure_scenes,
    observe_scenes,
)
from scenewright.evals.tables.reading import Dataset, find_commit, read_dataset
from scenewright.evals.tables.robustness import (
    RobustnessRate,
    compute_robustness,
    count_out_of_scope,
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
ROUGH = 1.0
"""Smoothing under which real positions bear an acceleration, for both sides [s]."""


@dataclass(frozen=True)
class Tables:
    """The contents of the report.

    Attributes:
        understanding: rows of Table 3, by method; empty if not evaluated.
        about: dataset, versions, commit, seed, counts.
    """

    fidelity: Fidelity
    rates: tuple[RobustnessRate, ...]
    near: tuple[ReferenceDistance, ...]
    spreads: tuple[Spread, ...]
    understanding: Mapping[str, Any]
    about: Mapping[str, Any]


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
    dataset = read_dataset(folder)
    if not any(row.folder for row in dataset.rows):
        raise InputError(f"{folder} holds no scene, so there is nothing to measure")
    log("likelihoods")
    found = compute_fidelity(dataset, draws=draws, seed=seed)
    place = str(dataset.manifest.get("intersection"))
    log("spread across paths")
    scenes = (scene for _, scene in dataset.read_scenes(dataset.rows))
    few = min(draws, 200)
    spreads = compare_lateral_positions(scenes, bundle=place, draws=few, seed=seed)
    near: list[ReferenceDistance] = []
    if corpus is not None:
        more, beside = _compare_with_traffic(dataset, corpus, real, place, few, seed, log)
        near += beside
        spreads += more
    return Tables(
        found,
        compute_robustness(dataset),
        tuple(near),
        tuple(spreads),
        produce_table_3(folder, log=log) if understand else {},
        _describe_run(dataset, draws, seed, corpus),
    )


def _load_clips_or_scenes(folder: Path, log: Callable[[str], None]) -> list[Any]:
    """Load the clips of the test half; where none can be cut, whole scenes, and say so."""
    from scenewright.evals.understanding.evaluate import load_cases

    try:
        return list(load_cases(folder, split="test", log=log))
    except InputError as error:
        log(f"Table 3 is of whole scenes: {error}")
        return list(load_cases(folder, split="test", whole=True, log=log))


def produce_table_3(
    folder: Path, *, log: Callable[[str], None] = lambda _: None
) -> dict[str, tuple[str, ...]]:
    """Table 3 on the test half: a row for each method that runs without a language model."""
    from scenewright.evals.understanding.evaluate import evaluate

    try:
        cases = _load_clips_or_scenes(folder, log)
    except InputError as error:
        log(f"no Table 3: {error}")
        return {}
    found = {}
    for method in METHODS:
        try:
            rows = evaluate(cases, method, windows=(INTENT_AT, RELATION_AT), log=log).rows
        except InputError as error:
            log(f"no {method} in Table 3: {error}")
            continue
        found[method] = _format_row_of_3({row.window: row for row in rows})
    return found


def _format_row_of_3(rows: Mapping[float, Any]) -> tuple[str, ...]:
    intent, relations = rows[INTENT_AT].intent, rows[RELATION_AT].strict
    cells = [
        *(intent.get(name) for name in ("pedestrian", "vehicle", "overall")),
        *(relations.get(name) for name in ("normal", "collision", "yielding", "macro")),
    ]
    seconds = rows[RELATION_AT].seconds
    return (*map(_format_cell_of_3, cells), "–" if seconds is None else f"{seconds:.3f}")


def _format_cell_of_3(figure: Any) -> str:
    if figure is None or figure.value is None:
        return "–"
    return f"{figure.value:.2f} [{figure.low:.1f}, {figure.high:.1f}]"


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
    intersection_map = load_map(place)
    recordings = load_recordings(corpus, split="test")
    if not recordings:
        raise InputError(f"{corpus} holds no test hours")
    log("encounters in the dataset")
    scenes = [
        convert_scene(scene) for _, scene in dataset.read_scenes(_thin(dataset.rows, MOST_SCENES))
    ]
    ours = list(observe_scenes(scenes, intersection_map=intersection_map))
    log("encounters in the corpus")
    windows = [
        scene
        for _, scene in cut_scenes(recordings, intersection_map=intersection_map)
        if scene.users
    ]
    known = list(observe_scenes(_thin(windows, MOST_WINDOWS), intersection_map=intersection_map))
    near = list(
        compare_with_reference(
            measure_scenes(ours), measure_scenes(known), named="corpus", draws=draws, seed=seed
        )
    )
    if real is not None:
        log("encounters in real tracks")
        recordings = read_taf_bw(real).recordings
        cut = [
            scene
            for _, scene in cut_scenes(recordings, intersection_map=intersection_map)
            if scene.users
        ]
        theirs = list(observe_scenes(_thin(cut, MOST_WINDOWS), intersection_map=None))
        smooth = measure_scenes(ours, smoothing=ROUGH)
        # Real tracks are short: whole windows are few, so motion is that of every track.
        reference = {
            **measure_scenes(theirs),
            **measure_motion(isolate_agents(recordings), smoothing=ROUGH),
        }
        near += compare_with_reference(smooth, reference, named="TAF-BW", draws=draws, seed=seed)
    beside = match_windows(scenes, windows, least=MOST_SCENES)
    against = CorpusWindows(list(observe_scenes(beside, intersection_map=intersection_map)), known)
    spreads = compare_speeds(ours, against, draws=draws, seed=seed)
    return [*spreads, *compare_events(ours, against, draws=draws, seed=seed)], near


def _thin(items: Sequence[Any], most: int) -> Any:
    """At most so many, evenly spread."""
    if len(items) <= most:
        return tuple(items)
    return tuple(items[k * len(items) // most] for k in range(most))


def _describe_run(dataset: Dataset, draws: int, seed: int, corpus: Path | None) -> dict[str, Any]:
    from scenewright import __version__

    manifest = dataset.manifest
    keys = ("order", "input", "intersection", "backend", "refiner", "selection", "writer")
    return {
        "dataset": {key: manifest[key] for key in keys if key in manifest},
        "dataset seed": manifest.get("seed"),
        "rows": dict(manifest["rows"]),
        "complete": manifest.get("complete"),
        "made by scenewright": manifest.get("scenewright"),
        "measured by scenewright": __version__,
        "commit": find_commit(),
        "out of scope": count_out_of_scope(dataset),
        "draws": draws,
        "seed of intervals": seed,
        "corpus": None if corpus is None else corpus.name,
    }
