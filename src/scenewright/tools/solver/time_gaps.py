"""`time_gap` and `passes_beside`: two agents pass a place so far apart in time, or abreast so far
apart.

On present courses they would touch: one responds to the threat, and the time that it loses or gains
is why they miss; the other responds as well. Where none can, their entry times alone are apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from scenewright.scene.constraints import PassesBeside, TimeGap
from scenewright.scene.kinds import has_trait
from scenewright.tools.solver.conflicts import Conflict, ConflictSampler, Draw, Pair, Response
from scenewright.tools.solver.context import (
    FailureStage,
    SolverContext,
    compute_excess,
    find_meetings,
    is_in_range,
)
from scenewright.tools.solver.impact import find_least_clearance
from scenewright.tools.solver.path_conflict import Intervals, compute_gap
from scenewright.tools.solver.reactions import SEEN_BEFORE
from scenewright.tools.solver.scheduled_agent import (
    PartialSchedule,
    ScheduledAgent,
    ScheduledEvent,
    get_pair,
)

_TRIES, _ALONE, _BACK, _MOST = 24, 10, 60, 2
"""Responses that are drawn, and of these with one agent responding alone; where one steps back; and
schedules that are offered."""

_APART = 6
"""Offsets that are drawn where neither responds."""

_KEEPS, _KEEPS_LITTLE = (0.58, 0.75), (0.25, 0.55)
"""Share of its speed that an agent keeps which slows and passes second; and if it is close behind
or brakes harshly."""

_KEEPS_FIRST, _KEEPS_ON_FOOT = (0.6, 0.8), (0.4, 0.55)
"""The same for an agent that slows for a moment and still passes first; the second on foot."""

_CLEAR = 0.05
"""Least clearance of two that pass without touching [m]."""

_IN_TIME = 1.7
"""Time [s] within which a reaction must have ended the threat, or the other had to react, too."""

_WHERE, _PLACES = (0.2, 0.6), 6
"""Share of the overtaken one's path at which it may be, and how many places are tried."""

_FASTER, _MOVING = 1.3, 1.5
"""By how much the overtaker is faster, and how fast the other is, at the least [m/s]."""


def schedule_time_gaps(
    clause: TimeGap, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the PET of the two is as the clause says."""
    a, b = context.get_pair(clause, schedule)
    meetings = find_meetings(a, b)
    if schedule.has_event(clause):
        if _is_pet_in_range(clause, meetings, b.enters - a.enters, context):
            yield schedule
        return
    names = get_pair(clause)
    able = [
        k
        for k, of in enumerate((a, b))
        if context.reactions.may_react(names[k])
        and names[k] not in schedule.actors
        and not of.slowings
    ]
    back = any(has_trait("reaction", context.reactions.ways.get(name), "back") for name in names)
    if len(meetings) and able:
        draws = _list_draws(clause, context, (a, b), meetings, able, back=back)
        sampler = _NearMissSampler(clause, schedule, context, (a, b), (clause.low, clause.high))
        yield from islice(sampler.sample(draws), _MOST)
        if back or not context.lenient:
            words = "no reaction of either agent brings it about"
            context.note_miss(clause, FailureStage.COMPANY, words)
    if back or (not context.lenient and len(meetings) and able):
        return
    for delta in _draw_outside(meetings, clause.low, clause.high, context.rng):
        placed_a, placed_b = schedule.place(clause, a, b, delta)
        if not _is_pet_in_range(clause, meetings, placed_b.enters - placed_a.enters, context):
            continue
        yield from _pass(clause, schedule, context, (placed_a, placed_b), (_CLEAR, np.inf))
    if not len(meetings):
        context.note_paths_apart(clause)


def schedule_overtakings(
    clause: PassesBeside, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the first overtakes the second as the clause says."""
    a, b = context.get_pair(clause, schedule)
    if schedule.has_event(clause):
        return
    for share in context.rng.uniform(*_WHERE, _PLACES):
        delta = _find_offset(a, b, float(share) * b.candidate.path.length)
        if delta is None:
            words = f"{clause.first} is not faster than {clause.second} where it would pass"
            context.note_miss(clause, FailureStage.MEASURE, words)
            continue
        placed = schedule.place(clause, a, b, delta)
        yield from _pass(clause, schedule, context, placed, (clause.low, clause.high))


def _find_offset(a: ScheduledAgent, b: ScheduledAgent, s: float) -> float | None:
    """Find o_b - o_a [s] at which both are abreast where b is at `s` [m]; None if a is no
    faster."""
    x, y, _ = b.get_pose(s)
    path = a.candidate.path
    abreast = float(path.s[int(np.hypot(*(path.xy - (x, y)).T).argmin())])
    times = a.motion.find_time_at(abreast), b.motion.find_time_at(s)
    if not np.isfinite(times).all():
        return None
    speeds = a.motion.find_speed_at(times[0]), b.motion.find_speed_at(times[1])
    if speeds[1] < _MOVING or speeds[0] - speeds[1] < _FASTER:
        return None
    return times[0] - times[1]


def _pass(
    clause: TimeGap | PassesBeside,
    schedule: PartialSchedule,
    context: SolverContext,
    pair: Pair,
    clearances: tuple[float, float],
) -> Iterator[PartialSchedule]:
    """Add that the two pass one another with such a least clearance [m], if they do."""
    clearance, time, place = find_least_clearance(*pair)
    if not all(_passes_the_pause(each, time) for each in pair):
        return
    if not clearances[0] <= clearance <= clearances[1]:
        words, off = f"the two pass at {clearance:.1f} m", compute_excess(*clearances, clearance)
        context.note_miss(clause, FailureStage.MEASURE, words, off=off)
    elif schedule.is_too_soon(time, clause):
        context.note_miss(clause, FailureStage.COMPANY, "the two are not yet free for it")
    else:
        event = ScheduledEvent(clause, time, time - 4.0, time + 1.0, time + 1.0, place)
        yield schedule.add_event(event, *pair)


def _list_draws(
    clause: TimeGap,
    context: SolverContext,
    pair: Pair,
    meetings: Intervals,
    able: list[int],
    *,
    back: bool,
) -> Iterator[Draw]:
    """List offsets at which the two would touch, and how they respond: one, an asked one rather,
    evades so that they part, the other responds for a moment; in the last `_ALONE` draws it does
    not."""
    rng, names = context.rng, get_pair(clause)
    asked = [k for k in able if names[k] in context.reactions.ways]
    tries = _BACK if back else _TRIES
    for n in range(tries):
        ways: list[tuple[Response, ...]] = [(), ()]
        evader = int(rng.choice(asked or able))
        other = 1 - evader
        evasion = context.reactions.draw(names[evader], pair[evader], rng)
        keeps = rng.uniform(*(_KEEPS if rng.random() < 0.5 else _KEEPS_LITTLE))
        ways[evader] = (Response(evasion, float(keeps)),)
        answer = context.reactions.draw(names[other], pair[other], rng)
        # Who lets a hurrying one pass slows as who passes second does, up to the other's path.
        lets_pass = evasion.hurries and not answer.hurries
        walks = pair[other].candidate.shape.type == "pedestrian"
        shares = _KEEPS if lets_pass else _KEEPS_ON_FOOT if walks else _KEEPS_FIRST
        kept = None if lets_pass or answer.hurries else 1.0
        keeps = rng.uniform(*shares)
        if n < tries - _ALONE and other in able:
            ways[other] = (Response(answer, float(keeps), kept),)
        low, high = meetings[int(rng.integers(len(meetings)))].tolist()
        yield Draw(float(rng.uniform(low, high)), (ways[0], ways[1]))


@dataclass(eq=False)
class _NearMissSampler(ConflictSampler):
    """Samples conflicts in which the two, responding, pass one another."""

    def judge(self, conflict: Conflict) -> PartialSchedule | None:
        """Return the schedule with the near miss; None where the two touch or nothing was
        perceptible as they respond."""
        pair = conflict.pair
        clearance, time, place = find_least_clearance(*pair)
        if clearance <= _CLEAR or self.schedule.is_too_soon(time, self.clause):
            return None
        threat = self.context.find_threat(self.clause, *pair, until=time)
        alone = not (pair[0].slowings and pair[1].slowings)
        if threat is None or (alone and threat[1] - threat[0] > _IN_TIME):
            return None
        begins = min(time - 4.0, threat[0] - SEEN_BEFORE)
        event = ScheduledEvent(self.clause, time, begins, time + 1.0, time + 1.0, place)
        return self.schedule.add_event(event, *pair)


def _passes_the_pause(of: ScheduledAgent, time: float) -> bool:
    """Return whether an agent pausing on the road does so when, or just before, the two are
    closest."""
    pauses = [stop for stop in of.stops if stop.reason == "pauses"]
    return all(stop.start - 1.0 <= time <= stop.until + 2.0 for stop in pauses)


def _is_pet_in_range(
    clause: TimeGap, meetings: Intervals, delta: float, context: SolverContext
) -> bool:
    pet = compute_gap(meetings, delta)
    if is_in_range(clause.low, clause.high, pet):
        return True
    words = f"a PET of {clause.low:g} to {clause.high:g} s: the nearest possible is {pet:.1f} s"
    off = compute_excess(clause.low, clause.high, pet)
    context.note_miss(clause, FailureStage.MEASURE, words, off=off)
    return False


def _draw_outside(
    meetings: Intervals, low: float, high: float, rng: np.random.Generator
) -> list[float]:
    """Draw offsets whose distance from all intervals lies in [low, high]."""
    found = []
    for gap in rng.uniform(low, high, _APART):
        for start, end in meetings:
            found += [float(start - gap), float(end + gap)]
    kept = [delta for delta in found if compute_gap(meetings, delta) >= low - 1e-6]
    rng.shuffle(kept)
    return kept
