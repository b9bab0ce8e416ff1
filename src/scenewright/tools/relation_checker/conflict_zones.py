"""Paths, swept paths, conflict zones, and when a footprint is in a zone (SEMANTICS section 4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.footprints import compute_angle_between, compute_corners
from scenewright.tools.relation_checker.planar import Area, geos
from scenewright.tools.relation_checker.track_path import TrackPath, project
from scenewright.tools.relation_checker.trajectory import Trajectory

SHARED = np.deg2rad(30.0)
"""Paths within this angle of one another run in one direction [rad]."""
MERGE_LENGTH = 5.0
"""So much of a merge or a shared lane is a conflict zone [m]."""


def get_path(track: Trajectory) -> TrackPath:
    """The mover's path; a single point where it never moves 0.05 m."""
    return track.path


def get_swept_path(track: Trajectory) -> Area:
    """The path widened by half the agent's width [m], ending where the centre does."""
    known = _swept.get(track)
    if known is None:
        known = _swept[track] = _sweep(track)
    return known


_swept: WeakKeyDictionary[Trajectory, Area] = WeakKeyDictionary()


def _sweep(track: Trajectory) -> Area:
    path = get_path(track)
    if len(path.s) < 2:
        return build_footprint_polygons(track, np.array([track.start]))[0]
    return (
        geos.LineString(path.xy)
        .simplify(0.01, preserve_topology=False)
        .buffer(track.width / 2, cap_style="flat")
    )


@dataclass(frozen=True, eq=False)
class PathConflictZone:
    """A conflict zone of two paths.

    Attributes:
        polygon: its area; shared: whether it is the beginning of a merge or shared lane.
    """

    polygon: Area
    shared: bool


def find_conflict_zones(first: Trajectory, second: Trajectory) -> tuple[PathConflictZone, ...]:
    """Each connected overlap of the two swept paths, in no particular order.

    Where both run in one direction (within 30 degrees) for more than 5 m, only the first 5 m of the
    overlap; nothing at all where the overlap begins in one lane at the start of a track, for then
    the two are behind one another from the outset. Vehicles and pedestrians never share a lane.
    """
    return _find_conflict_zones(*((first, second) if first.id <= second.id else (second, first)))


@lru_cache(maxsize=8)
def _find_conflict_zones(a: Trajectory, b: Trajectory) -> tuple[PathConflictZone, ...]:
    """Events and the places asked for look at the same pairs; movers are known by identity."""
    overlap = get_swept_path(a).intersection(get_swept_path(b))
    parts = [p for p in geos.get_parts(overlap) if p.area > 1e-6]
    if a.is_vehicle != b.is_vehicle:
        return tuple(PathConflictZone(p, False) for p in parts)
    paths = get_path(a), get_path(b)
    zones = (_drop_shared_lane(p, a, paths) for p in parts)
    return tuple(z for z in zones if z is not None)


def _drop_shared_lane(
    part: Area, track: Trajectory, paths: tuple[TrackPath, TrackPath]
) -> PathConflictZone | None:
    ring = geos.get_coordinates(geos.segmentize(geos.get_exterior_ring(part), 0.5))
    one, two = (project(ring, path) for path in paths)
    parallel = compute_angle_between(one.direction, two.direction) <= SHARED
    start, length = float(one.s.min()), float(one.s.max() - one.s.min())
    if length <= MERGE_LENGTH or not parallel.any():
        return PathConflictZone(part, False)
    first = (one.s < start + 1.0) & parallel
    if first.any() and (start < 1.0 or float(two.s[first].min()) < 1.0):
        return None
    line = geos.LineString(paths[0].xy)
    piece = geos.ops.substring(line, start, start + MERGE_LENGTH)
    begin = piece.buffer(track.width / 2 + 0.5, cap_style="flat").intersection(part)
    return PathConflictZone(begin, True)


def build_footprint_polygons(
    track: Trajectory, times: FloatArray
) -> np.ndarray[tuple[int], np.dtype[np.object_]]:
    """Footprints at times [s] as polygons."""
    xy, heading = track.at(times)
    if not track.is_vehicle:
        return np.asarray(geos.buffer(geos.points(xy), track.radius))
    box = compute_corners(xy, heading, length=track.length, width=track.width)
    return np.asarray(geos.polygons(box))


@dataclass(frozen=True)
class ZoneOccupancy:
    """When a footprint is in a zone.

    Attributes:
        enter: first touch [s]; leave: last touch [s].
        begins_inside: whether it touches at its first sample; ends_inside: at its last.
    """

    enter: float
    leave: float
    begins_inside: bool
    ends_inside: bool


def find_zone_occupancy(track: Trajectory, polygon: Area) -> ZoneOccupancy | None:
    """When the mover's footprint first and last touches a polygon, to 0.01 s; None if never."""
    times = track.times
    geos.prepare(polygon)
    hits = np.flatnonzero(_touches(track, polygon, times))
    if len(hits) == 0:
        return None
    first, last = int(hits[0]), int(hits[-1])
    enter, leave = float(times[first]), float(times[last])
    fine = np.concatenate((enter - STEP + _FORTH, leave + _BACK))
    coming, going = _touches(track, polygon, fine).reshape(2, -1)
    if first > 0:
        enter = float(fine[int(np.argmax(coming))])
    if last < len(times) - 1:
        leave = float(fine[len(_FORTH) + int(np.argmax(going))])
    return ZoneOccupancy(enter, leave, first == 0, last == len(times) - 1)


_FORTH, _BACK = np.linspace(0.0, STEP, 11), np.linspace(STEP, 0.0, 11)
"""Moments of the steps in which it comes and goes, from outside the zone inwards [s]."""


def _touches(
    track: Trajectory, polygon: Area, times: FloatArray
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    xy, heading = track.at(times)
    (west, south, east, north), reach = polygon.bounds, track.reach
    x, y = xy[:, 0], xy[:, 1]
    near = (x > west - reach) & (x < east + reach) & (y > south - reach) & (y < north + reach)
    result = np.zeros(len(times), dtype=np.bool_)
    poses = np.column_stack((xy[near], heading[near]))
    # A standing agent is checked once.
    new = np.ones(len(poses), dtype=np.bool_)
    new[1:] = (poses[1:] != poses[:-1]).any(axis=1)
    xy, heading = poses[new, :2], poses[new, 2]
    if track.is_vehicle:
        box = compute_corners(xy, heading, length=track.length, width=track.width)
        touches = geos.intersects(polygon, geos.polygons(box))
    else:
        touches = geos.dwithin(polygon, geos.points(xy), track.radius)
    result[near] = touches[np.cumsum(new) - 1]
    return result
