"""Fits a calibration on scenes of development: `python -m scenewright.evals.understanding.tuning`.

    python -m scenewright.evals.understanding.tuning DIR... --out calibration.npz [--oracle]

Only scenes of the development half of each folder are read, unless `--split all` says that the
folders were made for tuning alone. Scenes are weighed so that they stand for the paper's
composition, whatever the folders hold most of. The trees come first; the model that looks at all
pairs of a scene is fitted to what they say of scenes that they had not seen, and so are thresholds.
How well all of it does on scenes of which none of it had seen anything is told in the end. Needs
scikit-learn.
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
from scenewright.evals.understanding.calibration import Calibration, chosen, save_calibration
from scenewright.evals.understanding.dataset import Split, foreseeable, read_case, scene_ids
from scenewright.evals.understanding.features import NAMES, mirrored, pairs_of
from scenewright.evals.understanding.futures import outlook
from scenewright.evals.understanding.labels import Labels, Relation
from scenewright.evals.understanding.observing import as_arrays, code_of, observe
from scenewright.evals.understanding.oracle import futures_with_routes
from scenewright.evals.understanding.predictions import Prediction
from scenewright.evals.understanding.reasoner import relation
from scenewright.evals.understanding.scoring import DRAWS, KINDS, PAPER, tally
from scenewright.evals.understanding.together import (
    CLASSES,
    SIZE,
    SWAPPED,
    numbers_of,
    swapped,
    weighed,
)
from scenewright.scene.base import FloatArray

WINDOWS = (1.0, 2.0, 3.0, 4.0, 5.0)
CHECKED = 4.0
"""After which window it is told how well unseen scenes are understood [s]."""
COMPOSITION = {"collision": 40.0, "yielding": 50.0, None: 100.0}
"""What scenes are made for, in the paper; of anything else as much as there is."""
QUIET = 0.4
"""Share of the scenes without a relation among those seen that are looked at. There are plenty of
them; each then counts for as many as it stands for."""
FOLDS = 3
_TREES = {
    "max_iter": 140,
    "learning_rate": 0.07,
    "max_leaf_nodes": 16,
    "max_features": 0.4,
    "l2_regularization": 8.0,
    "min_samples_leaf": 40,
    "random_state": 0,
}
_GRID = np.round(np.arange(0.06, 0.66, 0.03), 2)
_FIRST = (9.0, 0.3, 0.36, 0.3, 0.3)
_ROUNDS = 2
_IN_TURN = ((1,), (3, 4), (2,))
"""Which thresholds are sought one after the other; who gives way is one question."""
_LINEAR = 0.1
"""How free the model is that looks at all pairs of a scene (scikit-learn's C)."""
_NEAR_MISS = 0.1
"""What a near miss counts for where the paper tells three kinds apart."""

Swap = np.array(SWAPPED)


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

    def scenes(self) -> Iterator[tuple[View, slice]]:
        """Every view and its rows."""
        for n, view in enumerate(self.views):
            yield view, slice(int(self.first[n]), int(self.first[n + 1]))


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
    counted = tuple(replace(v, weight=v.weight * shares[v.named]) for v in listed)
    sizes = [len(view.pairs) for view in counted]
    return Table(
        views=counted,
        values=np.concatenate([view.values for view in counted]).astype(np.float64),
        classes=np.array(
            [class_of(view.labels, a, b) for view in counted for a, b in view.pairs], dtype=np.intp
        ),
        fold=np.repeat([_fold(view) for view in counted], sizes),
        weight=np.repeat([view.weight for view in counted], sizes),
        first=np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp),
    )


def _fold(view: View) -> int:
    return int(view.scene[:4], 16) % FOLDS


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


def tuned(table: Table, unseen: FloatArray) -> Calibration:
    """The calibration that a table gives, and what trees say of its scenes `unseen`."""
    fair = _weighed_apart(table, unseen)
    windows = sorted({view.window for view in table.views})
    limits = np.array([_thresholds(_Game.of(table, fair, window)) for window in windows])
    every = np.ones(len(table.values), dtype=np.bool_)
    return replace(
        _fitted(table, every), together=_together(table, unseen, every),
        windows=np.array(windows), threshold=_smooth(limits),
    )  # fmt: skip


def unseen_by_trees(table: Table) -> FloatArray:
    """[N, C] what trees say of pairs in scenes that they had not seen."""
    unseen = np.zeros((len(table.values), len(CLASSES)))
    unseen[:, 0] = 1.0
    for fold in range(FOLDS):
        mine = table.fold == fold
        if mine.any() and not mine.all():
            unseen[mine] = _fitted(table, ~mine).likely(table.values[mine])
    return unseen


def _weighed_apart(table: Table, unseen: FloatArray) -> FloatArray:
    """[N, C] the same with all pairs of a scene together, by a model of the other folds."""
    found = unseen.copy()
    for fold in range(FOLDS):
        mine = table.fold == fold
        if mine.any() and not mine.all():
            weights = _together(table, unseen, ~mine)
            for view, rows in table.scenes():
                if len(view.pairs) and mine[rows.start]:
                    found[rows] = weighed(unseen[rows], view.pairs, weights)
    return found


def _together(table: Table, unseen: FloatArray, used: NDArray[np.bool_]) -> FloatArray:
    """[M + 1, C] the model that looks at all pairs of a scene, its constant last."""
    from sklearn import linear_model

    values = np.zeros((len(unseen), SIZE))
    for view, rows in table.scenes():
        if len(view.pairs):
            values[rows] = numbers_of(unseen[rows], view.pairs)
    values, classes, weight = values[used], table.classes[used], table.weight[used]
    mean, spread = values.mean(axis=0), values.std(axis=0) + 1e-9
    make: Any = linear_model.LogisticRegression
    model = make(C=_LINEAR, max_iter=300)
    model.fit(
        np.concatenate([(values - mean) / spread, (swapped(values) - mean) / spread]),
        np.concatenate([classes, Swap[classes]]),
        sample_weight=np.concatenate([weight, weight]),
    )
    return _as_weights(model, mean, spread)


def _as_weights(model: Any, mean: FloatArray, spread: FloatArray) -> FloatArray:
    """Of values as they are; a class that is in no scene is never likely."""
    rows, constant = np.atleast_2d(model.coef_), np.ravel(model.intercept_)
    present = [int(c) for c in model.classes_]
    speaking = present[-len(rows) :]  # of two classes only the second
    found = np.zeros((SIZE + 1, len(CLASSES)))
    found[-1] = -30.0
    found[-1, present] = 0.0
    found[:-1, speaking] = (rows / spread).T
    found[-1, speaking] = constant - (rows / spread) @ mean
    return found


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
        together=np.zeros((SIZE + 1, len(CLASSES))),
        windows=np.array([WINDOWS[-1]]),
        threshold=np.ones((1, len(CLASSES))),
        **joined,
    )


@dataclass(frozen=True, eq=False)
class _Game:
    """The views of one window, and what is known to score whatever is told of them.

    Attributes:
        quiet: [V, 4, 3] counts of each if nothing is told; likely: [V] of its pairs.
    """

    views: tuple[View, ...]
    quiet: FloatArray
    likely: tuple[FloatArray, ...]
    known: dict[tuple[int, tuple[tuple[int, int], ...]], FloatArray]

    @staticmethod
    def of(table: Table, likely: FloatArray, window: float) -> _Game:
        """The views of a window."""
        mine = [(view, rows) for view, rows in table.scenes() if view.window == window]
        quiet = np.array([view.weight * _items(view, ()) for view, _ in mine])
        return _Game(tuple(v for v, _ in mine), quiet, tuple(likely[r] for _, r in mine), {})

    def counts(self, limits: FloatArray, among: Sequence[int]) -> FloatArray:
        """[V, 4, 3] of the views among those named; those of the others if nothing is told."""
        found = self.quiet.copy()
        for n in among:
            told = tuple(chosen(self.likely[n], limits, self.views[n].pairs))
            if told:
                found[n] = self._scored(n, told)
        return found

    def _scored(self, n: int, told: tuple[tuple[int, int], ...]) -> FloatArray:
        if (n, told) not in self.known:
            view = self.views[n]
            said = tuple(relation(*view.pairs[k], CLASSES[c]) for k, c in told)
            self.known[n, told] = view.weight * _items(view, said)
        return self.known[n, told]


def _thresholds(game: _Game, used: NDArray[np.bool_] | None = None) -> FloatArray:
    """[C] the thresholds with the best macro F1 on unseen scenes, one after the other."""
    mine = np.ones(len(game.views), dtype=np.bool_) if used is None else used
    # Where nothing is as likely as the least threshold, nothing is ever told.
    open_ = [n for n in np.flatnonzero(mine).tolist()
             if game.likely[n][:, 1:].max(initial=0.0) >= _GRID[0]]  # fmt: skip
    limits = np.array(_FIRST)
    for _ in range(_ROUNDS):
        for which in _IN_TURN:
            scores = []
            for tried in _GRID:
                limits[list(which)] = tried
                scores.append(_macro(game.counts(limits, open_)[mine].sum(axis=0)))
            smooth = np.convolve(np.pad(scores, 1, mode="edge"), np.ones(3) / 3, mode="valid")
            best = np.flatnonzero(smooth >= smooth.max() - 1e-9)
            limits[list(which)] = _GRID[best[len(best) // 2]]
    return limits


def checked(
    table: Table, unseen: FloatArray, window: float
) -> dict[str, tuple[float, float, float]]:
    """F1 [percent] and its 95 % interval by kind on scenes of which nothing was seen.

    Trees, the model of the scene and thresholds are all those of the other folds.
    """
    game = _Game.of(table, _weighed_apart(table, unseen), window)
    fold = np.array([_fold(view) for view in game.views])
    counts = game.quiet.copy()
    for f in range(FOLDS):
        limits = _thresholds(game, fold != f)
        mine = fold == f
        counts[mine] = game.counts(limits, np.flatnonzero(mine).tolist())[mine]
    draws = np.random.default_rng(0).multinomial(
        len(counts), np.full(len(counts), 1 / len(counts)), size=DRAWS
    )
    drawn = np.einsum("bv,vkx->bkx", draws, counts)
    whole = np.concatenate([counts.sum(axis=0)[None], drawn])
    f1 = 2 * whole[..., 0] / np.maximum(2 * whole[..., 0] + whole[..., 1] + whole[..., 2], 1e-9)
    ours = [KINDS.index(kind) for kind in PAPER]
    shown = {**dict(zip(KINDS, f1.T, strict=True)), "macro": f1[:, ours].mean(axis=1)}
    return {
        kind: (100 * each[0], *(100 * np.percentile(each[1:], (2.5, 97.5))).tolist())
        for kind, each in shown.items()
    }


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
    unseen = unseen_by_trees(table)
    found = tuned(table, unseen)
    save_calibration(given.out, found)
    print(f"{len(scenes)} scenes, {len(table.views)} views, {len(table.values)} pairs")
    for window, limits in zip(found.windows.tolist(), found.threshold.tolist(), strict=True):
        shown = dict(zip(CLASSES[1:], limits[1:], strict=True))
        print(f"{window:g} s: {shown}")
    for kind, (f1, low, high) in checked(table, unseen, CHECKED).items():
        print(f"unseen at {CHECKED:g} s, {kind}: {f1:.1f} [{low:.1f}, {high:.1f}]")


if __name__ == "__main__":
    main()
