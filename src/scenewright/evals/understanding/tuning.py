"""Fits the calibration on development halves: `python -m scenewright.evals.understanding.tuning`.

    python -m scenewright.evals.understanding.tuning DIR... --out calibration.npz

Only scenes of the development half of each folder are read. Thresholds are those that serve best
on scenes which the trees of five folds had not seen. Needs scikit-learn.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.understanding.calibration import (
    CLASSES,
    Calibration,
    save_calibration,
)
from scenewright.evals.understanding.dataset import Case, read_cases
from scenewright.evals.understanding.features import NAMES, mirrored, pairs_of
from scenewright.evals.understanding.futures import outlook
from scenewright.evals.understanding.labels import Labels
from scenewright.evals.understanding.observing import as_arrays, observe
from scenewright.evals.understanding.oracle import futures_with_routes
from scenewright.scene.base import FloatArray

WINDOWS = (2.0, 3.0, 4.0, 5.0)
FOLDS = 5
_TREES = {
    "max_iter": 90,
    "learning_rate": 0.06,
    "max_leaf_nodes": 10,
    "l2_regularization": 8.0,
    "min_samples_leaf": 25,
    "random_state": 0,
}
_GRID = np.round(np.arange(0.10, 0.62, 0.02), 2)

Table = tuple[FloatArray, NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]
"""Features [N, F], class [N], scene [N], and per class how many events no pair stands for."""


def table_of(
    cases: Iterable[Case], windows: Sequence[float] = WINDOWS, *, informed: bool = False
) -> Table:
    """One row per pair and window; with `informed`, as who knows all routes sees them."""
    values, classes, scenes = [], [], []
    missed = np.zeros(len(CLASSES), dtype=np.intp)
    for number, case in enumerate(cases):
        for window in windows:
            if window > case.record.meta.duration:
                continue
            seen = as_arrays(observe(case.record, scene=case.id, window=window))
            futures = futures_with_routes(seen, case) if informed else outlook(seen)
            rows = pairs_of(futures, window=window)
            there = {(row.a, row.b): class_of(case.labels, row.a, row.b) for row in rows}
            values += [row.values for row in rows]
            classes += [there[row.a, row.b] for row in rows]
            scenes += [number] * len(rows)
            missed += _missed(case.labels, set(seen.ids), list(there.values()))
    return (
        np.array(values).reshape(-1, len(NAMES)),
        np.array(classes, dtype=np.intp),
        np.array(scenes, dtype=np.intp),
        missed,
    )


def class_of(labels: Labels, a: str, b: str) -> int:
    """The class of a pair."""
    for relation in labels.relations:
        if {relation.from_, relation.to} == {a, b}:
            if relation.type == "yielding":
                return CLASSES.index("gives_a" if relation.from_ == a else "gives_b")
            return CLASSES.index(relation.type)
    return 0


def _missed(labels: Labels, seen: set[str], found: list[int]) -> NDArray[np.intp]:
    wanted = np.zeros(len(CLASSES), dtype=np.intp)
    for each in labels.relations:
        if {each.from_, each.to} <= seen:
            name = "gives_a" if each.type == "yielding" else each.type
            wanted[CLASSES.index(name)] += 1
    got = np.bincount(found, minlength=len(CLASSES))
    got[3] += got[4]
    got[0] = got[4] = 0
    return np.asarray(np.maximum(wanted - got, 0))


def tuned(table: Table) -> Calibration:
    """The calibration that a table gives."""
    values, classes, scenes, missed = table
    both = np.concatenate([values, mirrored(values)])
    labels = np.concatenate([classes, np.array([0, 1, 2, 4, 3])[classes]])
    groups = np.concatenate([scenes, scenes])
    unseen = np.zeros((len(values), len(CLASSES)))
    for fold in range(FOLDS):
        inside = groups % FOLDS != fold
        part = _fitted(both[inside], labels[inside])
        mine = scenes % FOLDS == fold
        unseen[mine] = part.likely(values[mine])
    return replace(_fitted(both, labels), threshold=_thresholds(unseen, classes, missed))


def _fitted(values: FloatArray, classes: NDArray[np.intp]) -> Calibration:
    from sklearn import ensemble

    make: Any = ensemble.HistGradientBoostingClassifier
    trees = make(**_TREES)
    trees.fit(values, classes)
    present = [int(c) for c in trees.classes_]
    start = np.full(len(CLASSES), -30.0)
    start[present] = np.ravel(trees._baseline_prediction)
    parts: dict[str, list[Any]] = defaultdict(list)
    count = 0
    for each in trees._predictors:
        for c, tree in zip(present, each, strict=True):
            nodes = tree.nodes
            leaf = nodes["is_leaf"].astype(bool)
            parts["owner"].append(c)
            parts["root"].append(count)
            parts["feature"].append(np.where(leaf, -1, nodes["feature_idx"].astype(np.intp)))
            parts["limit"].append(np.where(leaf, 0.0, nodes["num_threshold"]))
            parts["left"].append(np.where(leaf, 0, nodes["left"].astype(np.intp) + count))
            parts["right"].append(np.where(leaf, 0, nodes["right"].astype(np.intp) + count))
            parts["value"].append(np.where(leaf, nodes["value"], 0.0))
            count += len(nodes)
    joined = {key: np.concatenate(parts[key]) for key in ("feature", "limit", "left", "right")}
    return Calibration(
        start=start,
        owner=np.array(parts["owner"], dtype=np.intp),
        root=np.array(parts["root"], dtype=np.intp),
        value=np.concatenate(parts["value"]),
        threshold=np.ones(len(CLASSES)),
        **joined,
    )


def _thresholds(
    likely: FloatArray, classes: NDArray[np.intp], missed: NDArray[np.intp]
) -> FloatArray:
    """Per relation, the threshold with the best F1 on unseen scenes, one after the other."""
    found = np.ones(len(CLASSES))
    yields = np.where(likely[:, 3] >= likely[:, 4], 3, 4)
    for c in (1, 2):
        found[c] = _best(likely[:, c], classes == c, int(missed[c]))
    right = classes == yields
    wanted = int(np.isin(classes, (3, 4)).sum()) - int(right.sum()) + int(missed[3])
    found[3] = found[4] = _best(likely[:, 3:].max(axis=1), right, wanted)
    return found


def _best(likely: FloatArray, right: NDArray[np.bool_], missed: int) -> float:
    scores = []
    for limit in _GRID:
        told = likely >= limit
        hits = int((told & right).sum())
        scores.append(2 * hits / max(int(told.sum()) + int(right.sum()) + missed, 1))
    smooth = np.convolve(np.pad(scores, 1, mode="edge"), np.ones(3) / 3, mode="valid")
    return float(_GRID[int(np.argmax(smooth))])


def main(argv: Sequence[str] | None = None) -> None:
    """Tunes on the folders named and writes the calibration."""
    words = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    words.add_argument("folders", nargs="+", type=Path)
    words.add_argument("--out", type=Path, required=True)
    words.add_argument("--oracle", action="store_true", help="for who knows all routes")
    given = words.parse_args(argv)
    cases = [case for folder in given.folders for case in read_cases(folder, split="dev")]
    table = table_of(cases, informed=given.oracle)
    found = tuned(table)
    save_calibration(given.out, found)
    shown = dict(zip(CLASSES[1:], found.threshold[1:].tolist(), strict=True))
    print(f"{len(cases)} scenes, {len(table[0])} pairs, thresholds {shown}")


if __name__ == "__main__":
    main()
