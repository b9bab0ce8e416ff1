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
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.bootstrap import compute_interval, draw_resamples
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
        auc: area under the ROC curve, each scene scored by a classifier not trained on it; low,
            high: 95 % interval over resampled scenes; n: windows a side; groups: scenes.
    """

    auc: float
    low: float
    high: float
    n: int
    groups: int


def compare_windows(one: Windows, other: Windows, *, seed: int = 0) -> dict[str, Separability]:
    """Run the test over all situations (key "all") and for each that has enough windows.

    Empty where too few windows can be matched.
    """
    from sklearn import ensemble, model_selection

    rng = np.random.default_rng(seed)
    first, second = _match_windows(one, other, rng)
    label = np.repeat([0, 1], [len(first), len(second)])
    names = [
        f"{k} {name}" for k, side in enumerate((first, second)) for name in side.group.tolist()
    ]
    group = np.unique(names, return_inverse=True)[1]
    few = min(len(np.unique(group[label == k])) for k in (0, 1)) < _FOLDS
    if few or min(len(first), len(second)) < FEWEST:
        return {}
    features = np.concatenate([first.features, second.features])
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
    situation = np.concatenate([first.situation, second.situation])
    kinds = {"all": np.ones(len(label), dtype=np.bool_)}
    kinds |= {str(each): situation == each for each in np.unique(situation)}
    found = {}
    for name, chosen in kinds.items():
        own, asked, scenes = score[chosen], label[chosen], group[chosen]
        if np.bincount(asked, minlength=2).min() < FEWEST:
            continue
        units, number = np.unique(scenes, return_inverse=True)
        draws = draw_resamples(len(units), draws=_DRAWS, seed=seed)
        again = [compute_auc(own, asked, drawn[number].astype(np.float64)) for drawn in draws]
        auc = compute_auc(own, asked, np.ones(len(asked)))
        interval = compute_interval(np.array(again))
        found[name] = Separability(auc, *interval, int((asked == 0).sum()), len(units))
    return found


def split_halves(windows: Windows) -> tuple[Windows, Windows]:
    """Split a source into two halves by its groups, for the floor of the test."""
    names = np.unique(windows.group)
    chosen = np.random.default_rng(0).permutation(names)[: len(names) // 2]
    inside = np.isin(windows.group, chosen)
    return windows.select(inside), windows.select(~inside)


def _match_windows(
    one: Windows, other: Windows, rng: np.random.Generator
) -> tuple[Windows, Windows]:
    """Draw equally many windows of each situation and band of speed from both sides."""
    cells = [
        [f"{s} {b}" for s, b in zip(each.situation.tolist(), each.band.tolist(), strict=True)]
        for each in (one, other)
    ]
    kept: tuple[list[int], list[int]] = ([], [])
    for cell in sorted(set(cells[0]) & set(cells[1])):
        rows = [rng.permutation([k for k, c in enumerate(side) if c == cell]) for side in cells]
        count = min(map(len, rows))
        for k, found in enumerate(rows):
            kept[k].extend(found[:count].tolist())
    share = min(1.0, MOST / max(len(kept[0]), 1))
    chosen = np.sort(rng.permutation(len(kept[0]))[: round(share * len(kept[0]))])
    return tuple(
        each.select(np.array(side, dtype=np.int64)[chosen])
        for each, side in zip((one, other), kept, strict=True)
    )  # type: ignore[return-value]


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
class Windows:
    """Windows of one class and source.

    Attributes:
        features: [W, F]; speed: [W, 33] smoothed [m/s]; situation: [W] what it does; band: [W] of
            its mean speed; group: [W] agents that are split together; foreground: [W].
    """

    features: FloatArray
    speed: FloatArray
    situation: NDArray[np.str_]
    band: NDArray[np.int64]
    group: NDArray[np.str_]
    foreground: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.features)

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Windows:
        """Select some of the windows."""
        return Windows(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


def cut_windows(source: TrackSource, kind: AgentClass) -> Windows:
    """Cut the windows of a class, one every 1.6 s of every track, without standing agents."""
    rows = [
        (features, speed, _classify_situation(speed, turned, kind), stretch.groups[user.id],
         user.id in stretch.foreground)
        for stretch in source.stretches
        for user in stretch.users
        if user.shape.type == kind
        for features, speed, turned in _cut_track(user.track)
        if speed.max() > _STANDS
    ]  # fmt: skip
    if not rows:
        return Windows(
            np.zeros((0, 1)), np.zeros((0, SPAN + 1)), np.array([], dtype=np.str_),
            np.zeros(0, np.int64), np.array([], dtype=np.str_), np.zeros(0, np.bool_),
        )  # fmt: skip
    speed = np.stack([row[1] for row in rows])
    return Windows(
        np.stack([row[0] for row in rows]), speed, np.array([row[2] for row in rows]),
        np.searchsorted(_BANDS[kind], speed.mean(axis=1)), np.array([row[3] for row in rows]),
        np.array([row[4] for row in rows], dtype=np.bool_),
    )  # fmt: skip


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
    return np.concatenate([np.asarray(each) for each in features]), speed, turned


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


def find_constant_speed(windows: Windows) -> list[bool]:
    """Return for each moving window whether its first 3 s keep one speed within 0.05 m/s."""
    speed = windows.speed[:, :31]
    return [bool(np.ptp(row) <= 0.1) for row in speed[speed.min(axis=1) > _STANDS]]
