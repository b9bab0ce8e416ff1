"""What a street shows beyond one agent's motion: headways, companions, starts, counts, reactions.

Each measure gives values by stretch, so that intervals can draw whole stretches anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from scenewright.evals.bootstrap import Figure, compute_mean
from scenewright.evals.realism.sources import Stretch
from scenewright.geometry.kinematics import compute_kinematics
from scenewright.geometry.polyline import interpolate_points, measure_arc_lengths, measure_length
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker import RoadUser, find_events

SHORT_HEADWAY = 2.0
"""Passing a place less than this after another [s] is following closely."""
_PLACES = (0.25, 0.5, 0.75)
"""Shares of a vehicle's path at which its headway is measured."""
_SAME_PLACE, _SAME_COURSE = 1.5, 0.5
"""Another passes a place within this distance [m], its course within this angle [rad]."""
_LEAST_WAY = 10.0
COMPANION = 1.5
"""Mean distance of two pedestrians that walk together [m] (SEMANTICS section 8: groups)."""
_TOGETHER = 3.0
"""For at least so long [s]."""
_START_TOGETHER, _START_NEAR = 1.5, 10.0
"""Two start together within this time [s] and distance [m]."""
_STANDS, _WALKS = 0.3, 0.5
BEFORE_EVENT = 3.0
"""How long before an event a reaction is looked for [s]."""
REACTS = 0.3
"""Change of speed from which a party counts as reacting [m/s]."""
_TURNS_AWAY = 0.3
"""Change of course from which a party counts as reacting [rad]."""


def compute_share(parts: Sequence[Sequence[float] | Sequence[bool]], *, seed: int = 0) -> Figure:
    """Compute the mean of all values, one sequence for each stretch; stretches are drawn anew."""
    x = np.array([value for part in parts for value in part], dtype=np.float64)
    stretch = np.array([k for k, part in enumerate(parts) for _ in part], dtype=np.int64)
    return compute_mean(x, stretch, draws=500, seed=seed)


def find_close_followers(stretch: Stretch) -> list[bool]:
    """Return for each vehicle that drives 10 m whether it passes a place within 2 s of another."""
    drives = [u for u in stretch.users if u.shape.type == "vehicle"]
    vehicles = [u for u in drives if measure_length(u.track.xy) > _LEAST_WAY]
    return [
        any(_compute_headway(u, other) < SHORT_HEADWAY for other in vehicles if other.id != u.id)
        for u in vehicles
    ]


def _compute_headway(user: RoadUser, other: RoadUser) -> float:
    """Compute the least time at which a vehicle passes a place after another vehicle [s]."""
    s = measure_arc_lengths(user.track.xy)
    least = np.inf
    for part in _PLACES:
        k = int(np.searchsorted(s, part * s[-1]))
        away = np.hypot(*(other.track.xy - user.track.xy[k]).T)
        j = int(away.argmin())
        turned = np.cos(other.track.heading[j] - user.track.heading[k])
        later = float(user.track.times[k] - other.track.times[j])
        inside = 0 < j < len(away) - 1 and away[j] < _SAME_PLACE
        if inside and turned > np.cos(_SAME_COURSE) and later > 0.0:
            least = min(least, later)
    return least


def find_accompanied(stretch: Stretch) -> list[bool]:
    """Return for each walking pedestrian whether another keeps within 1.5 m for 3 s or longer."""
    people = (u.track for u in stretch.users if u.shape.type == "pedestrian")
    walkers = [
        track
        for track in people
        if measure_length(track.xy) > _WALKS * max((len(track.xy) - 1) * track.step, 1e-9)
    ]
    together = np.zeros((len(walkers), len(walkers)), dtype=np.bool_)
    for (j, one), (k, two) in combinations(enumerate(walkers), 2):
        first, last = max(one.start, two.start), min(one.end, two.end)
        if last - first >= _TOGETHER:
            times = np.arange(first, last, 0.4)
            places = [interpolate_points(times, t.times, t.xy) for t in (one, two)]
            apart = float(np.hypot(*(places[0] - places[1]).T).mean())
            together[j, k] = together[k, j] = apart <= COMPANION
    return [bool(row.any()) for row in together]


def find_common_starts(stretch: Stretch) -> list[bool]:
    """Return for each pedestrian that sets off whether another nearby does so within 1.5 s."""
    starts: list[tuple[float, FloatArray]] = []
    for track in (u.track for u in stretch.users if u.shape.type == "pedestrian"):
        done = compute_kinematics(track.xy, smoothing=0.3)
        if len(done):  # who walks off after standing for a second sets off
            still = np.convolve(done.speed <= _STANDS, np.ones(10), mode="full")[: len(done)] >= 10
            for k in np.flatnonzero(still[:-1] & ~still[1:]):
                if (done.speed[k : k + 20] > _WALKS).any():
                    at = k + done.first
                    starts.append((float(track.times[at]), track.xy[at]))
    return [
        any(
            k != j
            and abs(t - other) <= _START_TOGETHER
            and float(np.hypot(*(xy - place))) <= _START_NEAR
            for j, (other, place) in enumerate(starts)
        )
        for k, (t, xy) in enumerate(starts)
    ]


def compute_count_ranks(
    stretches: Sequence[Stretch], mass_of: Callable[[str, int], FloatArray], *, seed: int = 0
) -> dict[AgentClass, list[list[float]]]:
    """Compute by class the rank of each scene's agent count in p_tod (randomised PIT).

    Uniform, with a mean of 0.5, if scenes are as full as the hour is. One value for each scene
    whose request left the number open.

    Args:
        mass_of: [V, P] probability of each pair of numbers, of an intersection and hour.
    """
    rng = np.random.default_rng(seed)
    kinds: tuple[AgentClass, ...] = ("vehicle", "pedestrian")
    found: dict[AgentClass, list[list[float]]] = {kind: [] for kind in kinds}
    for stretch in stretches:
        if stretch.hour is None or stretch.place is None:
            continue
        mass = mass_of(stretch.place, stretch.hour)
        for axis, kind in enumerate(kinds):
            n = sum(user.shape.type == kind for user in stretch.users)
            below = np.concatenate([[0.0], np.cumsum(mass.sum(axis=1 - axis)), [1.0, 1.0]])
            low, high = (below[min(k, len(below) - 1)] for k in (n, n + 1))
            found[kind].append([float(low + rng.random() * (high - low))])
    return found


@dataclass(frozen=True)
class EventParty:
    """One of the two agents of a collision or a near miss.

    Attributes:
        event, kind: what happened and the class of the party; reacts: whether its speed changed by
            0.3 m/s or its course by 0.3 rad in the 3 s before.
    """

    event: str
    kind: AgentClass
    reacts: bool


def find_reactions(stretch: Stretch) -> list[tuple[EventParty, EventParty]]:
    """Find the parties of each collision and near miss, both present for 3 s before it.

    In our scenes the events are those of the scene, elsewhere those that the checker finds.
    """
    users = {user.id: user for user in stretch.users}
    if stretch.events is None:
        found: list[Any] = list(find_events(list(stretch.users)))
    else:
        found = list(stretch.events)
    return [
        (one, two)
        for event in found
        if event.type in ("collision", "near_miss")
        and (one := _measure_party(users.get(event.from_), event)) is not None
        and (two := _measure_party(users.get(event.to), event)) is not None
    ]


def _measure_party(user: RoadUser | None, event: Any) -> EventParty | None:
    if user is None or event.time is None:
        return None
    done = compute_kinematics(user.track.xy, smoothing=0.1)
    times = user.track.start + STEP * (done.first + np.arange(len(done)))
    inside = (times >= event.time - BEFORE_EVENT) & (times <= event.time)
    if inside.sum() < 0.5 * BEFORE_EVENT / STEP:
        return None
    moving = inside & (done.speed > _WALKS)
    course = np.unwrap(user.track.heading[done.first : done.first + len(done)][moving])
    turned = float(np.ptp(course)) if len(course) else 0.0
    slowed = float(np.ptp(done.speed[inside]))
    return EventParty(event.type, user.shape.type, slowed >= REACTS or turned >= _TURNS_AWAY)


MEASURES: Mapping[str, Callable[[Stretch], list[bool]]] = {
    "vehicles less than 2 s after another": find_close_followers,
    "pedestrians with a companion": find_accompanied,
    "pedestrians who set off together": find_common_starts,
}
"""Shares over agents, by name."""
