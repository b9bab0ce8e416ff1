"""The classifier two-sample test: how often a classifier separates two data sets.

Windows of both are matched by what the agent does and how fast it is, then boosted trees learn to
separate them on four fifths of the scenes and are tested on the others. Windows are 3.2 s of one
agent's motion; positions are smoothed over 1 s in all first, on both sides: real ones jitter, and
no classifier shall win by that. Nothing in a window says where on a map it was. 0.5 is chance. The
floor is what the same test finds between halves of one recording, and between two recordings of
real traffic (Lopez-Paz & Oquab 2017).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.bootstrap import Figure, build_figure, draw_weights
from scenewright.evals.realism.sources import TrackSource
from scenewright.geometry.kinematics import smooth
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.track import STEP, Track

FEWEST = 40
"""Least number of windows on either side for a test."""
MOST = 2500
"""Largest number of windows used on either side."""
_FOLDS = 5
_DRAWS = 200


@dataclass(frozen=True)
class Separability:
    """How well a classifier separates two sets of windows.

    Attributes:
        auc: area under the ROC curve of n windows a side, each scored by a classifier not trained
            on its scene; scenes are drawn anew. groups: scenes.
    """

    auc: Figure
    groups: int


def compare_windows(
    one: Sequence[MotionWindow], other: Sequence[MotionWindow], *, seed: int = 0
) -> dict[str, Separability]:
    """Run the test over all situations (key "all") and for each that has enough windows.

    Empty where too few windows can be matched.
    """
    from sklearn import ensemble, model_selection

    sides = _match_windows(one, other, np.random.default_rng(seed))
    label = np.repeat([0, 1], [len(side) for side in sides])
    names = [f"{k} {window.group}" for k, side in enumerate(sides) for window in side]
    group = np.unique(names, return_inverse=True)[1]
    few = min(len(np.unique(group[label == k])) for k in (0, 1)) < _FOLDS
    if few or min(map(len, sides)) < FEWEST:
        return {}
    windows = [*sides[0], *sides[1]]
    features = np.stack([window.features for window in windows])
    # Scores of boosted trees that were not trained on the window's scene.
    score = np.zeros(len(label))
    folds = model_selection.StratifiedGroupKFold(_FOLDS, shuffle=True, random_state=seed)
    for seen, asked in folds.split(features, label, group):
        trees = ensemble.HistGradientBoostingClassifier(
            max_iter=80, max_leaf_nodes=15, min_samples_leaf=15, early_stopping=False,
            random_state=seed,
        )  # fmt: skip
        trees.fit(features[seen], label[seen])
        score[asked] = trees.predict_proba(features[asked])[:, 1]
    situation = np.array([window.situation for window in windows])
    kinds = {"all": np.ones(len(label), dtype=np.bool_)}
    kinds |= {str(name): situation == name for name in np.unique(situation)}
    found = {}
    for name, chosen in kinds.items():
        own, asked = score[chosen], label[chosen]
        if np.bincount(asked, minlength=2).min() < FEWEST:
            continue
        scenes, number = np.unique(group[chosen], return_inverse=True)
        weights = draw_weights(len(scenes), draws=_DRAWS, seed=seed).astype(np.float64)
        values = np.array([compute_auc(own, asked, weight[number]) for weight in weights])
        found[name] = Separability(build_figure(values, int((asked == 0).sum())), len(scenes))
    return found


def split_halves(
    windows: Sequence[MotionWindow],
) -> tuple[list[MotionWindow], list[MotionWindow]]:
    """Split a source into two halves by its groups, for the floor of the test."""
    names = np.unique([window.group for window in windows])
    chosen = set(np.random.default_rng(0).permutation(names)[: len(names) // 2].tolist())
    halves: tuple[list[MotionWindow], list[MotionWindow]] = ([], [])
    for window in windows:
        halves[window.group not in chosen].append(window)
    return halves


def _match_windows(
    one: Sequence[MotionWindow], other: Sequence[MotionWindow], rng: np.random.Generator
) -> list[list[MotionWindow]]:
    """Draw equally many windows of each situation and band of speed from both sides."""
    cells: dict[str, tuple[list[MotionWindow], list[MotionWindow]]] = {}
    for k, side in enumerate((one, other)):
        for window in side:
            cells.setdefault(f"{window.situation} {window.band}", ([], []))[k].append(window)
    pairs: list[tuple[MotionWindow, MotionWindow]] = []
    for _, sides in sorted(cells.items()):
        if all(sides):
            orders = [rng.permutation(len(side)) for side in sides]
            pairs += [(sides[0][j], sides[1][k]) for j, k in zip(*orders, strict=False)]
    chosen = np.sort(rng.permutation(len(pairs))[:MOST]).tolist()
    return [[pairs[k][side] for k in chosen] for side in (0, 1)]


def compute_auc(score: FloatArray, label: NDArray[np.int64], weight: FloatArray) -> float:
    """Chance that a window of the second kind scores above one of the first; ties count half.

    Args:
        score, label, weight: [W]; label 0 or 1. NaN where one kind has no weight.
    """
    from sklearn import metrics

    kept = weight > 0
    if len(np.unique(label[kept])) < 2:
        return float("nan")
    return float(metrics.roc_auc_score(label[kept], score[kept], sample_weight=weight[kept]))


SPAN = 32
"""Steps of 0.1 s in a window."""
SMOOTHING = 1.0 / math.sqrt(12.0)
"""Standard deviation of the Gaussian that goes over positions first [s]: that of a mean over 1 s. A
Gaussian with a standard deviation of 1 s would reach over 6 s, twice the length of a window, and
hide how speeds change within one."""
TRIMMED = 5
"""Samples left out at either end of a track, where the smoothing has but one side."""
EVERY = 4
"""Samples from value to value of what the classifier sees."""
_STANDS = 0.3
_CHANGES = {"vehicle": 1.0, "pedestrian": 0.3}
"""Change of speed within a window [m/s] from which it speeds up or slows."""
_TURNS = 0.35
"""Change of course within a window [rad] that makes it a turn."""
_BANDS = {"vehicle": (2.0, 5.0, 8.0, 11.0), "pedestrian": (0.8, 1.1, 1.4, 1.7)}
"""Mean speeds [m/s] between bands within which windows are matched."""


@dataclass(frozen=True, eq=False)
class MotionWindow:
    """3.2 s of one agent's motion.

    Attributes:
        features: [F]; speed: [33] smoothed [m/s]; situation: what it does; band: of its mean
            speed; group: agents that are split together; foreground: whether a request names it.
    """

    features: FloatArray
    speed: FloatArray
    situation: str
    band: int
    group: str
    foreground: bool


def cut_windows(source: TrackSource, kind: AgentClass) -> list[MotionWindow]:
    """Cut the windows of a class, one every 1.6 s of every track, without standing agents."""
    return [
        MotionWindow(
            features, speed, _classify_situation(speed, turned, kind),
            int(np.searchsorted(_BANDS[kind], speed.mean())), stretch.groups[user.id],
            user.id in stretch.foreground,
        )
        for stretch in source.stretches
        for user in stretch.users
        if user.shape.type == kind
        for features, speed, turned in _cut_track(user.track)
        if speed.max() > _STANDS
    ]  # fmt: skip


def _cut_track(track: Track) -> Iterator[tuple[FloatArray, FloatArray, float]]:
    """Cut a track into windows: features, speeds [33] and change of course [rad] of each."""
    if abs(track.step - STEP) > 1e-6 or len(track.xy) < SPAN + 3 + 2 * TRIMMED:
        return
    xy = smooth(track.xy, SMOOTHING)
    velocity = (xy[2:] - xy[:-2]) / (2 * STEP)
    velocity = velocity[TRIMMED - 1 : len(velocity) - TRIMMED + 1]
    for first in range(0, len(velocity) - SPAN, SPAN // 2):
        yield _compute_features(velocity[first : first + SPAN + 1])


def _compute_features(velocity: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Compute features of a window of velocities [33, 2]; its course is 0 at the middle."""
    speed = np.hypot(*velocity.T)
    moving = speed > _STANDS
    course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    course = np.where(moving, course - course[len(course) // 2], 0.0)
    acceleration = np.gradient(speed, STEP)
    turning = np.where(moving, np.gradient(course, STEP), 0.0)
    turned = float(np.ptp(course[moving])) if moving.any() else 0.0
    features = [speed[::EVERY], acceleration[::EVERY], np.abs(turning[::EVERY]), [
        speed.std(), np.ptp(speed), acceleration.std(), acceleration.min(), acceleration.max(),
        np.gradient(acceleration, STEP).std(), turning.std(), turned,
        np.abs(np.diff(acceleration)).max(),
    ]]  # fmt: skip
    return np.concatenate([np.asarray(feature) for feature in features]), speed, turned


def classify_motion(velocity: FloatArray, kind: AgentClass) -> str:
    """Classify what an agent with velocities [N, 2] every 0.1 s does, as windows are matched."""
    _, speed, turned = _compute_features(velocity)
    return _classify_situation(speed, turned, kind)


def _classify_situation(speed: FloatArray, turned: float, kind: AgentClass) -> str:
    change = float(speed[-1] - speed[0])
    if speed.min() <= _STANDS:
        return "sets off" if change > 0 else "comes to stand"
    if turned > _TURNS:
        return "turns"
    if abs(change) > _CHANGES.get(kind, 1.0):
        return "speeds up" if change > 0 else "slows down"
    return "goes on"


def find_constant_speed(windows: Iterable[MotionWindow]) -> list[bool]:
    """Return for each moving window whether its first 3 s keep one speed within 0.05 m/s."""
    speeds = (window.speed[:31] for window in windows)
    return [bool(np.ptp(speed) <= 0.1) for speed in speeds if speed.min() > _STANDS]
