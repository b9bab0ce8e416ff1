"""`stops_at_yellow` and `blocks_junction`: what a vehicle does at its light without another agent.

It brakes hard for a light that turns yellow as it comes; or it passes its line on green and
stands in the junction while its light is red.
"""

from __future__ import annotations

import numpy as np

from scenewright.geometry.driving_profile import StopCommand, compute_arrival
from scenewright.geometry.landmarks import STOP_GAP, Landmarks
from scenewright.scene.candidates import Candidate
from scenewright.scene.selection import Stop
from scenewright.tools.map_grounding.signal_plan import SignalDemand
from scenewright.tools.solver.context import FOR_GOOD
from scenewright.tools.solver.motion_template import MotionTemplate
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_BRAKING = (4.2, 5.8)
"""Braking for a yellow light [m/s^2]."""

_REACTION = (0.7, 1.1)
"""From yellow to braking [s]."""

_WHEN = (8.0, 18.0)
"""When it comes to a stand [s]."""

_INSIDE, _STANDS = 5.0, (7.0, 11.0)
"""How near the middle of the junction the blocking vehicle stands [m], and for how long [s]."""

_CHANGES = 3.5
"""Time after passing its line by which the light of the blocking vehicle is red [s]."""


def stop_at_yellow(
    candidate: Candidate, landmarks: Landmarks, rng: np.random.Generator
) -> ScheduledAgent | None:
    """Brake the vehicle hard to a stop at its line; None if it has none, or is too slow."""
    if landmarks.line is None or landmarks.group is None:
        return None
    actor, s = ScheduledAgent.build_unplaced(candidate, landmarks), landmarks.line - STOP_GAP
    braking = float(rng.uniform(*_BRAKING))
    stands = compute_arrival(candidate, StopCommand(s, 0.0, braking))
    if not np.isfinite(stands) or s < 0.0:
        return None
    stop = Stop("stop_line", s, stands, stands + FOR_GOOD, "yellow", braking)
    held = actor.edit(stops=(stop,))
    if find_braking(held) < 1.0:
        return None
    return held.shift(round(float(rng.uniform(*_WHEN)) - stands, 1))


def block_junction(
    candidate: Candidate, landmarks: Landmarks, rng: np.random.Generator
) -> ScheduledAgent | None:
    """Stop the vehicle in the junction beyond its line; None if it does not come there."""
    if landmarks.line is None or landmarks.group is None:
        return None
    path = candidate.path
    inside = path.s[np.hypot(*path.xy.T) < _INSIDE]
    inside = inside[inside > landmarks.line + candidate.shape.length]
    free = [s for s in inside.tolist() if landmarks.move_off_crosswalks(s) == s]
    if not free:
        return None
    s = float(rng.choice(free))
    stands = compute_arrival(candidate, StopCommand(s, 0.0))
    until = stands + float(rng.uniform(*_STANDS))
    actor = ScheduledAgent.build_unplaced(candidate, landmarks)
    actor = actor.edit(stops=(Stop("stopping_point", s, stands, until, "blocks"),))
    return actor.shift(round(float(rng.uniform(*_WHEN)) - stands, 1))


def find_braking(actor: ScheduledAgent) -> float:
    """Find the time since it entered [s] at which it begins to brake for its stop."""
    speed = actor.motion.speed
    place = int(np.searchsorted(actor.motion.s, actor.stops[-1].s - 0.1))
    slows = np.diff(speed[: place + 1]) < -0.2
    free = np.flatnonzero(~slows[: max(place - 1, 1)])
    return 0.1 * float(free[-1] if len(free) else 0)


def list_yellow_demands(actor: ScheduledAgent, reaction: float) -> tuple[SignalDemand, ...]:
    """List demands: green until just before it brakes, yellow as it does."""
    group = str(actor.landmarks.group)
    turns = actor.enters + find_braking(actor) - reaction
    return (
        SignalDemand(group, turns - 1.5, turns - 0.3, ("green",)),
        SignalDemand(group, turns + 0.2, turns + reaction, ("yellow",)),
    )


def list_blocking_demands(actor: ScheduledAgent, _: float) -> tuple[SignalDemand, ...]:
    """List demands: red while it stands in the junction; passing on green is asked of all
    agents."""
    stop = actor.stops[-1]
    line = actor.enters + actor.motion.find_time_at(float(actor.landmarks.line or 0.0))
    begins = max(line + _CHANGES, stop.start)
    return (SignalDemand(str(actor.landmarks.group), begins, stop.until - 1.0, ("red",)),)


def draw_reaction(rng: np.random.Generator) -> float:
    """Draw how long after the light has turned yellow a driver brakes [s]."""
    return float(rng.uniform(*_REACTION))


_FAULT = "no light on its way, or too slow"
STOPPING = MotionTemplate(
    "cannot", _FAULT, place=stop_at_yellow, draw=draw_reaction, demands=list_yellow_demands
)
BLOCKING = MotionTemplate("cannot", _FAULT, place=block_junction, demands=list_blocking_demands)
