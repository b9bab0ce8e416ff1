"""One vehicle behind another in its lane: it keeps a headway, stops behind it, or runs into it.

The leader waits at its light, has stopped, or brakes hard to a stop. The follower brakes too late,
never, or in time. When the leader brakes, it does so a reaction time later, from which the offset
of the two follows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenewright.geometry.landmarks import STOP_GAP
from scenewright.scene.base import RIDERS
from scenewright.scene.constraints import Contact, Headway, PairClause, StopsBehind
from scenewright.scene.reaction_behavior import REACTION_TIME
from scenewright.scene.selection import Slowing, Stop
from scenewright.scene.track import STEP
from scenewright.tools.solver.context import (
    FailureStage,
    SolverContext,
    compute_excess,
    find_contact_nodes,
    find_touch,
    is_in_range,
)
from scenewright.tools.solver.entry_times import build_red_light_stop
from scenewright.tools.solver.hard_braking import (
    CLOSE_TTC,
    HARD,
    compute_smooth_acceleration,
    find_hardest_braking,
    find_ttc_while_braking,
)
from scenewright.tools.solver.impact import find_least_clearance
from scenewright.tools.solver.path_conflict import find_conflict_intervals
from scenewright.tools.solver.path_ttc import compute_path_ttc
from scenewright.tools.solver.scheduled_agent import (
    FOR_GOOD,
    PartialSchedule,
    ScheduledAgent,
    ScheduledEvent,
    compute_bumper_gaps,
    get_shared_times,
)

_TRIES = 6
"""Offsets that are drawn."""

_SUDDEN, _SUDDEN_BRAKING = (0.62, 0.82), 3.2
"""Where on its path (share of it) a leader stops without a light, and how hard it brakes
[m/s^2]."""

TURNED = 0.35
"""Who has turned so far is seen to turn [rad]."""

_SPEED_LEFT, _PUSHING_SPEED = (3.0, 5.5), (6.5, 9.5)
"""At contact, where the text names none, after braking too late [m/s]; the second of who pushes
the one that it strikes into another."""

_RIDER_BRAKING = 3.0
"""Of a rider that brakes too late [m/s^2]."""

_AT_THE_ZONE = 7.0
"""A vehicle that waits no farther than this [m] from a conflict zone visibly waits for it."""

_LINGERS = 2.5
"""How much later than it could a leader starts that is hit from behind [s]."""

_RED = 12.0
"""How long the leader of a rear-end would have stood at its red light [s]."""

_LEADERS, _FOLLOWERS, _REACTIONS = 4, 5, 5
"""Brakings of the leader; responses of the follower to each; reaction times of each response."""

_BRAKING = (5.6, 7.2)
"""Intended braking of the leader [m/s^2]."""

_ON_ITS_WAY, _LEAST_DRIVE = (0.22, 0.88), 1.7
"""Where it stops, as a share of its path; and how long it drives freely before it brakes [s]."""

_STANDS, _LAG = (1.5, 3.0), (0.7, 1.3)
"""How long the leader stands, and how much later the follower starts again [s]."""

_LATE_BRAKING = (5.0, 7.0)
"""Of who brakes too late behind a leader that brakes [m/s^2]."""

_CLOSE, _LEAST_HEADWAY = 1.05, 0.7
"""A headway below the first is tailgating; the shortest before either brakes, and where none is
asked for [s]."""

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


def plan_rear_ends(
    a: ScheduledAgent, b: ScheduledAgent, clause: Contact, context: SolverContext
) -> Iterator[tuple[ScheduledAgent, ScheduledAgent, list[float]]]:
    """Plan follower and leader, edited but not yet placed, and offsets at which they meet [s]."""
    room = context.find_room_ahead(clause.second)
    for leader in _list_standing_leaders(b, room, context.rng):
        touch, follower = find_touch(a.candidate, b.candidate, leader.stops[-1].s), a
        if touch is None:
            words = f"{clause.first} does not drive in the lane where {clause.second} stops"
            context.note_miss(clause, FailureStage.PATHS, words)
            continue
        if context.reactions.may_react(clause.first):  # it brakes, but too late
            drawn = _PUSHING_SPEED if clause.second in context.pushed else _SPEED_LEFT
            speed = clause.speed or float(context.rng.uniform(*drawn))
            braking = _RIDER_BRAKING if a.candidate.shape.type in RIDERS else 5.5
            follower = a.edit(stops=a.stops, slowings=(Slowing(touch, speed, braking),))
        yield follower, leader, _draw_arrivals(follower, leader, touch, context.rng)


def _draw_arrivals(
    follower: ScheduledAgent, leader: ScheduledAgent, touch: float, rng: np.random.Generator
) -> list[float]:
    """Draw offsets at which the follower reaches the leader's rear while the leader stands."""
    stop = leader.stops[-1]
    first = stop.start + 0.2
    if stop.reason == "gives_way":
        first = stop.until - _LINGERS - 0.1
    last = min(stop.until - 0.1, first + _RED)
    reaches = follower.motion.find_time_at(touch)
    return [
        float(leader.enters - (time - reaches))
        for time in rng.uniform(first, max(last, first), _TRIES)
    ]


def compute_passing_time(leader: ScheduledAgent) -> float:
    """Compute when [s] the agent has passed to which the leader gave way."""
    return leader.stops[-1].until - _LINGERS - 0.2


def _list_standing_leaders(
    b: ScheduledAgent, room: float, rng: np.random.Generator
) -> Iterator[ScheduledAgent]:
    """List leaders: standing already, longer after giving way; else at its red light, or in the
    queue there; else braked to a stop on its path.

    Args:
        room: how far behind that place another has to stand ahead of it [m].
    """
    if b.stops:
        *others, last = b.stops
        if last.reason != "gives_way":
            yield b
        elif last.ahead is not None and last.ahead <= _AT_THE_ZONE:
            # Hit far from the zone, it could have waited for any agent.
            yield b.edit(stops=(*others, replace(last, until=last.until + _LINGERS)))
        return
    path, marks = b.candidate.path, b.landmarks
    turned = np.flatnonzero(np.abs(path.heading - path.heading[0]) >= TURNED)
    if marks.line is not None and marks.group is not None and not len(turned):
        stop = build_red_light_stop(b, marks.line - STOP_GAP - room)
        yield b.edit(stops=(replace(stop, until=stop.start + _RED),))
    low, high = _SUDDEN
    if len(turned):  # who turns is struck in the turn: at the light nothing would show it
        low = max(low, (path.s[turned[0]] + b.candidate.shape.length + 2.0) / path.length)
    for share in rng.uniform(low, max(high, low + 0.05), 2):
        place = marks.move_off_crosswalks(share * path.length)
        yield b.edit(stops=(b.build_stop(place, "brakes", braking=_SUDDEN_BRAKING),))


def plan_lead_braking(
    a: ScheduledAgent, b: ScheduledAgent, clause: Contact, context: SolverContext
) -> Iterator[tuple[ScheduledAgent, ScheduledAgent, list[float]]]:
    """Plan follower and leader, which brakes ahead of it, and offsets at which they meet [s]."""
    for leader, touch in _draw_leaders(a, b, clause, context):
        for _ in range(_FOLLOWERS):
            speed = clause.speed or float(context.rng.uniform(*_SPEED_LEFT))
            braking = float(context.rng.uniform(*_LATE_BRAKING))
            follower = a.edit(stops=a.stops, slowings=(Slowing(touch, speed, braking),))
            deltas = _draw_reactions(follower, leader, context.rng)
            behind = [d for d in deltas if _is_behind(follower, leader, d, _SEEN)]
            yield follower, leader, behind


def schedule_stops_behind(
    clause: StopsBehind, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the second brakes and the first stops behind it."""
    a, b = context.get_pair(clause, schedule)
    if a.contact is not None or b.contact is not None or a.stops or b.stops:
        words = f"one of {clause.first} and {clause.second} has crashed or stopped before"
        context.note_miss(clause, FailureStage.PATHS, words)
        return
    for leader, touch in _draw_leaders(a, b, clause, context):
        for _ in range(_FOLLOWERS):
            kind = "near" if clause.high <= _IN_TIME else "in time"
            gap, braking = (float(context.rng.uniform(*each[kind])) for each in (_GAPS, _STOPPING))
            s = a.landmarks.move_off_crosswalks(touch - gap)
            follower = a.edit(stops=(a.build_stop(s, "brakes", braking=braking),))
            for delta in _draw_reactions(follower, leader, context.rng):
                scheduled = _place(clause, schedule, context, follower, leader, delta)
                if scheduled is not None:
                    yield scheduled


def _draw_leaders(
    a: ScheduledAgent, b: ScheduledAgent, clause: PairClause, context: SolverContext
) -> Iterator[tuple[ScheduledAgent, float]]:
    """Draw the leader braking hard to a stop, at several places, and where the follower touches it
    there [m]."""
    rng = context.rng
    for _ in range(_LEADERS):
        place = b.candidate.path.length * float(rng.uniform(*_ON_ITS_WAY))
        s = b.landmarks.move_off_crosswalks(place)
        braking = float(rng.uniform(*_BRAKING))
        lasts = FOR_GOOD if isinstance(clause, Contact) else float(rng.uniform(*_STANDS))
        leader = b.edit(stops=(b.build_stop(s, "brakes", lasts=lasts, braking=braking),))
        touch = find_touch(a.candidate, b.candidate, s)
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


def _draw_reactions(
    follower: ScheduledAgent, leader: ScheduledAgent, rng: np.random.Generator
) -> list[float]:
    """Draw offsets at which the follower begins to brake a reaction time after the leader."""
    first, second = _find_onset(follower), _find_onset(leader)
    return [first - second - REACTION_TIME.sample(rng) for _ in range(_REACTIONS)]


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
    if at + delta < seen:
        return False
    x, y, _ = follower.get_pose_at(follower.enters + at + delta)
    u, v, _ = leader.get_pose_at(leader.enters + at)
    room = (follower.candidate.shape.length + leader.candidate.shape.length) / 2
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
    nodes = find_contact_nodes(a.candidate, b.candidate)
    near = compute_path_ttc(nodes, a, b, horizon=clause.high + 1.5)
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


def schedule_headways(
    clause: Headway, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the first follows the second at the headway asked
    for."""
    a, b = context.get_pair(clause, schedule)
    if clause.high < _CLOSE and clause.first not in schedule.actors and not context.figures:
        close = replace(a.candidate, time_law=b.candidate.time_law)
        a = ScheduledAgent.build_unplaced(close, a.landmarks)
    nodes = find_contact_nodes(a.candidate, b.candidate)
    meetings = find_conflict_intervals(nodes, a.free, b.free)
    if not len(meetings):
        words = f"{clause.first} and {clause.second} never share a lane"
        context.note_miss(clause, FailureStage.PATHS, words)
        return
    low, high = clause.low, clause.high
    distance = context.find_figure("gap", clause.first, clause.second)
    if distance is not None:
        speed = a.candidate.time_law.speed
        low, high = distance.low / speed, distance.high / speed
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
            placed_a = _queue_behind(placed_a, placed_b, context.rng)
        begins = max(placed_a.enters, placed_b.enters)
        if not _follows(placed_a, placed_b, least=least):
            words = f"{clause.first} does not stay behind {clause.second} for 3.6 s on end"
            context.note_miss(clause, FailureStage.COMPANY, words)
            continue
        time = begins + 4.0
        place = placed_a.get_pose_at(time)[:2]
        event = ScheduledEvent(clause, time, begins, time, time, place)
        yield schedule.add_event(event, placed_a, placed_b)


def _queue_behind(a: ScheduledAgent, b: ScheduledAgent, rng: np.random.Generator) -> ScheduledAgent:
    """Return the follower with a stop behind every one of its leader's, its wreck included."""
    stands = [(stop.s, stop.start, stop.until) for stop in b.stops]
    if b.contact is not None:
        last = float(b.motion.s[-1])
        stands = [stand for stand in stands if stand[0] < last - 1.0]
        stands.append((last, b.contact, b.contact + FOR_GOOD))
    stops = list(a.stops)
    for s, start, until in stands:
        touch = find_touch(a.candidate, b.candidate, s)
        if touch is None:
            continue
        behind = touch - float(rng.uniform(1.8, 3.0))
        behind = a.landmarks.move_off_crosswalks(behind)
        if behind > 2.0 and all(abs(stop.s - behind) > 1.0 for stop in stops):
            lag = float(rng.uniform(0.7, 1.3))
            stops.append(Stop("queue", behind, start, until + lag, "queue"))
    if len(stops) == len(a.stops):
        return a
    return a.edit(stops=tuple(sorted(stops, key=lambda stop: stop.s)))


def _follows(a: ScheduledAgent, b: ScheduledAgent, *, least: float) -> bool:
    """Return whether `a` drives behind `b` at a headway of `least` to 3.4 s for 3.6 s on end."""
    times = get_shared_times(a, b)
    if times is None:
        return False
    gap = compute_bumper_gaps(a, b, times)
    speed = np.maximum(np.interp(times - a.enters, a.motion.clock, a.motion.speed), 0.5)
    fits = (gap / speed > least) & (gap / speed < 3.4)
    return bool((np.convolve(fits, np.ones(36)) > 35.5).any())
