"""The strong reasoner without a language model: posteriors, sampled futures, a calibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.evals.understanding.calibration import Calibration, chosen, load_calibration
from scenewright.evals.understanding.features import NAMES, Pair, pairs_of
from scenewright.evals.understanding.futures import Outlook
from scenewright.evals.understanding.labels import Relation
from scenewright.evals.understanding.together import CLASSES
from scenewright.scene.base import FloatArray


@dataclass(frozen=True, eq=False)
class Suspicion:
    """A pair, how likely each relation is [C], and when they would touch [s from now]."""

    pair: Pair
    likely: FloatArray


def suspicions(
    seen: Outlook, *, window: float, calibration: Calibration | None = None
) -> list[Suspicion]:
    """How likely every pair is to have each relation."""
    trees = calibration or load_calibration()
    pairs = pairs_of(seen, window=window)
    values = np.array([pair.values for pair in pairs]).reshape(len(pairs), len(NAMES))
    likely = trees.in_scene(values, [(pair.a, pair.b) for pair in pairs])
    return [Suspicion(pair, likely[n]) for n, pair in enumerate(pairs)]


def relations_of(
    found: list[Suspicion], *, window: float, calibration: Calibration | None = None
) -> tuple[Relation, ...]:
    """What is likely enough to be reported, the likeliest first and one for each agent."""
    trees = calibration or load_calibration()
    if not found:
        return ()
    likely = np.stack([each.likely for each in found])
    pairs = [(each.pair.a, each.pair.b) for each in found]
    told = chosen(likely, trees.limits(window), pairs)
    return tuple(relation(*pairs[n], CLASSES[c]) for n, c in told)


def relation(a: str, b: str, kind: str) -> Relation:
    """A relation by the class of its pair."""
    if kind == "gives_a":
        return Relation("yielding", a, b)
    if kind == "gives_b":
        return Relation("yielding", b, a)
    return Relation(kind, a, b)
