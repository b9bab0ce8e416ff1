"""`runs_red`: an agent passes its line on red, in the scene and before what it does to others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.candidates import Candidate
from scenewright.scene.constraints import GivesWay, Headway
from scenewright.tools.solver.schedule import Happening, Staging, pair_of
from scenewright.tools.solver.scheduled_agent import Actor

_SEEN = 0.6
"""Least time from the beginning of the scene to the run [s]."""

_LONE = (6.0, 19.0)
"""When somebody runs red whom no relation binds [s]."""


def runs_in_time(name: str, staging: Staging, *, until: float) -> bool:
    """Whether the agent passes its line in the scene, and before the last event it is in."""
    return _SEEN <= passes_line(staging.actors[name]) <= until and runs_first(name, staging)


def runs_first(name: str, staging: Staging) -> bool:
    """Whether the agent passes its line before the last event it is in, whenever all that is."""
    own = [each for each in staging.happenings if name in pair_of(each.clause)]
    latest = max((_decided(each, name) for each in own), default=float("inf"))
    return passes_line(staging.actors[name]) <= latest


def passes_line(actor: Actor) -> float:
    """Scene time [s] at which the agent passes its line; inf if it never does."""
    if actor.marks.line is None or actor.marks.group is None:
        return float("inf")
    return actor.enters + actor.motion.time_at(actor.marks.line)


def with_runners(
    staging: Staging,
    names: Iterable[str],
    candidates: Mapping[str, tuple[Candidate, Landmarks]],
    rng: np.random.Generator,
) -> Staging:
    """The staging with everybody in it who runs red without having to do with anybody."""
    actors = dict(staging.actors)
    for name in names:
        if name not in actors:
            actor = Actor.unplaced(*candidates[name])
            line = passes_line(actor)
            if np.isfinite(line):
                actors[name] = actor.shifted(float(rng.uniform(*_LONE)) - line)
    return Staging(actors, staging.happenings)


def _decided(happening: Happening, name: str) -> float:
    """Until when [s] running red can have brought about what happens."""
    match happening.clause:
        case GivesWay(second=second):
            return happening.freed if second == name else happening.ends
        case Headway():
            return float("inf")
    return happening.time
