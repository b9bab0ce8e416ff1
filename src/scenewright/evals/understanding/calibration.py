"""The reasoner without a language model: from the features of all pairs of a scene to relations.

Boosted trees look at every pair by itself. What is likely enough is reported, the likeliest first,
and no agent has two events at once. Trees and thresholds are fitted by `lab.understanding.tuning`
on development halves alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.special import softmax

from scenewright.evals.understanding.boosted_trees import BoostedTrees
from scenewright.evals.understanding.cases import PairRelation
from scenewright.evals.understanding.forecast import AgentForecast
from scenewright.evals.understanding.pair_features import (
    NAMES,
    compute_pair_features,
    mirror_features,
)
from scenewright.scene.base import FloatArray

_SHIPPED = Path(__file__).with_name("calibration.npz")
PAIR_CLASSES = ("none", "collision", "near_miss", "gives_a", "gives_b")
"""The relation of a pair: none, a collision, a near miss, or that a, or b, gives way."""
SWAPPED = np.array((0, 1, 2, 4, 3))
"""The classes with a and b swapped."""


@dataclass(frozen=True, eq=False)
class Calibration(BoostedTrees):
    """The trees and the thresholds.

    Attributes:
        windows: [W] ascending [s]; threshold: [W, C] probability from which a relation is reported.
    """

    windows: FloatArray
    threshold: FloatArray

    def interpolate_thresholds(self, window: float) -> FloatArray:
        """[C] thresholds after a window [s], linear between those known."""
        return np.array([np.interp(window, self.windows, each) for each in self.threshold.T])

    def predict_pairs(self, values: FloatArray) -> FloatArray:
        """[N, C] class probabilities of pairs [N, F], whichever of both is a."""
        there, back = (
            softmax(self.score(rows), axis=1) for rows in (values, mirror_features(values))
        )
        return np.asarray((there + back[:, SWAPPED]) / 2)


@lru_cache(maxsize=2)
def load_calibration(file: Path = _SHIPPED) -> Calibration:
    """Load the calibration in a file; the shipped one if none is named.

    Raises:
        InputError: missing, damaged, or for other features.
    """
    return Calibration.load(file, names=NAMES, what="calibration")


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


def predict_relations(
    futures: Sequence[AgentForecast], *, window: float
) -> tuple[PairRelation, ...]:
    """Predict the relations that are likely enough, the likeliest first, one for each agent.

    Args:
        futures: of all agents; window: length of the observation [s].
    """
    trees, (pairs, values) = load_calibration(), compute_pair_features(futures, window)
    if not pairs:
        return ()
    likely = trees.predict_pairs(values)
    selected = select_relations(likely, trees.interpolate_thresholds(window), pairs)
    return tuple(to_relation(*pairs[n], PAIR_CLASSES[c]) for n, c in selected)


def to_relation(a: str, b: str, kind: str) -> PairRelation:
    """Convert the class of a pair to a relation."""
    if kind == "gives_b":
        return PairRelation("yielding", b, a)
    return PairRelation("yielding" if kind == "gives_a" else kind, a, b)
