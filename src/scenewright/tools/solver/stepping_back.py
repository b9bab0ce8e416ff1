"""Near misses and collisions in which a pedestrian steps or jumps back, as the text says.

It has one foot or more in the way of the other when it perceives it. In a near miss that passes
where it was; so shortly after that this does not count as giving way. In a collision the step back
does not take it out of the way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from scenewright.scene.constraints import Contact, TimeGap
from scenewright.scene.kinds import get_kind, has_trait
from scenewright.scene.reaction_behavior import REACTION_TIME
from scenewright.tools.solver.context import SolverContext
from scenewright.tools.solver.evasions import step_back
from scenewright.tools.solver.impact import (
    FirstContact,
    find_first_contact,
    find_least_clearance,
)
from scenewright.tools.solver.path_conflict import Intervals, compute_gap
from scenewright.tools.solver.reacted_near_miss import (
    KEEPS_FIRST,
    NARROW,
    find_meetings,
    finish_near_miss,
    touch_brakes,
)
from scenewright.tools.solver.reactions import (
    SEEN_BEFORE,
    find_place,
    find_speed,
    find_threat,
    sees,
)
from scenewright.tools.solver.schedule import PartialSchedule, ScheduledEvent, get_pair
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_TRIES = 60
"""Offsets that are tried."""
_INTO, _DEEP = (0.05, 0.5), (0.7, 2.2)
"""How far in the other's way a pedestrian turns round that is missed, and one that is hit [m]."""
_CLEAR = 0.2
"""How far out of its way it is afterwards at least, if it is missed [m]."""
_RESTS = (0.4, 0.9)
"""How long it stands after that [s]."""
_GONE_BACK = 0.35
"""How far it has gone back at least when it is hit [m]."""

_Pair = tuple[ScheduledAgent, ScheduledAgent]


def find_one_stepping_back(clause: TimeGap | Contact, context: SolverContext) -> int | None:
    """Find which of the clause's agents is to step back: 0, 1, or None where neither is."""
    ways = [context.reactions.ways.get(name) for name in get_pair(clause)]
    return next((k for k in (0, 1) if has_trait("reaction", ways[k], "back")), None)


def schedule_missed_steps_back(
    clause: TimeGap,
    schedule: PartialSchedule,
    context: SolverContext,
    pair: _Pair,
    meetings: Intervals,
    by: int,
) -> Iterator[PartialSchedule]:
    """List schedules with the PET asked for in which one of the two steps back."""
    for placed in _list_offsets(clause, schedule, context, pair, meetings, by):
        for reacted in _list_steps(clause, context, placed, by, _INTO):
            delta = reacted[1].enters - reacted[0].enters
            pet = compute_gap(find_meetings(clause, context, reacted), delta)
            if clause.low - 1e-6 <= pet <= min(clause.high, NARROW):
                scheduled = finish_near_miss(clause, schedule, context, reacted)
                yield from () if scheduled is None else (scheduled,)


def schedule_struck_steps_back(
    clause: Contact,
    schedule: PartialSchedule,
    context: SolverContext,
    pair: _Pair,
    by: int,
    wanted: Callable[[ScheduledAgent, ScheduledAgent, FirstContact], bool],
) -> Iterator[PartialSchedule]:
    """List schedules in which one of the two steps back and is hit all the same.

    Args:
        wanted: whether a contact is the one asked for.
    """
    meetings = context.find_meeting_intervals(clause, *pair)
    for placed in _list_offsets(clause, schedule, context, pair, meetings, by):
        for reacted in _list_steps(clause, context, placed, by, _DEEP):
            found = find_first_contact(*reacted, left_hand=context.left_hand)
            if found is None or not wanted(*reacted, found):
                continue
            if find_place(reacted[by], found.time) <= reacted[by].slowings[-3].s + _GONE_BACK:
                continue
            conflict = context.find_evaded_conflict(clause, *reacted)
            threat = find_threat(conflict, *reacted, until=found.time)
            if threat is None or schedule.is_too_soon(found.time, clause):
                continue
            begins = min(found.time - 3.0, threat[0] - SEEN_BEFORE)
            event = ScheduledEvent(
                clause, found.time, begins, found.time, found.time, found.location
            )
            a, b = (each.end_at(found.time) for each in reacted)
            yield schedule.add_event(event, a, b)


def _list_offsets(
    clause: TimeGap | Contact,
    schedule: PartialSchedule,
    context: SolverContext,
    pair: _Pair,
    meetings: Intervals,
    by: int,
) -> Iterator[_Pair]:
    """List the two placed so that they would touch; none if the one that steps back is bound."""
    if get_pair(clause)[by] in schedule.actors or pair[by].slowings or not len(meetings):
        return
    for _ in range(_TRIES):
        low, high = meetings[int(context.rng.integers(len(meetings)))].tolist()
        yield schedule.place(clause, *pair, float(context.rng.uniform(low, high)))


def _list_steps(
    clause: TimeGap | Contact,
    context: SolverContext,
    placed: _Pair,
    by: int,
    depth: tuple[float, float],
) -> Iterator[_Pair]:
    """List the two with the one stepping back and the other braking, and with the one alone.

    Args:
        depth: how far in the other's way it turns round, least and most [m].
    """
    conflict, rng, names = context.find_path_conflict(clause), context.rng, get_pair(clause)
    of, other, kind = placed[by], placed[1 - by], context.reactions.ways[names[by]]
    meets = find_least_clearance(*placed)[1]
    threat = find_threat(conflict, *placed, until=meets)
    if threat is None:
        return
    how, into = context.reactions.draw(names[by], of, rng), float(rng.uniform(*depth))
    nodes = (conflict.s_a[conflict.i], conflict.s_b[conflict.j])[by]
    at, speed = float(nodes.min()) + into, find_speed(of, meets)
    onset = of.enters + of.motion.find_time_at(at - speed**2 / (2.0 * how.strength))
    if not REACTION_TIME.least <= onset - threat[0] <= REACTION_TIME.most:
        return
    own = get_kind("reaction", kind).ranges
    back = float(rng.uniform(*own["backwards"]))
    changed = step_back(
        of, at=at, back=max(back, into + _CLEAR) if depth == _INTO else back,
        braking=how.strength, speed=float(rng.uniform(*own["speed"])),
        rests=float(rng.uniform(*_RESTS)),
    )  # fmt: skip
    answer = context.reactions.draw(names[1 - by], other, rng)
    keeps, braked = float(rng.uniform(*KEEPS_FIRST)), None
    if context.reactions.may_react(names[1 - by]) and sees(other, of, threat[0]):
        braked = touch_brakes(other, answer, keeps, (threat[0], threat[0] + answer.after))
    for each in (braked, other):
        if each is not None and changed is not None:
            yield (changed, each) if by == 0 else (each, changed)
