"""People in vehicles, whom simulators write as persons at the place of their vehicle."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.track import Track
from scenewright.tools.relation_checker.trajectory import RoadUser

WALKS = 3.0
"""An agent on foot that is never faster than this [m/s] is not looked for in vehicles."""
BEFORE = 0.3
"""How far ahead of a vehicle's front its passenger may be [m]: SUMO writes it at the front."""
DRIFT, NOISE = 0.3, 0.05
"""How fast a passenger may move in its vehicle [m/s], and how far between two samples more [m]."""
RIDDEN = 2.0
"""Way together [m] from which an agent is a passenger."""

Named = tuple[str, RoadUser]


def leave_out_passengers(users: Sequence[Named]) -> tuple[list[Named], dict[str, str]]:
    """The road users without what pedestrians ride in vehicles, and who rides in which vehicle."""
    vehicles = [(name, user) for name, user in users if user.shape.type != "pedestrian"]
    spans = np.array([(u.track.start, u.track.end) for _, u in vehicles]).reshape(-1, 2)
    kept: list[Named] = []
    rides: dict[str, str] = {}
    for name, user in users:
        track = user.track
        steps = np.hypot(*np.diff(track.xy, axis=0).T)
        if user.shape.type != "pedestrian" or not (steps > WALKS * track.step).any():
            kept.append((name, user))
            continue
        riding = np.zeros(len(track.xy), dtype=np.bool_)
        together = (spans[:, 0] <= track.end) & (spans[:, 1] >= track.start)
        for k in np.flatnonzero(together).tolist():
            for first, last in _find_rides(track, vehicles[k][1]):
                riding[first:last] = True
                rides[name] = vehicles[k][0]
        edges = np.flatnonzero(np.diff(np.concatenate(([True], riding, [True])).astype(int)))
        for first, last in edges.reshape(-1, 2).tolist():
            if last - first == len(riding) or last - first > 1:
                part, start = slice(first, last), track.start + first * track.step
                walked = Track(track.xy[part], track.heading[part], start, track.step)
                kept.append((name, replace(user, track=walked)))
    return kept, rides


def _find_rides(track: Track, vehicle: RoadUser) -> Iterator[tuple[int, int]]:
    """The samples, from and to, in which a vehicle carries an agent.

    Its middle is within the vehicle and stays at its place there while the two go on.
    """
    shift = round((track.start - vehicle.track.start) / track.step)
    begin, end = max(0, -shift), min(len(track.xy), len(vehicle.track.xy) - shift)
    if end - begin < 2:
        return
    carrier = slice(begin + shift, end + shift)
    away = track.xy[begin:end] - vehicle.track.xy[carrier]
    cos, sin = np.cos(vehicle.track.heading[carrier]), np.sin(vehicle.track.heading[carrier])
    place: FloatArray = np.stack(
        (cos * away[:, 0] + sin * away[:, 1], cos * away[:, 1] - sin * away[:, 0]), axis=1
    )
    inside = np.abs(place[:, 0]) <= vehicle.shape.length / 2 + BEFORE
    inside &= np.abs(place[:, 1]) <= vehicle.shape.width / 2
    stays = np.hypot(*np.diff(place, axis=0).T) <= DRIFT * track.step + NOISE
    carried = inside[1:] & inside[:-1] & stays
    edges = np.flatnonzero(np.diff(np.concatenate(([False], carried, [False])).astype(int)))
    for first, last in edges.reshape(-1, 2).tolist():
        way = vehicle.track.xy[carrier][last] - vehicle.track.xy[carrier][first]
        if np.hypot(*way) >= RIDDEN:
            yield begin + first, begin + last + 1
