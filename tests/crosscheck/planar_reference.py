"""Shapely's answers: contact, clearance, PET and TTC by brute force, by no formula of ours.

A footprint is a shapely polygon, or a point with a radius. Tracks are read by `numpy.interp`. Every
function says how exact it is, because the tolerances of the tests rest on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from scenewright.scene.base import FloatArray
from scenewright.tools.relation_checker import RoadUser

TOUCH = 1e-3
"""The checker calls footprints nearer than this a contact [m]; so does this file."""


@dataclass(frozen=True)
class Crossing:
    """Least lag of two footprints over one place.

    Attributes:
        lag: [s]; angle: between the two headings there [rad].
    """

    lag: float
    angle: float


def pose_at(user: RoadUser, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions [n, 2] and headings [n] at times [s], linear between samples."""
    track = user.track
    xy = np.stack([np.interp(times, track.times, track.xy[:, k]) for k in (0, 1)], axis=1)
    return xy, np.interp(times, track.times, np.unwrap(track.heading))


def velocity_of(user: RoadUser) -> FloatArray:
    """[T, 2] velocity by central differences, one-sided at the ends [m/s]."""
    if len(user.track.xy) < 2:
        return np.zeros((len(user.track.xy), 2))
    return np.asarray(np.gradient(user.track.xy, user.track.step, axis=0))


def radius(user: RoadUser) -> float:
    return user.shape.width / 2 if user.shape.type == "pedestrian" else 0.0


def core(user: RoadUser, xy: FloatArray, heading: FloatArray) -> FloatArray:
    """[n, k, 2] corners of the rectangle, or the centre of the disc."""
    if user.shape.type == "pedestrian":
        return xy[:, None]
    a, b = user.shape.length / 2, user.shape.width / 2
    box = np.array([(a, b), (-a, b), (-a, -b), (a, -b)])
    cos, sin = np.cos(heading), np.sin(heading)
    turn = np.stack([np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)], axis=1)
    return xy[:, None] + np.einsum("kd,nde->nke", box, turn)


def areas(points: FloatArray) -> Any:
    """Shapely geometries of cores [n, k, 2]."""
    return shapely.points(points[:, 0]) if points.shape[1] == 1 else shapely.polygons(points)


def common(first: RoadUser, second: RoadUser, *, step: float = 0.1) -> FloatArray:
    """Times [s] at which both are there."""
    start, end = (
        max(first.track.start, second.track.start),
        min(first.track.end, second.track.end),
    )
    count = max(int(np.floor((end - start) / step + 1e-6)) + 1, 0)
    return np.asarray(start + step * np.arange(count))


def clearances(first: RoadUser, second: RoadUser, times: FloatArray) -> FloatArray:
    """[n] distance of the footprints [m], 0 in contact; exact."""
    one, two = (areas(core(u, *pose_at(u, times))) for u in (first, second))
    return np.maximum(shapely.distance(one, two) - radius(first) - radius(second), 0.0)


def first_touch(first: RoadUser, second: RoadUser) -> float | None:
    """First time at which the footprints are within 1 mm [s], to 0.001 s; None if they never are.

    A contact that begins and ends within 0.01 s can be missed.
    """
    times = common(first, second, step=0.01)
    touching = np.flatnonzero(clearances(first, second, times) <= TOUCH) if len(times) else []
    if len(touching) == 0:
        return None
    k = int(touching[0])
    if k == 0:
        return float(times[0])
    fine = np.linspace(times[k - 1], times[k], 11)
    near = clearances(first, second, fine) <= TOUCH
    return float(fine[int(np.argmax(near))])


def crossings(first: RoadUser, second: RoadUser, *, step: float) -> list[Crossing]:
    """Every pair of moments whose footprints meet, for samples every `step` seconds.

    Only the least lag for each moment of `first` and each kind of meeting: in one direction (within
    30 degrees) or not. The true least lag is at most about 2 `step` less.
    """
    times = [u.track.start + np.arange(0.0, u.track.end - u.track.start + 1e-9, step)
             for u in (first, second)]  # fmt: skip
    poses = [pose_at(u, t) for u, t in zip((first, second), times, strict=True)]
    one, two = (areas(core(u, *p)) for u, p in zip((first, second), poses, strict=True))
    near = radius(first) + radius(second) + TOUCH
    i, j = shapely.STRtree(two).query(one, predicate="dwithin", distance=near)
    lag = np.abs(times[0][i] - times[1][j])
    angle = np.abs(np.remainder(poses[0][1][i] - poses[1][1][j] + np.pi, 2 * np.pi) - np.pi)
    found = []
    for mask in (angle <= np.deg2rad(30), angle > np.deg2rad(30)):
        if mask.any():
            k = np.flatnonzero(mask)[int(np.argmin(lag[mask]))]
            found.append(Crossing(float(lag[k]), float(angle[k])))
    return found


def straight_ttc(
    first: RoadUser, second: RoadUser, times: FloatArray, *, horizon: float
) -> FloatArray:
    """[n] time to contact at constant velocities and headings [s], to 1e-6 s; inf beyond horizon.

    The footprint swept along the relative velocity is the convex hull of its two ends, and it only
    grows with time: the time to contact is found by bisection. Nothing can fall between samples.
    """
    corners, speeds = [], []
    for user in (first, second):
        corners.append(core(user, *pose_at(user, times)))
        k = np.rint((times - user.track.start) / user.track.step).astype(int)
        speeds.append(velocity_of(user)[k])
    relative, still = speeds[0] - speeds[1], areas(corners[1])
    near = radius(first) + radius(second)

    def reached(ahead: FloatArray) -> Any:
        moved = corners[0] + (ahead[:, None] * relative)[:, None]
        swept = shapely.convex_hull(shapely.multipoints(np.concatenate((corners[0], moved), 1)))
        return shapely.distance(swept, still) <= near

    low, high = np.zeros(len(times)), np.full(len(times), horizon)
    ever, at_once = reached(high), reached(low)
    for _ in range(24):
        middle = (low + high) / 2
        hit = reached(middle)
        low, high = np.where(hit, low, middle), np.where(hit, middle, high)
    return np.where(at_once, 0.0, np.where(ever, high, np.inf))


def path_ttc_at(
    first: RoadUser, second: RoadUser, time: float, *, horizon: float, step: float = 0.01
) -> float:
    """Time to contact at constant speed along the own paths [s], to `step`; inf beyond horizon."""
    ahead = np.arange(0.0, horizon + step / 2, step)
    poses = [_further(u, time, ahead) for u in (first, second)]
    reach = sum(float(np.hypot(u.shape.length, u.shape.width)) / 2 for u in (first, second))
    near = np.flatnonzero(np.hypot(*(poses[0][0] - poses[1][0]).T) <= reach)
    one, two = (
        areas(core(u, xy[near], heading[near]))
        for u, (xy, heading) in zip((first, second), poses, strict=True)
    )
    hit = shapely.distance(one, two) <= radius(first) + radius(second)
    return float(ahead[near[int(np.argmax(hit))]]) if hit.any() else np.inf


def _further(user: RoadUser, time: float, ahead: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where somebody is who keeps the speed: along the track's line, straight beyond its end."""
    k = round((time - user.track.start) / user.track.step)
    speed = float(np.hypot(*velocity_of(user)[k]))
    xy, heading = user.track.xy, user.track.heading
    steps = np.hypot(*np.diff(xy, axis=0).T)
    line = shapely.LineString(xy[np.concatenate(([True], steps > 1e-6))]) if steps.any() else None
    if line is None or speed < 0.1:
        return np.repeat(xy[k : k + 1], len(ahead), 0), np.repeat(heading[k], len(ahead))
    s = float(steps[:k].sum()) + speed * ahead
    on_line = np.clip(s, 0.0, line.length)
    points, before, after = (
        shapely.get_coordinates(line.interpolate(np.clip(on_line + d, 0.0, line.length)))
        for d in (0.0, -0.5, 0.5)
    )
    course = np.arctan2(*(after - before).T[::-1])
    beyond = (s - on_line)[:, None]
    return points + beyond * np.stack([np.cos(course), np.sin(course)], axis=1), course


def line_left(user: RoadUser, time: float, *, seconds: float) -> bool:
    """Whether the track goes on far enough to be followed for so long at the present speed."""
    k = round((time - user.track.start) / user.track.step)
    speed = float(np.hypot(*velocity_of(user)[k]))
    steps = np.hypot(*np.diff(user.track.xy[k:], axis=0).T)
    return bool(speed < 0.1 or steps.sum() >= speed * seconds)


def zone_lag(first: RoadUser, second: RoadUser) -> float | None:
    """PET of a zone: from when one has left the overlap of the swept areas to the other's entry.

    Only for straight tracks, whose swept area is a convex hull. To 0.01 s; None where the areas do
    not meet; negative where both are in the zone at once.
    """
    swept = []
    for user in (first, second):
        ends = core(user, *pose_at(user, np.array([user.track.start, user.track.end])))
        hull = shapely.convex_hull(shapely.multipoints(ends.reshape(-1, 2)))
        swept.append(hull.buffer(radius(user)))
    zone = swept[0].intersection(swept[1])
    if zone.is_empty:
        return None
    stays = []
    for user in (first, second):
        times = common(user, user, step=0.01)
        inside = shapely.distance(areas(core(user, *pose_at(user, times))), zone) <= radius(user)
        stays.append((times[inside][0], times[inside][-1]))
    (a, b), (c, d) = stays
    return float(max(c - b, a - d))
