"""Standing objects in an agent's path: it passes one, waits behind it, or drives into it.

The object is placed on the agent's own path. To pass it, the agent gets a path that leads round
it; to wait, it stops behind it for good; to hit it, it brakes too late and ends there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np

from scenewright.geometry.driving_profile import StopCommand, compute_arrival
from scenewright.geometry.landmarks import Landmarks
from scenewright.geometry.map_areas import MapAreas
from scenewright.geometry.spline import build_even_path
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.candidates import Candidate, K, Path, sample_evenly
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.selection import Slowing, Stop
from scenewright.scene.social import ObjectNode
from scenewright.tools.map_grounding.object_places import Side, find_places
from scenewright.tools.solver.objects import is_in_way, make_sweep
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

geos: Any = import_module("shapely")

_ASIDE = (0.5, 1.0)
"""Distance from an object when passing it [m]."""

_RUN, _WIDEST, _STEP = (14.0, 20.0), 4.6, 0.2
"""Distance over which an agent moves aside [m]; how far at most, and the step of the search."""

_SHARPEST = 0.12
"""Largest curvature of a path round an object [1/m]."""

_HEADS_FOR = 5.0
"""Least distance straight towards an object before the agent moves aside [m]."""

_GAP = (1.2, 3.0)
"""Gap behind an object when waiting [m]."""

_STRIKES, _BRAKES = (3.0, 7.0), (3.5, 6.5)
"""Speed [m/s] at which an object is hit, and braking before that [m/s^2]."""

_SCRAPES = (0.15, 0.45)
"""How far an agent drifts into an object beside its path [m]."""

_WHEN = (7.0, 18.0)
"""When an agent without other relations reaches its object [s]."""

_COMES = 12.0
"""Least distance driven before an object [m]."""

_FOR_GOOD = 60.0
"""Longer than any scene [s]."""

_PLACES = 12
"""Places tried for one candidate."""


@dataclass(frozen=True, eq=False)
class ObjectEncounter:
    """A candidate that meets an object, and the place of the object.

    Attributes:
        touch: arc length of its centre [m] at which it touches the object; where it goes round,
            at which it is beside it.
    """

    node: ObjectNode
    place: ObjectRecord
    candidate: Candidate
    touch: float


def find_meeting(
    node: ObjectNode, candidate: Candidate, ground: MapAreas, rng: np.random.Generator
) -> ObjectEncounter | None:
    """Draw a place of the object at which the candidate meets it; None if there is none."""
    places = [
        each
        for leg, side in _list_sides(node, candidate)
        for each in find_places(node, ground.intersection_map, leg=leg, side=side)
    ]
    for k in rng.permutation(len(places))[:_PLACES]:
        found = _meet(node, places[k], candidate, ground, rng)
        if found is not None:
            return found
    return None


def _list_sides(node: ObjectNode, candidate: Candidate) -> Iterator[tuple[Compass, Side]]:
    route = candidate.route
    both: tuple[tuple[Compass, Side], ...] = ((route.entry, "entry"), (route.exit, "exit"))
    for leg, side in both:
        if node.leg in (None, leg) and node.side in (None, side):
            yield leg, side


def _meet(
    node: ObjectNode,
    place: ObjectRecord,
    candidate: Candidate,
    ground: MapAreas,
    rng: np.random.Generator,
) -> ObjectEncounter | None:
    own = candidate
    if node.encounter == "hits" and node.kind in ("parked", "bus_stop"):
        drifting = _draw_drift(place, candidate, rng)
        if drifting is None:
            return None
        own = drifting
    touch = _find_touch(own, place)
    if touch is None or touch < _COMES:
        return None
    if node.encounter != "goes_round":
        return ObjectEncounter(node, place, own, touch)
    aside = _lead_round(place, candidate, touch, ground, rng)
    return None if aside is None else ObjectEncounter(node, place, aside, touch)


def _find_touch(candidate: Candidate, place: ObjectRecord) -> float | None:
    """Find the arc length [m] of the centre at which the agent first touches the object."""
    s = np.arange(0.0, candidate.path.length, 0.1)
    gaps = make_sweep(candidate, place, s)
    touching = np.flatnonzero(gaps <= 0.0)
    return float(s[touching[0]]) if len(touching) and touching[0] > 0 else None


def _lead_round(
    place: ObjectRecord,
    candidate: Candidate,
    touch: float,
    ground: MapAreas,
    rng: np.random.Generator,
) -> Candidate | None:
    """Lead the candidate past the object, on the side with the shorter detour."""
    keeps, run = float(rng.uniform(*_ASIDE)), float(rng.uniform(*_RUN))
    beside = touch, touch + candidate.shape.length + place.length
    left = -1.0 if ground.intersection_map.left_hand_traffic else 1.0
    if beside[0] - run < _HEADS_FOR:
        return None
    for wide in np.arange(_STEP, _WIDEST, _STEP):
        for side in (left, -left):
            path = shift_aside(candidate.path, float(side * wide), *beside, run=run)
            if np.abs(path.curvature).max() > max(
                _SHARPEST, _compute_largest_curvature(candidate.path)
            ):
                continue
            own = _follow(candidate, path)
            clear = not is_in_way(own, (place,), margin=keeps)
            if clear and _stays_on_road(own, ground):
                return own
    return None


def _compute_largest_curvature(path: Path) -> float:
    return float(np.abs(path.curvature).max())


def _draw_drift(
    place: ObjectRecord, candidate: Candidate, rng: np.random.Generator
) -> Candidate | None:
    """Draw a path of the candidate that drifts into the side of the object beside it."""
    s = sample_evenly(candidate.path.length, 200)
    gaps = make_sweep(candidate, place, s)
    k = int(gaps.argmin())
    if not 0.0 < gaps[k] < _WIDEST / 2 or s[k] < _COMES + _RUN[0]:
        return None
    x, y = candidate.path.xy[int(np.searchsorted(candidate.path.s, s[k]))].tolist()
    heading = float(np.interp(s[k], candidate.path.s, candidate.path.heading))
    side = np.sign(np.cos(heading) * (place.y - y) - np.sin(heading) * (place.x - x))
    wide = float(side * (gaps[k] + rng.uniform(*_SCRAPES)))
    return _follow(candidate, shift_aside(candidate.path, wide, s[k], s[k] + 8.0, run=_RUN[0]))


def shift_aside(path: Path, wide: float, begins: float, ends: float, *, run: float) -> Path:
    """Shift the path to its left by `wide` [m] from `begins` to `ends` [m].

    Args:
        run: distance over which it moves aside, and back again [m].
    """
    out = _smooth_step((path.s - begins + run) / run)
    back = _smooth_step((ends + run - path.s) / run)
    leftward = np.stack((-np.sin(path.heading), np.cos(path.heading)), axis=1)
    return build_even_path(path.xy + (wide * out * back)[:, None] * leftward)


def _smooth_step(x: FloatArray) -> FloatArray:
    """Smooth step [N] from 0 to 1 without a jerk."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**3 * (10 - 15 * x + 6 * x**2))


def _follow(candidate: Candidate, path: Path) -> Candidate:
    """Put the candidate on another path, its waypoints at equal arc length on that."""
    s = sample_evenly(path.length, K)
    waypoints = np.stack([np.interp(s, path.s, path.xy[:, axis]) for axis in (0, 1)], axis=1)
    return replace(candidate, path=path, waypoints=waypoints)


def _stays_on_road(candidate: Candidate, ground: MapAreas) -> bool:
    """Return whether both sides of the vehicle keep to the road."""
    path, half = candidate.path, candidate.shape.width / 2
    leftward = np.stack((-np.sin(path.heading), np.cos(path.heading)), axis=1)
    return all(
        ground.compute_road_share(path.xy + side * half * leftward) >= 0.995 for side in (1, -1)
    )


def place_encounter(
    meeting: ObjectEncounter, landmarks: Landmarks, rng: np.random.Generator
) -> ScheduledAgent | None:
    """Time an agent that meets only an object; None if it cannot stop, or is too slow."""
    actor = ScheduledAgent.build_unplaced(meeting.candidate, landmarks)
    match meeting.node.encounter:
        case "waits_behind":
            stopping = _wait(actor, meeting, rng)
            if stopping is None:
                return None
            actor, there = stopping
        case "hits":
            actor, there = _brake_too_late(actor, meeting, rng)
        case _:
            there = actor.motion.find_time_at(meeting.touch)
    if not np.isfinite(there):
        return None
    return actor.shift(round(float(rng.uniform(*_WHEN)) - there, 1))


def _wait(
    actor: ScheduledAgent, meeting: ObjectEncounter, rng: np.random.Generator
) -> tuple[ScheduledAgent, float] | None:
    wanted = meeting.touch - float(rng.uniform(*_GAP))
    s = actor.landmarks.move_off_crosswalks(wanted)
    if s < min(wanted, meeting.touch - _GAP[1]) or s < _HEADS_FOR:
        return None
    stands = compute_arrival(meeting.candidate, StopCommand(s, 0.0))
    stop = Stop("stopping_point", s, stands, stands + _FOR_GOOD, "waits")
    return actor.edit(stops=(stop,)), stands


def _brake_too_late(
    actor: ScheduledAgent, meeting: ObjectEncounter, rng: np.random.Generator
) -> tuple[ScheduledAgent, float]:
    """Brake it too late, ending where it touches the object."""
    slowing = Slowing(meeting.touch, float(rng.uniform(*_STRIKES)), float(rng.uniform(*_BRAKES)))
    braking = actor.edit(stops=(), slowings=(slowing,))
    touches = braking.motion.find_time_at(meeting.touch)
    return braking.end_at(touches), touches


def list_meetings(nodes: Sequence[ObjectNode]) -> dict[str, ObjectNode]:
    """List the objects that agents meet, by agent."""
    return {str(each.met_by): each for each in nodes if each.met_by is not None}
