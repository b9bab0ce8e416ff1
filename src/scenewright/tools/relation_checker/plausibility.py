"""Whether the motion could be real, and begins and ends where it may (SEMANTICS 5 and 9)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.events import Event, Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.record import SceneRecord
from scenewright.scene.track import STEP, VEHICLE_SIZES
from scenewright.tools.relation_checker.footprints import IntArray, compute_angle_between
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.trajectory import Trajectory, concatenate_samples

VEHICLE_SPEED = 20.0
VEHICLE_ACCELERATION = 4.0
VEHICLE_BRAKING = 8.0
EMERGENCY_BRAKING = 10.0
EMERGENCY_SPAN = 1.5
AFTERMATH = 0.25
"""A track may go on for 0.2 s after a contact, still braking [s]."""
LATERAL = 5.0
SLIP = np.deg2rad(20.0)
SLIP_ABOVE = 1.0
PEDESTRIAN_SPEED = 3.0
RUNNING_SPEED = 4.5
PEDESTRIAN_ACCELERATION = 3.0
RIDER_SPEED = {"cyclist": 9.0, "scooter": 7.0}
RIDER_ACCELERATION = 2.0
RIDER_BRAKING = 3.5
RIDER_CURVATURE = 1.0 / 3.0
"""Sharpest turn [1/m] that a rider can lean into."""
RIDES_ABOVE = 1.5
"""Slower than this [m/s] a rider may turn the handlebar further, or walk."""
RIDER_SIZES = {"cyclist": (1.8, 0.65), "scooter": (1.2, 0.55)}
STEP_FACTOR = 1.2
STEP_MARGIN = 0.05
HELD = np.deg2rad(5.0)
ON_ROAD = 0.98
LONGEST = 30.0
SIZE = 0.3
"""How much a vehicle may differ from the usual size of its subtype, as a share of it."""
ROUNDING = 0.02
"""Allowance for positions kept to 1 mm, in m/s and m/s^2 alike."""


@dataclass(frozen=True)
class AllowedExceptions:
    """What one agent may do beyond the rule.

    Attributes:
        emergencies: times of its collisions and near misses [s].
        running: a pedestrian that runs.
    """

    emergencies: tuple[float, ...] = ()
    running: bool = False


def check_form(scene: SceneRecord) -> tuple[Finding, ...]:
    """Time step, duration and sizes that SEMANTICS section 1 and 5 do not know."""
    found = []
    if abs(scene.meta.step - STEP) > 1e-9:
        detail = f"the time step is {scene.meta.step} s; it must be {STEP} s"
        found.append(Finding(rule="step", agents=(), measured=scene.meta.step, detail=detail))
    if scene.meta.duration > LONGEST + 1e-6:
        detail = f"the scene lasts {scene.meta.duration:.1f} s; at most {LONGEST:.0f} s"
        found.append(Finding(rule="duration", agents=(), limit=LONGEST, detail=detail))
    for agent in scene.agents:
        length, width = RIDER_SIZES.get(agent.type, (0.6, 0.6))
        usual = max(abs(agent.length - length), abs(agent.width - width)) < 0.01
        if agent.type == "vehicle":
            named = VEHICLE_SIZES.get(agent.subtype or "")
            usual = any(
                max(abs(agent.length / length - 1), abs(agent.width / width - 1)) <= SIZE
                for length, width in ([named] if named else VEHICLE_SIZES.values())
            )
        if not usual:
            detail = f"{agent.type} {agent.id} measures {agent.length:g} x {agent.width:g} m"
            found.append(Finding(rule="size", agents=(agent.id,), detail=detail))
    return tuple(found)


class _MotionLimit(NamedTuple):
    """A limit on all samples of all movers of one class.

    Attributes:
        values: [S]; limit: one for all or [S]; tolerance: for positions kept to 1 mm.
    """

    name: str
    values: FloatArray
    limit: FloatArray | float
    unit: str
    tolerance: float = ROUNDING


def check_motion_limits(
    tracks: Sequence[Trajectory], exceptions: Sequence[AllowedExceptions]
) -> tuple[tuple[Finding, ...], ...]:
    """Every limit of SEMANTICS section 5 that each agent's motion breaks, worst value each."""
    found: tuple[list[Finding], ...] = tuple([] for _ in tracks)
    for types in (("vehicle",), ("cyclist", "scooter"), ("pedestrian",)):
        rows = [n for n, m in enumerate(tracks) if m.type in types]
        chosen = [tracks[n] for n in rows]
        origin = concatenate_samples(chosen)[2]
        for rule in _list_limits(chosen, [exceptions[n] for n in rows], origin) if rows else ():
            excess = rule.values - rule.limit
            worst = np.maximum.reduceat(excess, origin[:-1])
            for n in np.flatnonzero(worst > rule.tolerance).tolist():
                track, first = chosen[n], origin[n]
                k = int(excess[first : origin[n + 1]].argmax())
                measured = float(rule.values[first + k])
                limit = float(np.broadcast_to(rule.limit, excess.shape)[first + k])
                found[rows[n]].append(Finding(
                    rule=rule.name, agents=(track.id,), time=round(float(track.times[k]), 3),
                    measured=round(measured, 3), limit=round(limit, 3),
                    detail=f"{track.type} {track.id}: {rule.name} {measured:.2f} {rule.unit} at "
                    f"{track.times[k]:.1f} s; at most {limit:.2f}",
                ))  # fmt: skip
    return tuple(map(tuple, found))


def _list_limits(
    tracks: Sequence[Trajectory], exceptions: Sequence[AllowedExceptions], origin: IntArray
) -> Iterator[_MotionLimit]:
    """The limits of one class (SEMANTICS sections 5 and 8): vehicles, riders or pedestrians."""
    speed, acceleration = _concatenate(tracks, "speed"), _concatenate(tracks, "acceleration")
    if not tracks[0].is_vehicle:
        fastest = [
            RUNNING_SPEED if exception.running else PEDESTRIAN_SPEED for exception in exceptions
        ]
        yield _MotionLimit("speed", speed, np.repeat(fastest, np.diff(origin)), "m/s")
        change = np.abs(acceleration)
        yield _MotionLimit("acceleration", change, PEDESTRIAN_ACCELERATION, "m/s^2")
        yield _limit_steps(tracks, origin)
        return
    rides = tracks[0].is_rider
    fastest = [RIDER_SPEED.get(m.type, VEHICLE_SPEED) for m in tracks]
    braking = np.full(len(speed), RIDER_BRAKING if rides else VEHICLE_BRAKING)
    for first, track, allowed in zip(origin, tracks, () if rides else exceptions, strict=False):
        for time in allowed.emergencies:
            near = (track.times >= time - EMERGENCY_SPAN) & (track.times <= time + AFTERMATH)
            braking[first : first + len(track)][near] = EMERGENCY_BRAKING
    lateral = _concatenate(tracks, "lateral_acceleration")
    hardest = RIDER_ACCELERATION if rides else VEHICLE_ACCELERATION
    yield _MotionLimit("speed", speed, np.repeat(fastest, np.diff(origin)), "m/s")
    yield _MotionLimit("acceleration", acceleration, hardest, "m/s^2")
    yield _MotionLimit("braking", -acceleration, braking, "m/s^2")
    yield _MotionLimit("lateral_acceleration", lateral, LATERAL, "m/s^2")
    if rides:  # they lean into their turns
        bend = np.where(speed > RIDES_ABOVE, lateral / np.maximum(speed, RIDES_ABOVE) ** 2, 0.0)
        yield _MotionLimit("curvature", bend, RIDER_CURVATURE, "1/m")
    yield from _limit_heading(tracks, speed, origin)
    yield _limit_steps(tracks, origin)


def _limit_heading(
    tracks: Sequence[Trajectory], speed: FloatArray, origin: IntArray
) -> Iterator[_MotionLimit]:
    """What faces forwards goes forwards, and does not turn on the spot."""
    heading, velocity = _concatenate(tracks, "heading"), _concatenate(tracks, "velocity")
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    slip = np.where(speed > SLIP_ABOVE, compute_angle_between(course, heading), 0.0)
    yield _MotionLimit("heading", slip, SLIP, "rad from the motion")
    turns = np.zeros(len(heading))
    turns[:-1] = np.abs(heading[1:] - heading[:-1])
    turns[origin[1:] - 1] = 0.0
    yield _MotionLimit("heading_step", turns, SLIP, "rad in one step")
    # How far it has turned since this standstill began.
    still = speed < 0.05
    begin = np.where(still, 0, np.arange(1, len(speed) + 1))
    begin[origin[:-1]] = np.maximum(begin[origin[:-1]], origin[:-1])
    begin = np.minimum(np.maximum.accumulate(begin), len(speed) - 1)
    held = np.where(still, np.abs(heading - heading[begin]), 0.0)
    yield _MotionLimit("heading_held", held, HELD, "rad turned at standstill")


def _concatenate(tracks: Sequence[Trajectory], name: str) -> FloatArray:
    return np.concatenate([getattr(track, name) for track in tracks])


def _limit_steps(tracks: Sequence[Trajectory], origin: IntArray) -> _MotionLimit:
    """Step length <= 1.2 x the larger of the speeds in the steps before and after, + 0.05 m."""
    steps, padding = np.zeros(origin[-1]), np.ones(origin[-1], dtype=np.bool_)
    padding[origin[1:] - 1] = False
    steps[padding] = _concatenate(tracks, "steps")
    before, after = np.concatenate(([0.0], steps[:-1])), np.concatenate((steps[1:], [0.0]))
    limit = STEP_FACTOR * np.maximum(before, after) + STEP_MARGIN
    limit[np.repeat(np.diff(origin) < 3, np.diff(origin))] = np.inf
    return _MotionLimit("step_length", steps, limit, "m in one step", 2e-3)


def check_ground(
    tracks: tuple[Trajectory, ...], intersection_map: IntersectionMap, *, jaywalkers: frozenset[int]
) -> tuple[Finding, ...]:
    """Agents with less than 98 % of their positions where their class belongs.

    That is the road, footways and crosswalks, or for riders either, and for jaywalkers any of both.
    """
    ground, shares = get_ground_raster(intersection_map), [0.0] * len(tracks)
    for area, chosen in (
        (ground.road, [n for n, m in enumerate(tracks) if m.is_vehicle]),
        (ground.walkable, [n for n, m in enumerate(tracks)
                           if m.is_rider or (not m.is_vehicle and m.id not in jaywalkers)]),
        (ground.anywhere, [n for n, m in enumerate(tracks)
                           if not m.is_vehicle and m.id in jaywalkers]),
    ):  # fmt: skip
        if chosen:
            xy, _, origin = concatenate_samples([tracks[n] for n in chosen])
            inside = np.add.reduceat(area.contains(xy), origin[:-1], dtype=np.float64)
            for n, share in zip(chosen, (inside / np.diff(origin)).tolist(), strict=True):
                shares[n] = max(shares[n], share)
    found = []
    for track, share in zip(tracks, shares, strict=True):
        if share < ON_ROAD:
            where = "road" if track.is_vehicle else "walkable area and crosswalks"
            where = "road, or on footways and crosswalks" if track.is_rider else where
            found.append(Finding(
                rule="off_road" if track.is_vehicle else "off_walkable", agents=(track.id,),
                measured=round(share, 4), limit=ON_ROAD,
                detail=f"{track.type} {track.id}: {share:.1%} of its positions on the {where}; "
                f"at least {ON_ROAD:.0%}",
            ))  # fmt: skip
    return tuple(found)


def find_extremes(tracks: Sequence[Trajectory]) -> dict[str, Any]:
    """Largest speeds and accelerations per class, for the report."""
    result: dict[str, Any] = {}
    for name in ("vehicle", "pedestrian", "cyclist", "scooter"):
        chosen = [m for m in tracks if m.type == name and len(m) > 1]
        if chosen:
            result[name] = {
                "speed": round(max(float(m.speed.max()) for m in chosen), 3),
                "acceleration": round(max(float(m.acceleration.max()) for m in chosen), 3),
                "braking": round(max(float(-m.acceleration.min()) for m in chosen), 3),
                "lateral_acceleration": round(
                    max(float(m.lateral_acceleration.max()) for m in chosen), 3
                ),
            }
    return result


STARTS_WITHIN = 1e-6
"""A track that begins this shortly after the scene [s] is there from its start."""
ENDS_WITHIN = 0.2 + 1e-6
"""A track that ends this shortly before the scene [s] was ended by it."""
EDGE = 4.0
"""How near to the edge of the map, or to an end of a way through it, vehicles come and go [m]."""
BESIDE_GOAL = 2.0
"""How far beside a goal region agents may begin and end [m]."""
BESIDE_OBJECT = 2.0
"""How far from the side of an object a pedestrian is that steps out of it [m]."""
LEAD = 3.0
"""How long an agent is there before its event [s]; how close to one no pedestrian comes or goes."""
IN_VIEW = 20.0
"""What is no further from an event than this is in view of it [m]."""


def check_ends(
    tracks: Sequence[Trajectory],
    intersection_map: IntersectionMap,
    *,
    until: float,
    collided: frozenset[int],
    foreground: frozenset[int],
    events: Sequence[Event],
    objects: Sequence[ObjectRecord],
) -> tuple[Finding, ...]:
    """Tracks that begin after the scene does, or end before it, where no agent comes or goes.

    Not asked on maps without goal regions.

    Args:
        until: end of the scene [s]; collided: ids of those that a collision may end.
        foreground: ids of those whose late beginnings are named instead.
        events: those asked for, in view of which no pedestrian comes out of nowhere.
        objects: which pedestrians may step out of.
    """
    found = []
    conflicts = [event for event in events if event.type != "follow"]
    for track in tracks if intersection_map.goal_regions else ():
        # A pedestrian may step out of what it begins beside.
        steps_out = track.type == "pedestrian" and any(
            math.dist(track.xy[0], (scene_object.x, scene_object.y))
            <= scene_object.length / 2 + BESIDE_OBJECT
            for scene_object in objects
        )
        late = track.start > STARTS_WITHIN and not steps_out
        early = track.end < until - ENDS_WITHIN and track.id not in collided
        named = track.id in foreground
        for rule, does, asked, k, seen in (
            ("appears", "begins", late, 0, () if named else conflicts),
            ("vanishes", "ends", early, -1, conflicts),
        ):
            fault = _find_fault(track, k, seen, intersection_map) if asked else None
            if fault is not None:
                time, (x, y) = float(track.times[k]), track.xy[k].tolist()
                found.append(Finding(
                    rule=rule, agents=(track.id,), time=round(time, 3),
                    detail=f"{track.type} {track.id} {does} at {time:.1f} s {fault}, at "
                    f"({x:.1f}, {y:.1f})",
                ))  # fmt: skip
    return tuple(found)


def _find_fault(
    track: Trajectory, k: int, conflicts: Sequence[Event], intersection_map: IntersectionMap
) -> str | None:
    """Why no agent of its class comes or goes where a track begins or ends; None where they do.

    Vehicles and riders come and go at the edge of the map. Beside the road pedestrians do anywhere
    but in view of a conflict: there are doors; in goal regions of theirs they always do, and so do
    riders.

    Args:
        k: 0 for its beginning, -1 for its end.
    """
    place, time = track.xy[k], float(track.times[k])
    walks = track.type == "pedestrian"
    if not walks:  # ways of vehicles begin or end there, or it is in a goal region of theirs
        ways = (movement.centreline for movement in intersection_map.movements)
        at_end = any(math.dist(place, end) <= EDGE for way in ways for end in (way[0], way[-1]))
        at_edge = float(np.abs(place).max()) >= intersection_map.extent - EDGE
        if at_edge or at_end or _is_at_goal("vehicle", place, intersection_map):
            return None
    on_road = bool(get_ground_raster(intersection_map).road.contains(place[None])[0])
    on_foot = (walks or track.is_rider) and not on_road
    if on_foot and _is_at_goal("pedestrian", place, intersection_map):
        return None
    if not walks or on_road:
        return "on the carriageway" if walks else "in the middle of the map"
    return next(
        (f"in view of the {conflict.type} at {conflict.time:.1f} s" for conflict in conflicts
         if abs(conflict.time - time) < LEAD and math.dist(place, conflict.location) < IN_VIEW),
        None,
    )  # fmt: skip


def _is_at_goal(kind: AgentClass, place: FloatArray, intersection_map: IntersectionMap) -> bool:
    """Whether a place is in, or just beside, a goal region of a class."""
    x, y = place.tolist()
    return any(
        max(west - x, x - east, south - y, y - north) <= BESIDE_GOAL
        for of, _, (west, south, east, north) in get_ground_raster(intersection_map).goals
        if of == kind
    )


def list_late_beginnings(
    tracks: Sequence[Trajectory], events: Sequence[Event]
) -> list[dict[str, Any]]:
    """Every agent that is there for less than 3 s before an event of its own."""
    begins = {track.id: track.start for track in tracks}
    return [
        {"agent": agent, "event": event.type, "lead": round(event.time - begins[agent], 3) + 0.0}
        for event in events
        for agent in (event.from_, event.to)
        if event.time - begins[agent] < LEAD - 1e-6
    ]
