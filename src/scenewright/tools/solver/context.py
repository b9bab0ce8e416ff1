"""Shared context of scheduling every kind of clause: a tuple of candidates, its nearest misses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, field
from enum import IntEnum
from functools import cached_property, lru_cache

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.candidates import Candidate, Path
from scenewright.scene.constraints import AgentFigure, PairClause, PairFigure, TimeGap
from scenewright.scene.reaction_behavior import YieldingBehavior, YieldingModel
from scenewright.scene.track import STEP, Shape
from scenewright.tools.solver.impact import FirstContact, find_first_contact
from scenewright.tools.solver.path_conflict import (
    Intervals,
    PathConflict,
    find_conflict_intervals,
    find_path_conflict,
)
from scenewright.tools.solver.reactions import ReactionRequests, find_threat
from scenewright.tools.solver.scheduled_agent import (
    Pairing,
    PartialSchedule,
    ScheduledAgent,
    get_pair,
)


class FailureStage(IntEnum):
    """What a clause failed on, in the order in which it is scheduled; later is nearer.

    The paths or the motions of the two; the kind of contact; the striking agent; the place; a
    figure asked for; what the two do besides.
    """

    PATHS = 0
    KIND = 1
    ROLES = 2
    PLACE = 3
    MEASURE = 4
    COMPANY = 5


@dataclass(frozen=True)
class NearestMiss:
    """The nearest miss of one clause.

    Attributes:
        reached: what it failed on.
        words: the quantity at fault, what was asked for and what is possible.
        off: how far what is possible lies from what was asked, in the unit of the quantity.
    """

    clause: PairClause
    reached: FailureStage
    words: str
    off: float = 0.0


class NearestMisses:
    """The nearest miss of every clause that was tried, and which clauses were met."""

    def __init__(self) -> None:
        self._nearest: dict[PairClause, NearestMiss] = {}
        self._served: set[PairClause] = set()

    def note(self, shortfall: NearestMiss) -> None:
        """Keep it if it is the nearest of its clause so far."""
        known = self._nearest.get(shortfall.clause, shortfall)
        self._nearest[shortfall.clause] = min(
            known, shortfall, key=lambda each: (-each.reached, each.off)
        )

    def note_met(self, clause: PairClause) -> None:
        """Note that the clause was met at least once."""
        self._served.add(clause)

    def find_culprit(self, clauses: Iterable[PairClause]) -> NearestMiss | None:
        """Find the nearest miss of the first clause, in order of scheduling, that was never met."""
        for clause in clauses:
            if clause not in self._served:
                return self._nearest.get(clause)
        return None


QUEUED_BEHIND = 1.5
"""Gap [m] of a vehicle that stands behind another and is pushed into it, at most."""

APART = (-9.0, 9.0)
"""How much later than others a pair or group without earlier events comes [s]."""

SPACING = {"vehicle": 0.25, "pedestrian": 0.12}
"""Distance between nodes of a path [m] where a PET is measured."""


@dataclass(eq=False)
class SolverContext:
    """One tuple of candidates, with a random generator and a record of failures.

    Attributes:
        candidates, landmarks: by agent.
        rng: draws among the many placements that satisfy a clause.
        lenient: agents may also wait in the middle of the road, or as long as fits best.
        misses: where the nearest miss of every clause is noted.
        yielding_model: how agents give way here; without one they stand a while near the zone.
        red_light_starts: the agents that wait at red before anything happens.
        figures: what is asked for of the agents' motion and of what happens between them.
        reactions: what is asked for of reactions to threats.
        strikers: of pairs that collide, the agent that strikes and the one that is struck.
        busy: agents of several clauses; pushed: into whom agents are; pets: what clauses ask for.
    """

    candidates: Mapping[str, Candidate]
    landmarks: Mapping[str, Landmarks]
    rng: np.random.Generator
    _: KW_ONLY
    lenient: bool = True
    misses: NearestMisses = field(default_factory=NearestMisses)
    yielding_model: YieldingModel = field(default_factory=dict)
    red_light_starts: Mapping[str, ScheduledAgent] = field(default_factory=dict)
    figures: tuple[AgentFigure | PairFigure, ...] = ()
    reactions: ReactionRequests = field(default_factory=ReactionRequests)
    strikers: frozenset[Pairing] = frozenset()
    busy: frozenset[str] = frozenset()
    pushed: Mapping[str, str] = field(default_factory=dict)
    pets: Mapping[Pairing, TimeGap] = field(default_factory=dict)
    do_lights_allow: Callable[[PartialSchedule], bool] = lambda _: True

    @cached_property
    def left_hand(self) -> bool:
        """Whether people drive on the left."""
        return any(landmark.left_hand for landmark in self.landmarks.values())

    def get_agent(self, name: str, schedule: PartialSchedule) -> ScheduledAgent:
        """Return the agent as placed; else its free motion, or first a wait at red."""
        if name in schedule.actors:
            return schedule.actors[name]
        if name in self.red_light_starts:
            return self.red_light_starts[name]
        return self.build_free(name)

    def build_free(self, name: str) -> ScheduledAgent:
        """Build the agent with its free motion, entering at time 0."""
        return ScheduledAgent.build_unplaced(self.candidates[name], self.landmarks[name])

    def find_room_ahead(self, name: str) -> float:
        """Find how far behind its place a vehicle stands that is pushed into another [m]; else
        0."""
        ahead = self.pushed.get(name)
        if ahead is None:
            return 0.0
        lengths = (self.candidates[each].shape.length for each in (name, ahead))
        return sum(lengths) / 2 + QUEUED_BEHIND

    def get_pair(
        self, clause: PairClause, schedule: PartialSchedule
    ) -> tuple[ScheduledAgent, ScheduledAgent]:
        """Return the clause's two agents."""
        first, second = get_pair(clause)
        a, b = self.get_agent(first, schedule), self.get_agent(second, schedule)
        if schedule.actors and not {first, second} & set(schedule.actors):
            # Neither is bound to a placed agent, so they may come at any time.
            a = a.shift(float(self.rng.uniform(*APART)))
        return a, b

    def get_yielding(self, clause: PairClause) -> YieldingBehavior | None:
        """Return how agents of `first`'s class give way to those of `second`'s class."""
        first, second = (self.candidates[name].route.type for name in get_pair(clause))
        return self.yielding_model.get((first, second))

    def find_first_contact(self, a: ScheduledAgent, b: ScheduledAgent) -> FirstContact | None:
        """Find the first contact of two placed agents; None if they never touch."""
        return find_first_contact(a, b, left_hand=self.left_hand)

    def find_threat(
        self, clause: PairClause, a: ScheduledAgent, b: ScheduledAgent, *, until: float
    ) -> tuple[float, float] | None:
        """Find from when to when [s] the conflict of the two is perceptible before `until`."""
        lead = self.reactions.hidden.get(frozenset(get_pair(clause)))
        nodes = find_contact_nodes(a.candidate, b.candidate)
        return find_threat(nodes, a, b, until=until, lead=lead)

    def get_requested_pet(self, clause: PairClause) -> TimeGap | None:
        """Return the PET asked for between the clause's two agents, by a clause of its own."""
        return self.pets.get(get_pair(clause)) or self.pets.get(get_pair(clause)[::-1])

    def find_figure(self, name: str, *agents: str) -> AgentFigure | PairFigure | None:
        """Find the figure of this name that is asked for of these agents."""
        for figure in self.figures:
            of = (
                (figure.agent,)
                if isinstance(figure, AgentFigure)
                else (figure.first, figure.second)
            )
            if figure.clause == name and of == agents:
                return figure
        return None

    def find_striker(self, clause: PairClause) -> int | None:
        """Find which of the clause's two agents strikes: 0, 1, or None where either may."""
        pair = get_pair(clause)
        return next((k for k in (0, 1) if (pair[k], pair[1 - k]) in self.strikers), None)

    def wants_impact_point(self, clause: PairClause) -> bool:
        """Return whether an impact point in per cent is asked for."""
        pair = set(get_pair(clause))
        points = (c for c in self.figures if isinstance(c, PairFigure) and "_point" in c.clause)
        return any({point.first, point.second} == pair for point in points)

    def note_miss(
        self, clause: PairClause, reached: FailureStage, words: str, *, off: float = 0.0
    ) -> None:
        """Note a miss of the clause."""
        self.misses.note(NearestMiss(clause, reached, words, off))

    def note_paths_apart(self, clause: PairClause) -> None:
        """Note that the paths of the clause's two agents never touch."""
        words = f"the paths of {clause.first} and {clause.second} never touch"
        self.note_miss(clause, FailureStage.PATHS, words)

    def refuse_after_collision(
        self, clause: PairClause, a: ScheduledAgent, b: ScheduledAgent
    ) -> bool:
        """Return whether a collision has ended one of the two, and note that as a miss."""
        if a.contact is None and b.contact is None:
            return False
        first, second = get_pair(clause)
        words = f"one of {first} and {second} has been in a collision before"
        self.note_miss(clause, FailureStage.PATHS, words)
        return True


def find_contact_nodes(a: Candidate, b: Candidate) -> PathConflict:
    """Find where agents on two paths would touch, with the resolution of a PET."""
    spacing = (SPACING[a.route.type], SPACING[b.route.type])
    return _find_contact_nodes(a.path, b.path, (a.shape, b.shape), spacing)


@lru_cache(maxsize=64)
def _find_contact_nodes(
    a: Path, b: Path, shapes: tuple[Shape, Shape], spacing: tuple[float, float]
) -> PathConflict:
    """Find them of paths that are known by identity: agents of many paces try the same one."""
    return find_path_conflict(a, b, shapes=shapes, reach=0.0, spacing=spacing)


def find_meetings(a: ScheduledAgent, b: ScheduledAgent) -> Intervals:
    """Find offsets o_b - o_a [s] at which the two meet as they move."""
    nodes = find_contact_nodes(a.candidate, b.candidate)
    return find_conflict_intervals(nodes, a.motion, b.motion)


def find_touch(a: Candidate, b: Candidate, s: float) -> float | None:
    """Find where [m] the first touches the second standing at `s`; None in another lane."""
    nodes = find_contact_nodes(a, b)
    standing = np.abs(nodes.s_b[nodes.j] - s) < 0.3
    return float(nodes.s_a[nodes.i[standing]].min()) if standing.any() else None


def is_in_range(low: float, high: float, value: float) -> bool:
    """Return whether the value is as asked, to the step; between placed agents it may not be."""
    return low - STEP <= value <= high + STEP


def compute_excess(low: float, high: float, value: float) -> float:
    """Compute how far the value lies outside of the range."""
    return max(low - value, value - high, 0.0)
