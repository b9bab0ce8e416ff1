"""Agents that refining would bring too close to another: behind it in its lane, or beside it.

The edited priors keep their distances, as the solver saw to it; the network knows nothing of them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from scenewright.compiled import compiled
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
_ALONG = float(np.cos(np.radians(30.0)))


def find_crowded(
    refined: Mapping[str, Track],
    edited: Mapping[str, Track],
    shapes: Mapping[str, Shape],
    among: Collection[str] | None = None,
) -> frozenset[str]:
    """Find agents that come closer to another than is usual, and closer than unrefined.

    Args:
        among: pairs without any of these are left out; none is if None.
    """
    found: set[str] = set()
    for one, two in _list_near_pairs(refined, shapes):
        sizes = (shapes[one], shapes[two])
        if among is not None and one not in among and two not in among:
            continue
        if all(size.type == "pedestrian" for size in sizes):
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
    if all(shape.type != "pedestrian" for shape in shapes):
        sizes = (shapes[0].length + shapes[1].length) / 2, (shapes[0].width + shapes[1].width) / 2
        room[0] = min(
            _measure_headway(first, second, *sizes), _measure_headway(second, first, *sizes)
        )
    near = apart < sum(np.hypot(shape.length, shape.width) / 2 for shape in shapes) + _CLEARANCE
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


@compiled
def _measure_headway(behind: FloatArray, ahead: FloatArray, lengths: float, widths: float) -> float:
    """Least time gap [s] of one to another ahead of it in its lane; inf if never there.

    Args:
        behind, ahead: [N, 3] poses of both; lengths, widths: half of what both measure [m].
    """
    least, last = np.inf, len(behind) - 1
    for k in range(len(behind)):
        dx, dy = ahead[k, 0] - behind[k, 0], ahead[k, 1] - behind[k, 1]
        first, second = behind[max(k - 1, 0)], behind[min(k + 1, last)]
        moved = np.hypot(second[0] - first[0], second[1] - first[1])
        speed = max(moved / (STEP * (min(k + 1, last) - max(k - 1, 0))), _SLOWEST)
        if np.hypot(dx, dy) - lengths - widths - _ASIDE > (_HEADWAY + _LESS) * speed:
            continue  # a gap too long to count
        cos, sin = np.cos(behind[k, 2]), np.sin(behind[k, 2])
        along, aside = dx * cos + dy * sin, abs(dy * cos - dx * sin)
        same = np.cos(ahead[k, 2] - behind[k, 2]) > _ALONG
        if same and along > 0.0 and aside < widths + _ASIDE:
            least = min(least, (along - lengths) / speed)
    return least
