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
        start: log odds before any tree; root: [T] index of each tree's first node.
        feature: [N] feature tested, -1 in leaves; limit: [N] at or below it goes left; left, right:
            [N] index of the next node; value: [N] of leaves.
    """

    start: FloatArray
    root: IntArray
    feature: IntArray
    limit: FloatArray
    left: IntArray
    right: IntArray
    value: FloatArray

    def find_values(self, values: FloatArray) -> FloatArray:
        """[N, T] the value of the leaf of every tree that each row of features [N, F] comes to."""
        return np.asarray(self.value[
            _find_leaves(values, self.root, self.feature, self.limit, self.left, self.right)
        ])  # fmt: skip

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
def _find_leaves(
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
