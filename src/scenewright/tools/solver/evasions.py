"""Reactions that leave the path: a vehicle swerves within its lane, a pedestrian steps back.

Both are motions forward along another path from a moment on: one that is moved aside for a while,
or one that turns round on the spot twice. So all that holds of motions along a path stays true;
where two paths touch is looked for anew.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.geometry.spline import build_even_path
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Path
from scenewright.scene.selection import Slowing
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_MOVES_OVER = 1.15
"""Time in which a vehicle moves aside [s]."""
_SHORTEST = 4.0
"""Way in which it moves aside at least [m]."""
_BACK_IN_LANE = 2.0
"""How many times as long the way back to its line is."""
_STAYS_ASIDE = 3.0
"""How far beyond the place where it passes the other it stays aside [m]."""

_FINE = 0.1
"""Between points of a path that turns round on the spot [m]."""
_TURNS_AT, _RESTS_AT = 0.06, 0.1
"""Speed at which a pedestrian turns round, and of one that all but stands [m/s]."""
_ENDS = 2.6
"""Braking with which it ends going backwards [m/s^2]."""
_JUMPS, _PUSHES_OFF = 1.2, 2.6
"""Who goes backwards faster than this [m/s] jumps, and sets off so hard [m/s^2]."""


def swerve(
    of: ScheduledAgent, *, onset: float, there: float, aside: float
) -> ScheduledAgent | None:
    """Move the agent aside from a moment [s] on, until it is past a place, and then back.

    Args:
        there: arc length of the place [m]; aside: how far, to the left [m].

    Returns:
        None where there is no way left for it.
    """
    here = float(of.motion.compute_positions(np.array([onset - of.enters]))[0])
    over = max(_MOVES_OVER * of.motion.find_speed_at(onset - of.enters), _SHORTEST)
    if there < here + over:
        return None
    path = of.candidate.path
    away = _rise((path.s - here) / over)
    back = _rise((path.s - there - _STAYS_ASIDE) / (_BACK_IN_LANE * over))
    normal = np.stack((-np.sin(path.heading), np.cos(path.heading)), axis=1)
    moved = build_even_path(path.xy + (aside * (away - back))[:, None] * normal)
    return _move_to(of, moved, of.landmarks, of.slowings)


def swerve_away(
    changed: ScheduledAgent,
    of: ScheduledAgent,
    other: ScheduledAgent,
    *,
    onset: float,
    meets: float,
    by: float,
) -> ScheduledAgent | None:
    """Move an agent that has reacted aside, away from where the other would be as they meet.

    Args:
        of: it without its reaction; by: how far [m]; onset, meets: [s].
    """
    x, y, heading = of.get_poses(np.array([meets]))[0].tolist()
    u, v, _ = other.get_poses(np.array([meets]))[0].tolist()
    left = (v - y) * np.cos(heading) - (u - x) * np.sin(heading) > 0.0
    there = float(of.motion.compute_positions(np.array([meets - of.enters]))[0])
    return swerve(changed, onset=onset, there=there, aside=-by if left else by)


def _rise(share: FloatArray) -> FloatArray:
    """[N] 0 before 0, 1 after 1, and a smooth rise between."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(share, 0.0, 1.0)))


def step_back(
    of: ScheduledAgent, *, at: float, back: float, braking: float, speed: float, rests: float
) -> ScheduledAgent | None:
    """Make the pedestrian turn round at an arc length [m], go backwards, rest and go on.

    Args:
        back: how far it goes backwards [m], and how fast: speed [m/s].
        braking: towards the place where it turns round [m/s^2].
        rests: how long it stands after that [s].
    """
    path = of.candidate.path
    if speed > _JUMPS:
        law = replace(of.candidate.time_law, acceleration=_PUSHES_OFF)
        of = replace(of, candidate=replace(of.candidate, time_law=law))
    turn, count = round(at / _FINE), round(back / _FINE)
    last = int(path.length / _FINE)
    if not count < turn < last - 2:
        return None
    folded = _fold_path(path, turn, count, last)
    at, back = _FINE * turn, _FINE * count
    rest = rests * _RESTS_AT
    slowings = (
        Slowing(at, _TURNS_AT, braking),
        Slowing(at + 0.05, speed, _ENDS, back - 0.1),
        Slowing(at + back - rest / 2, _RESTS_AT, _ENDS, rest),
    )
    crossed = tuple(
        (name, begins + 2 * back * (begins > at), ends + 2 * back * (ends > at))
        for name, begins, ends in of.landmarks.crosswalks
    )
    line = of.landmarks.line
    line = line if line is None or line <= at else line + 2 * back
    marks = replace(of.landmarks, crosswalks=crossed, line=line)
    return _move_to(of, folded, marks, (*of.slowings, *slowings))


def _fold_path(path: Path, turn: int, count: int, last: int) -> Path:
    """The path with its points in the order in which they are walked, facing as before."""
    order = np.concatenate((
        np.arange(turn), np.arange(turn, turn - count, -1), np.arange(turn - count, last + 1),
    ))  # fmt: skip
    s = _FINE * order
    rows = (path.xy[:, 0], path.xy[:, 1], path.heading, path.curvature)
    x, y, heading, curvature = (np.asarray(np.interp(s, path.s, each)) for each in rows)
    along: FloatArray = _FINE * np.arange(len(order), dtype=np.float64)
    return Path(np.stack((x, y), axis=1), along, heading, curvature)


def _move_to(
    of: ScheduledAgent, path: Path, marks: Landmarks, slowings: tuple[Slowing, ...]
) -> ScheduledAgent:
    candidate = replace(of.candidate, path=path, unevaded=of.candidate.path)
    moved = replace(of, candidate=candidate, landmarks=marks)
    return moved.edit(stops=of.stops, slowings=slowings)
