"""Predicts the scenes of a recording and scores them as TrajNet++ does."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError
from scenewright.evals.bootstrap import Figure, compute_mean
from scenewright.evals.trajnet.predictors import Predictor, Refining, predict_constant_velocity
from scenewright.evals.trajnet.recording import OBSERVED, PREDICTED, BenchmarkRecording, SceneRow
from scenewright.scene.base import FloatArray

STATIC, LINEAR, INTERACTING, OTHER = 1, 2, 3, 4
TYPE_NAMES = {STATIC: "static", LINEAR: "linear", INTERACTING: "interacting", OTHER: "other"}
LEADER_FOLLOWER, AVOIDANCE, GROUP, OTHER_INTERACTION = 1, 2, 3, 4
SUBTYPE_NAMES = {
    LEADER_FOLLOWER: "leader-follower",
    AVOIDANCE: "avoidance",
    GROUP: "group",
    OTHER_INTERACTION: "other interaction",
}

STANDING = 1.0
"""An agent that ends less than this far from its start is static [m]."""
STRAIGHT = 0.5
"""An agent whose last position the filter predicts better than this is linear [m]."""
_NEAR, _CONE, _SIDE = 5.0, 15.0, 45.0
_STRIDE = 3
_GROUP_DISTANCE, _GROUP_DEVIATION = 0.8, 0.2
_FOLLOWING = 5


def categorise(primary: FloatArray, others: FloatArray) -> tuple[int, tuple[int, ...]]:
    """Type and subtypes of a scene.

    Args:
        primary: [21, 2] positions [m], complete; others: [M, 21, 2], NaN where unseen.
    """
    if np.linalg.norm(primary[-1] - primary[0]) < STANDING:
        return STATIC, ()
    last = filter_path(primary[:OBSERVED], steps=PREDICTED)[-1]
    if np.linalg.norm(primary[-1] - last) < STRAIGHT:
        return LINEAR, ()
    # Where others are and which way they move, [M, 12] against the way the primary moves [degrees].
    way = _compute_angle(primary[OBSERVED:] - primary[OBSERVED - _STRIDE : -_STRIDE])
    offset = others[:, OBSERVED:] - primary[OBSERVED:]
    moved = others[:, OBSERVED:] - others[:, OBSERVED - _STRIDE : -_STRIDE]
    place, motion = (_compute_angle(offset) - way) % 360, (_compute_angle(moved) - way) % 360
    near = np.linalg.norm(offset, axis=-1) < _NEAR
    ahead = _is_within(place, 0.0, _CONE) & near
    # In a group are those at the primary's side once and close to it all along.
    side = _is_within(place, 90.0, _SIDE) | _is_within(place, 270.0, _SIDE)
    apart = np.linalg.norm(others - primary, axis=-1)
    close = (apart.mean(axis=1) < _GROUP_DISTANCE) & (apart.std(axis=1) < _GROUP_DEVIATION)
    group = (side & near).any(axis=1) & close
    if not (ahead.any() or group.any()):
        return OTHER, ()
    following = (ahead & _is_within(motion, 0.0, _CONE)).sum(axis=1) >= _FOLLOWING
    meeting = ahead & _is_within(motion, 180.0, _CONE)
    found = {LEADER_FOLLOWER: following.any(), AVOIDANCE: meeting.any(), GROUP: group.any()}
    return INTERACTING, tuple(k for k, yes in found.items() if yes) or (OTHER_INTERACTION,)


def filter_path(observed: FloatArray, *, steps: int) -> FloatArray:
    """[steps, D] the mean path that a constant-velocity Kalman filter expects.

    Noise as the benchmark starts from: 1e-5 on the state, 0.05 m on the observation; positions and
    velocities per step; the first state is the first position at rest, known to 1.

    Args:
        observed: [T, D] positions [m], one path or several side by side.
    """
    move = np.array([[1.0, 1.0], [0.0, 1.0]])
    mean = np.array([observed[0], np.zeros_like(observed[0])])
    spread = np.eye(2)
    for k, seen in enumerate(observed):
        if k:
            mean, spread = move @ mean, move @ spread @ move.T + 1e-5 * np.eye(2)
        gain = spread[:, :1] / (spread[0, 0] + 0.05**2)
        mean = mean + gain * (seen - mean[0])
        spread = spread - gain @ spread[:1]
    ahead = np.arange(1, steps + 1)[:, None]
    return np.asarray(mean[0] + ahead * mean[1])


def _compute_angle(vector: FloatArray) -> FloatArray:
    return np.asarray(np.degrees(np.arctan2(vector[..., 1], vector[..., 0])))


def _is_within(angle: FloatArray, centre: float, reach: float) -> NDArray[np.bool_]:
    """Whether an angle lies above centre - reach and at most at centre + reach; NaN does not."""
    off = (angle - centre + 180.0) % 360.0 - 180.0
    return np.asarray((off > -reach) & (off <= reach))


Goals = Literal["none", "destination", "horizon"]
"""What a predictor is given: nothing; where each pedestrian is last seen in the file, which is the
benchmark's definition; or where it is at the end of the scene, and that it is there then."""
TOUCHING = 0.2
"""Two pedestrians collide at this distance or less [m]: twice the benchmark's radius of 0.1 m."""
PARTS = 2
"""Sub-intervals of a step at whose ends distances are taken."""


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
    futures = {
        start: (np.concatenate((seen_places, left)), np.concatenate((xy, beyond)), len(seen_places))
        for start, seen_places, xy, (left, beyond) in zip(starts, places, ahead, gone, strict=True)
    }
    found = []
    for row in recording.scenes:
        seen_places, xy, present = futures[row.start]
        is_primary = recording.ids[seen_places] == row.primary
        if not is_primary[:present].any():
            raise InputError(
                f"{recording.name}.ndjson: the primary of scene {row.id}, pedestrian "
                f"{row.primary}, is not there at the ninth step"
            )
        order = np.argsort(~is_primary, kind="stable")
        found.append(PredictedScene(row, seen_places[order], xy[order].round(2)))
    return found


def _extend_gone(past: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Find agents gone at the last observed step, and extend their motion [M, 12, 2]."""
    seen = ~np.isnan(past[..., 0])
    seen_places = np.flatnonzero(seen.any(axis=1) & ~seen[:, -1])
    last = OBSERVED - 1 - np.argmax(seen[seen_places, ::-1], axis=1)
    at = past[seen_places, last]
    move = np.nan_to_num(at - past[seen_places, np.maximum(last - 1, 0)])
    steps = (OBSERVED - last)[:, None] + np.arange(PREDICTED)
    return seen_places, at[:, None] + steps[..., None] * move[:, None]


def compute_displacement(predicted: FloatArray, truth: FloatArray) -> tuple[float, float]:
    """Mean (ADE) and last (FDE) distance between two paths [P, 2], in metres."""
    distance = np.linalg.norm(predicted - truth, axis=-1)
    return float(distance.mean()), float(distance[-1])


def find_collisions(primary: FloatArray, others: FloatArray) -> NDArray[np.bool_]:
    """Which of the others the primary collides with.

    Distances are taken at the steps and at the ends of `PARTS` equal parts between them, as if
    all agents moved straight and evenly within a step. What lies before the first predicted step
    is not looked at. As in the benchmark, steps at which the other is unseen are left out, its
    next one follows directly, and a single common step is no collision.

    Args:
        primary: [P, 2]; others: [M, P, 2], NaN where unseen [m].

    Returns:
        [M]
    """
    offset = others - primary
    seen: NDArray[np.bool_] = np.asarray(~np.isnan(offset).any(axis=-1))
    hit = _is_touching(offset)
    for m in np.flatnonzero(~seen.all(axis=1)):
        hit[m] = bool(_is_touching(offset[m : m + 1, seen[m]])[0])
    return hit


def _is_touching(offset: FloatArray) -> NDArray[np.bool_]:
    """[M] of offsets [M, P, 2] that are nowhere NaN; NaN counts as far away."""
    if offset.shape[1] < 2:
        return np.zeros(len(offset), dtype=np.bool_)
    share = np.linspace(0.0, 1.0, PARTS + 1)[:, None, None]
    between = offset[:, None, :-1] * (1 - share) + offset[:, None, 1:] * share
    distance = np.linalg.norm(between, axis=-1)
    return np.asarray((distance <= TOUCHING).any(axis=(1, 2)))


def score_scenes(
    recording: BenchmarkRecording, scenes: Sequence[PredictedScene]
) -> list[SceneScore]:
    """Scores of all scenes whose primary's future is in the file."""
    stretches = {start: recording.stretch(start) for start in {s.row.start for s in scenes}}
    found = []
    for scene in scenes:
        real, primary, row = stretches[scene.row.start], scene.places[0], scene.row
        truth = real[primary, OBSERVED:]
        if np.isnan(truth).any():
            continue
        others = np.delete(real, primary, axis=0)
        others = others[~np.isnan(others[..., 0]).all(axis=1)]
        observed = others[~np.isnan(others[:, :OBSERVED, 0]).all(axis=1)]
        kind, parts = row.type, row.subtypes
        if kind is None:
            kind, parts = categorise(real[primary], others)
        hits = (
            bool(find_collisions(scene.xy[0], each).any())
            for each in (scene.xy[1:], observed[:, OBSERVED:])
        )
        person, errors = (recording.name, row.primary), compute_displacement(scene.xy[0], truth)
        found.append(SceneScore(person, kind, parts, *errors, *hits))
    return found


def format_predictions(
    recording: BenchmarkRecording, scenes: Iterable[PredictedScene]
) -> Iterable[str]:
    """The predictions in the benchmark's own format, line by line, each primary first."""
    for scene in scenes:
        row = scene.row
        names = {"id": row.id, "p": row.primary, "s": row.start, "e": row.end, "fps": row.fps}
        yield json.dumps({"scene": {**names, "tag": 0}})
        for person, track in zip(recording.ids[scene.places].tolist(), scene.xy, strict=True):
            for k, (x, y) in enumerate(track.tolist(), start=OBSERVED):
                place = {"p": person, "x": round(x, 2), "y": round(y, 2)}
                more = {"prediction_number": 0, "scene_id": row.id}
                yield json.dumps(
                    {"track": {"f": row.start + k * recording.stride, **place, **more}}
                )


@dataclass(frozen=True)
class ScoreRow:
    """One kind of scene in a table.

    Attributes:
        name: of the type or subtype; people: primaries, who are drawn anew with all their scenes.
        ade, fde: means over n scenes [m]; col1, col2: shares.
    """

    name: str
    people: int
    ade: Figure
    fde: Figure
    col1: Figure
    col2: Figure


def build_table(scores: Sequence[SceneScore]) -> list[ScoreRow]:
    """All scenes, then each type and each subtype of which there are scenes."""
    groups = {
        "all": list(scores),
        **{f"{k} {name}": [s for s in scores if s.type == k] for k, name in TYPE_NAMES.items()},
        **{f"3.{k} {name}": [s for s in scores if k in s.subtypes]
           for k, name in SUBTYPE_NAMES.items()},
    }  # fmt: skip
    rows = []
    for name, group in groups.items():
        people = np.array([str(score.person) for score in group])
        if group:
            figures = (
                compute_mean(np.array([getattr(s, measure) for s in group], np.float64), people)
                for measure in ("ade", "fde", "col1", "col2")
            )
            rows.append(ScoreRow(name, len(np.unique(people)), *figures))
    return rows


KINDS_OF_GOALS: tuple[Goals, ...] = ("none", "destination", "horizon")


@dataclass(frozen=True, eq=False)
class Evaluated:
    """One predictor over all recordings.

    Attributes:
        predictor: its name; goals: those it was given.
        predicted: of each recording its scenes, in order.
        rows: the scores; empty where no file holds what really happened.
    """

    predictor: str
    goals: Goals
    predicted: list[list[PredictedScene]]
    rows: list[ScoreRow]

    def to_json(self) -> dict[str, Any]:
        """For a report, without the predictions."""
        rows = [asdict(row) for row in self.rows]
        return {"predictor": self.predictor, "goals": self.goals, "rows": rows}


def evaluate(
    recordings: Sequence[BenchmarkRecording],
    *,
    weights: Path | None,
    log: Callable[[str], None] = lambda _: None,
) -> list[Evaluated]:
    """Constant velocity, then the refiner without and with goals, over all scenes together.

    Goals come from the future, so a file that does not hold it is predicted without.

    Args:
        weights: of the refiner; None leaves it out.

    Raises:
        InputError: the weights cannot be used, or a scene has no primary.
    """

    def run(predictor: Predictor, name: str, goals: Goals) -> Evaluated:
        predicted, scores = [], []
        for recording in recordings:
            with_goals = "" if goals == "none" else f", given the {goals}"
            log(f"{recording.name}: {name}{with_goals}")
            predicted.append(predict_scenes(recording, predictor, goals=goals))
            scores += score_scenes(recording, predicted[-1])
        return Evaluated(name, goals, predicted, build_table(scores))

    straight = run(predict_constant_velocity, "constant velocity", "none")
    if weights is None:
        return [straight]
    from scenewright.tools.trajnet_refiner.model import Refiner
    from scenewright.tools.trajnet_refiner.store import read_refiner

    net = Refiner.from_weights(*read_refiner(weights, task="benchmark"))
    kinds = KINDS_OF_GOALS if net.config.goals and straight.rows else KINDS_OF_GOALS[:1]
    return [straight, *(run(Refining(net), "refiner", goals) for goals in kinds)]
