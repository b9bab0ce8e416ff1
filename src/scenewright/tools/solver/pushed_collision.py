"""Chain collisions: a standing vehicle, struck from behind, is pushed into the one ahead of it.

Momentum is conserved along the lane, with a little restitution; then the struck vehicle brakes, as
its driver's foot is on the brake.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenewright.scene.candidates import Candidate
from scenewright.scene.constraints import Contact
from scenewright.scene.selection import Push
from scenewright.scene.track import VEHICLE_MASSES
from scenewright.tools.solver.context import QUEUED_BEHIND, FailureStage, SolverContext
from scenewright.tools.solver.impact import FirstContact, locate
from scenewright.tools.solver.scheduled_agent import PartialSchedule, ScheduledAgent, ScheduledEvent

_TRIES = 6
_GAP = (1.05, QUEUED_BEHIND)
"""Between the two that stand [m]; others in a queue keep at least 1 m."""

_RESTITUTION, _BRAKING = (0.1, 0.3), (5.0, 7.0)
"""Of cars struck at such speeds; and braking after it [m/s^2]."""

_EARLIER = (1.5, 5.0)
"""How long before the pushed vehicle the one ahead of it has come to stand [s]."""

_LONGEST, _LEAST_CLOSING = 0.8, 1.3
"""Time between the two contacts [s]; relative speed at the second [m/s]."""

_BESIDE, _TURNED = 0.4, 0.1
"""How far the one ahead may stand beside the other's axis [m], and be turned [rad]."""


def schedule_pushed_collisions(
    clause: Contact, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List schedules in which `first`, struck before, is pushed into `second` ahead of it."""
    struck = _find_strike(clause.first, schedule, context)
    if struck is None or clause.second in schedule.actors:
        words = f"{clause.first} is not struck from behind while it stands behind {clause.second}"
        context.note_miss(clause, FailureStage.PATHS, words)
        return
    for _ in range(_TRIES):
        placed = _place_ahead(clause, schedule.actors[clause.first], context)
        if placed is None:
            words = f"{clause.second} does not stand in the lane of {clause.first}, ahead of it"
            context.note_miss(clause, FailureStage.PATHS, words)
            return
        pushed, ahead = _push(struck, context.rng), placed
        found = context.find_first_contact(pushed, ahead)
        if (
            found is None
            or found.kind != "rear_end"
            or found.closing < _LEAST_CLOSING
            or found.time - struck.time > _LONGEST
        ):
            speed = 0.0 if pushed.push is None else pushed.push.speed
            words = f"struck so, {clause.first} is pushed on at {speed:.1f} m/s, which is too slow"
            context.note_miss(clause, FailureStage.MEASURE, words)
            continue
        time = found.time
        event = ScheduledEvent(clause, time, struck.time - 3.0, time, time, found.location)
        yield schedule.add_event(event, pushed.end_at(time), ahead.end_at(time))


def _find_strike(
    name: str, schedule: PartialSchedule, context: SolverContext
) -> FirstContact | None:
    """Find the contact in which the agent was struck from behind; None if it was not."""
    for event in schedule.events:
        clause = event.clause
        if isinstance(clause, Contact) and clause.second == name and clause.kind == "rear_end":
            return context.find_first_contact(schedule.actors[clause.first], schedule.actors[name])
    return None


def _place_ahead(
    clause: Contact, behind: ScheduledAgent, context: SolverContext
) -> ScheduledAgent | None:
    """Place `second` standing ahead of the other, which came later; None in another lane."""
    free = context.build_free(clause.second)
    stop = behind.stops[-1]
    place = _find_place_ahead(free, behind.get_pose(stop.s), context.rng, behind.candidate)
    line = free.landmarks.line
    if place is None or (stop.at_red and (line is None or place > line)):
        return None
    own = free.build_stop(place, stop.reason, braking=stop.braking, anchor=stop.anchor)
    earlier = float(context.rng.uniform(*_EARLIER))
    return free.edit(stops=(own,)).shift(round(stop.start - earlier - own.start, 1))


def _find_place_ahead(
    free: ScheduledAgent,
    behind: tuple[float, float, float],
    rng: np.random.Generator,
    candidate: Candidate,
) -> float | None:
    """Find where on its path [m] it stands a gap ahead of a pose; None if not in one lane."""
    x, y, heading = behind
    path = free.candidate.path
    room = (candidate.shape.length + free.candidate.shape.length) / 2 + float(rng.uniform(*_GAP))
    aim = np.array((x + room * np.cos(heading), y + room * np.sin(heading)))
    near = int(np.argmin(np.hypot(*(path.xy - aim).T)))
    turned = abs(float(np.angle(np.exp(1j * (path.heading[near] - heading)))))
    place = float(path.s[near])
    along, across = locate((*aim, heading), free.get_pose(place))
    return None if abs(across) > _BESIDE or turned > _TURNED else place - along


def _push(struck: FirstContact, rng: np.random.Generator) -> ScheduledAgent:
    """Return the agent that is struck standing until then, and pushed on from then."""
    agent, restitution = struck.second, float(rng.uniform(*_RESTITUTION))
    striker, own = (VEHICLE_MASSES[each.candidate.subtype or "car"] for each in struck.pair)
    speed = striker * struck.speed * (1.0 + restitution) / (striker + own)
    *before, stop = agent.stops
    standing = agent.edit(stops=(*before, replace(stop, until=struck.time)))
    return standing.push_on(Push(struck.time, speed, float(rng.uniform(*_BRAKING))))
