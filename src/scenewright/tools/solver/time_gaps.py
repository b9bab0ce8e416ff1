"""`time_gap` and `headway`: two agents pass a place one after the other, so far apart in time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from scenewright.scene.constraints import Headway, TimeGap
from scenewright.scene.selection import Stop
from scenewright.tools.solver.context import SolverContext, compute_excess, is_in_range
from scenewright.tools.solver.impact import find_least_clearance
from scenewright.tools.solver.nearest_miss import FailureStage
from scenewright.tools.solver.path_conflict import (
    Intervals,
    PathConflict,
    compute_gap,
    find_conflict_intervals,
)
from scenewright.tools.solver.reacted_near_miss import (
    can_react,
    schedule_reacted_time_gaps,
)
from scenewright.tools.solver.schedule import PartialSchedule, ScheduledEvent, get_point
from scenewright.tools.solver.scheduled_agent import ScheduledAgent, get_shared_times
from scenewright.tools.solver.stepping_back import (
    find_one_stepping_back,
    schedule_missed_steps_back,
)

_TRIES = 6
_MOST_STEPS = 2
"""Schedules with a step back that are offered."""
_FOR_GOOD = 60.0
"""Longer than any scene [s]."""

_CLOSE = 1.05
"""A headway below this is tailgating [s]."""

_LEAST_HEADWAY = 0.7
"""Shortest headway of a follower where none is asked for [s]."""

_LEAST_CLEARANCE = 0.05
"""Least clearance of two that pass without touching [m]."""


def schedule_time_gaps(
    clause: TimeGap, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the PET of the two is as the clause says."""
    a, b = context.get_pair(clause, schedule)
    meetings = context.find_meeting_intervals(clause, a, b)
    if schedule.has_event(clause):
        if _is_pet_in_range(clause, meetings, b.enters - a.enters, context):
            yield schedule
        return
    back = find_one_stepping_back(clause, context)
    if back is not None:
        some = schedule_missed_steps_back(clause, schedule, context, (a, b), meetings, back)
        yield from islice(some, _MOST_STEPS)
        return
    yield from schedule_reacted_time_gaps(clause, schedule, context, (a, b), meetings)
    if not context.lenient and can_react(clause, schedule, context, (a, b), meetings):
        words = "no reaction of either agent brings it about"
        context.note_miss(clause, FailureStage.COMPANY, words)
        return
    for delta in _draw_outside(meetings, clause.low, clause.high, context.rng):
        placed_a, placed_b = schedule.place(clause, a, b, delta)
        if not _is_pet_in_range(clause, meetings, placed_b.enters - placed_a.enters, context):
            continue
        clearance, time, place = find_least_clearance(placed_a, placed_b)
        if not all(_passes_the_pause(each, time) for each in (placed_a, placed_b)):
            continue
        if clearance <= _LEAST_CLEARANCE or schedule.is_too_soon(time, clause):
            words = "the two touch, or are not yet free for it, at every such moment"
            context.note_miss(clause, FailureStage.COMPANY, words)
            continue
        event = ScheduledEvent(clause, time, time - 4.0, time + 1.0, time + 1.0, place)
        yield schedule.add_event(event, placed_a, placed_b)
    if not len(meetings):
        words = f"the paths of {clause.first} and {clause.second} never touch"
        context.note_miss(clause, FailureStage.PATHS, words)


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
    for gap in rng.uniform(low, high, _TRIES):
        for start, end in meetings:
            found += [float(start - gap), float(end + gap)]
    kept = [delta for delta in found if compute_gap(meetings, delta) >= low - 1e-6]
    rng.shuffle(kept)
    return kept


def schedule_headways(
    clause: Headway, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the first follows the second at the headway asked
    for."""
    a, b = context.get_pair(clause, schedule)
    if clause.high < _CLOSE and clause.first not in schedule.actors and not context.figures:
        paced = replace(a.candidate, time_law=b.candidate.time_law)  # follows closely
        a = ScheduledAgent.build_unplaced(paced, a.landmarks)
    pair = context.find_path_conflict(clause)
    meetings = find_conflict_intervals(pair, a.free, b.free, c=0.0, exact=True)
    if not len(meetings):
        words = f"{clause.first} and {clause.second} never share a lane"
        context.note_miss(clause, FailureStage.PATHS, words)
        return
    low, high = _find_headways(clause, a, context)
    least = _LEAST_HEADWAY if low >= _LEAST_HEADWAY else low - 0.1
    for gap in context.rng.uniform(low, high, _TRIES):
        delta = float(meetings[0, 0] - gap)
        placed_a, placed_b = schedule.place(clause, a, b, delta)
        found = float(meetings[0, 0] - (placed_b.enters - placed_a.enters))
        if not is_in_range(low, high, found):
            words = f"a headway of {low:g} to {high:g} s: it is {found:.1f} s"
            off = compute_excess(low, high, found)
            context.note_miss(clause, FailureStage.MEASURE, words, off=off)
            continue
        if placed_a.contact is None:
            placed_a = _queue_behind(placed_a, placed_b, pair, context.rng)
        begins = max(placed_a.enters, placed_b.enters)
        if not _follows(placed_a, placed_b, least=least):
            words = f"{clause.first} does not stay behind {clause.second} for 3.6 s on end"
            context.note_miss(clause, FailureStage.COMPANY, words)
            continue
        time = begins + 4.0
        event = ScheduledEvent(clause, time, begins, time, time, get_point(placed_a, time))
        yield schedule.add_event(event, placed_a, placed_b)


def _queue_behind(
    a: ScheduledAgent, b: ScheduledAgent, pair: PathConflict, rng: np.random.Generator
) -> ScheduledAgent:
    """Return the follower with a stop behind every one of its leader's, its wreck included."""
    stands = [(stop.s, stop.start, stop.until) for stop in b.stops]
    if b.contact is not None:
        last = float(b.motion.s[-1])
        stands = [each for each in stands if each[0] < last - 1.0]
        stands.append((last, b.contact, b.contact + _FOR_GOOD))
    stops = list(a.stops)
    for s, start, until in stands:
        beside = np.abs(pair.s_b[pair.j] - s) < 0.3
        if not beside.any():
            continue
        behind = float(pair.s_a[pair.i[beside]].min()) - float(rng.uniform(1.8, 3.0))
        behind = a.landmarks.move_off_crosswalks(behind)
        if behind > 2.0 and all(abs(stop.s - behind) > 1.0 for stop in stops):
            lag = float(rng.uniform(0.7, 1.3))
            stops.append(Stop("queue", behind, start, until + lag, "queue"))
    if len(stops) == len(a.stops):
        return a
    return a.edit(stops=tuple(sorted(stops, key=lambda stop: stop.s)))


def _find_headways(
    clause: Headway, a: ScheduledAgent, context: SolverContext
) -> tuple[float, float]:
    """Find headways [s] to draw from: the clause's, or those that a gap asked for amounts to."""
    gap = context.find_figure("gap", clause.first, clause.second)
    if gap is None:
        return clause.low, clause.high
    speed = a.candidate.time_law.speed
    return gap.low / speed, gap.high / speed


def _follows(a: ScheduledAgent, b: ScheduledAgent, *, least: float) -> bool:
    """Return whether `a` drives behind `b` at a headway of `least` to 3.4 s for 3.6 s on end."""
    times = get_shared_times(a, b)
    if times is None:
        return False
    ahead = b.get_poses(times)[:, :2] - a.get_poses(times)[:, :2]
    gap = np.hypot(*ahead.T) - (a.candidate.shape.length + b.candidate.shape.length) / 2
    clock = a.motion.clock
    speed = np.maximum(np.interp(times - a.enters, clock, a.motion.speed), 0.5)
    fits = (gap / speed > least) & (gap / speed < 3.4)
    run = longest = 0
    for each in fits:
        run = run + 1 if each else 0
        longest = max(longest, run)
    return longest >= 36
