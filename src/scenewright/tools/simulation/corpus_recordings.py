"""Simulated traffic with all agents in it: recordings from which scenes can be cut.

Agents without a trip are here too, marked as not complete: still under way when the time began, or
removed by the cleaning.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from scenewright.geometry.polyline import interpolate_points, smooth_gaussian
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.track import PEDESTRIAN, STEP, Track, get_vehicle_shape
from scenewright.tools.simulation.corpus import (
    SPACING,
    TIME_BLUR,
    Trip,
    build_footways,
    clean_trip,
    compute_centres,
)
from scenewright.tools.simulation.sumo_run import HOUR, SumoTrack
from scenewright.tools.track_io import RecordedAgent

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
