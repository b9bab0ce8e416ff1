"""Near misses with a reaction: on present courses the two would touch (SEMANTICS 8).

One of the two responds to the threat a reaction time after it is perceptible; the time that it
loses or gains is why they miss. The other responds as well, unless it is over long before. Their
entry times are shifted so that the PET asked for comes about including the reactions.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from scenewright.scene.constraints import TimeGap
from scenewright.scene.reaction_behavior import ASIDE, Reaction
from scenewright.scene.track import STEP
from scenewright.tools.solver.context import SolverContext
from scenewright.tools.solver.evasions import swerve_away
from scenewright.tools.solver.impact import find_least_clearance
from scenewright.tools.solver.path_conflict import Intervals
from scenewright.tools.solver.reactions import (
    SEEN_BEFORE,
    SLOWS_FOR,
    find_place,
    find_speed,
    find_threat,
    find_usual_braking,
    run_on,
    sees,
    slow_down,
)
from scenewright.tools.solver.schedule import PartialSchedule, ScheduledEvent, get_pair
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_TRIES, _ALONE, _STEPS, _MOST = 24, 10, 4, 2
"""Reactions that are drawn, and of these with one agent reacting alone; steps towards the PET with
each; and schedules that are offered."""

_KEEPS, _KEEPS_LITTLE = (0.58, 0.75), (0.25, 0.55)
"""Share of its speed that an agent keeps which slows: below half it would have given way,"""

_HARSH, NARROW = 5.3, 0.44
"""but for braking harder than this [m/s^2], or a PET shorter than this [s] (SEMANTICS 4)."""

KEEPS_FIRST, _KEEPS_ON_FOOT = (0.6, 0.8), (0.4, 0.55)
"""The same for an agent that slows and still passes first; the second for pedestrians."""

_HARDER = 1.1
"""By how much an agent that passes first brakes harder at least than it would anyway [m/s^2]."""

_CALLED_OFF = 0.7
"""A reaction that would begin later than this after the threat has ended is called off [s]."""

LEAST_CLEARANCE = 0.05
"""Least clearance of two that pass without touching [m]."""

_IN_TIME = 1.7
"""Time [s] within which a reaction must have ended the threat, or the other had to react, too."""

_CLOSEST = 0.3
"""Time left to the meeting at which a reaction changes nothing any more [s]."""


@dataclass(frozen=True)
class _Attempt:
    """Reaction of the agent (0 or 1) that parts the two, down to which share of its speed; unless
    it reacts alone, of the other one; and how far it swerves [m]."""

    by: int
    how: Reaction
    keeps: float
    other: Reaction | None
    other_keeps: float
    aside: float = 0.0

    @property
    def first(self) -> int:
        """The agent of the two that passes first: the other one, unless the reacting one runs."""
        return self.by if self.how.hurries else 1 - self.by

    def get_longest_pet(self, most: float) -> float:
        """Return the longest PET [s], up to `most`, with which this does not count as yielding."""
        gives_way = self.keeps < _KEEPS[0] and self.how.strength < _HARSH
        return min(most, NARROW) if gives_way and not self.how.hurries else most


def can_react(
    clause: TimeGap,
    schedule: PartialSchedule,
    context: SolverContext,
    pair: tuple[ScheduledAgent, ScheduledAgent],
    meetings: Intervals,
) -> bool:
    """Return whether one of the two may react, and would have time to."""
    names = get_pair(clause)
    free = [k for k in (0, 1) if context.reactions.may_react(names[k])]
    return bool(len(meetings)) and any(
        names[k] not in schedule.actors and not pair[k].slowings for k in free
    )


def schedule_reacted_time_gaps(
    clause: TimeGap,
    schedule: PartialSchedule,
    context: SolverContext,
    pair: tuple[ScheduledAgent, ScheduledAgent],
    meetings: Intervals,
) -> Iterator[PartialSchedule]:
    """List schedules (lazily) with that PET in which one of the two reacts.

    Args:
        meetings: differences of entry times [s] at which the two would touch without reactions.
    """
    names = get_pair(clause)
    willing = [k for k in (0, 1) if context.reactions.may_react(names[k])]
    if not can_react(clause, schedule, context, pair, meetings):
        return
    asked = [k for k in willing if names[k] in context.reactions.ways]
    willing, offered = asked or willing, 0
    for n in range(_TRIES):
        attempt = _draw(willing, names, pair, context)
        bound = names[1 - attempt.by] in schedule.actors or bool(pair[1 - attempt.by].slowings)
        may = context.reactions.may_react(names[1 - attempt.by])
        if n >= _TRIES - _ALONE or bound or not may:
            attempt = replace(attempt, other=None)
        if names[attempt.by] in schedule.actors:
            continue  # it is bound already by earlier events
        scheduled = _schedule_reaction(clause, schedule, context, pair, meetings, attempt)
        if scheduled is not None:
            yield scheduled
            offered += 1
        if offered == _MOST:
            return


def _draw(
    willing: list[int],
    names: tuple[str, str],
    pair: tuple[ScheduledAgent, ScheduledAgent],
    context: SolverContext,
) -> _Attempt:
    by = willing[int(context.rng.integers(len(willing)))]
    how = context.reactions.draw(names[by], pair[by], context.rng)
    keeps = _KEEPS if context.rng.random() < 0.5 else _KEEPS_LITTLE
    walks = pair[1 - by].candidate.shape.type == "pedestrian"
    first = _KEEPS_ON_FOOT if walks else KEEPS_FIRST
    other_keeps = _KEEPS if how.hurries else first
    return _Attempt(
        by,
        how,
        float(context.rng.uniform(*keeps)),
        context.reactions.draw(names[1 - by], pair[1 - by], context.rng),
        float(context.rng.uniform(*other_keeps)),
        float(context.rng.uniform(*ASIDE)) if how.swerves else 0.0,
    )


def _schedule_reaction(
    clause: TimeGap,
    schedule: PartialSchedule,
    context: SolverContext,
    pair: tuple[ScheduledAgent, ScheduledAgent],
    meetings: Intervals,
    attempt: _Attempt,
) -> PartialSchedule | None:
    """Schedule the two with that reaction and the PET asked for; None if these are incompatible."""
    low, high = float(meetings[:, 0].min()), float(meetings[:, 1].max())
    most = attempt.get_longest_pet(clause.high)
    delta = float(context.rng.uniform(low, high))
    for _ in range(_STEPS):
        placed = schedule.place(clause, *pair, delta)
        delta = placed[1].enters - placed[0].enters
        reacted = _react(clause, context, placed, attempt)
        after = None if reacted is None else context.find_evaded_meetings(clause, *reacted)
        if reacted is None or after is None or not len(after):
            return None
        # How far the reaction moves the two apart, and how long a PET that leaves room for.
        first, last = float(after[:, 0].min()), float(after[:, 1].max())
        pet, gained = (first - delta, first - low) if attempt.first else (delta - last, high - last)
        longest = min(most, gained - STEP)
        if longest < clause.low:
            return None  # on present courses they would not meet, so that no reaction is needed
        if clause.low - 1e-6 <= pet <= longest + 1e-6:
            return finish_near_miss(clause, schedule, context, reacted)
        wanted = float(context.rng.uniform(clause.low, longest))
        delta = round(delta + (pet - wanted if attempt.first else wanted - pet), 1)
    return None


def _react(
    clause: TimeGap,
    context: SolverContext,
    placed: tuple[ScheduledAgent, ScheduledAgent],
    attempt: _Attempt,
) -> tuple[ScheduledAgent, ScheduledAgent] | None:
    """Return the two reacting; None if the one that parts them perceives nothing in time."""
    conflict = context.find_path_conflict(clause)
    meets = find_least_clearance(*placed)[1]
    lead = context.reactions.hidden.get(frozenset(get_pair(clause)))
    threat = find_threat(conflict, *placed, until=meets, lead=lead)
    of, other = placed[attempt.by], placed[1 - attempt.by]
    if threat is None or not sees(of, other, threat[0]):
        return None
    onset = threat[0] + attempt.how.after
    if onset > meets - _CLOSEST:
        return None
    changed = _change(clause, context, of, attempt, onset)
    if changed is not None and attempt.how.swerves:
        changed = swerve_away(changed, of, other, onset=onset, meets=meets, by=attempt.aside)
    if changed is None:
        return None
    other = _react_as_well(clause, context, (changed, other), attempt, (threat[0], meets))
    return (changed, other) if attempt.by == 0 else (other, changed)


def _react_as_well(
    clause: TimeGap,
    context: SolverContext,
    pair: tuple[ScheduledAgent, ScheduledAgent],
    attempt: _Attempt,
    threat: tuple[float, float],
) -> ScheduledAgent:
    """Return the other of the two, reacting unless the first one's reaction is long enough before.

    Args:
        pair: the one that has reacted, and the other; threat: from when on it is perceptible, and
            when they would meet [s].
    """
    changed, of = pair
    if attempt.other is None or not sees(of, changed, threat[0]):
        return of
    begin, meets = threat
    placed = pair if attempt.by == 0 else (of, changed)
    left = find_threat(context.find_evaded_conflict(clause, *placed), *placed, until=meets)
    onset = begin + attempt.other.after
    if onset > min(meets - _CLOSEST, (begin if left is None else left[1]) + _CALLED_OFF):
        return of
    reaction = _Attempt(1 - attempt.by, attempt.other, attempt.other_keeps, None, 1.0)
    if attempt.first == attempt.by or attempt.other.hurries:
        return _change(clause, context, of, reaction, onset) or of
    return touch_brakes(of, reaction.how, reaction.keeps, (begin, onset)) or of


def touch_brakes(
    of: ScheduledAgent, how: Reaction, keeps: float, times: tuple[float, float]
) -> ScheduledAgent | None:
    """Slow the agent for a moment, visibly; it goes on at once, and passes first.

    Args:
        keeps: share of its speed that it keeps.
        times: when the other is perceptible, and when it reacts [s].
    """
    begin, onset = times
    before, usual = find_speed(of, onset), find_usual_braking(of, begin, onset)
    least = usual + _HARDER if usual else 0.0
    speed = min(keeps * before, before - SLOWS_FOR * least)
    braking = max(min(how.strength, (before - speed) / SLOWS_FOR), least)
    return slow_down(of, onset=onset, braking=braking, speed=max(speed, 0.5), kept=1.0)


def _change(
    clause: TimeGap,
    context: SolverContext,
    of: ScheduledAgent,
    attempt: _Attempt,
    onset: float,
) -> ScheduledAgent | None:
    """Apply the reaction of `attempt.by` from `onset` [s] on; None where it changes nothing."""
    conflict, how = context.find_path_conflict(clause), attempt.how
    nodes = (conflict.s_a[conflict.i], conflict.s_b[conflict.j])[attempt.by]
    if how.hurries:
        beyond = float(nodes.max()) + 1.0
        return run_on(of, onset=onset, acceleration=how.strength, until=beyond)
    speed = attempt.keeps * find_speed(of, onset)
    # It stays slow until the other's path begins.
    kept = max(float(nodes.min()) - find_place(of, onset), 1.0)
    return slow_down(of, onset=onset, braking=how.strength, speed=speed, kept=kept)


def finish_near_miss(
    clause: TimeGap,
    schedule: PartialSchedule,
    context: SolverContext,
    reacted: tuple[ScheduledAgent, ScheduledAgent],
) -> PartialSchedule | None:
    """Add the near miss to the schedule; None where the two touch or nothing was perceptible."""
    clearance, time, place = find_least_clearance(*reacted)
    if clearance <= LEAST_CLEARANCE or schedule.is_too_soon(time, clause):
        return None
    conflict = context.find_evaded_conflict(clause, *reacted)
    lead = context.reactions.hidden.get(frozenset(get_pair(clause)))
    threat = find_threat(conflict, *reacted, until=time, lead=lead)
    alone = not (reacted[0].slowings and reacted[1].slowings)
    if threat is None or (alone and threat[1] - threat[0] > _IN_TIME):
        return None
    begins = min(time - 4.0, threat[0] - SEEN_BEFORE)
    event = ScheduledEvent(clause, time, begins, time + 1.0, time + 1.0, place)
    return schedule.add_event(event, *reacted)
