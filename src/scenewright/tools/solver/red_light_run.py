"""`runs_red`: an agent passes its line on red, in the scene and before its other events."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.candidates import Candidate
from scenewright.scene.constraints import GivesWay, Headway
from scenewright.tools.solver.schedule import PartialSchedule, ScheduledEvent, get_pair
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_SEEN = 0.6
"""Least time from the beginning of the scene to the run [s]."""

_LONE = (6.0, 19.0)
"""When an agent without other relations runs red [s]."""


def runs_in_time(name: str, schedule: PartialSchedule, *, until: float) -> bool:
    """Return whether the agent passes its line in the scene, and before its last event."""
    return _SEEN <= compute_line_time(schedule.actors[name]) <= until and runs_first(name, schedule)


def runs_first(name: str, schedule: PartialSchedule) -> bool:
    """Return whether the agent passes its line before its last event, at any scene time."""
    own = [each for each in schedule.events if name in get_pair(each.clause)]
    latest = max((_find_latest_cause(each, name) for each in own), default=float("inf"))
    return compute_line_time(schedule.actors[name]) <= latest


def compute_line_time(actor: ScheduledAgent) -> float:
    """Compute the scene time [s] at which the agent passes its line; inf if it never does."""
    if actor.landmarks.line is None or actor.landmarks.group is None:
        return float("inf")
    return actor.enters + actor.motion.find_time_at(actor.landmarks.line)


def add_red_light_runners(
    schedule: PartialSchedule,
    candidates: Mapping[str, tuple[Candidate, Landmarks]],
    rng: np.random.Generator,
) -> PartialSchedule:
    """Add all agents that run red without another relation to the schedule."""
    actors = dict(schedule.actors)
    for name, built in candidates.items():
        if name not in actors:
            actor = ScheduledAgent.build_unplaced(*built)
            line = compute_line_time(actor)
            if np.isfinite(line):
                actors[name] = actor.shift(float(rng.uniform(*_LONE)) - line)
    return PartialSchedule(actors, schedule.events)


def _find_latest_cause(event: ScheduledEvent, name: str) -> float:
    """Find until when [s] running red can have caused the event."""
    match event.clause:
        case GivesWay(second=second):
            return event.freed if second == name else event.ends
        case Headway():
            return float("inf")
    return event.time
