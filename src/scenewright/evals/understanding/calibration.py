"""From what futures say about a pair to how likely each relation is: boosted trees, as arrays.

They are fitted by `tuning` on development halves alone and shipped as plain numbers, so that a
method is a function of its observation and nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError
from scenewright.evals.understanding.features import NAMES, mirrored
from scenewright.evals.understanding.together import CLASSES, SWAPPED, weighed
from scenewright.scene.base import FloatArray

_SHIPPED = Path(__file__).with_name("calibration.npz")


@dataclass(frozen=True, eq=False)
class Calibration:
    """Trees, all of them end to end.

    Attributes:
        start: [C] log odds before any tree; owner: [T] class that a tree speaks for; root: [T]
            index of its first node.
        feature: [N] feature looked at, -1 in leaves; limit: [N] at or below it goes left;
            left, right: [N] index of the next node; value: [N] of leaves.
        together: [M + 1, C] weights of the model that looks at all pairs of a scene.
        windows: [W] ascending; threshold: [W, C] how likely a relation must be to be reported
            after each of them [s].
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

    def limits(self, window: float) -> FloatArray:
        """[C] thresholds after a window [s]: between those known, in proportion."""
        columns = self.threshold.T
        return np.array([np.interp(window, self.windows, column) for column in columns])

    def likely(self, values: FloatArray) -> FloatArray:
        """[N, C] how likely each class is for pairs [N, F], each by itself, whoever is called a."""
        if not len(values):
            return np.zeros((0, len(CLASSES)))
        there, back = self._softmax(values), self._softmax(mirrored(values))
        return np.asarray((there + back[:, SWAPPED]) / 2)

    def in_scene(self, values: FloatArray, pairs: Sequence[tuple[str, str]]) -> FloatArray:
        """[N, C] the same for all pairs of one scene, each in the light of the others."""
        return weighed(self.likely(values), pairs, self.together)

    def _softmax(self, values: FloatArray) -> FloatArray:
        node = np.broadcast_to(self.root, (len(values), len(self.root))).copy()
        rows = np.arange(len(values))[:, None]
        while True:
            feature = self.feature[node]
            inner = feature >= 0
            if not inner.any():
                break
            down = values[rows, np.maximum(feature, 0)] <= self.limit[node]
            node = np.where(inner, np.where(down, self.left[node], self.right[node]), node)
        raw = np.tile(self.start, (len(values), 1))
        leaves = self.value[node]
        for c in range(len(CLASSES)):
            raw[:, c] += leaves[:, self.owner == c].sum(axis=1)
        raw -= raw.max(axis=1, keepdims=True)
        odds = np.exp(raw)
        return np.asarray(odds / odds.sum(axis=1, keepdims=True))


@lru_cache(maxsize=4)
def load_calibration(file: Path = _SHIPPED) -> Calibration:
    """The calibration in a file; the shipped one if none is named.

    Raises:
        InputError: missing, damaged, or for other features.
    """
    try:
        with np.load(file, allow_pickle=False) as stored:
            names = tuple(str(name) for name in stored["names"])
            kept = {key: stored[key] for key in Calibration.__dataclass_fields__}
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"cannot read the calibration {file}: {error}") from None
    if names != NAMES:
        raise InputError(f"the calibration {file} is for other features; tune it anew")
    return Calibration(**{
        key: array.astype(np.float64 if array.dtype.kind == "f" else np.intp)
        for key, array in kept.items()
    })  # fmt: skip


def save_calibration(file: Path, found: Calibration) -> None:
    """Writes plain arrays, in half their width, which is exact enough for all of them."""
    whole = {key: getattr(found, key) for key in Calibration.__dataclass_fields__}
    arrays: dict[str, Any] = {
        key: array.astype(np.float32 if array.dtype.kind == "f" else np.int32)
        for key, array in whole.items()
    }
    save: Any = np.savez_compressed
    save(file, names=np.array(NAMES), **arrays)


def chosen(
    likely: FloatArray, limits: FloatArray, pairs: Sequence[tuple[str, str]]
) -> list[tuple[int, int]]:
    """(pair, class) of every pair that has a relation likely enough; the likeliest pair first.

    Whoever is in one relation already is in no other.

    Args:
        likely: [N, C] of every pair; limits: [C] what is enough.
        pairs: [N] the two agents.
    """
    ratio = likely / limits
    ratio[:, 0] = 0.0
    best, most = ratio.argmax(axis=1), ratio.max(axis=1)
    told: list[tuple[int, int]] = []
    busy: set[str] = set()
    for n in np.argsort(-most, kind="stable").tolist():
        if most[n] < 1.0:
            break
        if not busy.intersection(pairs[n]):
            told.append((n, int(best[n])))
            busy.update(pairs[n])
    return told
