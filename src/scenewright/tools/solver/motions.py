"""Motions of one agent alone, each a template that a kind's file names.

A pedestrian pauses on the road, or turns round there and returns. A vehicle comes to the junction
in a lane that leads out of it; brakes hard for a light that turns yellow as it comes; or passes its
line on green and stands in the junction while its light is red.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from scenewright.geometry.landmarks import STOP_GAP, Landmarks
from scenewright.geometry.spline import build_even_path
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Candidate, Path
from scenewright.scene.map import IntersectionMap
from scenewright.scene.track import STEP
from scenewright.tools.map_grounding.signal_plan import SignalDemand
from scenewright.tools.solver.encounters import follow_path, shift_aside
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_Rng = np.random.Generator

_PAUSES, _TURNS = ((0.35, 0.65), (3.0, 6.0)), ((0.35, 0.6), (4.5, 8.0))
"""Where a pedestrian pauses on the road, and where it turns round: as a share of its crosswalk;
without one as a distance from the kerb [m]."""

_LASTS = (1.5, 3.0)
"""How long it pauses [s]."""

_CAME_BACK = 1.2
"""How far it has come back at least when it is hit [m]."""

_RADIUS = 0.45
"""Radius of its turn [m]."""

_BACK = 14.0
"""Least way on which a wrong-way driver comes back to its own side beyond the leg [m]."""

_WIDE = (2.0, 12.0)
"""How far beside its own lane the lane of the others may be [m]."""

_LEAVES = (7.0, 14.0)
"""When a wrong-way driver leaves the wrong lane [s]."""

_BRAKING = (4.2, 5.8)
"""Braking for a yellow light [m/s^2]."""

_REACTION = (0.7, 1.1)
"""From yellow to braking [s]."""

_WHEN = (8.0, 18.0)
"""When the blocking vehicle comes to a stand [s],"""

_STANDS = (7.0, 11.0)
"""for how long [s],"""

_INSIDE = 5.0
"""and how near the middle of the junction at most [m]."""

_CHANGES = 3.5
"""Time after passing its line by which the light of the blocking vehicle is red [s]."""


@dataclass(frozen=True)
class MotionTemplate:
    """What a motion does to an agent.

    Attributes:
        company: whether the agent does something with another one: it must, may or cannot.
        fault: why a candidate cannot move so.
        reshape: puts the candidate on another path; None where it cannot.
        hold: times the agent for its other events to be fitted to, entering at time 0.
        place: times the agent that meets no other; None where it cannot.
        draw: a figure drawn once a search; demands: what lights must show, given that figure.
        is_done: whether the motion came about before the agent was hit.
        shortens: a path that is long enough is walked in part.
    """

    company: Literal["must", "may", "cannot"]
    fault: str = ""
    reshape: Callable[[Candidate, Landmarks, IntersectionMap, _Rng], Candidate | None] | None = None
    hold: Callable[[Candidate, Landmarks, _Rng], ScheduledAgent] | None = None
    place: Callable[[Candidate, Landmarks, _Rng], ScheduledAgent | None] | None = None
    draw: Callable[[_Rng], float] | None = None
    demands: Callable[[ScheduledAgent, float], tuple[SignalDemand, ...]] | None = None
    is_done: Callable[[ScheduledAgent], bool] | None = None
    shortens: bool = False


def draw_pause(candidate: Candidate, landmarks: Landmarks, rng: _Rng) -> ScheduledAgent:
    """Draw where and how long the pedestrian stands still on the road, entering at time 0."""
    s = _draw_place(landmarks, rng, *_PAUSES) or 0.0
    actor = ScheduledAgent.build_unplaced(candidate, landmarks)
    lasts = float(rng.uniform(*_LASTS))
    return actor.hold_at_lights((actor.build_stop(s, "pauses", lasts=lasts, anchor="midway"),))


def turn_back(
    candidate: Candidate, landmarks: Landmarks, _map: IntersectionMap, rng: _Rng
) -> Candidate | None:
    """Put the candidate on a path that returns to where it begins; None if it is never on the
    road."""
    s = _draw_place(landmarks, rng, *_TURNS)
    if s is None:
        return None
    side = 1.0 if rng.random() < 0.5 else -1.0
    return follow_path(candidate, build_even_path(_double_back(candidate.path, s, side)))


def _draw_place(
    landmarks: Landmarks, rng: _Rng, share: tuple[float, float], beyond: tuple[float, float]
) -> float | None:
    """Draw a place on the road [m]: at a share of its crosswalk, or so far beyond a jaywalker's
    kerb [m]; None if it is never on the road."""
    for name, begins, ends in landmarks.crosswalks:
        if name == landmarks.own_crosswalk:
            return begins + (ends - begins) * float(rng.uniform(*share))
    return None if landmarks.line is None else landmarks.line + float(rng.uniform(*beyond))


def has_turned(actor: ScheduledAgent) -> bool:
    """Return whether it has come back by a step or two when it is hit."""
    away = np.hypot(*(actor.candidate.path.xy - actor.candidate.path.xy[0]).T)
    turn = float(actor.candidate.path.s[int(away.argmax())])
    return float(actor.motion.s[-1]) > turn + _CAME_BACK


def _double_back(path: Path, s: float, side: float) -> FloatArray:
    """Build points [P, 2] up to arc length `s` [m], round to the left (side 1) or right, and
    back."""
    out = path.xy[path.s <= s]
    heading = path.heading[: len(out)]
    leftward = np.stack((-np.sin(heading), np.cos(heading)), axis=1)
    back = (out + 2 * _RADIUS * side * leftward)[::-1]
    angle = np.linspace(0.0, np.pi, 13)[1:-1, None]
    middle, ahead = (out[-1] + back[0]) / 2, np.array((leftward[-1][1], -leftward[-1][0]))
    arc = middle + (out[-1] - middle) * np.cos(angle) + _RADIUS * ahead * np.sin(angle)
    return np.concatenate((out, arc, back))


def drive_wrong_way(
    candidate: Candidate,
    _landmarks: Landmarks,
    intersection_map: IntersectionMap,
    rng: _Rng,
) -> Candidate | None:
    """The candidate coming in by a lane of its leg that leads out; None if there is none beside.

    It comes back to its own side inside the junction.
    """
    path, leg = candidate.path, candidate.route.entry
    own = [lanelet for lanelet in intersection_map.lanelets if lanelet.leg == leg]
    lanes = [np.array(each.centreline) for each in own if each.kind == "exit"]
    ends = [np.array(each.centreline[-1]) for each in own if each.kind == "approach"]
    if not lanes or not ends:
        return None
    away = np.min([np.hypot(*(path.xy - end).T) for end in ends], axis=0)
    until = float(path.s[int(away.argmin())])  # where it leaves its approach lanes
    wide = _measure_aside(path, until, lanes[int(rng.integers(len(lanes)))])
    if not _WIDE[0] <= abs(wide) <= _WIDE[1]:
        return None
    run = max(_BACK, 3.5 * abs(wide))
    return follow_path(candidate, shift_aside(path, wide, begins=-run, ends=until, run=run))


def place_wrong_way(candidate: Candidate, landmarks: Landmarks, rng: _Rng) -> ScheduledAgent:
    """The vehicle that drives the wrong way and meets no other, in time."""
    actor = ScheduledAgent.build_unplaced(candidate, landmarks)
    away = np.hypot(*candidate.path.xy.T)
    there = actor.motion.find_time_at(float(candidate.path.s[int(away.argmin())]))
    return actor.shift(round(float(rng.uniform(*_LEAVES)) - there, 1))


def _measure_aside(path: Path, until: float, lane: FloatArray) -> float:
    """How far to the left of the path's first part the middle of a lane lies [m]."""
    before = path.s <= until
    xy, heading = path.xy[before], path.heading[before]
    leftward = np.stack((-np.sin(heading), np.cos(heading)), axis=1)
    found = []
    for point, left in zip(xy[::10], leftward[::10], strict=True):
        offsets = lane - point
        ahead = offsets @ np.array((left[1], -left[0]))
        if np.abs(ahead).min() < 3.0:
            found.append(float((offsets @ left)[int(np.abs(ahead).argmin())]))
    return float(np.median(found)) if found else 0.0


def stop_at_yellow(candidate: Candidate, landmarks: Landmarks, rng: _Rng) -> ScheduledAgent | None:
    """Brake the vehicle hard to a stop at its line; None if it has none, or is too slow."""
    if landmarks.line is None or landmarks.group is None:
        return None
    actor, s = ScheduledAgent.build_unplaced(candidate, landmarks), landmarks.line - STOP_GAP
    braking = float(rng.uniform(*_BRAKING))
    stop = actor.build_stop(s, "yellow", braking=braking, anchor="stop_line")
    if not np.isfinite(stop.start) or s < 0.0:
        return None
    held = actor.edit(stops=(stop,))
    if find_brake_onset(held) < 1.0:
        return None
    return held.shift(round(float(rng.uniform(*_WHEN)) - stop.start, 1))


def block_junction(candidate: Candidate, landmarks: Landmarks, rng: _Rng) -> ScheduledAgent | None:
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
    actor = ScheduledAgent.build_unplaced(candidate, landmarks)
    stop = actor.build_stop(s, "blocks", lasts=float(rng.uniform(*_STANDS)))
    return actor.edit(stops=(stop,)).shift(round(float(rng.uniform(*_WHEN)) - stop.start, 1))


def find_brake_onset(actor: ScheduledAgent) -> float:
    """Find the time since it entered [s] at which it begins to brake for its stop."""
    speed = actor.motion.speed
    place = int(np.searchsorted(actor.motion.s, actor.stops[-1].s - 0.1))
    slows = np.diff(speed[: place + 1]) < -0.2
    free = np.flatnonzero(~slows[: max(place - 1, 1)])
    return STEP * float(free[-1] if len(free) else 0)


def list_yellow_demands(actor: ScheduledAgent, reaction: float) -> tuple[SignalDemand, ...]:
    """List demands: green until just before it brakes, yellow as it does."""
    group = str(actor.landmarks.group)
    turns = actor.enters + find_brake_onset(actor) - reaction
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


def draw_reaction(rng: _Rng) -> float:
    """Draw how long after the light has turned yellow a driver brakes [s]."""
    return float(rng.uniform(*_REACTION))


PAUSING = MotionTemplate("must", hold=draw_pause)
TURNING_BACK = MotionTemplate(
    "must", "it is never on the road", reshape=turn_back, is_done=has_turned, shortens=True
)
WRONG_WAY = MotionTemplate(
    "may", "no lane beside its own", reshape=drive_wrong_way, place=place_wrong_way
)
_FAULT = "no light on its way, or too slow"
STOPPING = MotionTemplate(
    "cannot", _FAULT, place=stop_at_yellow, draw=draw_reaction, demands=list_yellow_demands
)
BLOCKING = MotionTemplate("cannot", _FAULT, place=block_junction, demands=list_blocking_demands)
