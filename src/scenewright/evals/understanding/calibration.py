"""The calibration: from the features of a pair to relation probabilities, by boosted trees.

It is fitted by `tuning` on development halves alone and shipped as plain arrays, which load under
any version of scikit-learn and run no code of a pickle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from scenewright.compiled import compiled
from scenewright.errors import InputError
from scenewright.evals.understanding.pair_features import NAMES, mirror_features
from scenewright.evals.understanding.scene_model import (
    PAIR_CLASSES,
    apply_scene_model,
    average_mirrored,
)
from scenewright.evals.understanding.time_gaps import IntArray
from scenewright.scene.base import FloatArray

_SHIPPED = Path(__file__).with_name("calibration.npz")


@dataclass(frozen=True, eq=False)
class Calibration:
    """All trees, end to end, the scene model and the thresholds; names are those of the file.

    Attributes:
        start: [C] log odds before any tree; owner: [T] class that a tree contributes to; root: [T]
            index of its first node.
        feature: [N] feature tested, -1 in leaves; limit: [N] at or below it goes left; left, right:
            [N] index of the next node; value: [N] of leaves.
        together: [M + 1, C] weights of the scene model.
        windows: [W] ascending [s]; threshold: [W, C] probability from which a relation is reported.
    """

    start: FloatArray
    owner: NDArray[np.intp]
    root: NDArray[np.intp]
    feature: NDArray[np.intp]
    limit: FloatArray
    left: NDArray[np.intp]
    right: NDArray[np.intp]
    value: FloatArray
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
        node = find_leaves(values, self.root, self.feature, self.limit, self.left, self.right)
        raw, leaves = np.tile(self.start, (len(values), 1)), self.value[node]
        for c in range(len(PAIR_CLASSES)):
            raw[:, c] += leaves[:, self.owner == c].sum(axis=1)
        return np.asarray(softmax(raw, axis=1))


@compiled
def find_leaves(
    values: FloatArray, root: IntArray, feature: IntArray, limit: FloatArray, left: IntArray,
    right: IntArray,
) -> IntArray:  # fmt: skip
    """[N, T] the leaf of every tree that each row of features [N, F] comes to."""
    leaf = np.empty((len(values), len(root)), np.intp)
    for n in range(len(values)):
        for t in range(len(root)):
            node = root[t]
            while feature[node] >= 0:
                node = left[node] if values[n, feature[node]] <= limit[node] else right[node]
            leaf[n, t] = node
    return leaf


@lru_cache(maxsize=4)
def load_calibration(file: Path = _SHIPPED) -> Calibration:
    """Load the calibration in a file; the shipped one if none is named.

    Raises:
        InputError: missing, damaged, or for other features.
    """
    try:
        with np.load(file, allow_pickle=False) as stored:
            names = tuple(str(name) for name in stored["names"])
            arrays = {key: stored[key] for key in Calibration.__dataclass_fields__}
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"cannot read the calibration {file}: {error}") from None
    if names != NAMES:
        raise InputError(f"the calibration {file} is for other features; tune it anew")
    return Calibration(**{
        key: array.astype(np.float64 if array.dtype.kind == "f" else np.intp)
        for key, array in arrays.items()
    })  # fmt: skip


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
