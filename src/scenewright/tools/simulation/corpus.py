"""Clean tracks of simulated traffic, and recordings with all its agents.

A track is kept as its path (evenly spaced) and its progress along it (10 Hz): positions over time
follow from both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenewright.geometry.polyline import interpolate_points, rotate_left, smooth_gaussian
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.scene.track import PEDESTRIAN, STEP, VEHICLE_SIZES, Track, get_vehicle_shape
from scenewright.tools.map_import.map_parts import geos
from scenewright.tools.simulation.sumo_run import HOUR, SumoTrack
from scenewright.tools.track_io import RecordedAgent

SPACING = 0.5
"""Between points of a stored path [m]."""

_STANDING = {"vehicle": 0.15, "pedestrian": 0.4}
"""Slower than this is standing (or shuffling at the kerb): no progress [m/s]."""
TIME_BLUR = {"vehicle": 3.0, "pedestrian": 4.0}
"""Gaussian smoothing of positions over time [samples of 0.1 s]."""
_PATH_BLUR = {"vehicle": 3.0, "pedestrian": 4.0}
"""Gaussian smoothing of paths over length [points of 0.5 m]."""
_STRIPE = 0.65
_BODY = 0.32
_SIDESLIP = 0.6
"""Sideways movement on the spot that no vehicle can make [m]."""

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Trip:
    """One agent's path through the map.

    Attributes:
        route: route id; subtype: of vehicles.
        path: [P, 2] positions of the centre, 0.5 m apart, from map edge to map edge [m].
        progress: [T] distance along the path at 10 Hz [m].
        start: when it enters [s since the hour began].
    """

    route: str
    subtype: str | None
    path: FloatArray
    progress: FloatArray
    start: float

    @property
    def waypoints(self) -> FloatArray:
        """[K, 2] positions at equal arc length (SEMANTICS section 6)."""
        return resample_path(self.path)


def resample_path(path: FloatArray, count: int = K) -> FloatArray:
    """[count, 2] points at equal arc length along a path [P, 2], both ends included."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    return interpolate_points(np.linspace(0.0, s[-1], count), s, path)


def build_footways(intersection_map: IntersectionMap) -> dict[str, Any]:
    """By leg, where pedestrians who cross it may walk: sidewalks and its crosswalk."""
    areas = [geos.Polygon(area.exterior, area.holes) for area in intersection_map.walkable]
    return {
        c.leg: geos.unary_union([*areas, geos.Polygon(c.polygon)]).buffer(0.02).buffer(-_BODY)
        for c in intersection_map.crosswalks
    }


def clean_trip(
    track: SumoTrack, half: float, footways: dict[str, Any], rng: np.random.Generator
) -> Iterator[Trip]:
    """The cleaned trip, or nothing where the track is incomplete or slid sideways."""
    kind = track.route.split(":")[0]
    xy = smooth_gaussian(compute_centres(track), TIME_BLUR[kind])
    if kind == "vehicle" and _measure_sideslip(xy, track.angle) > _SIDESLIP:
        return
    moved = _measure_progress(xy, _STANDING[kind])
    if moved[-1] < 2 * SPACING:
        return
    path = _build_path(xy, moved, _PATH_BLUR[kind])
    if kind == "pedestrian":
        path = _correct_walk(path, footways[track.route.split(":")[1]], rng)
    inside = np.abs(path).max(axis=1) <= half
    where = np.flatnonzero(inside)
    if not len(where) or inside[0] or inside[-1]:
        return
    first, last = int(where[0]), int(where[-1])
    if not inside[first : last + 1].all():
        return
    here = (moved >= first * SPACING) & (moved <= last * SPACING)
    start = float(track.time[here][0])
    if 0.0 <= start < HOUR:
        along = moved[here] - first * SPACING
        yield Trip(track.route, track.subtype, path[first : last + 1], along, start)


def clean_walk(track: SumoTrack, footway: Any, rng: np.random.Generator) -> Iterator[Trip]:
    """The whole of a simulated walk, on sidewalk and crosswalk; nothing if it is too short."""
    xy = smooth_gaussian(compute_centres(track), TIME_BLUR["pedestrian"])
    moved = _measure_progress(xy, _STANDING["pedestrian"])
    here = track.time >= 0.0
    if moved[-1] < 8 * SPACING or not here[0]:
        return
    path = _correct_walk(_build_path(xy, moved, _PATH_BLUR["pedestrian"]), footway, rng)
    along = np.clip(moved, 0.0, (len(path) - 1) * SPACING)
    yield Trip(track.route, None, path, along, float(track.time[0]))


def compute_centres(track: SumoTrack) -> FloatArray:
    """SUMO gives the front bumper; the centre lies half a length behind it."""
    if track.subtype is None:
        return track.xy
    back = VEHICLE_SIZES[track.subtype][0] / 2
    return track.xy - back * np.stack([np.cos(track.angle), np.sin(track.angle)], axis=1)


def _measure_sideslip(xy: FloatArray, angle: FloatArray) -> float:
    """Sideways movement while hardly moving forwards, in all [m]."""
    step = np.diff(xy, axis=0)
    c, s = np.cos(angle[:-1]), np.sin(angle[:-1])
    forwards, sideways = step[:, 0] * c + step[:, 1] * s, step[:, 1] * c - step[:, 0] * s
    return float(np.abs(sideways[np.abs(sideways) > np.abs(forwards)]).sum())


def _measure_progress(xy: FloatArray, standing: float) -> FloatArray:
    """[T] distance travelled, without the jitter of standing agents."""
    step = np.linalg.norm(np.diff(xy, axis=0), axis=1)
    step[step < standing * STEP] = 0.0
    return np.concatenate([[0.0], np.cumsum(step)])


def _build_path(xy: FloatArray, moved: FloatArray, blur: float) -> FloatArray:
    """[P, 2] the way gone, evenly spaced by progress and smoothed over length."""
    kept = np.concatenate([[True], np.diff(moved) > 0.0])
    wanted = np.arange(0.0, moved[-1], SPACING)
    return smooth_gaussian(interpolate_points(wanted, moved[kept], xy[kept]), blur)


def _correct_walk(path: FloatArray, footway: Any, rng: np.random.Generator) -> FloatArray:
    """A walked path without two artefacts of the stripe model.

    Walkers keep to stripes 0.65 m apart: each gets its own place within its stripe. Some cut the
    corner over the roadway: they are brought back to sidewalk or crosswalk.
    """
    tangent = smooth_gaussian(np.gradient(path, axis=0), 2.0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    moved = path + rng.uniform(-_STRIPE / 2, _STRIPE / 2) * rotate_left(tangent)
    points = geos.points(moved)
    edge = footway.boundary
    back = geos.line_interpolate_point(edge, geos.line_locate_point(edge, points))
    outside = ~geos.contains(footway, points)
    moved[outside] = geos.get_coordinates(back)[outside]
    return smooth_gaussian(moved, 2.0)


_JAMMED = 180.0
"""No vehicle waits that long in one place [s], more than two cycles, while traffic flows."""
_CREEP = 0.15
"""Less progress than this in _JAMMED is none [m]."""


def build_agents(
    intersection_map: IntersectionMap,
    raw: Sequence[SumoTrack],
    *,
    half: Mapping[str, float],
    rng: np.random.Generator,
) -> list[RecordedAgent]:
    """All agents inside the map: cleaned trips, and the pieces of other tracks.

    Args:
        half: by class, half the side of the square that counts [m].
    """
    routes = {route.id: route for route in intersection_map.routes}
    footways = build_footways(intersection_map)
    agents: list[RecordedAgent] = []
    for track in raw:
        route = routes[track.route]
        trips = list(clean_trip(track, half[route.type], footways, rng))
        tracks = [build_track(trip) for trip in trips] or list(_cut_tracks(track, half[route.type]))
        shape = PEDESTRIAN if track.subtype is None else get_vehicle_shape(track.subtype)
        agents += [
            RecordedAgent(
                each, shape, track.subtype, route.entry, route.exit, route.crosswalk, route.id,
                bool(trips),
            )
            for each in tracks
        ]  # fmt: skip
    return agents


def find_jam_time(agents: Sequence[RecordedAgent]) -> float:
    """When the first vehicle comes to a standstill that does not end [s].

    Two vehicles that block one another in the simulation never move again, nor does the traffic
    behind them: of such an hour only the time before counts.
    """
    stuck = [start for agent in agents if (start := _find_standstill(agent)) is not None]
    return min([HOUR, *stuck])


def _find_standstill(agent: RecordedAgent) -> float | None:
    span, xy = round(_JAMMED / STEP), agent.track.xy
    if agent.shape.type != "vehicle" or len(xy) <= span:
        return None
    held = np.linalg.norm(xy[span:] - xy[:-span], axis=1) < _CREEP
    return float(agent.track.times[int(np.argmax(held))]) if held.any() else None


def build_track(trip: Trip) -> Track:
    """The track of a trip: its progress mapped to its path."""
    at = np.asarray(SPACING * np.arange(len(trip.path)), dtype=np.float64)
    tangent = np.gradient(trip.path, axis=0)
    course = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    heading = np.interp(trip.progress, at, course)
    return Track(interpolate_points(trip.progress, at, trip.path), heading, round(trip.start, 1))


def _cut_tracks(track: SumoTrack, half: float) -> Iterator[Track]:
    """The stretches of an uncleaned track inside the map and the hour, two samples or longer."""
    kind = track.route.split(":")[0]
    xy: FloatArray = smooth_gaussian(compute_centres(track), TIME_BLUR[kind])
    inside = (np.abs(xy).max(axis=1) <= half) & (track.time >= 0.0) & (track.time <= HOUR)
    edges = np.flatnonzero(np.diff(inside.astype(np.int8), prepend=0, append=0))
    for first, end in edges.reshape(-1, 2):
        if end - first >= 2:
            start = round(round(float(track.time[first]) / STEP) * STEP, 1)
            yield Track(xy[first:end], track.angle[first:end], start)
