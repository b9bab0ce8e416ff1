"""The classifier two-sample test: how often a classifier separates two data sets.

Windows of both are matched by what the agent does and how fast it is, then boosted trees learn to
separate them on four fifths of the scenes and are tested on the others. 0.5 is chance. The floor
is what the same test finds between halves of one recording, and between two recordings of real
traffic (Lopez-Paz & Oquab 2017).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.bootstrap import compute_interval, draw_resamples
from scenewright.evals.realism.motion_windows import Windows
from scenewright.scene.base import FloatArray

FEWEST = 40
"""Least number of windows on either side for a test."""
MOST = 2500
"""Largest number of windows used on either side."""
_FOLDS = 5
_DRAWS = 200


@dataclass(frozen=True)
class Separability:
    """How well a classifier separates two sets of windows.

    Attributes:
        auc: area under the ROC curve, each scene scored by a classifier not trained on it; low,
            high: 95 % interval over resampled scenes; n: windows a side; groups: scenes.
    """

    auc: float
    low: float
    high: float
    n: int
    groups: int


def compare_windows(one: Windows, other: Windows, *, seed: int = 0) -> dict[str, Separability]:
    """Run the test over all situations (key "all") and for each that has enough windows.

    Empty where too few windows can be matched.
    """
    from sklearn import ensemble, model_selection

    rng = np.random.default_rng(seed)
    first, second = _match_windows(one, other, rng)
    label = np.repeat([0, 1], [len(first), len(second)])
    names = [
        f"{k} {name}" for k, side in enumerate((first, second)) for name in side.group.tolist()
    ]
    group = np.unique(names, return_inverse=True)[1]
    few = min(len(np.unique(group[label == k])) for k in (0, 1)) < _FOLDS
    if few or min(len(first), len(second)) < FEWEST:
        return {}
    features = np.concatenate([first.features, second.features])
    # Scores of boosted trees that were not trained on the window's scene.
    score = np.zeros(len(label))
    folds = model_selection.StratifiedGroupKFold(_FOLDS, shuffle=True, random_state=seed)
    for seen, asked in folds.split(features, label, group):
        trees = ensemble.HistGradientBoostingClassifier(
            max_iter=80, max_leaf_nodes=15, min_samples_leaf=15, early_stopping=False,
            random_state=seed,
        )  # fmt: skip
        trees.fit(features[seen], label[seen])
        score[asked] = trees.predict_proba(features[asked])[:, 1]
    situation = np.concatenate([first.situation, second.situation])
    kinds = {"all": np.ones(len(label), dtype=np.bool_)}
    kinds |= {str(each): situation == each for each in np.unique(situation)}
    found = {}
    for name, chosen in kinds.items():
        own, asked, scenes = score[chosen], label[chosen], group[chosen]
        if np.bincount(asked, minlength=2).min() < FEWEST:
            continue
        units, number = np.unique(scenes, return_inverse=True)
        draws = draw_resamples(len(units), draws=_DRAWS, seed=seed)
        again = [compute_auc(own, asked, drawn[number].astype(np.float64)) for drawn in draws]
        auc = compute_auc(own, asked, np.ones(len(asked)))
        interval = compute_interval(np.array(again))
        found[name] = Separability(auc, *interval, int((asked == 0).sum()), len(units))
    return found


def split_halves(windows: Windows) -> tuple[Windows, Windows]:
    """Split a source into two halves by its groups, for the floor of the test."""
    names = np.unique(windows.group)
    chosen = np.random.default_rng(0).permutation(names)[: len(names) // 2]
    inside = np.isin(windows.group, chosen)
    return windows.select(inside), windows.select(~inside)


def _match_windows(
    one: Windows, other: Windows, rng: np.random.Generator
) -> tuple[Windows, Windows]:
    """Draw equally many windows of each situation and band of speed from both sides."""
    cells = [
        [f"{s} {b}" for s, b in zip(each.situation.tolist(), each.band.tolist(), strict=True)]
        for each in (one, other)
    ]
    kept: tuple[list[int], list[int]] = ([], [])
    for cell in sorted(set(cells[0]) & set(cells[1])):
        rows = [rng.permutation([k for k, c in enumerate(side) if c == cell]) for side in cells]
        count = min(map(len, rows))
        for k, found in enumerate(rows):
            kept[k].extend(found[:count].tolist())
    share = min(1.0, MOST / max(len(kept[0]), 1))
    chosen = np.sort(rng.permutation(len(kept[0]))[: round(share * len(kept[0]))])
    return tuple(
        each.select(np.array(side, dtype=np.int64)[chosen])
        for each, side in zip((one, other), kept, strict=True)
    )  # type: ignore[return-value]


def compute_auc(score: FloatArray, label: NDArray[np.int64], weight: FloatArray) -> float:
    """Chance that a window of the second kind scores above one of the first; ties count half.

    Args:
        score, label, weight: [W]; label 0 or 1. NaN where one kind has no weight.
    """
    from sklearn import metrics

    kept = weight > 0
    if len(np.unique(label[kept])) < 2:
        return float("nan")
    return float(metrics.roc_auc_score(label[kept], score[kept], sample_weight=weight[kept]))
