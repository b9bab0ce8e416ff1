"""`pauses`: a pedestrian that stands still for a while while crossing the road."""

from __future__ import annotations

import numpy as np

from scenewright.geometry.driving_profile import StopCommand, compute_arrival
from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.candidates import Candidate
from scenewright.scene.selection import Stop
from scenewright.tools.solver.motion_template import MotionTemplate
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_PLACE, _LASTS = (0.35, 0.65), (1.5, 3.0)
"""Where it stands, as a share of the way from kerb to kerb; and for how long [s]."""

_BEYOND_KERB = (3.0, 6.0)
"""How far from the kerb a jaywalker stands [m]."""


def draw_pause(
    candidate: Candidate, landmarks: Landmarks, rng: np.random.Generator
) -> ScheduledAgent:
    """Draw where and how long the pedestrian stands still on the road, entering at time 0."""
    own = [each for each in landmarks.crosswalks if each[0] == landmarks.own_crosswalk]
    if own:
        _, begins, ends = own[0]
        s = begins + (ends - begins) * float(rng.uniform(*_PLACE))
    else:  # a jaywalker, beyond its kerb
        s = (landmarks.line or 0.0) + float(rng.uniform(*_BEYOND_KERB))
    start = compute_arrival(candidate, StopCommand(s, 0.0))
    stop = Stop("midway", s, start, start + float(rng.uniform(*_LASTS)), "pauses")
    return ScheduledAgent.build_unplaced(candidate, landmarks).hold_at_lights((stop,))


PAUSING = MotionTemplate("must", hold=draw_pause)
