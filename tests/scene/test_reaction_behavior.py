"""How people react is drawn from what its sources say."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ndtr

from scenewright.scene.reaction_behavior import (
    BRAKING,
    REACTION_TIME,
    LogNormal,
    sample_reaction,
)


def compute_cdf(law: LogNormal, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Probability of less than each value, by the closed form of the cut lognormal."""
    ends, at = (
        ndtr(np.log(np.asarray(each) / law.median) / law.spread)
        for each in ((law.least, law.most), np.clip(values, law.least, law.most))
    )
    return np.asarray((at - ends[0]) / (ends[1] - ends[0]))


def test_reaction_times_have_the_quantiles_that_semantics_states() -> None:
    at = compute_cdf(REACTION_TIME, np.array([0.6, 1.0, 1.8]))

    assert at == pytest.approx([0.06, 0.5, 0.96], abs=0.02)


def test_what_is_drawn_follows_the_distribution() -> None:
    drawn = [sample_reaction("vehicle", np.random.default_rng(k)) for k in range(2000)]

    order = np.sort([each.strength for each in drawn])
    steps = (np.arange(len(order)) + 0.5) / len(order)
    assert np.abs(compute_cdf(BRAKING["vehicle"], order) - steps).max() < 0.04
    assert 0.96 < np.mean([each.kind == "brakes" for each in drawn]) < 1.0
