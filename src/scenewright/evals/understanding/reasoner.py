"""The reasoner without a language model: posteriors, sampled futures, a calibration."""

from __future__ import annotations

import numpy as np

from scenewright.evals.understanding.calibration import (
    Calibration,
    load_calibration,
    select_relations,
)
from scenewright.evals.understanding.forecast import SceneForecast
from scenewright.evals.understanding.labels import PairRelation
from scenewright.evals.understanding.pair_features import compute_pair_features
from scenewright.evals.understanding.scene_model import PAIR_CLASSES


def predict_relations(
    forecast: SceneForecast, *, window: float, calibration: Calibration | None = None
) -> tuple[PairRelation, ...]:
    """Predict the relations that are likely enough, the likeliest first, one for each agent.

    Args:
        window: length of the observation [s]; calibration: the shipped one if None.
    """
    trees, features = calibration or load_calibration(), compute_pair_features(forecast, window)
    if not features:
        return ()
    pairs = [(each.a, each.b) for each in features]
    likely = trees.predict_scene(np.array([each.values for each in features]), pairs)
    selected = select_relations(likely, trees.interpolate_thresholds(window), pairs)
    return tuple(to_relation(*pairs[n], PAIR_CLASSES[c]) for n, c in selected)


def to_relation(a: str, b: str, kind: str) -> PairRelation:
    """Convert the class of a pair to a relation."""
    if kind == "gives_b":
        return PairRelation("yielding", b, a)
    return PairRelation("yielding" if kind == "gives_a" else kind, a, b)
