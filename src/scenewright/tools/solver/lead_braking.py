"""A lead vehicle brakes hard: its follower hits it, nearly hits it, or stops in good time.

The leader brakes harder than 5 m/s^2 to a stop somewhere on its path. A reaction time later the
follower brakes: too late, or to a stop behind it. The offset of the two follows from that time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenewright.geometry.driving_profile import StopCommand, compute_arrival
from scenewright.scene.constraints import Contact, PairClause, StopsBehind
from scenewright.scene.selection import Slowing, Stop
from scenewright.scene.track import STEP
from scenewright.tools.solver.contact import schedule_offsets
from scenewright.tools.solver.context import FOR_GOOD, SolverContext, compute_excess
from scenewright.tools.solver.hard_braking import (
    CLOSE_TTC,
    HARD,
    compute_smooth_acceleration,
    find_hardest_braking,
    find_ttc_while_braking,
)
from scenewright.tools.solver.impact import find_least_clearance
from scenewright.tools.solver.nearest_miss import FailureStage
from scenewright.tools.solver.path_ttc import compute_path_ttc
from scenewright.tools.solver.schedule import PartialSchedule, ScheduledEvent
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_LEADERS, _FOLLOWERS, _REACTIONS = 4, 5, 5
"""Brakings of the leader; responses of the follower to each; reaction times of each response."""

_BRAKING = (5.6, 7.2)
"""Intended braking of the leader [m/s^2]."""

_ON_ITS_WAY, _LEAST_DRIVE = (0.22, 0.88), 1.7
"""Where it stops, as a share of its path; and how long it drives freely before it brakes [s]."""

_STANDS, _LAG = (1.5, 3.0), (0.7, 1.3)
"""How long the leader stands, and how much later the follower starts again [s]."""

_MEDIAN, _SPREAD, _REACTION = 1.0, 0.33, (0.5, 2.0)
"""Reaction time [s]: lognormal (SEMANTICS 8)."""

_SPEED_LEFT, _LATE_BRAKING = (2.5, 5.5), (5.0, 7.0)
"""When braking too late: speed where the leader stands [m/s], and braking [m/s^2]."""

_LEAST_HEADWAY = 0.7
"""Of the two before either brakes [s]."""

_IN_TIME = 1.6
"""A path TTC while braking above this makes no near miss [s]."""

_GAPS = {"near": (0.8, 2.0), "in time": (1.5, 4.0)}
"""Between the two when they stand [m]."""

_STOPPING = {"near": (5.2, 7.2), "in time": (2.2, 3.2)}
"""Braking of a follower that stops behind the leader [m/s^2]."""

_SEEN, _SEEN_FOLLOWING = 1.2, 3.4
"""How long before the braking the two are visible at least, and if car-following is asked for
[s]."""

_CLEARANCE = 0.5
"""Least distance of two that do not touch [m]."""


def schedule_lead_braking(
    clause: Contact, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the first hits the second, which brakes ahead of it."""
    a, b = context.get_pair(clause, schedule)
    if context.refuse_after_collision(clause, a, b):
        return
    for leader, touch in _draw_leaders(b, clause, context):
        for _ in range(_FOLLOWERS):
            speed = clause.speed or float(context.rng.uniform(*_SPEED_LEFT))
            braking = float(context.rng.uniform(*_LATE_BRAKING))
            follower = a.edit(stops=a.stops, slowings=(Slowing(touch, speed, braking),))
            deltas = _draw_offsets(follower, leader, context.rng)
            behind = [d for d in deltas if _is_behind(follower, leader, d, _SEEN)]
            yield from schedule_offsets(clause, schedule, context, (follower, leader), behind)


def schedule_stops_behind(
    clause: StopsBehind, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the second brakes and the first stops behind it."""
    a, b = context.get_pair(clause, schedule)
    if a.contact is not None or b.contact is not None or a.stops or b.stops:
        words = f"one of {clause.first} and {clause.second} has crashed or stopped before"
        context.note_miss(clause, FailureStage.PATHS, words)
        return
    for leader, touch in _draw_leaders(b, clause, context):
        for _ in range(_FOLLOWERS):
            kind = "near" if clause.high <= _IN_TIME else "in time"
            gap, braking = (float(context.rng.uniform(*each[kind])) for each in (_GAPS, _STOPPING))
            s = a.landmarks.move_off_crosswalks(touch - gap)
            start = a.enters + compute_arrival(a.candidate, StopCommand(s, 0.0, braking))
            stop = Stop("stopping_point", s, start, start + FOR_GOOD, "brakes", braking)
            follower = a.edit(stops=(stop,))
            for delta in _draw_offsets(follower, leader, context.rng):
                scheduled = _place(clause, schedule, context, follower, leader, delta)
                if scheduled is not None:
                    yield scheduled


def _draw_leaders(
    b: ScheduledAgent, clause: PairClause, context: SolverContext
) -> Iterator[tuple[ScheduledAgent, float]]:
    """Draw the leader braking hard to a stop, at several places, and where the follower touches it
    there [m]."""
    rng = context.rng
    for _ in range(_LEADERS):
        place = b.candidate.path.length * float(rng.uniform(*_ON_ITS_WAY))
        s = b.landmarks.move_off_crosswalks(place)
        braking = float(rng.uniform(*_BRAKING))
        start = b.enters + compute_arrival(b.candidate, StopCommand(s, 0.0, braking))
        lasts = FOR_GOOD if isinstance(clause, Contact) else float(rng.uniform(*_STANDS))
        stop = Stop("stopping_point", s, start, start + lasts, "brakes", braking)
        leader = b.edit(stops=(stop,))
        touch = context.find_touch(clause, s)
        if _find_onset(leader) < _LEAST_DRIVE:
            continue
        if not HARD[0] <= find_hardest_braking(leader) <= HARD[1]:
            words = f"{clause.second} is too slow on this movement to brake hard"
            context.note_miss(clause, FailureStage.PLACE, words)
        elif touch is None:
            words = f"{clause.first} does not drive in the lane where {clause.second} brakes"
            context.note_miss(clause, FailureStage.PATHS, words)
        else:
            yield leader, touch


def _draw_offsets(
    follower: ScheduledAgent, leader: ScheduledAgent, rng: np.random.Generator
) -> list[float]:
    """Draw offsets at which the follower begins to brake a reaction time after the leader."""
    first, second = _find_onset(follower), _find_onset(leader)
    drawn = _MEDIAN * np.exp(_SPREAD * rng.standard_normal(_REACTIONS))
    return [float(first - second - each) for each in np.clip(drawn, *_REACTION)]


def _find_onset(of: ScheduledAgent) -> float:
    """Find when it begins to brake for its stop or its slowing [s since it entered the map]."""
    change = compute_smooth_acceleration(of)
    place = of.stops[-1].s if of.stops else of.slowings[-1].s
    last = int(np.searchsorted(of.motion.s, place - 0.1))
    free = np.flatnonzero(change[:last] > -1.5)
    return STEP * float(free[-1] if len(free) else 0)


def _is_behind(follower: ScheduledAgent, leader: ScheduledAgent, delta: float, seen: float) -> bool:
    """Return whether the follower drives clear of the leader when that begins to brake."""
    at = _find_onset(leader)
    here, there = (
        float(of.motion.compute_positions(np.array([time]))[0])
        for of, time in ((follower, at + delta), (leader, at))
    )
    if at + delta < seen:
        return False
    room = (follower.candidate.shape.length + leader.candidate.shape.length) / 2
    (x, y, _), (u, v, _) = follower.get_pose(here), leader.get_pose(there)
    gap = float(np.hypot(u - x, v - y)) - room
    return gap >= _LEAST_HEADWAY * follower.motion.find_speed_at(at + delta)


def _place(
    clause: StopsBehind,
    schedule: PartialSchedule,
    context: SolverContext,
    follower: ScheduledAgent,
    leader: ScheduledAgent,
    delta: float,
) -> PartialSchedule | None:
    """Place the two at an offset, both starting again; None if the path TTC is not as asked."""
    seen = _SEEN if clause.high <= _IN_TIME else _SEEN_FOLLOWING
    if not _is_behind(follower, leader, delta, seen):
        return None
    free, b = schedule.place(clause, follower, leader, delta)
    until = b.stops[-1].until + float(context.rng.uniform(*_LAG))
    a = free.edit(stops=(replace(free.stops[-1], until=until),))
    near = compute_path_ttc(context.find_path_conflict(clause), a, b, horizon=clause.high + 1.5)
    off = compute_excess(clause.low, clause.high, near.least)
    if off > 0.0:
        asked = (clause.low + clause.high) / 2
        words = f"a path TTC of {asked:g} s behind a leader that brakes: it is {near.least:.1f} s"
        context.note_miss(clause, FailureStage.MEASURE, words, off=off)
        return None
    braking = min(find_ttc_while_braking(each, near) for each in (a, b))
    if braking > CLOSE_TTC if clause.high <= _IN_TIME else braking < _IN_TIME:
        return None
    clearance, time, place = find_least_clearance(a, b)
    if clearance < _CLEARANCE or schedule.is_too_soon(time, clause):
        words = "the two touch, or are not yet free for it"
        context.note_miss(clause, FailureStage.COMPANY, words)
        return None
    begins = b.enters + _find_onset(b) - seen
    event = ScheduledEvent(clause, near.when, begins, until + 1.0, until, place)
    return schedule.add_event(event, a, b)
