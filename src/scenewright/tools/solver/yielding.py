"""`gives_way`: an agent is held upstream of the conflict zone until the other has left it.

The offset is such that, without stopping, it would have been there while the other was
(SEMANTICS 4, cause).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from scenewright.geometry.driving_profile import (
    Motion,
    StopCommand,
    compute_arrival,
    compute_motion,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import DrivingProfile
from scenewright.scene.constraints import GivesWay, PairClause, TimeGap
from scenewright.scene.selection import Stop
from scenewright.scene.track import STEP
from scenewright.scene.yielding_behavior import sample_quantiles
from scenewright.tools.segment_editor import make_stop_command
from scenewright.tools.solver.context import SolverContext
from scenewright.tools.solver.impact import find_least_clearance
from scenewright.tools.solver.nearest_miss import FailureStage
from scenewright.tools.solver.path_conflict import (
    PathConflict,
    compute_gap,
    find_conflict_intervals,
)
from scenewright.tools.solver.schedule import PartialSchedule, ScheduledEvent, get_point
from scenewright.tools.solver.scheduled_agent import ScheduledAgent
from scenewright.tools.solver.stop_positions import UPSTREAM, list_stop_positions

MERGE_METRES = 5.0
"""How much of a shared lane belongs to the conflict zone (SEMANTICS 4)."""

_STANDS = 1.6
"""Least standstill of a yielding agent [s], including its smoothed start and end."""

_PAUSES, _LONGEST, _USUAL = {"vehicle": 0.2, "pedestrian": 1.0}, 11.0, 5.0
"""The same where short standstills were observed; longest standstills, and the usual where none
were observed [s]."""

_REACTS, _SOONEST = (0.3, 0.8), -1.5
"""From the other's leaving to the start [s]: where none was observed; and the soonest of all."""

_MOVES_BY, _MOVING = 3.6, {"vehicle": 1.0, "pedestrian": 0.5}
"""How long after the other has left [s] the yielding agent must be moving (SEMANTICS: 4 s), that
is, at more than this [m/s]."""

_ROLLS, _SLOWEST, _SMOOTHED = 4, 0.15, 0.25
"""Draws for a rolling yield; least speed that it slows to, and what smoothing adds to it [m/s]."""

_SLOW = 0.42
"""Largest share of the free speed at which slowing counts as giving way (SEMANTICS: half)."""

_ON = 0.4
"""How long a pedestrian is on its crosswalk when a vehicle that stops for it begins to slow [s]."""

_BEFORE = 0.5
"""How long before it slows a vehicle must be visible [s]."""

_NO_LATER, _AWAITED, _THERE = 0.15, 4.0, 0.8
"""How long after the other has left the slowest moment may be (SEMANTICS 8: 0.5 s), how long
before the other comes to the zone the stop begins at the earliest (stated), and how long the other
is in the scene by the time of slowing for it [s]."""

_WAVES = {"vehicle": 0.5, "pedestrian": 0.2, "cyclist": 0.5, "scooter": 0.5}
"""Differences of speed below that [m/s] are no slowing, and begin none."""

_APPROACH = {"vehicle": 40.0, "pedestrian": 5.0, "cyclist": 40.0, "scooter": 40.0}
"""The approach speed is the highest on so long a way before an agent slows [m] (SEMANTICS 4)."""

_CAUSE, _CAUSE_SEEN = 1.2, 1.7
"""How far [s] from the other's time in the zone it would have been there without stopping (2 s):
where no standstill was observed, and where it was."""

_SETS_OFF = 4.5
"""Least distance [m] from a red light at which an agent set off to where it gives way: it must have
been moving at 2 m/s (SEMANTICS)."""

_FREE = DrivingProfile(1.0, acceleration=2.0, braking=2.0, lateral=3.0, foresight=0.0)
"""Free speed as SEMANTICS section 4 defines it."""

_CLEARANCE, _PETS = 0.4, (0.6, 7.0)
"""Limits of a yield: least clearance [m], range of its PET [s]."""


def schedule_yields(
    clause: GivesWay, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the first gives way to the second."""
    a, b = context.get_pair(clause, schedule)
    if context.refuse_after_collision(clause, a, b):
        return
    zone = find_conflict_zone(clause, a, b, context)
    if not len(zone.i):
        words = f"the paths of {clause.first} and {clause.second} never touch"
        context.note_miss(clause, FailureStage.PATHS, words)
        return
    words = f"{clause.first} has no place to wait near where {clause.second} passes"
    context.note_miss(clause, FailureStage.PATHS, words)
    if _may_roll(clause, schedule, context):
        yield from _schedule_rolling(clause, schedule, context, zone)
    for anchor, hold in list_stop_positions(clause, a, b, zone, context):
        if _gets_going(a, hold.s):
            yield from _schedule_held(clause, schedule, context, zone, (anchor, hold))


def find_conflict_zone(
    clause: PairClause, a: ScheduledAgent, b: ScheduledAgent, context: SolverContext
) -> PathConflict:
    """Find the nodes of the pair's conflict zone."""
    zone = context.find_path_conflict(clause).compute_intervals(0.0)
    one, two = a.candidate.route, b.candidate.route
    merge = "pedestrian" not in (one.type, two.type) and one.exit == two.exit
    return zone.keep_first_metres(MERGE_METRES) if merge else zone


def _schedule_held(
    clause: GivesWay,
    schedule: PartialSchedule,
    context: SolverContext,
    zone: PathConflict,
    place: tuple[str, StopCommand],
) -> Iterator[PartialSchedule]:
    a, b = context.get_pair(clause, schedule)
    anchor, hold = place
    others = tuple(stop for stop in a.stops if abs(stop.s - hold.s) > 0.5)
    earlier = _build_commands(others, a.enters)
    stands = compute_arrival(a.candidate, hold, earlier)
    unheld = _compute_unheld(a, hold, stands, zone.s_a[zone.i], earlier)
    _, b_out = compute_passage(b.motion, zone.s_b[zone.j])
    for seen, lasts in _draw_timings(clause, a, hold, stands, zone, context):
        low, high = _find_causal_offsets(clause, b, unheld, zone, context)
        low, high = _select_offsets(b, unheld, stands, zone, within=(low, high))
        react = seen
        if lasts is not None:
            # An agent that could not have come so early stands as long by starting later.
            missing = max(stands + lasts - seen - b_out - high, 0.0)
            react = max(min(seen + missing, _find_latest_start(a, hold, stands, zone)), seen)
        least = _PAUSES[a.candidate.route.type] if lasts is not None else _STANDS
        longest = _USUAL if lasts is None else _LONGEST
        low = max(stands + least - react - b_out, low)
        high = min(stands + longest - react - b_out, high)
        if not np.isfinite(low + high) or low > high:
            _note_no_cause(clause, low, high, stands + least - react - b_out, context)
            continue
        delta = float(context.rng.uniform(low, high))
        if lasts is not None:
            delta = min(max(stands + lasts - react - b_out, low), high)
        placed_a, placed_b = schedule.place(clause, a, b, delta)
        start = placed_a.enters + stands
        ahead = float(zone.s_a[zone.i].min()) - hold.s
        stop = Stop(anchor, hold.s, start, 0.0, "gives_way", hold.braking, ahead)
        release = max(placed_b.enters + b_out + react, start + least)
        held = _release(clause, placed_a, placed_b, replace(stop, until=release), zone, context)
        if held is not None:
            yield _add_yield(clause, schedule, held, placed_b, start, unheld, zone)


def _draw_timings(
    clause: GivesWay,
    a: ScheduledAgent,
    hold: StopCommand,
    stands: float,
    zone: PathConflict,
    context: SolverContext,
) -> Iterator[tuple[float, float | None]]:
    """Draw how soon a yielding agent starts once the other has left, and how long it stood [s].

    As observed, or as the PET asked for needs it; else, so that it fits best: at once, besides the
    observed values, that would replace the long standstills.
    """
    wanted, behavior = context.get_requested_pet(clause), context.get_yielding(clause)
    if wanted is not None:
        react = (wanted.low + wanted.high) / 2 - _compute_time_to_zone(a, hold, stands, zone)
        yield from [(react, None)] * 3
        return
    if behavior is not None:
        lasts = sample_quantiles(behavior.stands, context.rng)
        latest = _find_latest_start(a, hold, stands, zone)
        for _ in range(2):
            seen = sample_quantiles(behavior.reacts, context.rng)
            yield float(np.clip(seen, _SOONEST, max(latest, _SOONEST))), lasts
    if behavior is None or context.lenient:
        react = float(context.rng.uniform(*_REACTS))
        yield from [(react, None)] * (3 if behavior is None else 2)


def _find_latest_start(
    a: ScheduledAgent, hold: StopCommand, stands: float, zone: PathConflict
) -> float:
    """Find how long after the other has left it may start [s] and still count as giving way."""
    picks_up = _MOVING[a.candidate.route.type] / a.candidate.time_law.acceleration
    return min(_MOVES_BY - picks_up, _PETS[1] - _compute_time_to_zone(a, hold, stands, zone) - 0.3)


def _find_causal_offsets(
    clause: GivesWay,
    b: ScheduledAgent,
    unheld: _UnheldMotion,
    zone: PathConflict,
    context: SolverContext,
) -> tuple[float, float]:
    """Find the differences of entry times [s] at which the other is the cause (SEMANTICS 4)."""
    b_in, b_out = compute_passage(b.motion, zone.s_b[zone.j])
    slack = _CAUSE if context.get_yielding(clause) is None else _CAUSE_SEEN
    high = unheld.leaves + slack - b_in
    crosses = b.candidate.route.type == "pedestrian" and b.landmarks.own_crosswalk is not None
    if crosses and context.get_yielding(clause) is not None and b.landmarks.line is not None:
        # It is on the crosswalk when the yielding agent begins to slow.
        high = max(high, unheld.begins - b.motion.find_time_at(b.landmarks.line) - _ON)
    return unheld.enters - _CAUSE - b_out, high


def _select_offsets(
    b: ScheduledAgent,
    unheld: _UnheldMotion,
    slowest: float,
    zone: PathConflict,
    *,
    within: tuple[float, float],
) -> tuple[float, float]:
    """Select differences of entry times [s] at which the other is there to give way to.

    It is in the scene when `first` begins to slow, has not long left the zone when that is slowest,
    and is no longer away from it then than agents wait; or is on its crosswalk before.

    Args:
        slowest: local time of the standstill's beginning, or of the lowest speed [s].
        within: differences that are possible otherwise.
    """
    b_in, b_out = compute_passage(b.motion, zone.s_b[zone.j])
    soonest = slowest + _AWAITED - b_in
    if b.candidate.route.type == "pedestrian" and b.landmarks.line is not None:
        on = b.motion.find_time_at(b.landmarks.line)
        soonest = max(soonest, unheld.begins - on - _ON)
    low, high = within
    return max(low, slowest - b_out - _NO_LATER), min(high, soonest, unheld.begins - _THERE)


def _note_no_cause(
    clause: GivesWay, low: float, high: float, by_standing: float, context: SolverContext
) -> None:
    words = f"{clause.first}, unheld, would not have met {clause.second}, so it has no reason"
    context.note_miss(clause, FailureStage.ROLES, words)
    wanted = context.get_requested_pet(clause)
    if wanted is not None and np.isfinite(low + high):
        longer = low - high if by_standing >= low else high - low
        _note_pet((wanted.low + wanted.high) / 2 + longer, clause, wanted, context)


def _add_yield(
    clause: GivesWay,
    schedule: PartialSchedule,
    held: ScheduledAgent,
    other: ScheduledAgent,
    start: float,
    unheld: _UnheldMotion,
    zone: PathConflict,
) -> PartialSchedule:
    """Add the yield to the schedule; `start` is when it is slowest [s]."""
    enters = held.enters + held.motion.find_time_at(float(zone.s_a[zone.i].min()))
    passed = other.enters + compute_passage(other.motion, zone.s_b[zone.j])[1]
    begins = min(held.enters + unheld.begins, start) - _BEFORE
    event = ScheduledEvent(clause, start, begins, enters, passed, get_point(held, start))
    return schedule.add_event(event, held, other)


def _may_roll(clause: GivesWay, schedule: PartialSchedule, context: SolverContext) -> bool:
    """Return whether `first` may slow without standing; nothing else may depend on its stop."""
    behavior = context.get_yielding(clause)
    if behavior is None or context.get_requested_pet(clause) is not None:
        return False
    if clause.first in context.busy or clause.first in schedule.actors:
        return False
    return bool(context.rng.random() < behavior.rolls)


def _schedule_rolling(
    clause: GivesWay, schedule: PartialSchedule, context: SolverContext, zone: PathConflict
) -> Iterator[PartialSchedule]:
    """Schedule the first slowing so far that the other has left the zone when it arrives there."""
    a, b = context.get_pair(clause, schedule)
    behavior = context.get_yielding(clause)
    if behavior is None:
        return
    nodes = zone.s_a[zone.i]
    _, b_out = compute_passage(b.motion, zone.s_b[zone.j])
    for _ in range(_ROLLS):
        s = a.landmarks.move_off_crosswalks(
            float(nodes.min()) - max(sample_quantiles(behavior.place, context.rng), 0.5),
            own=b.landmarks.own_crosswalk,
        )
        margin = max(sample_quantiles(behavior.margin, context.rng), _PETS[0] + 0.2)
        found = _slow_down(a, s, sample_quantiles(behavior.pace, context.rng), nodes)
        if found is None:
            continue
        rolling, unheld = found
        low, high = _find_causal_offsets(clause, b, unheld, zone, context)
        slowest = rolling.stops[-1].start - rolling.enters
        low, high = _select_offsets(b, unheld, slowest, zone, within=(low, high))
        enters = rolling.motion.find_time_at(float(nodes.min()))
        delta = min(max(enters - b_out - margin, low), high)
        if low > high or not np.isfinite(delta) or enters - b_out - delta < _PETS[0]:
            continue
        placed_a, placed_b = schedule.place(clause, rolling, b, delta)
        if _passes_well(clause, placed_a, placed_b, zone, context):
            start = placed_a.stops[-1].start
            yield _add_yield(clause, schedule, placed_a, placed_b, start, unheld, zone)


def _slow_down(
    a: ScheduledAgent, s: float, pace: float, nodes: FloatArray
) -> tuple[ScheduledAgent, _UnheldMotion] | None:
    """Slow the agent to a share `pace` of its approach speed at `s` [m]; None if that is no
    yield."""
    too_far = nodes.min() - s >= UPSTREAM[a.candidate.route.type]
    if s <= 2.0 or too_far or not _gets_going(a, s):
        return None
    stop, earlier = StopCommand(s, 0.0), _build_commands(a.stops, a.enters)
    unheld = _compute_unheld(a, stop, compute_arrival(a.candidate, stop, earlier), nodes, earlier)
    free = float(np.interp(s, unheld.free.s, unheld.free.speed))
    speed = max(min(pace * unheld.approach, _SLOW * free) - _SMOOTHED, _SLOWEST)
    hold = StopCommand(s, 0.0, speed=speed)
    at = compute_arrival(a.candidate, hold, earlier)
    ahead = float(nodes.min()) - s
    stop_at = Stop("yield_point", s, at + a.enters, at + a.enters, "gives_way", None, ahead, speed)
    rolling = a.edit(stops=(*a.stops, stop_at))
    lowest = rolling.motion.find_speed_at(at)
    if lowest > (_SLOW + 0.04) * free:
        return None
    return rolling, _compute_unheld(a, hold, at, nodes, earlier)


def _gets_going(a: ScheduledAgent, s: float) -> bool:
    """Return whether it drives fast enough before `s` [m], if it comes from a red light."""
    return all(s - stop.s > _SETS_OFF for stop in a.stops if stop.at_red)


def _compute_time_to_zone(
    a: ScheduledAgent, hold: StopCommand, stands: float, zone: PathConflict
) -> float:
    """Compute how long it takes from its release to the zone [s]."""
    release = stands + _STANDS
    motion = compute_motion(a.candidate, holds=(replace(hold, release=release),))
    return motion.find_time_at(float(zone.s_a[zone.i].min())) - release


def _release(
    clause: GivesWay,
    a: ScheduledAgent,
    b: ScheduledAgent,
    stop: Stop,
    zone: PathConflict,
    context: SolverContext,
) -> ScheduledAgent | None:
    """Hold the yielding agent until then, or until the PET asked for; None if that is no yield."""
    held = a.edit(stops=_join_stops(a.stops, stop))
    wanted = context.get_requested_pet(clause)
    if wanted is None:
        return held if _passes_well(clause, held, b, zone, context) else None
    middle = (wanted.low + wanted.high) / 2
    later = middle - _compute_pet(held, b, zone)
    earliest = stop.start + _STANDS
    until = max(stop.until + later, earliest) if np.isfinite(later) else stop.until
    held = a.edit(stops=_join_stops(a.stops, replace(stop, until=until)))
    return held if _passes_well(clause, held, b, zone, context) else None


def _passes_well(
    clause: GivesWay,
    held: ScheduledAgent,
    other: ScheduledAgent,
    zone: PathConflict,
    context: SolverContext,
) -> bool:
    """Return whether the yield has 0.4 m clearance and a PET between 0.6 and 7 s, or as asked."""
    wanted = context.get_requested_pet(clause)
    low, high = _PETS if wanted is None else (wanted.low, wanted.high)
    clearance, _, _ = find_least_clearance(held, other)
    pet = _compute_pet(held, other, zone)
    if clearance >= _CLEARANCE and low - 0.02 <= pet <= high + 0.02:
        return True
    if clearance < _CLEARANCE:
        words = f"{clause.first} keeps only {max(clearance, 0.0):.1f} m clear of {clause.second}"
        context.note_miss(clause, FailureStage.PLACE, words)
        return False
    if wanted is not None:
        _note_pet(pet, clause, wanted, context)
    else:
        words = f"a PET of {low:g} to {high:g} s after the yield: it is {pet:.1f} s"
        context.note_miss(clause, FailureStage.MEASURE, words, off=max(low - pet, pet - high))
    return False


def _note_pet(pet: float, clause: GivesWay, wanted: TimeGap, context: SolverContext) -> None:
    """Note that only this PET [s] was possible."""
    asked, extreme = (wanted.low + wanted.high) / 2, "shortest" if pet > wanted.high else "longest"
    words = f"a PET of {asked:g} s after the yield: the {extreme} possible is {pet:.1f} s"
    context.note_miss(
        clause, FailureStage.MEASURE, words, off=max(wanted.low - pet, pet - wanted.high)
    )


def _compute_pet(held: ScheduledAgent, other: ScheduledAgent, zone: PathConflict) -> float:
    meetings = find_conflict_intervals(zone, held.motion, other.motion, c=0.0, exact=True)
    return compute_gap(meetings, other.enters - held.enters)


def _join_stops(stops: tuple[Stop, ...], stop: Stop) -> tuple[Stop, ...]:
    """Join a stop to others: one standstill at one place, as long as the longer of the two
    needs."""
    same = [each for each in stops if abs(each.s - stop.s) <= 0.5]
    rest = tuple(each for each in stops if each not in same)
    if not same:
        return tuple(sorted((*rest, stop), key=lambda each: each.s))
    until = max(stop.until, *(each.until for each in same))
    return tuple(sorted((*rest, replace(same[0], until=until, speed=0.0)), key=lambda each: each.s))


def _build_commands(stops: tuple[Stop, ...], enters: float) -> tuple[StopCommand, ...]:
    return tuple(make_stop_command(stop, enters) for stop in stops)


def compute_passage(motion: Motion, nodes: FloatArray) -> tuple[float, float]:
    """Compute local times [s] of reaching the first and leaving the last of the nodes."""
    return motion.find_time_at(float(nodes.min())), motion.find_time_at(float(nodes.max()))


@dataclass(frozen=True, eq=False)
class _UnheldMotion:
    """Motion of a yielding agent without its stop, free from where it began to slow.

    Attributes:
        enters, leaves: local times [s] of reaching and leaving the zone.
        begins: when it begins to slow [s]; approach: its speed then [m/s].
        free: the motion, not in its times.
    """

    enters: float
    leaves: float
    begins: float
    approach: float
    free: Motion


def _compute_unheld(
    a: ScheduledAgent,
    hold: StopCommand,
    stands: float,
    nodes: FloatArray,
    others: tuple[StopCommand, ...],
) -> _UnheldMotion:
    """Compute it from where it begins to slow, at the highest speed on the way there.

    Where it stood before (at `others`), it approaches from there.
    """
    kind = a.candidate.route.type
    earlier = tuple(each for each in others if each.s < hold.s)
    motion = compute_motion(a.candidate, holds=(*earlier, replace(hold, release=stands + 9.0)))
    until = int(stands / STEP)
    speed, s = motion.speed[: until + 1], motion.s[: until + 1]
    begin = _find_slowing_start(speed, _WAVES[kind])
    since = max([s[begin] - _APPROACH[kind], *(each.s + 0.1 for each in earlier)])
    approach = float(speed[: begin + 1][s[: begin + 1] >= min(since, s[begin])].max())
    law = replace(_FREE, speed=approach)
    free = compute_motion(replace(a.candidate, time_law=law), holds=earlier)
    shift = STEP * begin - free.find_time_at(float(s[begin]))
    first, last = compute_passage(free, nodes)
    return _UnheldMotion(first + shift, last + shift, STEP * begin, approach, free)


def _find_slowing_start(speed: FloatArray, waves: float) -> int:
    """Find the sample from which on an agent slows to the last one, but for smaller waves.

    Args:
        speed: [T] [m/s]; waves: differences of speed that are not regarded [m/s].
    """
    top = 0.0
    for first in range(len(speed) - 1, -1, -1):
        if speed[first] < top - waves:
            break
        top = max(top, float(speed[first]))
    return int(np.flatnonzero(speed >= top - 0.6 * waves)[-1])
