"""`drives_wrong_way`: a vehicle that comes to the junction in a lane that leads out of it."""

from __future__ import annotations

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Candidate, Path
from scenewright.scene.map import IntersectionMap
from scenewright.tools.solver.encounters import follow_path, shift_aside
from scenewright.tools.solver.motion_template import MotionTemplate
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_BACK = 14.0
"""Least way on which it comes back to its own side beyond the leg [m]."""

_WIDE = (2.0, 12.0)
"""How far beside its own lane the other one may be [m]."""

_WHEN = (7.0, 14.0)
"""When a wrong-way driver that meets no other vehicle leaves the wrong lane [s]."""


def drive_wrong_way(
    candidate: Candidate,
    _landmarks: Landmarks,
    intersection_map: IntersectionMap,
    rng: np.random.Generator,
) -> Candidate | None:
    """The candidate coming in by a lane of its leg that leads out; None if there is none beside.

    It comes back to its own side inside the junction.
    """
    path, leg = candidate.path, candidate.route.entry
    own = [each for each in intersection_map.lanelets if each.leg == leg]
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


def place_wrong_way(
    candidate: Candidate, landmarks: Landmarks, rng: np.random.Generator
) -> ScheduledAgent:
    """The vehicle that drives the wrong way and meets no other, in time."""
    actor = ScheduledAgent.build_unplaced(candidate, landmarks)
    away = np.hypot(*candidate.path.xy.T)
    there = actor.motion.find_time_at(float(candidate.path.s[int(away.argmin())]))
    return actor.shift(round(float(rng.uniform(*_WHEN)) - there, 1))


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


WRONG_WAY = MotionTemplate(
    "may", "no lane beside its own", reshape=drive_wrong_way, place=place_wrong_way
)
