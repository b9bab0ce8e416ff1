"""Segment editor: a behavior program turned into motion (paper 3.5, Eq. 6, A.1).

    Keep       the prior as it is
    Stop       stands at the anchor from the segment's start to its end
    Proceed    the deferred remainder of the prior
    Terminate  ends at the anchor

Space is continuous because every segment runs along the one prior path; time has one step; the
braking before a Stop and the start after it are the agent's own time law.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenewright.geometry.driving_profile import Motion, StopCommand, compute_motion
from scenewright.scene.behavior import Segment
from scenewright.scene.selection import Push, SelectedAgent, Slowing, Stop
from scenewright.scene.track import STEP

_STAYS_ON = 5.0
_SAME_PLACE = 1e-3
"""Anchors of stops have their arc length to the millimetre [m]."""


@dataclass(frozen=True)
class MotionEdits:
    """Edits in local time (0 = the agent enters the map)."""

    holds: tuple[StopCommand, ...]
    slowings: tuple[Slowing, ...]
    end: float | None
    push: Push | None = None


def make_stop_command(stop: Stop, enters: float) -> StopCommand:
    """A stop in the time of an agent that enters then [s]."""
    return StopCommand(stop.s, stop.until - enters, stop.braking, stop.speed)


def get_motion_edits(agent: SelectedAgent) -> MotionEdits:
    """The edits that the solver found for a selected agent."""
    holds = tuple(make_stop_command(stop, agent.enters) for stop in agent.stops)
    end = None if agent.contact is None else agent.contact - agent.enters
    return MotionEdits(holds, agent.slowings, end, _get_local_push(agent))


def _get_local_push(agent: SelectedAgent) -> Push | None:
    """The push in the time of the agent (0 = it enters the map)."""
    return None if agent.push is None else agent.push.shift(-agent.enters)


def compute_edited_motion(
    agent: SelectedAgent,
    segments: tuple[Segment, ...],
    anchors: dict[str, float],
    *,
    duration: float,
) -> Motion:
    """The prior of an agent edited by its segments, from where it enters the map to where it ends.

    Args:
        anchors: arc length [m] of every anchor on the agent's path; duration: of the scene [s].
    """
    editing = _build_edits(agent, segments, anchors, duration)
    motion = compute_motion(agent.candidate, holds=editing.holds, slowings=editing.slowings)
    if editing.push is not None:
        motion = push_motion(motion, editing.push)
    return motion if editing.end is None else end_motion(motion, editing.end)


def push_motion(motion: Motion, push: Push) -> Motion:
    """The motion of a vehicle that is pushed on from where it stands, until it stands again.

    Args:
        push: its time is local [s].
    """
    times = STEP * np.arange(len(motion.s))
    since = np.clip(times - push.time, 0.0, push.speed / push.braking)
    moved = push.speed * since - 0.5 * push.braking * since**2
    stands = float(motion.compute_positions(np.array([push.time]))[0])
    s = np.where(times < push.time, motion.s, np.minimum(stands + moved, motion.path.length))
    return replace(motion, s=s)


def end_motion(motion: Motion, time: float) -> Motion:
    """The motion cut at the first sample not before local `time` [s]."""
    return motion.cut(int(np.ceil(time / STEP - 1e-6)))


def _build_edits(
    agent: SelectedAgent,
    segments: tuple[Segment, ...],
    anchors: dict[str, float],
    duration: float,
) -> MotionEdits:
    # An agent that started before the scene began shows no stop in it, but comes from there; and
    # one that rolls never stands.
    unseen = [stop for stop in agent.stops if stop.rolls or stop.until <= 0.0]
    holds = [make_stop_command(stop, agent.enters) for stop in unseen]
    end = None
    for segment in segments:
        if segment.status == "stop":
            s = anchors[segment.anchor]
            stop = _find_stop(agent, s)
            if stop is not None and stop.rolls:
                continue
            # An agent that still stands when the scene ends has not begun to start.
            lasts = segment.end + (_STAYS_ON if segment.end >= duration - STEP else 0.0)
            braking = None if stop is None else stop.braking
            holds.append(StopCommand(s, lasts - agent.enters, braking))
        if segment.status == "terminate":
            end = segment.start - agent.enters
    return MotionEdits(tuple(holds), agent.slowings, end, _get_local_push(agent))


def _find_stop(agent: SelectedAgent, s: float) -> Stop | None:
    """The solver's stop at an anchor at arc length `s` [m]; None where an agent added its own."""
    return next((stop for stop in agent.stops[::-1] if abs(stop.s - s) < _SAME_PLACE), None)
