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
from scenewright.tools.solver.context import FOR_GOOD, SolverContext
from scenewright.tools.solver.entry_times import build_red_light_stop
from scenewright.tools.solver.nearest_miss import FailureStage
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_TRIES = 6
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
        touch, follower = context.find_touch(clause, leader.stops[-1].s), a
        if touch is None:
            words = f"{clause.first} does not drive in the lane where {clause.second} stops"
            context.note_miss(clause, FailureStage.PATHS, words)
            continue
        if context.reactions.may_react(clause.first):  # it brakes, but too late
            drawn = _PUSHING_SPEED if clause.second in context.pushed else _SPEED_LEFT
            speed = clause.speed or float(context.rng.uniform(*drawn))
            braking = _RIDER_BRAKING if a.candidate.shape.type in RIDERS else 5.5
            follower = a.edit(stops=a.stops, slowings=(Slowing(touch, speed, braking),))
        yield follower, leader, _draw_offsets(follower, leader, touch, context.rng)


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
        hold = StopCommand(place, 0.0, _SUDDEN_BRAKING)
        start = b.enters + compute_arrival(b.candidate, hold)
        stop = Stop("stopping_point", place, start, start + FOR_GOOD, "brakes", _SUDDEN_BRAKING)
        yield b.edit(stops=(stop,))
