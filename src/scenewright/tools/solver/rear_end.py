"""Rear-end collisions: the leader stands, and the follower brakes hard but too late, or never."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenewright.geometry.driving_profile import StopCommand, compute_arrival
from scenewright.geometry.landmarks import STOP_GAP
from scenewright.scene.base import RIDERS
from scenewright.scene.constraints import Contact
from scenewright.scene.selection import Slowing, Stop
from scenewright.tools.solver.context import SolverContext
from scenewright.tools.solver.entry_times import build_red_light_stop
from scenewright.tools.solver.nearest_miss import FailureStage
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_TRIES = 6
_FOR_GOOD = 60.0
"""Longer than any scene [s]."""

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


def plan_rear_ends(
    a: ScheduledAgent, b: ScheduledAgent, clause: Contact, context: SolverContext
) -> Iterator[tuple[ScheduledAgent, ScheduledAgent, list[float]]]:
    """Plan follower and leader, edited but not yet placed, and offsets at which they meet [s]."""
    room = context.find_room_ahead(clause.second)
    for leader in _list_standing_leaders(b, room, context.rng):
        touch = _find_rear(leader, clause, context)
        if touch is not None:
            follower = a
            if context.reactions.may_react(clause.first):
                follower = _brake_late(a, touch, clause, context)
            yield follower, leader, _draw_offsets(follower, leader, touch, context.rng)
        else:
            words = f"{clause.first} does not drive in the lane where {clause.second} stops"
            context.note_miss(clause, FailureStage.PATHS, words)


def _draw_offsets(
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
    """List leaders: standing already; else at its red light; else braked to a stop on its path.

    Args:
        room: how far behind that place another has to stand ahead of it [m].
    """
    if b.stops:
        lingering = _delay_start(b)
        if lingering is not None:
            yield lingering
        return
    at_light = _stop_at_light(b, room)
    path = b.candidate.path
    turned = np.flatnonzero(np.abs(path.heading - path.heading[0]) >= TURNED)
    if at_light is not None and not len(turned):
        yield at_light
    low, high = _SUDDEN
    if len(turned):  # who turns is struck in the turn: at the light nothing would show it
        low = max(low, (path.s[turned[0]] + b.candidate.shape.length + 2.0) / path.length)
    for share in rng.uniform(low, max(high, low + 0.05), 2):
        place = b.landmarks.move_off_crosswalks(share * b.candidate.path.length)
        hold = StopCommand(place, 0.0, _SUDDEN_BRAKING)
        start = b.enters + compute_arrival(b.candidate, hold)
        until = start + _FOR_GOOD
        stop = Stop("stopping_point", hold.s, start, until, "brakes", _SUDDEN_BRAKING)
        yield b.edit(stops=(stop,))


def _stop_at_light(b: ScheduledAgent, room: float) -> ScheduledAgent | None:
    """Stop the leader of a rear-end collision at its red light, or in the queue there."""
    if b.landmarks.line is None or b.landmarks.group is None:
        return None
    stop = build_red_light_stop(b, b.landmarks.line - STOP_GAP - room)
    return b.edit(stops=(replace(stop, until=stop.start + _RED),))


def _find_rear(b: ScheduledAgent, clause: Contact, context: SolverContext) -> float | None:
    """Find where on its path [m] the follower touches the standing leader; None if it does not."""
    shared = context.find_path_conflict(clause).compute_intervals(0.0)
    standing = np.abs(shared.s_b[shared.j] - b.stops[-1].s) < 0.3
    if not standing.any():
        return None
    return float(shared.s_a[shared.i[standing]].min())


def _brake_late(
    a: ScheduledAgent, touch: float, clause: Contact, context: SolverContext
) -> ScheduledAgent:
    drawn = _PUSHING_SPEED if clause.second in context.pushed else _SPEED_LEFT
    speed = clause.speed or float(context.rng.uniform(*drawn))
    braking = _RIDER_BRAKING if a.candidate.shape.type in RIDERS else 5.5
    return a.edit(stops=a.stops, slowings=(Slowing(touch, speed, braking),))


def _delay_start(leader: ScheduledAgent) -> ScheduledAgent | None:
    """Delay the leader's start after giving way; one that waits at red stays as it is.

    None for one that waits far from the zone: hit there, it could have waited for any agent.
    """
    last = leader.stops[-1]
    if last.reason != "gives_way":
        return leader
    if last.ahead is None or last.ahead > _AT_THE_ZONE:
        return None
    return leader.edit(stops=(*leader.stops[:-1], replace(last, until=last.until + _LINGERS)))
