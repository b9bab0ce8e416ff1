"""Staging the foreground: spawn times and edits under which every relation happens.

Each pair clause of the constraint language is a target set for delta, the difference of the two
agents' entry times (see `encounter`). Clauses are served in order, depth first: an agent already
placed keeps its time, the other one gets the delta that the clause wants.

    contact    delta inside C(0), the first contact of the wanted kind
    time_gap   delta at the wanted distance outside C(0)
    headway    delta just behind C(0) of a shared lane
    gives_way  `first` is held upstream of the zone until `second` has left it; delta such that,
               unheld, it would have been there while `second` was (SEMANTICS 4, cause)
    brakes_for delta inside C(0) of the free motions, outside of it once `first` brakes hard
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.candidates import Candidate
from scenewright.scene.constraints import (
    BrakesFor,
    Contact,
    GivesWay,
    Headway,
    PairClause,
    TimeGap,
)
from scenewright.scene.selection import Stop
from scenewright.scene.yielding_behavior import YieldingModel
from scenewright.tools.map_grounding.signal_plan import Demand
from scenewright.tools.solver.contact import contacts
from scenewright.tools.solver.context import Setting, close_encounter
from scenewright.tools.solver.encounter import meeting_offsets
from scenewright.tools.solver.entry_times import START_LAG
from scenewright.tools.solver.hard_braking import brakings
from scenewright.tools.solver.nearest_miss import Shortfalls
from scenewright.tools.solver.schedule import Staging, pair_of
from scenewright.tools.solver.scheduled_agent import Actor
from scenewright.tools.solver.time_gaps import headways, time_gaps
from scenewright.tools.solver.yielding import yields

_SLOWS = 5.5
"""How long before a stop [s] the light must not explain it."""


class Stage:
    """Serves pair clauses for one tuple of candidates.

    Args:
        candidates, marks: by agent.
        rng: draws among the many placements that serve a clause.
        lenient: people may also wait in the middle of the road, or as long as fits best.
        shortfalls: where the nearest miss of every clause is noted.
        habits: how people give way here.
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
        self._setting = Setting(
            candidates, marks, rng, lenient=lenient, shortfalls=shortfalls, habits=habits,
            openings=openings,
        )  # fmt: skip

    def play(self, clauses: tuple[PairClause, ...], staging: Staging) -> Iterator[Staging]:
        """Every staging (lazily, several per clause) under which all clauses hold, in order."""
        gaps = [each for each in clauses if isinstance(each, TimeGap)]
        self._setting.pets = {pair_of(each): each for each in gaps}
        named = Counter(name for each in clauses for name in pair_of(each))
        self._setting.busy = frozenset(name for name, count in named.items() if count > 1)
        # A PET asked for on top of another relation of the two is looked at when that is placed.
        ordered = sorted(clauses, key=lambda each: each in gaps and _bound(each, clauses))
        yield from self._play(tuple(ordered), staging)

    def _play(self, clauses: tuple[PairClause, ...], staging: Staging) -> Iterator[Staging]:
        if not clauses:
            yield staging
            return
        first, *others = clauses
        for staged in _served(first, staging, self._setting):
            self._setting.shortfalls.served(first)
            yield from self._play(tuple(others), staged)


def _served(clause: PairClause, staging: Staging, setting: Setting) -> Iterator[Staging]:
    match clause:
        case Contact():
            return contacts(clause, staging, setting)
        case TimeGap():
            return time_gaps(clause, staging, setting)
        case Headway():
            return headways(clause, staging, setting)
        case GivesWay():
            return yields(clause, staging, setting)
        case BrakesFor():
            return brakings(clause, staging, setting)
        case _:
            raise ValueError(f"{clause.clause} is not staged")


def _bound(gap: PairClause, clauses: tuple[PairClause, ...]) -> bool:
    """Whether another clause relates the same two agents."""
    pair = set(pair_of(gap))
    return any(set(pair_of(each)) == pair for each in clauses if not isinstance(each, TimeGap))


def passes_first(first: Actor, second: Actor) -> bool:
    """Whether `first` has left the pair's conflict zone before `second` enters it."""
    pair = close_encounter(first.candidate, second.candidate)
    meetings = meeting_offsets(pair, first.motion, second.motion, c=0.0, exact=True)
    delta = second.enters - first.enters
    return bool(len(meetings) and delta >= meetings[:, 1].max())


def demands(actor: Actor, *, violates: bool, until: float) -> tuple[Demand, ...]:
    """What the signal plan must show for this actor: to obey it, or to run its red light."""
    line, group = actor.marks.line, actor.marks.group
    if line is None or group is None:
        return ()
    found = [_red_while(stop, actor, group, until) for stop in actor.stops if stop.at_red]
    crosses = actor.enters + actor.motion.time_at(line)
    if not np.isfinite(crosses) or crosses > until or crosses < -25.0:
        return tuple(found)
    if violates:
        # Who slows at a light that is not green waits for the light.
        slows = [each.start for each in actor.stops if each.reason == "gives_way" and each.s < line]
        found += [Demand(group, start - _SLOWS, start + 0.3, ("green",)) for start in slows]
        return (*found, Demand(group, crosses - 0.5, crosses + 0.4, ("red",)))
    near = [stop for stop in actor.stops if abs(stop.s - line) < 2.0]
    waits = [stop.start - _SLOWS for stop in near if not stop.at_red]
    starts = [stop.until - START_LAG[0] for stop in near if stop.at_red]
    begins = min([crosses - 0.2, *waits, *starts])
    return (*found, Demand(group, begins, crosses + 0.5, ("green",)))


def _red_while(stop: Stop, actor: Actor, group: str, until: float) -> Demand:
    """Red from before the agent slows for its stop until it is hit, or until the light changes.

    Where it has started before the scene begins, red just before that.
    """
    turns = stop.until - START_LAG[1]
    if actor.contact is not None and actor.contact <= stop.until:
        turns = actor.contact
    ends = min(turns, until)
    return Demand(group, min(max(stop.start - 2.0, 0.0), ends), ends, ("red",))
