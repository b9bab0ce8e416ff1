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

import numpy as np

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
from scenewright.scene.selection import Stop
from scenewright.tools.map_grounding.signal_plan import SignalDemand
from scenewright.tools.solver.contact import schedule_contacts
from scenewright.tools.solver.context import SolverContext, find_contact_nodes
from scenewright.tools.solver.entry_times import START_LAG
from scenewright.tools.solver.following import schedule_headways, schedule_stops_behind
from scenewright.tools.solver.hard_braking import schedule_hard_braking
from scenewright.tools.solver.independent_events import join_schedules, split_clauses
from scenewright.tools.solver.overtaking import schedule_overtakings
from scenewright.tools.solver.path_conflict import find_conflict_intervals
from scenewright.tools.solver.schedule import PartialSchedule, get_pair
from scenewright.tools.solver.scheduled_agent import ScheduledAgent
from scenewright.tools.solver.time_gaps import schedule_time_gaps
from scenewright.tools.solver.yielding import schedule_yields
from scenewright.work_limit import count_work

_CLEARLY = 0.2
"""How much earlier [s] the first agent in the zone of a collision must be there."""

_SLOWS = 5.5
"""How long before a stop [s] the light must not explain it."""


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


_YELLOW = 0.7
"""Least time since a light turned yellow for an agent that passes it then [s]."""


def list_signal_demands(
    actor: ScheduledAgent, *, violates: bool, until: float, yellow: bool = False
) -> tuple[SignalDemand, ...]:
    """List what the signal plan must show for this agent: to obey it, or to run its light."""
    line, group = actor.landmarks.line, actor.landmarks.group
    if line is None or group is None:
        return ()
    found = [_demand_red(stop, actor, group, until) for stop in actor.stops if stop.at_red]
    crosses = actor.enters + actor.motion.find_time_at(line)
    if not np.isfinite(crosses) or crosses > until or crosses < -25.0:
        return tuple(found)
    if yellow:
        return (*found, SignalDemand(group, crosses - _YELLOW, crosses + 0.3, ("yellow",)))
    if violates:
        # An agent that slows at a light that is not green waits for the light.
        slows = [each.start for each in actor.stops if each.reason == "gives_way" and each.s < line]
        found += [SignalDemand(group, start - _SLOWS, start + 0.3, ("green",)) for start in slows]
        return (*found, SignalDemand(group, crosses - 0.5, crosses + 0.4, ("red",)))
    near = [stop for stop in actor.stops if abs(stop.s - line) < 2.0]
    waits = [stop.start - _SLOWS for stop in near if not stop.at_red]
    starts = [stop.until - START_LAG[0] for stop in near if stop.at_red]
    begins = min([crosses - 0.2, *waits, *starts])
    return (*found, SignalDemand(group, begins, crosses + 0.5, ("green",)))


def _demand_red(stop: Stop, actor: ScheduledAgent, group: str, until: float) -> SignalDemand:
    """Demand red from before the agent slows for its stop until it is hit, or the light changes.

    Where it has started before the scene begins, red just before that.
    """
    turns = stop.until - START_LAG[1]
    if actor.contact is not None and actor.contact <= stop.until:
        turns = actor.contact
    ends = min(turns, until)
    return SignalDemand(group, min(max(stop.start - 2.0, 0.0), ends), ends, ("red",))
