"""`turns_back`: a pedestrian that turns round while crossing the road and returns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.geometry.spline import build_even_path
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Candidate, K, Path, sample_evenly
from scenewright.scene.map import IntersectionMap
from scenewright.tools.solver.motion_template import MotionTemplate
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_PLACE = (0.35, 0.6)
"""Where it turns, as a share of the way from kerb to kerb."""

_BEYOND_KERB = (4.5, 8.0)
"""How far from the kerb a jaywalker turns [m]."""

_CAME_BACK = 1.2
"""How far it has come back at least when it is hit [m]."""

_RADIUS = 0.45
"""Of the turn [m]."""


def turn_back(
    candidate: Candidate, landmarks: Landmarks, _map: IntersectionMap, rng: np.random.Generator
) -> Candidate | None:
    """Put the candidate on a path that returns to where it begins; None if it is never on the
    road."""
    kerbs = ((b, e) for name, b, e in landmarks.crosswalks if name == landmarks.own_crosswalk)
    begins, ends = next(kerbs, (landmarks.line, None))  # for a jaywalker the first kerb alone
    if begins is None:
        return None
    if ends is None:
        s = begins + float(rng.uniform(*_BEYOND_KERB))
    else:
        s = begins + (ends - begins) * float(rng.uniform(*_PLACE))
    side = 1.0 if rng.random() < 0.5 else -1.0
    path = build_even_path(_double_back(candidate.path, s, side))
    even = sample_evenly(path.length, K)
    waypoints = np.stack([np.interp(even, path.s, path.xy[:, axis]) for axis in (0, 1)], axis=1)
    return replace(candidate, path=path, waypoints=waypoints)


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


TURNING_BACK = MotionTemplate(
    "must", "it is never on the road", reshape=turn_back, is_done=has_turned, shortens=True
)
