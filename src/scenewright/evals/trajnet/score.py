"""Predicts the scenes of a recording and scores them as TrajNet++ does."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError
from scenewright.evals.bootstrap import compute_interval, draw_resamples
from scenewright.evals.trajnet.categories import SUBTYPE_NAMES, TYPE_NAMES, categorise
from scenewright.evals.trajnet.metrics import compute_displacement, find_collisions
from scenewright.evals.trajnet.predictors import Predictor
from scenewright.evals.trajnet.recording import (
    OBSERVED,
    PREDICTED,
    BenchmarkRecording,
    SceneRow,
    format_prediction,
)
from scenewright.scene.base import FloatArray

Goals = Literal["none", "destination", "horizon"]
"""What a predictor is given: nothing; where each pedestrian is last seen in the file, which is the
benchmark's definition; or where it is at the end of the scene, and that it is there then."""
MEASURES = ("ade", "fde", "col1", "col2")
_RESAMPLES = 1000


@dataclass(frozen=True, eq=False)
class PredictedScene:
    """A scene with its prediction.

    Attributes:
        row: as the file names it.
        places: [M] places of the predicted among the recording's pedestrians, the primary first.
        xy: [M, 12, 2] [m], rounded to centimetres as the benchmark's files are.
    """

    row: SceneRow
    places: NDArray[np.int64]
    xy: FloatArray


@dataclass(frozen=True)
class SceneScore:
    """What a prediction is worth.

    Attributes:
        person: whose scene it is, over all recordings; scenes of one person are much alike.
        ade, fde: [m]; col1: whether the primary collides with a predicted neighbour; col2: with a
            neighbour as it really moved. As in the official evaluator, neighbours are those seen
            in the first nine steps, and a scene without any counts as one without collision.
    """

    person: tuple[str, int]
    type: int
    subtypes: tuple[int, ...]
    ade: float
    fde: float
    col1: bool
    col2: bool


def predict_scenes(
    recording: BenchmarkRecording, predictor: Predictor, *, goals: Goals = "none"
) -> list[PredictedScene]:
    """Every scene of a recording, predicted from its first nine steps.

    Every pedestrian seen at the ninth step is predicted, scenes that begin together at once. One
    that was seen before and is gone goes on evenly: the official evaluator refuses Col-I of a file
    that leaves one of them out.
    """
    starts = sorted({row.start for row in recording.scenes})
    places, pasts, given, gone = [], [], [], []
    for start in starts:
        xy = recording.stretch(start)
        seen_places = np.flatnonzero(~np.isnan(xy[:, OBSERVED - 1, 0]))
        places.append(seen_places)
        pasts.append(xy[seen_places, :OBSERVED])
        given.append(recording.last[seen_places] if goals == "destination" else xy[seen_places, -1])
        gone.append(_extend_gone(xy[:, :OBSERVED]))
    ahead = predictor(
        pasts,
        None if goals == "none" else given,
        due=PREDICTED if goals == "horizon" else None,
        step=recording.step,
    )
    all_futures = [
        (np.concatenate((seen_places, left)), np.concatenate((xy, beyond)), len(seen_places))
        for seen_places, xy, (left, beyond) in zip(places, ahead, gone, strict=True)
    ]
    by_start = dict(zip(starts, all_futures, strict=True))
    return [_build_scene(recording, row, *by_start[row.start]) for row in recording.scenes]


def _extend_gone(past: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Find agents gone at the last observed step, and extend their motion [M, 12, 2]."""
    seen = ~np.isnan(past[..., 0])
    seen_places = np.flatnonzero(seen.any(axis=1) & ~seen[:, -1])
    last = OBSERVED - 1 - np.argmax(seen[seen_places, ::-1], axis=1)
    at = past[seen_places, last]
    move = np.nan_to_num(at - past[seen_places, np.maximum(last - 1, 0)])
    steps = (OBSERVED - last)[:, None] + np.arange(PREDICTED)
    return seen_places, at[:, None] + steps[..., None] * move[:, None]


def _build_scene(
    recording: BenchmarkRecording,
    row: SceneRow,
    seen_places: NDArray[np.int64],
    ahead: FloatArray,
    present: int,
) -> PredictedScene:
    is_primary = recording.ids[seen_places] == row.primary
    if not is_primary[:present].any():
        raise InputError(
            f"{recording.name}.ndjson: the primary of scene {row.id}, pedestrian {row.primary}, "
            "is not there at the ninth step"
        )
    order = np.argsort(~is_primary, kind="stable")
    return PredictedScene(row, seen_places[order], ahead[order].round(2))


def score_scenes(
    recording: BenchmarkRecording, scenes: Sequence[PredictedScene]
) -> list[SceneScore]:
    """Scores of all scenes whose primary's future is in the file."""
    real = {start: recording.stretch(start) for start in {s.row.start for s in scenes}}
    found = (_score(recording, scene, real[scene.row.start]) for scene in scenes)
    return [score for score in found if score is not None]


def _score(
    recording: BenchmarkRecording, scene: PredictedScene, real: FloatArray
) -> SceneScore | None:
    truth = real[scene.places[0], OBSERVED:]
    if np.isnan(truth).any():
        return None
    others = np.delete(real, scene.places[0], axis=0)
    others = others[~np.isnan(others[..., 0]).all(axis=1)]
    observed = others[~np.isnan(others[:, :OBSERVED, 0]).all(axis=1)]
    kind, parts = scene.row.type, scene.row.subtypes
    if kind is None:
        kind, parts = categorise(real[scene.places[0]], others)
    ade, fde = compute_displacement(scene.xy[0], truth)
    neighbours = scene.xy[1:]
    return SceneScore(
        (recording.name, scene.row.primary),
        kind,
        parts,
        ade,
        fde,
        bool(find_collisions(scene.xy[0], neighbours).any()),
        bool(find_collisions(scene.xy[0], observed[:, OBSERVED:]).any()),
    )


def format_predictions(
    recording: BenchmarkRecording, scenes: Iterable[PredictedScene]
) -> Iterable[str]:
    """The predictions in the benchmark's own format, line by line."""
    for scene in scenes:
        yield from format_prediction(
            scene.row, stride=recording.stride, ids=recording.ids[scene.places], xy=scene.xy
        )


@dataclass(frozen=True)
class ScoreRow:
    """One kind of scene in a table.

    Attributes:
        name: of the type or subtype; scenes, people: how many.
        values: measure -> mean, collisions in percent; None where there is no scene to count.
        intervals: measure -> 95 % interval, from drawing people anew with all their scenes.
    """

    name: str
    scenes: int
    people: int
    values: dict[str, float | None]
    intervals: dict[str, tuple[float, float] | None]

    def to_json(self) -> dict[str, Any]:
        """For a report."""
        return {
            "name": self.name, "scenes": self.scenes, "people": self.people, **self.values,
            "intervals": {key: pair and list(pair) for key, pair in self.intervals.items()},
        }  # fmt: skip


def build_table(scores: Sequence[SceneScore], *, seed: int = 0) -> list[ScoreRow]:
    """All scenes, then each type and each subtype of which there are scenes."""
    groups = [("all", list(scores))]
    for k, name in TYPE_NAMES.items():
        groups.append((f"{k} {name}", [s for s in scores if s.type == k]))
    for k, name in SUBTYPE_NAMES.items():
        groups.append((f"3.{k} {name}", [s for s in scores if k in s.subtypes]))
    return [_build_row(name, group, seed) for name, group in groups if group]


def _build_row(name: str, scores: Sequence[SceneScore], seed: int) -> ScoreRow:
    people = sorted({s.person for s in scores})
    place = {person: k for k, person in enumerate(people)}
    groups = np.array([place[s.person] for s in scores])
    draws = draw_resamples(len(people), draws=_RESAMPLES, seed=seed)
    values, intervals = {}, {}
    for measure in MEASURES:
        given = [getattr(s, measure) for s in scores]
        x = np.array([np.nan if v is None else float(v) for v in given])
        x = 100 * x if measure.startswith("col") else x
        values[measure], intervals[measure] = compute_mean_with_interval(x, groups, draws)
    return ScoreRow(name, len(scores), len(people), values, intervals)


def compute_mean_with_interval(
    x: FloatArray, groups: NDArray[np.int64], draws: NDArray[np.int64]
) -> tuple[float | None, tuple[float, float] | None]:
    """Mean of the values and its 95 % interval; None without any.

    Args:
        x: [S] one value per scene; NaN is left out; groups: [S] its person.
        draws: [R, people] how often each person was drawn, R times.
    """
    known = ~np.isnan(x)
    if not known.any():
        return None, None
    total = np.bincount(groups[known], x[known], minlength=draws.shape[1])
    count = np.bincount(groups[known], minlength=draws.shape[1])
    counted = draws @ count
    means = (draws @ total)[counted > 0] / counted[counted > 0]
    return float(x[known].mean()), compute_interval(means)
