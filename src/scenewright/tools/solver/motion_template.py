"""How the solver brings a motion of one agent about; a kind's file names the module's template."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.candidates import Candidate
from scenewright.scene.map import IntersectionMap
from scenewright.tools.map_grounding.signal_plan import SignalDemand
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_Rng = np.random.Generator
_Reshape = Callable[[Candidate, Landmarks, IntersectionMap, _Rng], Candidate | None]
_Place = Callable[[Candidate, Landmarks, _Rng], ScheduledAgent | None]


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
    reshape: _Reshape | None = None
    hold: Callable[[Candidate, Landmarks, np.random.Generator], ScheduledAgent] | None = None
    place: _Place | None = None
    draw: Callable[[np.random.Generator], float] | None = None
    demands: Callable[[ScheduledAgent, float], tuple[SignalDemand, ...]] | None = None
    is_done: Callable[[ScheduledAgent], bool] | None = None
    shortens: bool = False
