"""How road users react to a threat, and yield: when, in which way, how strongly (SEMANTICS 8).

Sources. Reaction time: stated by SEMANTICS section 8 (lognormal, median 1.0 s, 5 to 95 % about 0.6
to 1.8 s). Recordings do not show it, as drivers there have seen one another long before.
Braking of vehicles: highest braking in the 3 s after the path TTC fell below 3 s, of 55 that braked
above 1 m/s^2 and had not before, at two intersections in Karlsruhe (TAF-BW, Zipfl et al. 2020).
What is done: 338 conflicts of right-turning vehicles and pedestrians less than 3 s apart in Utah
(Singleton et al. 2023, CC BY 4.0): of 195 drivers who braked or swerved 191 braked; of 75
pedestrians that reacted 40 stopped or slowed, 24 ran or hurried and 11 turned away.
Stated, for want of data: riders brake below the 3.5 m/s^2 of SEMANTICS; a walk at 1.4 m/s stops
within one to two steps, that is 0.5 to 1.2 s.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenewright.scene.base import AgentClass
from scenewright.scene.kinds import has_trait, list_kinds, list_shipped

PERCEPTIBLE_TTC = 3.0
"""Path TTC [s] below which a conflict is perceptible, where the line of sight is free."""


@dataclass(frozen=True)
class LogNormal:
    """A lognormal distribution cut off at both ends.

    Attributes:
        median: in the unit of what is drawn; spread: standard deviation of the logarithm.
        least, most: nothing beyond is drawn.
    """

    median: float
    spread: float
    least: float
    most: float

    def sample(self, rng: np.random.Generator) -> float:
        """One value; those beyond the ends are drawn again."""
        while True:
            value = self.median * float(np.exp(self.spread * rng.standard_normal()))
            if self.least <= value <= self.most:
                return value


REACTION_TIME = LogNormal(1.0, 0.334, 0.4, 2.4)
"""From the moment at which a conflict is perceptible to the reaction [s]."""

BRAKING: dict[AgentClass, LogNormal] = {
    "vehicle": LogNormal(3.6, 0.45, 1.2, 7.8),
    "cyclist": LogNormal(2.4, 0.25, 1.2, 3.4),
    "scooter": LogNormal(2.4, 0.25, 1.2, 3.4),
    "pedestrian": LogNormal(1.9, 0.25, 1.2, 2.8),
}
"""Highest braking of who reacts by slowing down, by class [m/s^2]."""

HURRY = LogNormal(1.5, 0.25, 1.0, 2.6)
"""Acceleration of a pedestrian running out of the way [m/s^2]; stated as for stopping."""

ASIDE = (0.45, 0.65)
"""How far to a side a driver or rider swerves that stays in its lane [m]; stated: a car of 1.85 m
in a lane of 3.2 m has 0.67 m on either side."""

RUNS = next(kind.id for kind in list_shipped("reaction") if "hurries" in kind.traits)
"""The reaction that speeds up."""

_BRAKES: dict[AgentClass, tuple[str, float]] = {
    "vehicle": ("brakes", 0.98), "cyclist": ("brakes", 1.0), "scooter": ("brakes", 1.0),
    "pedestrian": ("stops", 0.53),
}  # fmt: skip
"""What it is called that a class slows down, and how often it does, where it reacts; the other
shares are those of the kinds of reactions."""


@dataclass(frozen=True)
class Reaction:
    """What a threatened road user does.

    Attributes:
        after: perception-reaction time [s].
        strength: highest braking or, when running, acceleration [m/s^2].
    """

    kind: str
    after: float
    strength: float

    @property
    def hurries(self) -> bool:
        """Whether it speeds up."""
        return has_trait("reaction", self.kind, "hurries")

    @property
    def swerves(self) -> bool:
        """Whether it leaves its way to a side."""
        return has_trait("reaction", self.kind, "aside")


def sample_reaction(
    of: AgentClass, rng: np.random.Generator, *, kind: str | None = None
) -> Reaction:
    """One reaction of a member of a class; of this kind, if one is given."""
    others = ((k.id, k.figures.get(f"{of}_share", 0.0)) for k in list_kinds("reaction"))
    shares = dict([_BRAKES[of], *sorted((e for e in others if e[1]), key=lambda e: -e[1])])
    chosen = kind or list(shares)[int(rng.choice(len(shares), p=list(shares.values())))]
    after = REACTION_TIME.sample(rng)
    return Reaction(chosen, after, (HURRY if chosen == RUNS else BRAKING[of]).sample(rng))


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
