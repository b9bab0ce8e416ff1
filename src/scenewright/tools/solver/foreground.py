"""Scheduling of the foreground: entry times and edits under which every relation holds.

Each pair clause of the constraint language is a target set for delta, the difference of the two
agents' entry times (see `path_conflict`). Clauses are scheduled in order, depth first: a placed
agent keeps its time, the other one gets the delta that the clause needs.

    contact    delta inside C(0), the first contact of the wanted kind
    time_gap   delta at the wanted distance outside C(0)
    headway    delta just behind C(0) of a shared lane
    gives_way  `first` is held upstream of the zone until `second` has left it; delta such that,
               unheld, it would have been there while `second` was (SEMANTICS 4, cause)
    passes_beside  delta that brings both abreast where their paths lie side by side
    brakes_for delta inside C(0) of the free motions, outside of it once `first` brakes hard
    stops_behind  delta such that `first` answers the braking of `second` a reaction time later
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from itertools import chain
from typing import Any

from scenewright.scene.constraints import (
    BrakesFor,
    Contact,
    GivesWay,
    Headway,
    PairClause,
    PassesBeside,
    StopsBehind,
    TimeGap,
)
from scenewright.scene.kinds import has_trait
from scenewright.tools.solver.contact import schedule_contacts
from scenewright.tools.solver.context import SolverContext, find_contact_nodes
from scenewright.tools.solver.following import schedule_headways, schedule_stops_behind
from scenewright.tools.solver.hard_braking import schedule_hard_braking
from scenewright.tools.solver.independent_events import join_schedules, split_clauses
from scenewright.tools.solver.path_conflict import find_conflict_intervals
from scenewright.tools.solver.schedule import PartialSchedule, get_pair
from scenewright.tools.solver.scheduled_agent import ScheduledAgent
from scenewright.tools.solver.time_gaps import schedule_overtakings, schedule_time_gaps
from scenewright.tools.solver.yielding import schedule_yields
from scenewright.work_limit import count_work

_CLEARLY = 0.2
"""How much earlier [s] the first agent in the zone of a collision must be there."""


_Scheduler = Callable[[Any, PartialSchedule, SolverContext], Iterator[PartialSchedule]]
_SCHEDULERS: dict[type[PairClause], _Scheduler] = {
    Contact: schedule_contacts,
    TimeGap: schedule_time_gaps,
    Headway: schedule_headways,
    GivesWay: schedule_yields,
    PassesBeside: schedule_overtakings,
    BrakesFor: schedule_hard_braking,
    StopsBehind: schedule_stops_behind,
}


class ForegroundSolver:
    """Schedules pair clauses for one tuple of candidates.

    Attributes:
        unscheduled: agents of the part that cannot be scheduled, where others share none of them.
    """

    unscheduled: frozenset[str] = frozenset()

    def __init__(self, context: SolverContext) -> None:
        self._context = context

    def schedule_all(
        self, clauses: tuple[PairClause, ...], schedule: PartialSchedule
    ) -> Iterator[PartialSchedule]:
        """List every schedule (lazily, several per clause) under which all clauses hold, in
        order."""
        gaps = [each for each in clauses if isinstance(each, TimeGap)]
        self._context.pets = {get_pair(each): each for each in gaps}
        self._context.pushed = {
            each.first: each.second
            for each in clauses
            if isinstance(each, Contact) and has_trait("manoeuvre", each.cause, "chain")
        }
        named = Counter(name for each in clauses for name in get_pair(each))
        self._context.busy = frozenset(name for name, count in named.items() if count > 1)
        # A PET asked for besides another relation of the two is checked when that one is placed.
        others = [{*get_pair(each)} for each in clauses if not isinstance(each, TimeGap)]
        ordered = sorted(clauses, key=lambda each: each in gaps and {*get_pair(each)} in others)
        parts = split_clauses(ordered)
        if schedule.actors or len(parts) < 2:
            yield from self._schedule_rest(tuple(ordered), schedule)
            return
        found = []
        for part in parts:
            schedules = self._schedule_rest(part, schedule)
            first = next(schedules, None)
            if first is None:
                self.unscheduled = frozenset(name for each in part for name in get_pair(each))
                return
            found.append(chain((first,), schedules))
        for each in zip(*found, strict=False):
            yield join_schedules(each, self._context.rng)

    def _schedule_rest(
        self, clauses: tuple[PairClause, ...], schedule: PartialSchedule
    ) -> Iterator[PartialSchedule]:
        if not clauses:
            yield schedule
            return
        first, *others = clauses
        for scheduled in _SCHEDULERS[type(first)](first, schedule, self._context):
            count_work()
            self._context.misses.note_met(first)
            yield from self._schedule_rest(tuple(others), scheduled)


def passes_first(first: ScheduledAgent, second: ScheduledAgent) -> bool:
    """Return whether `first` leaves the pair's conflict zone before `second` enters it.

    Where the two collide: whether it is clearly earlier where they could first touch.
    """
    pair = find_contact_nodes(first.candidate, second.candidate)
    if first.contact is not None and first.contact == second.contact:
        if not len(pair.i):
            return False
        early = first.enters + first.motion.find_time_at(float(pair.s_a[pair.i].min()))
        late = second.enters + second.motion.find_time_at(float(pair.s_b[pair.j].min()))
        return bool(early + _CLEARLY <= late)
    meetings = find_conflict_intervals(pair, first.motion, second.motion, c=0.0, exact=True)
    delta = second.enters - first.enters
    return bool(len(meetings) and delta >= meetings[:, 1].max())
