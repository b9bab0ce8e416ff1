"""The reasoner without a language model: from the features of all pairs of a scene to relations.

Boosted trees look at every pair by itself. On top of their probabilities, a linear model looks at
all pairs of the scene: little of what may happen does, and no agent has two events at once. So a
pair next to a likelier one is less likely to have a relation than it looks, and one that stands
alone is likelier. Both are fitted by `lab.understanding.tuning` on development halves alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.special import logit, softmax

from scenewright.evals.understanding.boosted_trees import BoostedTrees, IntArray
from scenewright.evals.understanding.cases import PairRelation
from scenewright.evals.understanding.forecast import SceneForecast
from scenewright.evals.understanding.pair_features import (
    NAMES,
    compute_pair_features,
    mirror_features,
)
from scenewright.scene.base import FloatArray

_SHIPPED = Path(__file__).with_name("calibration.npz")
PAIR_CLASSES = ("none", "collision", "near_miss", "gives_a", "gives_b")
"""The relation of a pair: none, a collision, a near miss, or that a, or b, gives way."""
SWAPPED = np.array((0, 1, 2, 4, 3))
"""The classes with a and b swapped."""
SIZE = 20
"""Features of a pair: its own log odds, and log odds and probabilities of the others."""
_LEAST = 1e-4


def apply_scene_model(
    likely: FloatArray, pairs: Sequence[tuple[str, str]], weights: FloatArray
) -> FloatArray:
    """Compute [N, C] class probabilities given all pairs of the scene.

    Args:
        likely: [N, C] of each pair by itself; pairs: [N] the two agents.
        weights: [SIZE + 1, C], the constant last.
    """
    if not len(likely):
        return likely
    return average_mirrored(
        lambda values: np.asarray(softmax(values @ weights[:-1] + weights[-1], axis=1)),
        compute_scene_features(likely, pairs),
        mirror_scene_features,
    )


def average_mirrored(
    predict: Callable[[FloatArray], FloatArray],
    values: FloatArray,
    mirror: Callable[[FloatArray], FloatArray],
) -> FloatArray:
    """[N, C] mean over both orders of a and b, so that their order makes no difference."""
    return np.asarray((predict(values) + predict(mirror(values))[:, SWAPPED]) / 2)


def compute_scene_features(likely: FloatArray, pairs: Sequence[tuple[str, str]]) -> FloatArray:
    """[N, SIZE] features of the model.

    Of collisions, yields and near misses the likeliest among the pairs that share no agent with
    this one, and among those that do; and the expected collisions and yields of all others.
    """
    events = np.stack([likely[:, 1], likely[:, 3] + likely[:, 4], likely[:, 2]], axis=1)
    _, codes = np.unique(pairs, return_inverse=True)
    ends = codes.reshape(-1, 2)
    shares = (ends[:, None, :, None] == ends[None, :, None]).any(axis=(2, 3))
    others = shares & ~np.eye(len(pairs), dtype=np.bool_)
    most = [np.where(mask[..., None], events, 0.0).max(axis=1) for mask in (~shares, others)]
    rest = events[:, :2].sum(axis=0) - events[:, :2]
    around = np.concatenate([*most, rest], axis=1)
    odds = logit(np.clip(np.concatenate([likely[:, 1:], around], axis=1), _LEAST, 1.0 - _LEAST))
    return np.concatenate([odds, around], axis=1)


def mirror_scene_features(values: FloatArray) -> FloatArray:
    """[N, SIZE] with a and b swapped."""
    return values[:, [0, 1, 3, 2, *range(4, SIZE)]]


@dataclass(frozen=True, eq=False)
class Calibration(BoostedTrees):
    """The trees, of which `start` has one entry a class, the scene model and the thresholds.

    Attributes:
        owner: [T] class that a tree contributes to; together: [M + 1, C] of the scene model.
        windows: [W] ascending [s]; threshold: [W, C] probability from which a relation is reported.
    """

    owner: IntArray
    together: FloatArray
    windows: FloatArray
    threshold: FloatArray

    def interpolate_thresholds(self, window: float) -> FloatArray:
        """[C] thresholds after a window [s], linear between those known."""
        return np.array([np.interp(window, self.windows, each) for each in self.threshold.T])

    def predict_pairs(self, values: FloatArray) -> FloatArray:
        """[N, C] class probabilities of pairs [N, F], each by itself."""
        if not len(values):
            return np.zeros((0, len(PAIR_CLASSES)))
        return average_mirrored(self._run_trees, values, mirror_features)

    def predict_scene(self, values: FloatArray, pairs: Sequence[tuple[str, str]]) -> FloatArray:
        """[N, C] class probabilities of all pairs of one scene, given the others."""
        return apply_scene_model(self.predict_pairs(values), pairs, self.together)

    def _run_trees(self, values: FloatArray) -> FloatArray:
        raw, leaves = np.tile(self.start, (len(values), 1)), self.find_values(values)
        for c in range(len(PAIR_CLASSES)):
            raw[:, c] += leaves[:, self.owner == c].sum(axis=1)
        return np.asarray(softmax(raw, axis=1))


@lru_cache(maxsize=2)
def load_calibration(file: Path = _SHIPPED) -> Calibration:
    """Load the calibration in a file; the shipped one if none is named.

    Raises:
        InputError: missing, damaged, or for other features.
    """
    return Calibration.load(file, names=NAMES, what="calibration")


def select_relations(
    likely: FloatArray, limits: FloatArray, pairs: Sequence[tuple[str, str]]
) -> list[tuple[int, int]]:
    """Select (pair, class) above the limits, likeliest first, one relation for each agent.

    Args:
        likely: [N, C] of every pair; limits: [C] thresholds.
        pairs: [N] the two agents.
    """
    ratio = likely / limits
    ratio[:, 0] = 0.0
    best, most = ratio.argmax(axis=1), ratio.max(axis=1)
    selected: list[tuple[int, int]] = []
    busy: set[str] = set()
    for n in np.argsort(-most, kind="stable").tolist():
        if most[n] < 1.0:
            break
        if not busy.intersection(pairs[n]):
            selected.append((n, int(best[n])))
            busy.update(pairs[n])
    return selected


def predict_relations(forecast: SceneForecast, *, window: float) -> tuple[PairRelation, ...]:
    """Predict the relations that are likely enough, the likeliest first, one for each agent.

    Args:
        window: length of the observation [s].
    """
    trees, (pairs, values) = load_calibration(), compute_pair_features(forecast, window)
    if not pairs:
        return ()
    likely = trees.predict_scene(values, pairs)
    selected = select_relations(likely, trees.interpolate_thresholds(window), pairs)
    return tuple(to_relation(*pairs[n], PAIR_CLASSES[c]) for n, c in selected)


def to_relation(a: str, b: str, kind: str) -> PairRelation:
    """Convert the class of a pair to a relation."""
    if kind == "gives_b":
        return PairRelation("yielding", b, a)
    return PairRelation("yielding" if kind == "gives_a" else kind, a, b)
