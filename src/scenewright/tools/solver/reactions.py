"""Threatened agents that react: from when a conflict is perceptible, and how (SEMANTICS 8).

A reaction is an edit of the agent's motion from a moment on: a vehicle or rider brakes, a
pedestrian slows down or runs. It is solved for like a stop: its outcome decides.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from scenewright.geometry.driving_profile import get_pace
from scenewright.scene.candidates import PACE_STEP
from scenewright.scene.kinds import has_trait
from scenewright.scene.reaction_behavior import (
    PERCEPTIBLE_TTC,
    Reaction,
    sample_reaction,
)
from scenewright.scene.selection import Slowing
from scenewright.scene.track import STEP
from scenewright.tools.solver.path_conflict import PathConflict
from scenewright.tools.solver.path_ttc import compute_path_ttc
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

SEEN_BEFORE = 0.6
"""How long before a conflict is perceptible the two are visible at least [s]."""

SLOWS_FOR = 0.45
"""Shortest time in which an agent slows down [s]."""

_LASTS = 0.3
"""How long a conflict must stay perceptible to count [s] (SEMANTICS 8)."""

_LOOK_BACK = 6.0
"""How long before an event a threat is looked for [s]."""

_SMOOTHED = 0.15
"""By how much the smoothing of motion makes a braking begin earlier than it is meant to [s]."""

_LEAST_TIME = 0.4
"""A braking shorter than this [s] is smoothed away."""

_BEHIND = np.deg2rad(105.0)
"""An agent from further round than this is not seen from a seat or saddle [rad]."""

_RUNS, _FASTEST = 2.5, 2.85
"""How fast a pedestrian runs out of the way [m/s]."""


@dataclass(frozen=True)
class ReactionRequests:
    """Reactions asked for, and agents that are hidden up to a time.

    Attributes:
        excluded: agents that do not react, as the text says.
        hidden: of pairs of which one is hidden: least and most time from the first line of sight
            to the event [s].
        ways: agents that react in a certain way, as the text says.
    """

    excluded: frozenset[str] = frozenset()
    hidden: Mapping[frozenset[str], tuple[float, float]] = field(default_factory=dict)
    ways: Mapping[str, str] = field(default_factory=dict)

    def may_react(self, name: str) -> bool:
        """Return whether the text leaves the agent to react."""
        return name not in self.excluded

    def draw(self, name: str, of: ScheduledAgent, rng: np.random.Generator) -> Reaction:
        """Draw a reaction of the agent: as asked for, else one along its path."""
        drawn = sample_reaction(of.candidate.shape.type, rng, kind=self.ways.get(name))
        if name in self.ways:
            return drawn
        if of.candidate.shape.type != "pedestrian":
            drawn = replace(drawn, kind="brakes")
        elif has_trait("reaction", drawn.kind, "back"):
            drawn = replace(drawn, kind="stops")
        return drawn


def find_threat(
    pair: PathConflict,
    a: ScheduledAgent,
    b: ScheduledAgent,
    *,
    until: float,
    lead: tuple[float, float] | None = None,
) -> tuple[float, float] | None:
    """Find when [s] a conflict of the two is perceptible; None if it never is.

    Args:
        until: the event [s]; lead: how long before it the line of sight is free [s], if not always.
    """
    near = compute_path_ttc(pair, a, b, horizon=PERCEPTIBLE_TTC)
    seen = (near.times >= until - _LOOK_BACK) & (near.times <= until + 1e-6)
    if lead is not None:
        seen &= near.times >= until - sum(lead) / 2
    holds = np.flatnonzero(seen & (near.ttc < PERCEPTIBLE_TTC))
    need = round(_LASTS / STEP)
    lasting = np.flatnonzero(holds[need:] == holds[: max(len(holds) - need, 0)] + need)
    if not len(lasting):
        return None
    return float(near.times[holds[lasting[0]]]), float(near.times[holds[-1]]) + STEP


def sees(of: ScheduledAgent, other: ScheduledAgent, time: float) -> bool:
    """Return whether the other is not behind it at a time [s]; pedestrians look all around."""
    if of.candidate.shape.type == "pedestrian":
        return True
    at = np.array([time])
    (x, y, heading), (u, v, _) = of.get_poses(at)[0].tolist(), other.get_poses(at)[0].tolist()
    bearing = np.arctan2(v - y, u - x) - heading
    return bool(abs(np.angle(np.exp(1j * bearing))) < _BEHIND)


def slow_down(
    of: ScheduledAgent, *, onset: float, braking: float, speed: float, kept: float
) -> ScheduledAgent | None:
    """Brake the agent from a moment [s] on to a speed [m/s], which it keeps for a distance [m].

    None where it is hardly faster than that then.
    """
    s, before = _find_state(of, onset + _SMOOTHED)
    if before - speed < _LEAST_TIME * braking:
        return None
    at = s + (before**2 - speed**2) / (2.0 * braking)
    slowing = Slowing(at, speed, braking, kept)
    return of.edit(stops=of.stops, slowings=(*of.slowings, slowing))


def run_on(
    of: ScheduledAgent, *, onset: float, acceleration: float, until: float
) -> ScheduledAgent | None:
    """Make the pedestrian run from a moment [s] on, up to an arc length [m]; None if it stands."""
    s, before = _find_state(of, onset + _SMOOTHED)
    if before < 0.6 or before > _RUNS - 0.4 or until - s < 0.5:
        return None
    law = of.candidate.time_law
    places = np.arange(0.0, of.candidate.path.length + PACE_STEP, PACE_STEP)
    own = get_pace(law, places)
    runs = (places > s - PACE_STEP) & (places <= until)
    pace = np.where(runs, np.minimum(own, _FASTEST / _RUNS), own * law.speed / _RUNS)
    hurried = replace(
        law, speed=_RUNS, acceleration=acceleration, pace=tuple(pace.round(4).tolist())
    )
    # A pace has its speeds every metre, and in between it would run before the moment.
    near = min(s, 2 * PACE_STEP)
    walks = Slowing(s - near, before, law.braking, near)
    runner = replace(of, candidate=replace(of.candidate, time_law=hurried))
    return runner.edit(stops=of.stops, slowings=(*of.slowings, walks))


def find_usual_braking(of: ScheduledAgent, begin: float, onset: float) -> float:
    """Find how hard [m/s^2] it brakes anyway, for a bend or a light: a reaction must be harder.

    Args:
        begin: when the other is perceptible; onset: when it would react [s].
    """
    if of.candidate.shape.type == "pedestrian":
        return 0.0
    rate = of.motion.acceleration
    at = [min(max(round((time - of.enters) / STEP), 0), len(rate) - 1) for time in (begin, onset)]
    return max(-float(rate[at].min()), 0.0)


def find_speed(of: ScheduledAgent, time: float) -> float:
    """Find its speed [m/s] at a scene time."""
    return _find_state(of, time)[1]


def find_place(of: ScheduledAgent, time: float) -> float:
    """Find its arc length [m] at a scene time."""
    return _find_state(of, time)[0]


def _find_state(of: ScheduledAgent, time: float) -> tuple[float, float]:
    """Find arc length [m] and speed [m/s] at a scene time."""
    local = time - of.enters
    place = float(np.interp(local, of.motion.clock, of.motion.s))
    return place, of.motion.find_speed_at(local)
