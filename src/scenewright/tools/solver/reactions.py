"""Threatened agents that react, swerve or step back: from when, and how (SEMANTICS 8).

A reaction is an edit of the agent's motion from a moment on: a vehicle or rider brakes, a
pedestrian slows down or runs. It is solved for like a stop: its outcome decides.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from scenewright.geometry.driving_profile import get_pace
from scenewright.geometry.landmarks import Landmarks
from scenewright.geometry.spline import build_even_path
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import PACE_STEP, Path
from scenewright.scene.kinds import has_trait
from scenewright.scene.reaction_behavior import (
    PERCEPTIBLE_TTC,
    Reaction,
    sample_reaction,
)
from scenewright.scene.selection import Slowing
from scenewright.scene.track import STEP
from scenewright.tools.solver.impact import locate
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
    (x, y, heading), (u, v, _) = of.get_pose_at(time), other.get_pose_at(time)
    bearing = np.arctan2(v - y, u - x) - heading
    return bool(abs(np.angle(np.exp(1j * bearing))) < _BEHIND)


def slow_down(
    of: ScheduledAgent, *, onset: float, braking: float, speed: float, kept: float
) -> ScheduledAgent | None:
    """Brake the agent from a moment [s] on to a speed [m/s], which it keeps for a distance [m].

    None where it is hardly faster than that then.
    """
    s, before = of.find_place(onset + _SMOOTHED), of.find_speed(onset + _SMOOTHED)
    if before - speed < _LEAST_TIME * braking:
        return None
    at = s + (before**2 - speed**2) / (2.0 * braking)
    slowing = Slowing(at, speed, braking, kept)
    return of.edit(stops=of.stops, slowings=(*of.slowings, slowing))


def run_on(
    of: ScheduledAgent, *, onset: float, acceleration: float, until: float
) -> ScheduledAgent | None:
    """Make the pedestrian run from a moment [s] on, up to an arc length [m]; None if it stands."""
    s, before = of.find_place(onset + _SMOOTHED), of.find_speed(onset + _SMOOTHED)
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
    here, over = of.find_place(onset), max(_MOVES_OVER * of.find_speed(onset), _SHORTEST)
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
    _, left = locate(of.get_pose_at(meets), other.get_pose_at(meets))
    aside = -by if left > 0.0 else by
    return swerve(changed, onset=onset, there=of.find_place(meets), aside=aside)


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
    x, y, heading, curvature = (np.asarray(np.interp(s, path.s, row)) for row in rows)
    along: FloatArray = _FINE * np.arange(len(order), dtype=np.float64)
    return Path(np.stack((x, y), axis=1), along, heading, curvature)


def _move_to(
    of: ScheduledAgent, path: Path, marks: Landmarks, slowings: tuple[Slowing, ...]
) -> ScheduledAgent:
    candidate = replace(of.candidate, path=path, unevaded=of.candidate.path)
    moved = replace(of, candidate=candidate, landmarks=marks)
    return moved.edit(stops=of.stops, slowings=slowings)
