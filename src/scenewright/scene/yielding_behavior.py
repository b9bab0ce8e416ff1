"""How people give way: whether they stand, how far off and for how long, as quantiles."""

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
    """What was seen of those of one class who gave way to those of another.

    Attributes:
        rolls: share of those who slowed without standing.
        pace: of these, lowest speed over approach speed; place: where it was driven, from the
            centre to where the centre enters the zone [m]; margin: from the other's leaving the
            zone to its own entering [s].
        gap: of those who stood, from the front to the zone or the stop line ahead, whichever is
            nearer [m]; stands: for how long [s]; reacts: from the other's leaving the zone to its
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
"""By class of who gives way and of who is let pass."""


def sample_quantiles(quantiles: Quantiles, rng: np.random.Generator) -> float:
    """One value: between the quantiles evenly, none beyond the outermost."""
    return float(np.interp(rng.uniform(LEVELS[0], LEVELS[-1]), LEVELS, quantiles))
