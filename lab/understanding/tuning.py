"""Fit a calibration on scenes of development: `python -m lab.understanding.tuning`.

    python -m lab.understanding.tuning DIR... --out calibration.npz

Only the development half of each folder is read, unless `--split all` says that the folders were
made for tuning alone. Scenes are weighed to the paper's composition, whatever the folders hold most
of. The trees are fitted first; the scene model and the thresholds are fitted to what the trees
predict for scenes of other folds. In the end the scores of all of it on unseen folds are printed.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import chain
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError
from scenewright.evals.bootstrap import compute_interval, draw_resamples
from scenewright.evals.understanding.boosted_trees import BoostedTrees
from scenewright.evals.understanding.calibration import (
    PAIR_CLASSES,
    SWAPPED,
    Calibration,
    select_relations,
    to_relation,
)
from scenewright.evals.understanding.cases import Labels, SceneCase, hash_scene, observe
from scenewright.evals.understanding.evaluate import load_cases
from scenewright.evals.understanding.forecast import forecast_scene
from scenewright.evals.understanding.intent import infer_routes
from scenewright.evals.understanding.pair_features import (
    NAMES,
    compute_pair_features,
    mirror_features,
)
from scenewright.evals.understanding.scoring import (
    DRAWS,
    KINDS,
    PAPER,
    ScenePrediction,
    compute_f1,
    count_scene,
)
from scenewright.scene.base import FloatArray

WINDOWS = (2.0, 4.0)
CHECKED = 4.0
"""Window at which scores on unseen folds are printed [s]."""
COMPOSITION = {"collision": 40.0, "yielding": 50.0, None: 100.0}
"""Scenes by requested event in the paper; others keep their number."""
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
_QUIET, _MANY = 0.1, 20_000
"""Share of the pairs without a relation that are fitted on where there are so many; 97 of 100
pairs have none."""
_GRID = np.round(np.arange(0.06, 0.66, 0.03), 2)
_FIRST = (9.0, 0.3, 0.36, 0.3, 0.3)
_ROUNDS = 2
_IN_TURN = ((1,), (3, 4), (2,))
"""Thresholds are searched in this order; both directions of yielding share one."""
_NEAR_MISS = 0.1
"""Weight of the F1 of near misses beside the paper's macro F1."""
_NEVER = -30.0
"""Log odds of a class that is in no scene."""

BoolArray = NDArray[np.bool_]
_View = TypeVar("_View")


@dataclass(frozen=True, eq=False)
class TrainingView:
    """One clip after one window.

    Attributes:
        scene: hash of the scene, which is in one fold with all its clips.
        named: its requested event; weight: of how many clips it is one.
        pairs: [N] agents; values: [N, F] features.
    """

    scene: str
    named: str | None
    labels: Labels
    window: float
    weight: float
    pairs: tuple[tuple[str, str], ...]
    values: FloatArray

    @property
    def fold(self) -> int:
        """Fold of the scene."""
        return int(self.scene[:4], 16) % FOLDS


@dataclass(frozen=True, eq=False)
class TrainingTable:
    """Views, and their pairs end to end.

    Attributes:
        values: [N, F]; classes: [N]; fold: [N]; weight: [N]; rows: [V] of each view.
    """

    views: tuple[TrainingView, ...]
    values: FloatArray
    classes: NDArray[np.intp]
    fold: NDArray[np.intp]
    weight: FloatArray
    rows: tuple[slice, ...]


def view_scene(case: SceneCase, *, windows: Sequence[float] = WINDOWS) -> list[TrainingView]:
    """View a clip after every window."""
    found = []
    for window in windows:
        observed = observe(case.record, scene=case.id, window=window)
        forecast = forecast_scene(observed, infer_routes(observed))
        pairs, values = compute_pair_features(forecast, window)
        found.append(TrainingView(
            hash_scene(case.scene), case.named, case.labels, window, 1.0, tuple(pairs),
            values.astype(np.float32),
        ))  # fmt: skip
    return found


def build_table(views: Iterable[TrainingView]) -> TrainingTable:
    """Build the table of views, weighed to the paper's composition.

    Raises:
        InputError: no view has a pair.
    """
    unweighed = tuple(views)
    if not any(len(view.values) for view in unweighed):
        raise InputError("there is no pair to tune on in these scenes")
    factors = _weigh_kinds(unweighed)
    weighed = tuple(replace(v, weight=v.weight * factors[v.named]) for v in unweighed)
    sizes = [len(view.pairs) for view in weighed]
    ends = np.cumsum([0, *sizes]).tolist()
    return TrainingTable(
        views=weighed,
        values=np.concatenate([view.values for view in weighed]).astype(np.float64),
        classes=np.array([_classify(v.labels, *pair) for v in weighed for pair in v.pairs]),
        fold=np.repeat([view.fold for view in weighed], sizes),
        weight=np.repeat([view.weight for view in weighed], sizes),
        rows=tuple(map(slice, ends[:-1], ends[1:])),
    )


def _weigh_kinds(views: Sequence[TrainingView]) -> dict[str | None, float]:
    """The factor of the weight of a view, by requested event."""
    found: dict[str | None, float] = defaultdict(float)
    for view in views:
        found[view.named] += view.weight
    known = {kind: n for kind, n in found.items() if kind in COMPOSITION}
    scale = sum(known.values()) / max(sum(COMPOSITION[kind] for kind in known), 1.0)
    return {kind: scale * COMPOSITION[kind] / n if kind in known else 1.0
            for kind, n in found.items()}  # fmt: skip


def _classify(labels: Labels, a: str, b: str) -> int:
    """The class of a pair."""
    for each in labels.relations:
        if {each.from_, each.to} == {a, b}:
            yields = "gives_a" if each.from_ == a else "gives_b"
            return PAIR_CLASSES.index(yields if each.type == "yielding" else each.type)
    return 0


def fit_calibration(table: TrainingTable, unseen: FloatArray) -> Calibration:
    """Fit a calibration to a table.

    Args:
        unseen: [N, C] as from `predict_unseen`.
    """
    windows = sorted({view.window for view in table.views})
    limits = np.array([_search_thresholds(_WindowViews(table, unseen, w)) for w in windows])
    every = np.ones(len(table.values), dtype=np.bool_)
    return replace(
        _fit_trees(table, every), windows=np.array(windows), threshold=_smooth_thresholds(limits)
    )


def _list_folds(table: TrainingTable) -> Iterator[BoolArray]:
    """[N] the rows of each fold that has rows and leaves some."""
    for fold in range(FOLDS):
        mine = table.fold == fold
        if mine.any() and not mine.all():
            yield mine


def predict_unseen(table: TrainingTable) -> FloatArray:
    """Predict [N, C] classes of all pairs, each by trees fitted on the other folds."""
    unseen = np.zeros((len(table.values), len(PAIR_CLASSES)))
    unseen[:, 0] = 1.0
    for mine in _list_folds(table):
        unseen[mine] = _fit_trees(table, ~mine).predict_pairs(table.values[mine])
    return unseen


def _thin_out(table: TrainingTable, used: BoolArray) -> tuple[BoolArray, FloatArray]:
    """[N] which pairs are fitted on, few of those without a relation; [M] their weights."""
    quiet = table.classes == 0
    share = _QUIET if quiet.sum() > _MANY else 1.0
    drawn = used & (~quiet | (np.random.default_rng(0).random(len(quiet)) < share))
    return drawn, np.where(quiet, table.weight / share, table.weight)[drawn]


def _smooth_thresholds(limits: FloatArray) -> FloatArray:
    """[W, C] thresholds, each averaged with its neighbours against chance."""
    wide = np.pad(limits, ((1, 1), (0, 0)), mode="edge")
    return np.asarray((wide[:-2] + 2.0 * wide[1:-1] + wide[2:]) / 4.0)


def _fit_trees(table: TrainingTable, used: BoolArray) -> Calibration:
    from sklearn import ensemble

    drawn, weight = _thin_out(table, used)
    values, classes = table.values[drawn], table.classes[drawn]
    make: Any = ensemble.HistGradientBoostingClassifier
    trees = make(**_TREES)
    trees.fit(
        np.concatenate([values, mirror_features(values)]),
        np.concatenate([classes, SWAPPED[classes]]),
        sample_weight=np.concatenate([weight, weight]),
    )
    return _convert_trees(trees)


def _convert_trees(trees: Any) -> Calibration:
    """The arrays of a scikit-learn ensemble."""
    present = [int(c) for c in trees.classes_]
    scored = present[-trees.n_trees_per_iteration_ :]  # of two classes only the second
    start = np.full(len(PAIR_CLASSES), _NEVER)
    start[present] = 0.0
    start[scored] = np.ravel(trees._baseline_prediction)
    return Calibration(
        start=start,
        **flatten_trees(trees, scored),
        windows=np.array([WINDOWS[-1]]),
        threshold=np.ones((1, len(PAIR_CLASSES))),
    )


def flatten_trees(trees: Any, scored: Sequence[int] = (0,)) -> dict[str, Any]:
    """The nodes of all trees of a scikit-learn ensemble, end to end.

    Args:
        scored: classes that one tree of each round adds to, in turn.
    """
    parts = [tree.nodes for each in trees._predictors for tree in each]
    sizes = [len(each) for each in parts]
    nodes, root = np.concatenate(parts), np.cumsum([0, *sizes[:-1]])
    leaf, offset = nodes["is_leaf"].astype(bool), np.repeat(root, sizes)
    return {
        "owner": np.array([*scored] * len(trees._predictors), dtype=np.intp),
        "root": root.astype(np.intp),
        "feature": np.where(leaf, -1, nodes["feature_idx"].astype(np.intp)),
        "limit": np.where(leaf, 0.0, nodes["num_threshold"]),
        "left": np.where(leaf, 0, nodes["left"].astype(np.intp) + offset),
        "right": np.where(leaf, 0, nodes["right"].astype(np.intp) + offset),
        "value": np.where(leaf, nodes["value"], 0.0),
    }


class _WindowViews:
    """The views of one window, with the counts of each for any set of relations.

    Attributes:
        quiet: [V, 4, 3] counts if no relation is reported; likely: [V] of its pairs.
    """

    def __init__(self, table: TrainingTable, likely: FloatArray, window: float) -> None:
        mine = [
            each for each in zip(table.views, table.rows, strict=True) if each[0].window == window
        ]
        self.views = [view for view, _ in mine]
        self.likely = [likely[rows] for _, rows in mine]
        self._known: dict[tuple[int, tuple[tuple[int, int], ...]], FloatArray] = {}
        self.quiet = np.array([self._count(n, ()) for n in range(len(mine))])

    def count(self, limits: FloatArray, among: Sequence[int]) -> FloatArray:
        """[V, 4, 3] counts under thresholds; of views not in `among` if nothing is reported."""
        found = self.quiet.copy()
        for n in among:
            selected = select_relations(self.likely[n], limits, self.views[n].pairs)
            found[n] = self._count(n, tuple(selected))
        return found

    def _count(self, n: int, selected: tuple[tuple[int, int], ...]) -> FloatArray:
        if (n, selected) not in self._known:
            view = self.views[n]
            said = tuple(to_relation(*view.pairs[k], PAIR_CLASSES[c]) for k, c in selected)
            counts = count_scene(view.labels, ScenePrediction(None, said), window=view.window)
            self._known[n, selected] = view.weight * np.asarray(counts.strict)
        return self._known[n, selected]


def _search_thresholds(views: _WindowViews, used: BoolArray | None = None) -> FloatArray:
    """[C] the thresholds with the best macro F1, one after the other."""
    mine = np.ones(len(views.views), dtype=np.bool_) if used is None else used
    # Where nothing reaches the least threshold, nothing is ever reported.
    open_ = [n for n in np.flatnonzero(mine).tolist()
             if views.likely[n][:, 1:].max(initial=0.0) >= _GRID[0]]  # fmt: skip
    limits = np.array(_FIRST)
    for which in _IN_TURN * _ROUNDS:
        scores = []
        for tried in _GRID:
            limits[list(which)] = tried
            f1 = _compute_f1(views.count(limits, open_)[mine].sum(axis=0))
            scores.append(_average(f1) + _NEAR_MISS * f1[KINDS.index("near_miss")])
        smooth = np.convolve(np.pad(scores, 1, mode="edge"), np.ones(3) / 3, mode="valid")
        best = np.flatnonzero(smooth >= smooth.max() - 1e-9)
        limits[list(which)] = _GRID[best[len(best) // 2]]
    return limits


def score_unseen(
    table: TrainingTable, unseen: FloatArray, window: float
) -> dict[str, tuple[float, float, float]]:
    """Compute F1 [percent] and its 95 % interval by kind on unseen folds.

    Trees and thresholds are those of the other folds.
    """
    views = _WindowViews(table, unseen, window)
    fold, counts = np.array([view.fold for view in views.views]), views.quiet.copy()
    for f in range(FOLDS):
        limits, mine = _search_thresholds(views, fold != f), fold == f
        counts[mine] = views.count(limits, np.flatnonzero(mine).tolist())[mine]
    draws = draw_resamples(len(counts), draws=DRAWS)
    drawn = np.einsum("bv,vkx->bkx", draws, counts)
    f1 = 100 * _compute_f1(np.concatenate([counts.sum(axis=0)[None], drawn]))
    by_kind = {**dict(zip(KINDS, f1.T, strict=True)), "macro": _average(f1)}
    return {k: (float(each[0]), *compute_interval(each[1:])) for k, each in by_kind.items()}


def _compute_f1(counts: FloatArray) -> FloatArray:
    """[..., 4] by kind; 0 where there is nothing to find."""
    return np.nan_to_num(compute_f1(counts))


def _average(f1: FloatArray) -> FloatArray:
    """The paper's macro F1."""
    return np.asarray(f1[..., [KINDS.index(kind) for kind in PAPER]].mean(axis=-1))


def save_trees(file: Path, trees: BoostedTrees, names: Sequence[str]) -> None:
    """Write the arrays at half their width, which is exact enough for all of them."""
    arrays: dict[str, Any] = {
        key: array.astype(np.float32 if array.dtype.kind == "f" else np.int32)
        for key, array in vars(trees).items()
    }
    np.savez_compressed(file, names=np.array(names), **arrays)


def view_all(
    view: Callable[[SceneCase], list[_View]], cases: Sequence[SceneCase], workers: int
) -> Iterator[_View]:
    """View many clips, in their order."""
    if workers == 1:
        yield from chain.from_iterable(map(view, cases))
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield from chain.from_iterable(pool.map(view, cases, chunksize=16))


def main(argv: Sequence[str] | None = None) -> None:
    """Tune on the folders named and write the calibration."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--split", choices=("dev", "all"), default="dev")
    parser.add_argument("--limit", type=int, help="so many clips at most")
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args(argv)
    split = None if given.split == "all" else given.split
    cases = [case for folder in given.folders for case in load_cases(folder, split=split)]
    scenes = sorted(cases, key=lambda case: case.code)[: given.limit]
    table = build_table(view_all(view_scene, scenes, given.workers))
    unseen = predict_unseen(table)
    found = fit_calibration(table, unseen)
    save_trees(given.out, found, NAMES)
    print(f"{len(scenes)} clips, {len(table.views)} views, {len(table.values)} pairs")
    for window, limits in zip(found.windows.tolist(), found.threshold.tolist(), strict=True):
        print(f"{window:g} s: {dict(zip(PAIR_CLASSES[1:], limits[1:], strict=True))}")
    for kind, (f1, low, high) in score_unseen(table, unseen, CHECKED).items():
        print(f"unseen at {CHECKED:g} s, {kind}: {f1:.1f} [{low:.1f}, {high:.1f}]")


if __name__ == "__main__":
    main()
