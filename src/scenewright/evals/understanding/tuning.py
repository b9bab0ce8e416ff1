"""Fits a calibration on scenes of development: `python -m scenewright.evals.understanding.tuning`.

    python -m scenewright.evals.understanding.tuning DIR... --out calibration.npz [--oracle]

Only scenes of the development half of each folder are read, unless `--split all` says that the
folders were made for tuning alone. Scenes are weighed so that they stand for the paper's
composition, whatever the folders hold most of. Thresholds are those that serve best on scenes
which the trees of some folds had not seen. Needs scikit-learn.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError
from scenewright.evals.understanding.calibration import (
    CLASSES,
    Calibration,
    chosen,
    save_calibration,
)
from scenewright.evals.understanding.dataset import Split, foreseeable, read_case, scene_ids
from scenewright.evals.understanding.features import NAMES, mirrored, pairs_of
from scenewright.evals.understanding.futures import outlook
from scenewright.evals.understanding.labels import Labels, Relation
from scenewright.evals.understanding.observing import as_arrays, code_of, observe
from scenewright.evals.understanding.oracle import futures_with_routes
from scenewright.evals.understanding.predictions import Prediction
from scenewright.evals.understanding.reasoner import relation
from scenewright.evals.understanding.scoring import KINDS, PAPER, tally
from scenewright.scene.base import FloatArray

WINDOWS = (1.0, 2.0, 3.0, 4.0, 5.0)
COMPOSITION = {"collision": 40.0, "yielding": 50.0, None: 100.0}
"""What scenes are made for, in the paper; of anything else as much as there is."""
QUIET = 0.3
"""Share of the scenes without a relation among those seen that are looked at. There are plenty of
them; each then counts for as many as it stands for."""
FOLDS = 3
_TREES = {
    "max_iter": 100,
    "learning_rate": 0.08,
    "max_leaf_nodes": 12,
    "l2_regularization": 8.0,
    "min_samples_leaf": 30,
    "random_state": 0,
}
_GRID = np.round(np.arange(0.06, 0.66, 0.03), 2)
_FIRST = (9.0, 0.3, 0.36, 0.3, 0.3)
_ROUNDS = 2
_IN_TURN = ((1,), (3, 4), (2,))
"""Which thresholds are sought one after the other; who gives way is one question."""
_NEAR_MISS = 0.1
"""What a near miss counts for where the paper tells three kinds apart."""

Swap = np.array([0, 1, 2, 4, 3])


@dataclass(frozen=True, eq=False)
class View:
    """One scene after one window.

    Attributes:
        scene: its code; named: what it was made for; weight: of how many scenes it is one.
        pairs: [N] agents; values: [N, F] features.
    """

    scene: str
    named: str | None
    labels: Labels
    window: float
    weight: float
    pairs: tuple[tuple[str, str], ...]
    values: FloatArray


@dataclass(frozen=True, eq=False)
class Table:
    """Views, and their pairs end to end.

    Attributes:
        values: [N, F]; classes: [N]; fold: [N]; weight: [N]; first: [V + 1] where each view begins.
    """

    views: tuple[View, ...]
    values: FloatArray
    classes: NDArray[np.intp]
    fold: NDArray[np.intp]
    weight: FloatArray
    first: NDArray[np.intp]


def views_of(
    folder: Path, *, informed: bool = False, windows: Sequence[float] = WINDOWS
) -> list[View]:
    """A scene after every window; with `informed`, as who knows all routes sees it.

    Nothing of a scene that is not scored either, as it cannot be foreseen.
    """
    case = read_case(folder)
    if not foreseeable(case):
        return []
    plenty = int(case.code[8:15], 16) / 16**7 < QUIET
    found = []
    for window in windows:
        if window > case.record.meta.duration:
            continue
        eventful = _eventful(case.labels, window)
        if not (eventful or plenty):
            continue
        seen = as_arrays(observe(case.record, scene=case.id, window=window))
        futures = futures_with_routes(seen, case) if informed else outlook(seen)
        rows = pairs_of(futures, window=window)
        found.append(
            View(
                case.code, case.named, case.labels, window, 1.0 if eventful else 1.0 / QUIET,
                tuple((row.a, row.b) for row in rows),
                np.array([row.values for row in rows]).reshape(-1, len(NAMES)).astype(np.float32),
            )
        )  # fmt: skip
    return found


def _eventful(labels: Labels, window: float) -> bool:
    starts = labels.starts
    return any(max(starts[r.from_], starts[r.to]) <= window for r in labels.relations)


def all_views(
    folders: Sequence[Path], *, workers: int = 1, informed: bool = False
) -> Iterator[View]:
    """Views of many scenes, in their order."""
    job = partial(views_of, informed=informed)
    if workers == 1:
        for folder in folders:
            yield from job(folder)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for found in pool.map(job, folders, chunksize=16):
            yield from found


def table_of(views: Iterable[View]) -> Table:
    """Views as a table, weighed to stand for the paper's composition."""
    listed = tuple(views)
    if not any(len(view.values) for view in listed):
        raise InputError("there is no pair to tune on in these scenes")
    shares = _shares(listed)
    weighed = tuple(replace(v, weight=v.weight * shares[v.named]) for v in listed)
    sizes = [len(view.pairs) for view in weighed]
    return Table(
        views=weighed,
        values=np.concatenate([view.values for view in weighed]).astype(np.float64),
        classes=np.array(
            [class_of(view.labels, a, b) for view in weighed for a, b in view.pairs], dtype=np.intp
        ),
        fold=np.repeat([int(view.scene[:4], 16) % FOLDS for view in weighed], sizes),
        weight=np.repeat([view.weight for view in weighed], sizes),
        first=np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp),
    )


def _shares(views: Sequence[View]) -> dict[str | None, float]:
    """What a view of each kind counts for."""
    found: dict[str | None, float] = defaultdict(float)
    for view in views:
        found[view.named] += view.weight
    known = {kind: n for kind, n in found.items() if kind in COMPOSITION}
    scale = sum(known.values()) / max(sum(COMPOSITION[kind] for kind in known), 1.0)
    return {kind: scale * COMPOSITION.get(kind, 0.0) / n if kind in known else 1.0
            for kind, n in found.items()}  # fmt: skip


def class_of(labels: Labels, a: str, b: str) -> int:
    """The class of a pair."""
    for each in labels.relations:
        if {each.from_, each.to} == {a, b}:
            if each.type == "yielding":
                return CLASSES.index("gives_a" if each.from_ == a else "gives_b")
            return CLASSES.index(each.type)
    return 0


def tuned(table: Table) -> Calibration:
    """The calibration that a table gives."""
    unseen = np.zeros((len(table.values), len(CLASSES)))
    for fold in range(FOLDS):
        mine = table.fold == fold
        if mine.any() and not mine.all():
            unseen[mine] = _fitted(table, ~mine).likely(table.values[mine])
    windows = sorted({view.window for view in table.views})
    limits = np.array([_thresholds(table, unseen, window) for window in windows])
    every = np.ones(len(table.values), dtype=np.bool_)
    return replace(_fitted(table, every), windows=np.array(windows), threshold=_smooth(limits))


def _smooth(limits: FloatArray) -> FloatArray:
    """[W, C] thresholds, each with a half of its neighbours: the best of one window is chance."""
    wide = np.pad(limits, ((1, 1), (0, 0)), mode="edge")
    return np.asarray((wide[:-2] + 2.0 * wide[1:-1] + wide[2:]) / 4.0)


def _fitted(table: Table, used: NDArray[np.bool_]) -> Calibration:
    from sklearn import ensemble

    values, classes, weight = table.values[used], table.classes[used], table.weight[used]
    make: Any = ensemble.HistGradientBoostingClassifier
    trees = make(**_TREES)
    trees.fit(
        np.concatenate([values, mirrored(values)]),
        np.concatenate([classes, Swap[classes]]),
        sample_weight=np.concatenate([weight, weight]),
    )
    return _as_arrays(trees)


def _as_arrays(trees: Any) -> Calibration:
    present = [int(c) for c in trees.classes_]
    speaking = present[-trees.n_trees_per_iteration_ :]  # of two classes only the second
    start = np.full(len(CLASSES), -30.0)
    start[present] = 0.0
    start[speaking] = np.ravel(trees._baseline_prediction)
    parts: dict[str, list[Any]] = defaultdict(list)
    count = 0
    for each in trees._predictors:
        for c, tree in zip(speaking, each, strict=True):
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
        windows=np.array([WINDOWS[-1]]),
        threshold=np.ones((1, len(CLASSES))),
        **joined,
    )


def _thresholds(table: Table, unseen: FloatArray, window: float) -> FloatArray:
    """[C] the thresholds with the best macro F1 on unseen scenes, one after the other."""
    mine = [n for n, view in enumerate(table.views) if view.window == window]
    quiet = {n: table.views[n].weight * _items(table.views[n], ()) for n in mine}
    whole = np.sum(list(quiet.values()), axis=0)
    rows = {n: slice(table.first[n], table.first[n + 1]) for n in mine}
    likely = {n: unseen[rows[n]] for n in mine}
    # Where nothing is as likely as the least threshold, nothing is ever told.
    open_ = [n for n in mine if likely[n][:, 1:].max(initial=0.0) >= _GRID[0]]

    def score(limits: FloatArray) -> float:
        counts = whole.copy()
        for n in open_:
            view = table.views[n]
            told = chosen(likely[n], limits, view.pairs)
            if told:
                said = tuple(relation(*view.pairs[k], CLASSES[c]) for k, c in told)
                counts += view.weight * _items(view, said) - quiet[n]
        return _macro(counts)

    limits = np.array(_FIRST)
    for _ in range(_ROUNDS):
        for which in _IN_TURN:
            scores = []
            for tried in _GRID:
                limits[list(which)] = tried
                scores.append(score(limits))
            smooth = np.convolve(np.pad(scores, 1, mode="edge"), np.ones(3) / 3, mode="valid")
            limits[list(which)] = _GRID[int(np.argmax(smooth))]
    return limits


def _items(view: View, said: tuple[Relation, ...]) -> FloatArray:
    """Counts of one scene, as the score has them."""
    items = tally(view.labels, Prediction(None, said), window=view.window).items
    return np.zeros((len(KINDS), 3)) if items is None else items


def _macro(counts: FloatArray) -> float:
    f1 = 2 * counts[:, 0] / np.maximum(2 * counts[:, 0] + counts[:, 1] + counts[:, 2], 1e-9)
    ours = [KINDS.index(kind) for kind in PAPER]
    return float(f1[ours].mean() + _NEAR_MISS * f1[KINDS.index("near_miss")])


def main(argv: Sequence[str] | None = None) -> None:
    """Tunes on the folders named and writes the calibration."""
    words = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    words.add_argument("folders", nargs="+", type=Path)
    words.add_argument("--out", type=Path, required=True)
    words.add_argument("--oracle", action="store_true", help="for who knows all routes")
    words.add_argument("--split", choices=("dev", "all"), default="dev")
    words.add_argument("--limit", type=int, help="so many scenes at most")
    words.add_argument("--workers", type=int, default=1)
    given = words.parse_args(argv)
    split: Split | None = "dev" if given.split == "dev" else None
    scenes = [folder / name for folder in given.folders for name in scene_ids(folder, split=split)]
    scenes = sorted(scenes, key=lambda each: code_of(each.name))[: given.limit]
    table = table_of(all_views(scenes, workers=given.workers, informed=given.oracle))
    found = tuned(table)
    save_calibration(given.out, found)
    print(f"{len(scenes)} scenes, {len(table.views)} views, {len(table.values)} pairs")
    for window, limits in zip(found.windows.tolist(), found.threshold.tolist(), strict=True):
        shown = dict(zip(CLASSES[1:], limits[1:], strict=True))
        print(f"{window:g} s: {shown}")


if __name__ == "__main__":
    main()
