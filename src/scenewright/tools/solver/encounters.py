"""Standing objects in an agent's path: it passes one, waits behind it, or drives into it.

The object is placed on the agent's own path. Who goes round gets a path that leads past it, and may
wait first; who waits stops behind it for good, gently or at the last moment, and others queue
behind; who hits it brakes too late and ends there. Who is doored passes close beside a parked
vehicle, whose door opens too late for any reaction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.geometry.map_areas import MapAreas
from scenewright.geometry.spline import build_even_path
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.candidates import Candidate, K, Path, sample_evenly
from scenewright.scene.kinds import get_kind, has_trait, load_function
from scenewright.scene.objects import OBJECT_SIZES, ObjectRecord, name_door
from scenewright.scene.selection import Slowing
from scenewright.scene.social import Encounter, ObjectNode
from scenewright.scene.track import STEP
from scenewright.tools.map_grounding.object_places import Side, find_places
from scenewright.tools.solver.impact import locate
from scenewright.tools.solver.objects import is_in_way, make_sweep
from scenewright.tools.solver.scheduled_agent import FOR_GOOD, ScheduledAgent

_ASIDE = (0.5, 1.0)
"""Distance from an object when passing it [m]."""

_RUN, _WIDEST, _STEP = (14.0, 20.0), 4.6, 0.2
"""Distance over which an agent moves aside [m]; how far at most, and the step of the search."""

_SHARPEST = 0.12
"""Largest curvature of a path round an object [1/m]."""

_HEADS_FOR = 5.0
"""Least distance straight towards an object before the agent moves aside [m]."""

_FARTHEST = 3.0
"""Farthest that who is moved off a crosswalk waits behind an object [m]."""

_PULLS_OUT, _SHARPEST_START = (8.5, 10.0), 0.19
"""Way on which who has waited moves over [m], and its sharpest bend [1/m]."""

_PATIENCE = (3.0, 6.0)
"""How long who then goes round waits [s]."""

_LATER = (2.5, 5.0)
"""How much later the next one comes to an object [s]."""

_STRIKES, _BRAKES = (3.0, 7.0), (3.5, 6.5)
"""Speed [m/s] at which an object is hit, and braking before that [m/s^2]."""

_EXACT = 0.3
"""How far inside the bounds asked for a figure lies, as a share of their distance."""

_BESIDE, _OPENS, _HINGE = (0.2, 0.6), (0.4, 0.9), 0.1
"""How near a parked vehicle who is doored passes [m]; how long before the contact the door opens
[s]; and where the door is, ahead of the middle, as a share of the length."""

_SCRAPES = (0.15, 0.45)
"""How far an agent drifts into an object beside its path [m]."""

_WHEN = (7.0, 18.0)
"""When an agent without other relations reaches its object [s]."""

_COMES = 12.0
"""Least distance driven before an object [m]."""

_STANDING = 0.3
"""Slower than this [m/s] the checker calls it standing."""

_PLACES = 12
"""Places tried for one candidate."""


@dataclass(frozen=True, eq=False)
class ObjectEncounter:
    """A candidate that meets an object, and the place of the object.

    Attributes:
        touch: arc length of its centre [m] at which it touches the object; where it goes round,
            at which it is beside it.
        waits_at: where it waits before it goes round.
        door: the door of the object that it rides into; opens: how long before that [s].
    """

    node: ObjectNode
    place: ObjectRecord
    candidate: Candidate
    touch: float
    waits_at: float | None = None
    door: ObjectRecord | None = None
    opens: float = 0.0

    @property
    def how(self) -> Encounter | None:
        """What the agent does about the object."""
        return self.node.encounter

    def choose(self, usual: tuple[float, float], rng: np.random.Generator) -> float:
        """The figure of the encounter: as asked for, else as usual."""
        if self.node.figure is None:
            return float(rng.uniform(*usual))
        low, high = self.node.figure
        inside = _EXACT * (high - low)
        return float(rng.uniform(low + inside, high - inside))


def find_meeting(
    node: ObjectNode, candidate: Candidate, ground: MapAreas, rng: np.random.Generator
) -> ObjectEncounter | None:
    """Draw a place of the object at which the candidate meets it; None if there is none."""
    route = candidate.route
    sides: tuple[tuple[Compass, Side], ...] = ((route.entry, "entry"), (route.exit, "exit"))
    places = [
        each
        for leg, side in sides
        if node.leg in (None, leg) and node.side in (None, side)
        for each in find_places(node, ground.intersection_map, leg=leg, side=side)
    ]
    for k in rng.permutation(len(places))[:_PLACES]:
        found = meet_at(node, places[k], candidate, ground, rng)
        if found is not None:
            return found
    return None


def meet_at(
    node: ObjectNode,
    place: ObjectRecord,
    candidate: Candidate,
    ground: MapAreas,
    rng: np.random.Generator,
) -> ObjectEncounter | None:
    """Let the candidate meet the object where it stands; None if it does not fit there."""
    if has_trait("encounter", node.encounter, "door"):
        return _meet_door(node, place, candidate, rng)
    own = candidate
    if has_trait("encounter", node.encounter, "ends") and node.kind in ("parked", "bus_stop"):
        beside = _find_beside(place, candidate)
        if beside is None:
            return None
        s, gap, side = beside
        wide = side * (gap + float(rng.uniform(*_SCRAPES)))
        own = follow_path(candidate, shift_aside(candidate.path, wide, s, s + 8.0, run=_RUN[0]))
    touch = _find_touch(own, place)
    if touch is None or touch < _COMES:
        return None
    meeting = ObjectEncounter(node, place, own, touch)
    if not has_trait("encounter", node.encounter, "leads_round"):
        return meeting
    if has_trait("encounter", node.encounter, "waits_first"):
        run = float(rng.uniform(*_PULLS_OUT))
        meeting = replace(meeting, waits_at=touch - run - 0.5)
        aside = _lead_round(meeting, ground, float(rng.uniform(*_ASIDE)), run)
    else:
        keeps = meeting.choose(_ASIDE, rng)
        aside = _lead_round(meeting, ground, keeps, float(rng.uniform(*_RUN)))
    return None if aside is None else replace(meeting, candidate=aside)


def _meet_door(
    node: ObjectNode, place: ObjectRecord, candidate: Candidate, rng: np.random.Generator
) -> ObjectEncounter | None:
    """Let the candidate pass close beside a parked vehicle, whose door then opens."""
    beside = _find_beside(place, candidate)
    if beside is None:
        return None
    (s, gap, side), own = beside, candidate
    wide = side * (gap - float(rng.uniform(*_BESIDE)))
    if not _BESIDE[0] <= gap <= _BESIDE[1]:
        path = shift_aside(candidate.path, wide, s, s + place.length, run=_RUN[0])
        own = follow_path(candidate, path)
    door = _open_door(place, own)
    touch = _find_touch(own, door)
    if touch is None or touch < _COMES:
        return None
    return ObjectEncounter(node, place, own, touch, door=door, opens=float(rng.uniform(*_OPENS)))


def _find_beside(place: ObjectRecord, candidate: Candidate) -> tuple[float, float, float] | None:
    """Find where on a path [m] an object is beside it, the gap [m], and 1 if it is to the left, or
    -1; None if it is not beside it."""
    path = candidate.path
    s = sample_evenly(path.length, 200)
    gaps = make_sweep(candidate, place, s)
    k = int(gaps.argmin())
    if not 0.0 < gaps[k] < _WIDEST / 2 or s[k] < _COMES + _RUN[0]:
        return None
    x, y = path.xy[int(np.searchsorted(path.s, s[k]))].tolist()
    heading = float(np.interp(s[k], path.s, path.heading))
    _, left = locate((x, y, heading), (place.x, place.y))
    return float(s[k]), float(gaps[k]), float(np.sign(left))


def _open_door(place: ObjectRecord, candidate: Candidate) -> ObjectRecord:
    """The open front door of a vehicle, on the side by which a candidate passes."""
    away = np.hypot(*(candidate.path.xy - (place.x, place.y)).T)
    near = candidate.path.xy[int(away.argmin())]
    _, left = locate((place.x, place.y, place.heading), near)
    cos, sin, side = np.cos(place.heading), np.sin(place.heading), float(np.sign(left))
    length, width = OBJECT_SIZES["door"]
    ahead, aside = _HINGE * place.length, side * (place.width / 2 + 0.02 + length / 2)
    return ObjectRecord(
        id=name_door(place.id), kind="door", height="low", length=length, width=width,
        x=round(float(place.x + ahead * cos - aside * sin), 3),
        y=round(float(place.y + ahead * sin + aside * cos), 3),
        heading=round(float(place.heading + np.pi / 2), 4),
    )  # fmt: skip


def _find_touch(candidate: Candidate, place: ObjectRecord) -> float | None:
    """Find the arc length [m] of the centre at which the agent first touches the object."""
    s = np.arange(0.0, candidate.path.length, 0.1)
    gaps = make_sweep(candidate, place, s)
    touching = np.flatnonzero(gaps <= 0.0)
    return float(s[touching[0]]) if len(touching) and touching[0] > 0 else None


def _lead_round(
    meeting: ObjectEncounter, ground: MapAreas, keeps: float, run: float
) -> Candidate | None:
    """The candidate on a path past the object, on the side that takes it less far.

    Args:
        keeps: how far from the object it keeps [m]; run: way on which it moves over [m].
    """
    place, candidate = meeting.place, meeting.candidate
    beside = meeting.touch, meeting.touch + candidate.shape.length + place.length
    left = -1.0 if ground.intersection_map.left_hand_traffic else 1.0
    sharpest = _SHARPEST if meeting.waits_at is None else _SHARPEST_START
    sharpest = max(sharpest, float(np.abs(candidate.path.curvature).max()))
    if beside[0] - run < _HEADS_FOR:
        return None
    for wide in np.arange(_STEP, _WIDEST, _STEP):
        for side in (left, -left):
            path = shift_aside(candidate.path, float(side * wide), *beside, run=run)
            if np.abs(path.curvature).max() > sharpest:
                continue
            own = follow_path(candidate, path)
            clear = not is_in_way(own, (place,), margin=keeps)
            if clear and _stays_on_road(own, ground):
                return own
    return None


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


def follow_path(candidate: Candidate, path: Path) -> Candidate:
    """The candidate on another path, its waypoints at equal arc length on that."""
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


@dataclass(frozen=True)
class Earlier:
    """The previous agent at an object: its arrival [s], and its standing footprint, if any."""

    time: float
    standing: ObjectRecord | None = None


def place_encounter(
    meeting: ObjectEncounter,
    landmarks: Landmarks,
    rng: np.random.Generator,
    *,
    earlier: Earlier | None = None,
) -> tuple[ScheduledAgent, Earlier] | None:
    """Time an agent that meets only an object; None if it cannot stop, or is too slow."""
    actor = ScheduledAgent.build_unplaced(meeting.candidate, landmarks)
    act = load_function(str(get_kind("encounter", str(meeting.how)).template), __package__)
    placed: _Timed = act(actor, meeting, rng, earlier)
    if placed is None or not np.isfinite(placed[1]):
        return None
    wanted = rng.uniform(*_WHEN) if earlier is None else earlier.time + rng.uniform(*_LATER)
    shift = round(float(wanted) - placed[1], 1)
    actor, standing = placed[0].shift(shift), None
    if actor.stops and actor.stops[-1].until - actor.stops[-1].start >= FOR_GOOD:
        x, y, heading = actor.get_pose(actor.stops[-1].s)
        shape = actor.candidate.shape
        standing = ObjectRecord(
            id="standing", kind="stalled", height="high", length=shape.length,
            width=shape.width, x=x, y=y, heading=heading,
        )  # fmt: skip
    return actor, Earlier(placed[1] + shift, standing)


_Timed = tuple[ScheduledAgent, float] | None
"""An agent with what it does about the object, and the time there [s]; None if it cannot."""


def stand_behind(
    actor: ScheduledAgent,
    meeting: ObjectEncounter,
    rng: np.random.Generator,
    earlier: Earlier | None,
) -> _Timed:
    """Stop it behind the object, or the agent that stands there, for good; off crosswalks, unless
    it brakes hard."""
    kind, touch = get_kind("encounter", str(meeting.how)), meeting.touch
    if "behind_agent" in kind.traits:
        standing = None if earlier is None else earlier.standing
        found = None if standing is None else _find_touch(meeting.candidate, standing)
        if found is None:
            return None
        touch = found
    hard = kind.ranges.get("braking")
    braking = None if hard is None else float(rng.uniform(*hard))
    wanted = touch - meeting.choose(kind.ranges["gap"], rng)
    s = wanted if braking else actor.landmarks.move_off_crosswalks(wanted)
    if s < min(wanted, touch - _FARTHEST) or s < _HEADS_FOR:
        return None
    stop = actor.build_stop(s, "waits", braking=braking)
    return (actor.edit(stops=(stop,)), stop.start) if np.isfinite(stop.start) else None


def go_round(
    actor: ScheduledAgent, meeting: ObjectEncounter, _rng: np.random.Generator, _: Earlier | None
) -> _Timed:
    """Let it drive on; its path leads round the object."""
    return actor, actor.motion.find_time_at(meeting.touch)


def ride_into_door(
    actor: ScheduledAgent,
    meeting: ObjectEncounter,
    rng: np.random.Generator,
    earlier: Earlier | None,
) -> _Timed:
    """End it at the door, at its own speed or at the one asked for."""
    if meeting.node.figure is not None:
        return brake_too_late(actor, meeting, rng, earlier)
    touches = actor.motion.find_time_at(meeting.touch)
    return (actor.end_at(touches), touches) if np.isfinite(touches) else None


def wait_first(
    actor: ScheduledAgent, meeting: ObjectEncounter, rng: np.random.Generator, _: Earlier | None
) -> _Timed:
    """Let it stand before it moves over, as long as asked for at walking pace or less."""
    s = meeting.waits_at or 0.0
    if s < _HEADS_FOR or actor.landmarks.move_off_crosswalks(s) != s:
        return None
    wanted = meeting.choose(_PATIENCE, rng)
    stop = actor.build_stop(s, "waits", lasts=wanted)
    held = actor.edit(stops=(stop,))
    seen = STEP * int((held.motion.speed <= _STANDING).sum())
    stop = replace(stop, until=round(stop.until + wanted - seen, 2))
    return actor.edit(stops=(stop,)), stop.start


def brake_too_late(
    actor: ScheduledAgent, meeting: ObjectEncounter, rng: np.random.Generator, _: Earlier | None
) -> _Timed:
    """Brake it too late, ending where it touches the object."""
    speed = meeting.choose(_STRIKES, rng)
    # Slowed down a little before, so that no smoothing changes the speed of the contact.
    early = 0.5 * speed
    place = meeting.touch - early
    slowing = Slowing(place, speed, float(rng.uniform(*_BRAKES)), kept=early + 3.0)
    braking = actor.edit(stops=(), slowings=(slowing,))
    touches = braking.motion.find_time_at(meeting.touch)
    if not np.isfinite(touches):
        return None
    k = int(touches / STEP)
    low, high = meeting.node.figure or (0.0, np.inf)
    if not low <= float(braking.motion.speed[k]) <= high:
        return None
    return braking.end_at(touches), touches


def list_meetings(nodes: Sequence[ObjectNode]) -> dict[str, ObjectNode]:
    """The objects that agents meet, by agent, each as that one meets it; the first comes first."""
    return {
        met.agent: node.model_copy(
            update={"met_by": met.agent, "encounter": met.encounter, "figure": met.figure}
        )
        for node in nodes
        for met in node.list_meetings()
    }
