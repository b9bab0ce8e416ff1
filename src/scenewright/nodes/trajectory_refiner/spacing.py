"""Agents that refining would bring too close to another: behind it in its lane, or beside it.

The edited priors keep their distances, as the solver saw to it; the network knows nothing of them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP, Shape, Track
from scenewright.tools.solver.path_conflict import compute_clearance

_HEADWAY, _SLOWEST = 0.95, 1.2
"""Least time gap in a lane [s], at no less than that speed [m/s]: so standing ones keep 1.1 m."""
_CLEARANCE = 0.6
"""Least distance of two footprints, of which one is a vehicle's [m]."""
_LESS = 0.02
"""By how much it must be less than unrefined to count."""
_NEAR, _NEAR_ON_FOOT = 25.0, 9.0
"""Centres further apart than this [m] are not near; the second where one is a pedestrian's."""
_STRIDE = 5
"""Samples from one at which that is looked at to the next."""
_ASIDE = 0.5
"""How far beside the footprint of the one behind the one ahead may be in a bend [m]."""
_ALONG = np.cos(np.radians(30.0))


def find_crowded(
    refined: Mapping[str, Track], edited: Mapping[str, Track], shapes: Mapping[str, Shape]
) -> frozenset[str]:
    """Find agents that come closer to another than is usual, and closer than unrefined."""
    found: set[str] = set()
    for one, two in _list_near_pairs(refined, shapes):
        sizes = (shapes[one], shapes[two])
        if all(each.type == "pedestrian" for each in sizes):
            continue
        now = _measure_room(refined[one], refined[two], sizes)
        if not (now < np.array([_HEADWAY, _CLEARANCE])).any():
            continue
        before = _measure_room(edited[one], edited[two], sizes)
        if ((now < np.array([_HEADWAY, _CLEARANCE])) & (now < before - _LESS)).any():
            found |= {one, two}
    return frozenset(found)


def _list_near_pairs(
    tracks: Mapping[str, Track], shapes: Mapping[str, Shape]
) -> list[tuple[str, str]]:
    """List pairs that are near at some time; looked at every half second."""
    names, coarse = tuple(tracks), _STRIDE * STEP
    first = [round(tracks[name].start / coarse) for name in names]
    parts = [tracks[name].xy[::_STRIDE] for name in names]
    ends = [begin + len(part) for begin, part in zip(first, parts, strict=True)]
    places = np.full((len(names), max(ends, default=0), 2), np.nan)
    for row, begin, part in zip(places, first, parts, strict=True):
        row[begin : begin + len(part)] = part
    x, y = places[..., 0], places[..., 1]
    apart = np.hypot(x[:, None] - x, y[:, None] - y)
    drives = np.array([shapes[name].type != "pedestrian" for name in names])
    reach = np.where(drives[:, None] & drives, _NEAR, _NEAR_ON_FOOT)
    rows = np.argwhere(np.triu((apart <= reach[..., None]).any(axis=2), 1))
    return [(names[i], names[j]) for i, j in rows.tolist()]


def _measure_room(one: Track, two: Track, shapes: tuple[Shape, Shape]) -> FloatArray:
    """[2] least time gap in one lane [s] and least clearance [m] of two; inf where never near."""
    room = np.full(2, np.inf)
    begin, end = max(one.start, two.start), min(one.end, two.end)
    count = round((end - begin) / STEP) + 1
    if count < 2:
        return room
    first, second = (_cut(each, begin, count) for each in (one, two))
    apart = np.hypot(*(second - first)[:, :2].T)
    if all(each.type != "pedestrian" for each in shapes):
        turned = (shapes[1], shapes[0])
        room[0] = min(
            _measure_headway(first, second, shapes), _measure_headway(second, first, turned)
        )
    near = apart < sum(np.hypot(each.length, each.width) / 2 for each in shapes) + _CLEARANCE
    if near.any():
        room[1] = compute_clearance(first[near], second[near], shapes=shapes).min()
    return room


def _cut(track: Track, begin: float, count: int) -> FloatArray:
    """[count, 3] poses (x, y, heading) from a time [s] on."""
    first = round((begin - track.start) / STEP)
    poses = np.empty((count, 3))
    poses[:, :2] = track.xy[first : first + count]
    poses[:, 2] = track.heading[first : first + count]
    return poses


def _measure_headway(behind: FloatArray, ahead: FloatArray, shapes: tuple[Shape, Shape]) -> float:
    """Least time gap [s] of one to another ahead of it in its lane; inf if never there."""
    cos, sin = np.cos(behind[:, 2]), np.sin(behind[:, 2])
    dx, dy = (ahead - behind)[:, :2].T
    along, aside = dx * cos + dy * sin, np.abs(dy * cos - dx * sin)
    beside = (shapes[0].width + shapes[1].width) / 2 + _ASIDE
    in_lane = (along > 0.0) & (aside < beside) & (np.cos(ahead[:, 2] - behind[:, 2]) > _ALONG)
    if not in_lane.any():
        return np.inf
    speed = np.hypot(*np.gradient(behind[:, :2], STEP, axis=0).T)
    gap = (along - (shapes[0].length + shapes[1].length) / 2) / np.maximum(speed, _SLOWEST)
    return float(gap[in_lane].min())
