"""From what futures say about a pair to how likely each relation is: boosted trees, as arrays.

They are fitted by `tuning` on development halves alone and shipped as plain numbers, so that a
method is a function of its observation and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError
from scenewright.evals.understanding.features import NAMES, mirrored
from scenewright.scene.base import FloatArray

CLASSES = ("none", "collision", "near_miss", "gives_a", "gives_b")
"""What a pair may have: nothing, a collision, a near miss, or that a, or b, gives way."""
_SWAPPED = (0, 1, 2, 4, 3)
_SHIPPED = Path(__file__).with_name("calibration.npz")


@dataclass(frozen=True, eq=False)
class Calibration:
    """Trees, all of them end to end.

    Attributes:
        start: [C] log odds before any tree; owner: [T] class that a tree speaks for; root: [T]
            index of its first node.
        feature: [N] feature looked at, -1 in leaves; limit: [N] at or below it goes left;
            left, right: [N] index of the next node; value: [N] of leaves.
        threshold: [C] how likely a relation must be to be reported.
    """

    start: FloatArray
    owner: NDArray[np.intp]
    root: NDArray[np.intp]
    feature: NDArray[np.intp]
    limit: FloatArray
    left: NDArray[np.intp]
    right: NDArray[np.intp]
    value: FloatArray
    threshold: FloatArray

    def likely(self, values: FloatArray) -> FloatArray:
        """[N, C] how likely each class is for pairs [N, F]; the same whoever is called a."""
        if not len(values):
            return np.zeros((0, len(CLASSES)))
        there, back = self._softmax(values), self._softmax(mirrored(values))
        return np.asarray((there + back[:, _SWAPPED]) / 2)

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
        for c in range(len(CLASSES)):
            raw[:, c] += self.value[node[:, self.owner == c]].sum(axis=1)
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
            found = Calibration(**{key: stored[key] for key in Calibration.__dataclass_fields__})
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"cannot read the calibration {file}: {error}") from None
    if names != NAMES:
        raise InputError(f"the calibration {file} is for other features; tune it anew")
    return found


def save_calibration(file: Path, found: Calibration) -> None:
    """Writes plain arrays."""
    arrays: dict[str, Any] = {key: getattr(found, key) for key in Calibration.__dataclass_fields__}
    save: Any = np.savez_compressed
    save(file, names=np.array(NAMES), **arrays)


def chosen(likely: FloatArray, threshold: FloatArray) -> list[tuple[int, int]]:
    """(pair, class) of every pair that has a relation likely enough; the likeliest pair first."""
    ratio = likely / threshold
    ratio[:, 0] = 0.0
    best = ratio.argmax(axis=1)
    most = ratio[np.arange(len(best)), best]
    order = np.argsort(-most, kind="stable").tolist()
    return [(n, int(best[n])) for n in order if most[n] >= 1.0]
