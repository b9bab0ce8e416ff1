"""Boosted trees as plain arrays, which load under any version of scikit-learn and run no pickle."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from scenewright.arrays import read_arrays
from scenewright.compiled import compiled
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray

IntArray = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class BoostedTrees:
    """All trees, end to end; names are those of the file.

    Attributes:
        start: [C] log odds of each class before any tree; owner: [T] class that a tree adds to.
        root: [T] index of each tree's first node.
        feature: [N] feature tested, -1 in leaves; limit: [N] at or below it goes left; left, right:
            [N] index of the next node; value: [N] of leaves.
    """

    start: FloatArray
    owner: IntArray
    root: IntArray
    feature: IntArray
    limit: FloatArray
    left: IntArray
    right: IntArray
    value: FloatArray

    def score(self, values: FloatArray) -> FloatArray:
        """[N, C] log odds of the classes of rows of features [N, F]."""
        return _add_leaves(values, *(getattr(self, each.name) for each in fields(BoostedTrees)))

    @classmethod
    def load(cls, file: Path, *, names: tuple[str, ...], what: str) -> Self:
        """Load a file of such arrays.

        Args:
            names: of the features; what: it is, for errors.

        Raises:
            InputError: missing, damaged, or for other features.
        """
        stored = read_arrays(file, what=f"the {what} {file}")
        if tuple(map(str, stored.get("names", ()))) != names:
            raise InputError(f"the {what} {file} is for other features; tune it anew")
        wanted = [each.name for each in fields(cls)]
        if missing := sorted({*wanted} - {*stored}):
            raise InputError(f"cannot read the {what} {file}: it lacks {missing[0]}")
        arrays: dict[str, Any] = {name: stored[name] for name in wanted}
        return cls(**{
            key: array.astype(np.float64 if array.dtype.kind == "f" else np.intp)
            for key, array in arrays.items()
        })  # fmt: skip


@compiled
def _add_leaves(
    values: FloatArray, start: FloatArray, owner: IntArray, root: IntArray, feature: IntArray,
    limit: FloatArray, left: IntArray, right: IntArray, value: FloatArray,
) -> FloatArray:  # fmt: skip
    """[N, C] `start` and, of every tree, the leaf that each row of features [N, F] comes to."""
    total = np.empty((len(values), len(start)))
    for n in range(len(values)):
        total[n] = start
        for t in range(len(root)):
            node = root[t]
            while feature[node] >= 0:
                node = left[node] if values[n, feature[node]] <= limit[node] else right[node]
            total[n, owner[t]] += value[node]
    return total
