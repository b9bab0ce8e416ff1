"""What the serving of every kind of clause works with: one tuple of candidates and its meetings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.candidates import Candidate
from scenewright.scene.constraints import PairClause, TimeGap
from scenewright.scene.track import STEP
from scenewright.scene.yielding_behavior import YieldingBehavior, YieldingModel
from scenewright.tools.solver.encounter import Encounter, Intervals, encounter, meeting_offsets
from scenewright.tools.solver.nearest_miss import Reached, Shortfall, Shortfalls
from scenewright.tools.solver.schedule import Pairing, Staging, pair_of
from scenewright.tools.solver.scheduled_agent import Actor

_APART = (-9.0, 9.0)
"""How much later than others a pair comes that has nothing to do with them [s]."""

SPACING = {"vehicle": 0.25, "pedestrian": 0.12}
"""Distance between nodes of a path [m] where a PET is measured."""


class Setting:
    """One tuple of candidates, with chance and a memory of what failed.

    Args:
        candidates, marks: by agent.
        rng: draws among the many placements that serve a clause.
        lenient: people may also wait in the middle of the road, or as long as fits best.
        clauses: everything that is to hold, as a PET asked for shapes the clause it goes with.
        shortfalls: where nearest misses are noted.
        habits: how people give way here; where nobody knows, they stand a while near the zone.
        openings: those who wait at red before anything happens.
    """

    def __init__(
        self,
        candidates: Mapping[str, Candidate],
        marks: Mapping[str, Landmarks],
        rng: np.random.Generator,
        *,
        lenient: bool = True,
        shortfalls: Shortfalls | None = None,
        habits: YieldingModel | None = None,
        openings: Mapping[str, Actor] | None = None,
    ) -> None:
        self.openings = openings or {}
        self.habits: YieldingModel = {} if habits is None else habits
        self.busy: frozenset[str] = frozenset()
        self.candidates = candidates
        self.lenient = lenient
        self.rng = rng
        self.shortfalls = shortfalls or Shortfalls()
        self.pets: dict[Pairing, TimeGap] = {}
        self.left_hand = any(each.left_hand for each in marks.values())
        self._marks = marks
        self._encounters: dict[Pairing, Encounter] = {}

    def actor(self, name: str, staging: Staging) -> Actor:
        """As placed; else as it opens: its time law's motion, or first a wait at red."""
        if name in staging.actors:
            return staging.actors[name]
        if name in self.openings:
            return self.openings[name]
        return Actor.unplaced(self.candidates[name], self._marks[name])

    def both(self, clause: PairClause, staging: Staging) -> tuple[Actor, Actor]:
        """The clause's two agents."""
        first, second = pair_of(clause)
        a, b = self.actor(first, staging), self.actor(second, staging)
        if staging.actors and not {first, second} & set(staging.actors):
            # The two have nothing to do with those on stage, so they may come at any time.
            a = a.shifted(float(self.rng.uniform(*_APART)))
        return a, b

    def manners(self, clause: PairClause) -> YieldingBehavior | None:
        """How those of the class of `first` give way to those of the class of `second`."""
        first, second = (self.candidates[name].route.type for name in pair_of(clause))
        return self.habits.get((first, second))

    def encounter(self, clause: PairClause) -> Encounter:
        """Where the two paths come close."""
        key = pair_of(clause)
        if key not in self._encounters:
            a, b = (self.candidates[name] for name in key)
            self._encounters[key] = close_encounter(a, b)
        return self._encounters[key]

    def meetings(self, clause: PairClause, a: Actor, b: Actor) -> Intervals:
        """Offsets o_b - o_a [s] that bring the two together."""
        return meeting_offsets(self.encounter(clause), a.motion, b.motion, c=0.0, exact=True)

    def pet_of(self, clause: PairClause) -> TimeGap | None:
        """The PET asked for between the clause's two agents, by a clause of its own."""
        return self.pets.get(pair_of(clause)) or self.pets.get(pair_of(clause)[::-1])

    def missed(self, clause: PairClause, reached: Reached, words: str, *, off: float = 0.0) -> None:
        """Notes a miss of the clause."""
        self.shortfalls.note(Shortfall(clause, reached, words, off))


def close_encounter(a: Candidate, b: Candidate) -> Encounter:
    """Where two paths come within 0.1 m, as finely as a PET wants it."""
    spacing = (SPACING[a.route.type], SPACING[b.route.type])
    return encounter(a.path, b.path, shapes=(a.shape, b.shape), reach=0.0, spacing=spacing)


def in_range(low: float, high: float, value: float) -> bool:
    """Whether the value is as asked, to the step; one between two already placed may not be."""
    return low - STEP <= value <= high + STEP


def outside(low: float, high: float, value: float) -> float:
    """How far the value lies outside of the range."""
    return max(low - value, value - high, 0.0)
