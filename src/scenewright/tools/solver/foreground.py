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
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from scenewright.scene.track import STEP
from scenewright.tools.solver.contact import schedule_contacts
from scenewright.tools.solver.context import (
    APART,
    SolverContext,
    find_contact_nodes,
    find_meetings,
)
from scenewright.tools.solver.following import schedule_headways, schedule_stops_behind
from scenewright.tools.solver.hard_braking import schedule_hard_braking
from scenewright.tools.solver.reservation import find_blocked_offsets
from scenewright.tools.solver.scheduled_agent import (
    PartialSchedule,
    ScheduledAgent,
    find_needed_end,
    get_pair,
)
from scenewright.tools.solver.time_gaps import schedule_overtakings, schedule_time_gaps
from scenewright.tools.solver.yielding import schedule_yields
from scenewright.work_limit import count_work

_FARTHEST = 20.0
"""How far a group of agents is moved at most, to either side [s]."""

_LONGEST = 29.0
"""From the beginning of the first event to the end of the last [s], so that a scene holds both."""

_GRID = 0.5
"""Spacing of the signal programme's offsets, and of the times by which groups are moved [s]."""

FindOffsets = Callable[[PartialSchedule], NDArray[np.bool_]]
"""Whether each offset of the signal programme, on its grid, is lawful for all agents."""

_TRIES = 8
"""How many orders of the groups are tried."""


def list_separations(
    schedule: PartialSchedule, rng: np.random.Generator, find_offsets: FindOffsets
) -> Iterator[PartialSchedule]:
    """List the schedule, and others in which unrelated agents of its events keep apart."""
    yield schedule
    parts = split_by_agents(schedule)
    if len(parts) < 2:
        return
    lights = [find_offsets(part) for part in parts]
    for _ in range(_TRIES):
        order = rng.permutation(len(parts))
        moved = _move_apart([parts[k] for k in order], [lights[k] for k in order], rng)
        if moved is not None:
            # The agents' order decides what is drawn for them later.
            yield replace(moved, actors={name: moved.actors[name] for name in schedule.actors})


def split_by_agents(schedule: PartialSchedule) -> list[PartialSchedule]:
    """Split a schedule into parts that share no agent; an agent without an event is a part."""
    groups = join_names(schedule.actors, (get_pair(event.clause) for event in schedule.events))
    return [
        PartialSchedule(
            {name: each for name, each in schedule.actors.items() if name in group},
            tuple(event for event in schedule.events if get_pair(event.clause)[0] in group),
        )
        for group in groups
    ]


def split_clauses(clauses: Sequence[PairClause]) -> list[tuple[PairClause, ...]]:
    """Split clauses into lists that share no agent, each in the order given."""
    groups = join_names((), map(get_pair, clauses))
    return [tuple(clause for clause in clauses if get_pair(clause)[0] in group) for group in groups]


def join_names(names: Iterable[str], pairs: Iterable[tuple[str, str]]) -> list[set[str]]:
    """Group names that pairs connect.

    >>> [sorted(each) for each in join_names("a", [("b", "c"), ("d", "e"), ("c", "f")])]
    [['a'], ['d', 'e'], ['b', 'c', 'f']]
    """
    groups = [{name} for name in names]
    for pair in pairs:
        joined = set(pair).union(*(group for group in groups if group & set(pair)))
        groups = [*(group for group in groups if not group & set(pair)), joined]
    return groups


def join_schedules(parts: Sequence[PartialSchedule], rng: np.random.Generator) -> PartialSchedule:
    """Join schedules that share no agent, all but the first moved in time."""
    moved = [parts[0], *(part.shift(round(float(rng.uniform(*APART)), 1)) for part in parts[1:])]
    actors = {name: actor for each in moved for name, actor in each.actors.items()}
    return PartialSchedule(actors, tuple(event for each in moved for event in each.events))


def _move_apart(
    parts: Sequence[PartialSchedule], lights: Sequence[NDArray[np.bool_]], rng: np.random.Generator
) -> PartialSchedule | None:
    """Place one part after the other at a time drawn among those without a conflict, if any."""
    placed, lawful = parts[0], lights[0]
    for part, own in zip(parts[1:], lights[1:], strict=True):
        # A part that comes later needs what the programme shows that much later.
        shifts = [k for k in _find_free_shifts(placed, part) if (lawful & np.roll(own, -k)).any()]
        if not shifts:
            return None
        k = int(rng.choice(shifts))
        moved, lawful = part.shift(round(k * _GRID, 1)), lawful & np.roll(own, -k)
        placed = PartialSchedule({**placed.actors, **moved.actors}, (*placed.events, *moved.events))
    return placed


def _find_free_shifts(placed: PartialSchedule, part: PartialSchedule) -> list[int]:
    """Find by how much [grid steps] a part can be moved so that no agent meets one placed."""
    reach = round(_FARTHEST / _GRID)
    shifts = np.arange(-reach, reach + 1)
    free = np.ones(len(shifts), dtype=np.bool_)
    if placed.events and part.events:
        moved, ends = shifts * _GRID, [find_needed_end(each) for each in (placed, part)]
        begins = [min(event.begins for event in each.events) for each in (placed, part)]
        last = np.maximum(ends[0], ends[1] + moved)
        free = last - np.minimum(begins[0], begins[1] + moved) <= _LONGEST
    steps = shifts * (_GRID / STEP)
    for a, b in product(placed.actors.values(), part.actors.values()):
        apart = (b.enters - a.enters) / STEP
        for low, high in find_blocked_offsets(a, b, strict=True):
            free &= (steps + apart <= low) | (steps + apart >= high)
    return [int(shift) for shift in shifts[free]]


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
        gaps = [clause for clause in clauses if isinstance(clause, TimeGap)]
        self._context.pets = {get_pair(gap): gap for gap in gaps}
        self._context.pushed = {
            clause.first: clause.second
            for clause in clauses
            if isinstance(clause, Contact) and has_trait("manoeuvre", clause.cause, "chain")
        }
        named = Counter(name for each in clauses for name in get_pair(each))
        self._context.busy = frozenset(name for name, count in named.items() if count > 1)
        # A PET asked for besides another relation of the two is checked when that one is placed.
        others = [{*get_pair(clause)} for clause in clauses if not isinstance(clause, TimeGap)]
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
    if first.contact is not None and first.contact == second.contact:
        pair = find_contact_nodes(first.candidate, second.candidate)
        if not len(pair.i):
            return False
        early = first.enters + first.motion.find_time_at(float(pair.s_a[pair.i].min()))
        late = second.enters + second.motion.find_time_at(float(pair.s_b[pair.j].min()))
        return bool(early + _CLEARLY <= late)
    meetings = find_meetings(first, second)
    delta = second.enters - first.enters
    return bool(len(meetings) and delta >= meetings[:, 1].max())
