"""How agents yield: whether they stand, how far off and for how long, as quantiles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenewright.scene.base import AgentClass

LEVELS = (0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.98)
"""Levels of the quantiles of every measure."""

Quantiles = tuple[float, ...]


@dataclass(frozen=True)
class YieldingBehavior:
    """How agents of one class yield to agents of another, as quantiles at LEVELS.

    Attributes:
        rolls: share of those that slow without standing.
        pace: of these, lowest speed over approach speed; place: where it is driven, from the
            centre to where the centre enters the zone [m]; margin: from the other's leaving the
            zone to its own entering [s].
        gap: of those that stand, from the front to the zone or the stop line ahead, the nearer
            one [m]; stands: for how long [s]; reacts: from the other's leaving the zone to its
            own start [s].
    """

    rolls: float
    pace: Quantiles
    place: Quantiles
    margin: Quantiles
    gap: Quantiles
    stands: Quantiles
    reacts: Quantiles


YieldingModel = Mapping[tuple[AgentClass, AgentClass], YieldingBehavior]
"""By the class that yields and the class that has the right of way."""


def sample_quantiles(quantiles: Quantiles, rng: np.random.Generator) -> float:
    """One value: between the quantiles evenly, none beyond the outermost."""
    return float(np.interp(rng.uniform(LEVELS[0], LEVELS[-1]), LEVELS, quantiles))
