"""Straight roads, candidates and actors known by hand, and geometry the slow, obvious way."""

from __future__ import annotations

import numpy as np
import shapely

from scenewright.geometry.driving_profile import compute_motion
from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.candidates import (
    AgentCandidates,
    Candidate,
    DrawnWaypoints,
    DrivingProfile,
    Path,
)
from scenewright.scene.map_elements import Route
from scenewright.scene.track import PEDESTRIAN, Shape, get_vehicle_shape
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

EAST, NORTH, WEST, SOUTH = 0.0, np.pi / 2, np.pi, -np.pi / 2
CAR = get_vehicle_shape("car")
BARE = Landmarks(line=None, crosswalks=(), group=None)

SOUTHBOUND = Route(
    id="vehicle:north>south:straight",
    type="vehicle",
    entry="north",
    exit="south",
    movement="straight",
    movement_id="north>south:straight",
)
WESTBOUND = Route(
    id="vehicle:east>west:straight",
    type="vehicle",
    entry="east",
    exit="west",
    movement="straight",
    movement_id="east>west:straight",
)
WALK_NORTH = Route(
    id="pedestrian:north:west>east:along>along",
    type="pedestrian",
    entry="west",
    exit="east",
    movement="crossing",
    crosswalk="north",
    side="along>along",
)


def straight(start, heading, length, spacing=0.5) -> Path:
    """A straight road of `length` metres."""
    s = np.linspace(0.0, length, round(length / spacing) + 1)
    xy = np.asarray(start) + s[:, None] * [np.cos(heading), np.sin(heading)]
    return Path(xy=xy, s=s, heading=np.full(len(s), heading), curvature=np.zeros(len(s)))


def bend(before, radius, after, spacing=0.5) -> Path:
    """Straight, a quarter turn to the left, straight."""
    turn = radius * np.pi / 2
    length = before + turn + after
    s = np.linspace(0.0, length, round(length / spacing) + 1)
    heading = np.clip(s - before, 0.0, turn) / radius
    steps = np.diff(s)[:, None] * np.column_stack(
        [np.cos((heading[1:] + heading[:-1]) / 2), np.sin((heading[1:] + heading[:-1]) / 2)]
    )
    xy = np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)])
    curvature = np.where((s >= before) & (s <= before + turn), 1.0 / radius, 0.0)
    return Path(xy=xy, s=s, heading=heading, curvature=curvature)


def law(speed=10.0, acceleration=2.0, braking=2.5, lateral=2.5) -> DrivingProfile:
    return DrivingProfile(speed, acceleration, braking, lateral)


def candidate(path, *, time_law=None, shape=CAR, route=SOUTHBOUND, nll=0.0) -> Candidate:
    return Candidate(
        route=route,
        waypoints=path.xy[np.linspace(0, len(path.s) - 1, 10).astype(int)],
        path=path,
        nll=nll,
        time_law=time_law or law(),
        time_nll=0.0,
        shape=shape,
        subtype="car" if shape.type == "vehicle" else None,
    )


def walker(path, *, speed=1.4, route=WALK_NORTH) -> Candidate:
    return candidate(path, time_law=law(speed, 1.0, 1.5, 1.0), shape=PEDESTRIAN, route=route)


def actor(of: Candidate, *, enters=0.0, landmarks=BARE) -> ScheduledAgent:
    motion = compute_motion(of)
    return ScheduledAgent(of, landmarks, enters, motion, motion)


def draws(
    name,
    options: list[Candidate],
    *,
    nll=None,
    time_nll=None,
    role="foreground",
    arrival=None,
    reserve=False,
):
    """A pool entry that offers ready-made candidates."""
    nothing = np.zeros(len(options))
    first = options[0]
    drawn = DrawnWaypoints(
        waypoints=np.stack([each.waypoints for each in options]),
        nll=nothing if nll is None else np.asarray(nll, dtype=float),
        component=np.zeros(len(options), dtype=np.intp),
        time_laws=tuple(each.time_law for each in options),
        time_nll=nothing if time_nll is None else np.asarray(time_nll, dtype=float),
    )
    return AgentCandidates(
        name=name,
        role=role,
        route=first.route,
        shape=first.shape,
        subtype=first.subtype,
        draw=lambda: drawn,
        build=options.__getitem__,
        arrival=arrival,
        reserve=reserve,
    )


def footprints(poses, shape: Shape):
    """Shapely geometries at poses [N, 3]; a pedestrian is its centre (see `distances`)."""
    poses = np.atleast_2d(poses)
    if shape.type == "pedestrian":
        return shapely.points(poses[:, :2])
    along = shape.length / 2 * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    across = shape.width / 2 * np.column_stack([-np.sin(poses[:, 2]), np.cos(poses[:, 2])])
    corners = [along + across, -along + across, -along - across, along - across]
    return shapely.polygons(np.stack([poses[:, :2] + each for each in corners], axis=1))


def distances(poses_a, poses_b, shapes: tuple[Shape, Shape]):
    """[N] footprint distances by shapely; 0 or less where they touch."""
    apart = shapely.distance(footprints(poses_a, shapes[0]), footprints(poses_b, shapes[1]))
    return apart - sum(shape.width / 2 for shape in shapes if shape.type == "pedestrian")


def clearances(a: ScheduledAgent, b: ScheduledAgent, step=0.05):
    """Times both are there, and the distance of their footprints then."""
    start, end = max(a.enters, b.enters), min(a.leaves, b.leaves)
    times = np.arange(start, end + 1e-9, step)
    return times, distances(
        a.get_poses(times), b.get_poses(times), (a.candidate.shape, b.candidate.shape)
    )


def brute_offsets(a: ScheduledAgent, b: ScheduledAgent, *, within=0.0, step=0.05):
    """[N] every t_a - t_b (scene times) at which the footprints come within a distance."""
    t_a = np.arange(a.enters, a.leaves + 1e-9, step)
    t_b = np.arange(b.enters, b.leaves + 1e-9, step)
    at_a, at_b = a.get_poses(t_a), b.get_poses(t_b)
    reach = within + 0.5 * sum(
        np.hypot(each.candidate.shape.length, each.candidate.shape.width) for each in (a, b)
    )
    gap = np.hypot(at_a[:, None, 0] - at_b[None, :, 0], at_a[:, None, 1] - at_b[None, :, 1])
    i, j = np.nonzero(gap <= reach)
    close = distances(at_a[i], at_b[j], (a.candidate.shape, b.candidate.shape)) <= within
    return t_a[i[close]] - t_b[j[close]]


def brute_pet(a: ScheduledAgent, b: ScheduledAgent, step=0.05) -> float:
    """How much either would have to be early or late for a contact."""
    found = brute_offsets(a, b, step=step)
    return float(np.abs(found).min()) if len(found) else float("inf")
