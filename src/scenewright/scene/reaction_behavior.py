"""How threatened road users react: after what time, in which way, how strongly (SEMANTICS 8).

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

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scenewright.scene.base import AgentClass

ReactionKind = Literal["brakes", "swerves", "stops", "steps_back", "jumps_back", "runs"]
"""A vehicle or rider brakes or swerves within its lane; a pedestrian does one of the others."""

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

BACK: dict[ReactionKind, tuple[float, float]] = {"steps_back": (0.5, 0.8), "jumps_back": (0.8, 1.1)}
BACKWARDS: dict[ReactionKind, tuple[float, float]] = {
    "steps_back": (0.7, 0.95), "jumps_back": (1.5, 1.9)
}  # fmt: skip
"""How far [m] and how fast [m/s] a pedestrian goes backwards; stated: a step or two, or a jump."""

_SHARES: dict[AgentClass, dict[ReactionKind, float]] = {
    "vehicle": {"brakes": 0.98, "swerves": 0.02},
    "cyclist": {"brakes": 1.0},
    "scooter": {"brakes": 1.0},
    "pedestrian": {"stops": 0.53, "runs": 0.32, "steps_back": 0.15},
}
"""How often each class reacts in which way, where it reacts."""


@dataclass(frozen=True)
class Reaction:
    """What a threatened road user does.

    Attributes:
        after: perception-reaction time [s].
        strength: highest braking or, when running, acceleration [m/s^2].
    """

    kind: ReactionKind
    after: float
    strength: float


def sample_reaction(
    of: AgentClass, rng: np.random.Generator, *, kind: ReactionKind | None = None
) -> Reaction:
    """One reaction of a member of a class; of this kind, if one is given."""
    shares = _SHARES[of]
    chosen = kind or list(shares)[int(rng.choice(len(shares), p=list(shares.values())))]
    after = REACTION_TIME.sample(rng)
    return Reaction(chosen, after, (HURRY if chosen == "runs" else BRAKING[of]).sample(rng))
