"""The strong reasoner without a language model: posteriors, sampled futures, a calibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.evals.understanding.calibration import (
    CLASSES,
    Calibration,
    chosen,
    load_calibration,
)
from scenewright.evals.understanding.features import NAMES, Pair, pairs_of
from scenewright.evals.understanding.futures import Outlook
from scenewright.evals.understanding.labels import Relation
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
    likely = trees.likely(values)
    return [Suspicion(pair, likely[n]) for n, pair in enumerate(pairs)]


def relations_of(
    found: list[Suspicion], calibration: Calibration | None = None
) -> tuple[Relation, ...]:
    """What is likely enough to be reported, the likeliest first and one for each agent."""
    trees = calibration or load_calibration()
    if not found:
        return ()
    likely = np.stack([each.likely for each in found])
    told: list[Relation] = []
    busy: set[str] = set()
    for n, c in chosen(likely, trees.threshold):
        pair = found[n].pair
        if not busy & {pair.a, pair.b}:
            told.append(_relation(pair, CLASSES[c]))
            busy |= {pair.a, pair.b}
    return tuple(told)


def _relation(pair: Pair, kind: str) -> Relation:
    if kind == "gives_a":
        return Relation("yielding", pair.a, pair.b)
    if kind == "gives_b":
        return Relation("yielding", pair.b, pair.a)
    return Relation(kind, pair.a, pair.b)
