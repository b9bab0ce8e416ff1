"""Paths, swept paths, conflict zones, and when a footprint is in a zone (SEMANTICS section 4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.footprints import (
    Box,
    IntArray,
    Pose,
    compute_angle_between,
    compute_corners,
    make_pose,
    meets_box,
)
from scenewright.tools.relation_checker.planar import Area, geos
from scenewright.tools.relation_checker.track_path import project
from scenewright.tools.relation_checker.trajectory import Trajectory, interpolate_samples

SHARED = np.deg2rad(30.0)
"""Paths within this angle of one another run in one direction [rad]."""
MERGE_LENGTH = 5.0
"""So much of a merge or a shared lane is a conflict zone [m]."""


def get_swept_path(track: Trajectory) -> Area:
    """The path widened by half the agent's width [m], ending where the centre does."""
    known = _swept.get(track)
    if known is not None:
        return known
    path = track.path
    if len(path.s) >= 2:
        line = geos.LineString(path.xy).simplify(0.01, preserve_topology=False)
        area = line.buffer(track.width / 2, cap_style="flat")
    else:
        xy, heading = track.at(np.array([track.start]))
        if track.is_vehicle:
            corners = compute_corners(xy, heading, length=track.length, width=track.width)
            area = geos.Polygon(corners[0])
        else:
            area = geos.buffer(geos.Point(xy[0]), track.radius)
    _swept[track] = area
    return area


_swept: WeakKeyDictionary[Trajectory, Area] = WeakKeyDictionary()


def find_conflict_zones(first: Trajectory, second: Trajectory) -> tuple[Area, ...]:
    """Each connected overlap of the two swept paths, in no particular order.

    Where both run in one direction (within 30 degrees) for more than 5 m, only the first 5 m of the
    overlap; nothing at all where the overlap begins in one lane at the start of a track, for then
    the two are behind one another from the outset. Vehicles and pedestrians never share a lane.
    """
    return _find_conflict_zones(*((first, second) if first.id <= second.id else (second, first)))


@lru_cache(maxsize=8)
def _find_conflict_zones(a: Trajectory, b: Trajectory) -> tuple[Area, ...]:
    """Events and the places asked for look at the same pairs; movers are known by identity."""
    overlap = get_swept_path(a).intersection(get_swept_path(b))
    zones: list[Area] = []
    for part in (each for each in geos.get_parts(overlap) if each.area > 1e-6):
        if a.is_vehicle != b.is_vehicle:
            zones.append(part)
            continue
        ring = geos.get_coordinates(geos.segmentize(geos.get_exterior_ring(part), 0.5))
        one, two = project(ring, a.path), project(ring, b.path)
        parallel = compute_angle_between(one.direction, two.direction) <= SHARED
        start, length = float(one.s.min()), float(one.s.max() - one.s.min())
        if length <= MERGE_LENGTH or not parallel.any():
            zones.append(part)
            continue
        first = (one.s < start + 1.0) & parallel
        if first.any() and (start < 1.0 or float(two.s[first].min()) < 1.0):
            continue
        piece = geos.ops.substring(geos.LineString(a.path.xy), start, start + MERGE_LENGTH)
        zones.append(piece.buffer(a.width / 2 + 0.5, cap_style="flat").intersection(part))
    return tuple(zones)


def find_nearest_zone(
    first: Trajectory, second: Trajectory, place: tuple[float, float]
) -> Area | None:
    """The conflict zone of two movers that lies nearest to a place [m]; None without one."""
    here = geos.Point(place)
    zones = find_conflict_zones(first, second)
    return min(zones, key=lambda each: float(each.distance(here)), default=None)


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
    rings = geos.get_rings(geos.get_parts(polygon))
    zone = *geos.get_coordinates(rings, return_index=True), polygon.bounds
    mover = track.xy, track.heading, track.reach, track.box
    first, last, enter, leave = _find_stay(track.times, mover, zone)
    return None if first < 0 else ZoneOccupancy(enter, leave, first == 0, last == len(track) - 1)


Mover = tuple[FloatArray, FloatArray, float, Box]
"""Positions [T, 2] [m], headings [T], reach [m] and size of a footprint."""
Zone = tuple[FloatArray, IntArray, tuple[float, float, float, float]]
"""Corners [C, 2] [m] of rings, which ring each is of, and west, south, east and north end [m]."""
_FORTH, _BACK = np.linspace(0.0, STEP, 11), np.linspace(STEP, 0.0, 11)
"""Moments of the steps in which it comes and goes, from outside the zone inwards [s]."""


@compiled
def _find_stay(times: FloatArray, mover: Mover, zone: Zone) -> tuple[int, int, float, float]:
    """First and last sample that touches a zone, -1 if none does, and the times to 0.01 s."""
    last = len(times) - 1
    first = _find_touch(times, times[0], mover, zone)
    if first < 0:
        return first, first, 0.0, 0.0
    last -= _find_touch(times[::-1], times[0], mover, zone)
    enter, leave = times[first], times[last]
    if first > 0:
        fine = enter - STEP + _FORTH
        enter = fine[max(_find_touch(fine, times[0], mover, zone), 0)]
    if last < len(times) - 1:
        fine = leave + _BACK
        leave = fine[max(_find_touch(fine, times[0], mover, zone), 0)]
    return first, last, enter, leave


@compiled
def _find_touch(times: FloatArray, start: float, mover: Mover, zone: Zone) -> int:
    """At which of some times it first touches a zone; -1 if at none."""
    xy, heading = interpolate_samples(times, start, mover[0], mover[1])
    west, south, east, north = zone[2]
    reach = mover[2]
    for k in range(len(times)):
        x, y = xy[k]
        near = west - reach < x < east + reach and south - reach < y < north + reach
        if near and _touches(make_pose(x, y, heading[k]), mover[3], zone[0], zone[1]):
            return k
    return -1


@compiled
def _touches(place: Pose, size: Box, corners: FloatArray, ring: IntArray) -> bool:
    """Whether a footprint meets an edge of rings, or lies within them."""
    x, y, inside = place[0], place[1], False
    for k in range(len(corners) - 1):
        if ring[k] != ring[k + 1]:
            continue
        one, two = corners[k], corners[k + 1]
        if size[2] > 0.0:
            if _measure_distance(x, y, one, two) <= size[2]:
                return True
        elif meets_box(one, two, place, 2 * size[0], 2 * size[1]):
            return True
        if (one[1] > y) != (two[1] > y):
            inside ^= x < one[0] + (two[0] - one[0]) * (y - one[1]) / (two[1] - one[1])
    return inside


@compiled
def _measure_distance(x: float, y: float, one: FloatArray, two: FloatArray) -> float:
    """How far a place is from a line between two others [2] [m]."""
    dx, dy = two[0] - one[0], two[1] - one[1]
    x, y = x - one[0], y - one[1]
    part = min(max((x * dx + y * dy) / max(dx * dx + dy * dy, 1e-18), 0.0), 1.0)
    return float(np.hypot(x - part * dx, y - part * dy))
