"""Post-encroachment time of footprints, encounter by encounter (SEMANTICS section 4, *PET*).

The PET of a pair is the least |t_a - t_b| over all times at which footprint a(t_a) would touch
footprint b(t_b). The search works on *places*: runs of samples at which an agent stays within
2 cm. Blocks of places are discarded by boxes round them, the rest tested place by place with
footprints lengthened by the way to the next place, and the pairs of places that can hold the least
lag are resolved to 0.01 s.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scenewright.compiled import compiled, compiled_to_write
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.conflict_zones import MERGE_LENGTH, SHARED
from scenewright.tools.relation_checker.contact import TOUCH
from scenewright.tools.relation_checker.footprints import (
    BoolArray,
    Box,
    IntArray,
    Pose,
    is_in_touch,
)
from scenewright.tools.relation_checker.track_path import (
    LANE_AFTER,
    LANE_BEFORE,
    LaneTable,
    project_on_lane,
)
from scenewright.tools.relation_checker.trajectory import (
    Trajectory,
    concatenate_samples,
    get_lane_table,
)

STILL = 0.02
BLOCK, LARGE = 8, 64
BATCH = 8
_PARTS = np.linspace(0.0, 1.0, 5)
"""Parts of the way to the next place that are tried first, for either agent."""
_AROUND = np.linspace(-0.25, 0.25, 7)
"""Parts beside the best of them that are tried then."""
SPLIT = 3.0
"""Contacts further apart along a path than this [m] belong to different encounters."""


@dataclass(frozen=True)
class Encounter:
    """One connected stretch of paths on which two agents could have met.

    Attributes:
        first, second: positions of the movers in the sequence that was searched.
        pet: least lag [s]; first_time, second_time: when either is there [s].
    """

    first: int
    second: int
    pet: float
    first_time: float
    second_time: float


class _Occupancies(NamedTuple):
    """All movers' places, one after another.

    Attributes:
        owner: [K] mover; s: [K] arc length [m]; reach: [K] radius of the circle [m].
        table: [19, K] x, y and heading there and one sample after; first and last sample time
            there, and when the next place is reached, at the end of a track the same as the last
            [s]; half length, half width and radius [m]; x, y, cosine and sine midway to the next
            place, half length and radius lengthened by the way; and by how much it may turn [m].
        origin: [N+1] where each mover's places begin.
    """

    owner: IntArray
    s: FloatArray
    reach: FloatArray
    table: FloatArray
    origin: IntArray


def compute_pet(first: Trajectory, second: Trajectory) -> float | None:
    """PET of a pair [s], 0 where they are in contact; None where they never would be.

    Agents behind one another in one lane have headway, not PET: contacts on a stretch that both
    drive in one direction count only in its first 5 m, and not at all where they begin on it.
    """
    found = find_encounters((first, second), horizon=np.inf, asked={(first.id, second.id)})
    return min((e.pet for e in found), default=None)


def find_encounters(
    tracks: tuple[Trajectory, ...],
    *,
    horizon: float = 8.5,
    asked: Collection[tuple[int, int]] = (),
    among: IntArray | None = None,
) -> tuple[Encounter, ...]:
    """All encounters with a lag of at most `horizon` seconds.

    Args:
        asked: pairs of ids; of two pedestrians, only these are looked at.
        among: [M, 2] positions of the pairs that are looked at, in order; None means all.
    """
    if len(tracks) < 2:
        return ()
    xy, heading, origin = concatenate_samples(tracks)
    times, s = (
        np.concatenate(each) for each in zip(*((m.times, m.s) for m in tracks), strict=True)
    )
    sizes = np.array([(*m.box, m.reach) for m in tracks])
    occupancies = _Occupancies(*_fill_table(xy, heading, times, s, origin, sizes))
    among = np.stack(np.triu_indices(len(tracks), 1), axis=1) if among is None else among
    first, second = among[_find_overlapping_boxes(tracks, asked, among)].T
    lanes = get_lane_table(tracks)
    found = _search_encounters(first, second, occupancies, horizon, lanes)
    return tuple(Encounter(*row) for row in found if row[2] <= horizon)


def _find_overlapping_boxes(
    tracks: tuple[Trajectory, ...], asked: Collection[tuple[int, int]], pairs: IntArray
) -> BoolArray:
    """[M] whether the boxes of the two tracks overlap, and one of them drives or they are asked."""
    west, south, east, north = np.array([m.bounds for m in tracks]).T
    reach = np.array([m.reach for m in tracks])
    i, j = pairs.T
    drives = np.array([m.is_vehicle for m in tracks])
    result = drives[i] | drives[j]
    if asked:
        index = {m.id: k for k, m in enumerate(tracks)}
        wanted = np.sort([(index[a], index[b]) for a, b in asked])
        result |= np.isin(i * len(tracks) + j, wanted[:, 0] * len(tracks) + wanted[:, 1])
    for low, high in ((west - reach, east + reach), (south - reach, north + reach)):
        result &= (low[i] <= high[j]) & (low[j] <= high[i])
    return np.asarray(result)


# ---- as machine code, on the table of places ----------------------------------------------------

(
    _X, _Y, _HEADING, _NEXT_X, _NEXT_Y, _NEXT_HEADING, _ARRIVE, _DEPART, _LEAVE, _LENGTH, _WIDTH,
    _RADIUS, _SWEPT_X, _SWEPT_Y, _COS, _SIN, _SWEPT_LENGTH, _SWEPT_RADIUS, _SLACK,
) = range(19)  # fmt: skip


@compiled
def _fill_table(
    xy: FloatArray,
    heading: FloatArray,
    times: FloatArray,
    s: FloatArray,
    origin: IntArray,
    sizes: FloatArray,
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """What `_Occupancies` holds, of samples one after another and sizes [N, 4] (reach the last)."""
    first, owner, begin = _find_occupancies(s, origin)
    count = len(owner)
    at, reach, table = np.empty(count), np.empty(count), np.empty((_SLACK + 1, count))
    for k in range(count):
        i, n = first[k], owner[k]
        last = first[k + 1] - 1
        j = min(last + 1, origin[n + 1] - 1)
        dx, dy = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
        stride = np.hypot(dx, dy) / 2
        length, width, radius = sizes[n, 0], sizes[n, 1], sizes[n, 2]
        at[k], reach[k] = s[i], sizes[n, 3] + stride
        table[_X, k], table[_Y, k], table[_HEADING, k] = xy[i, 0], xy[i, 1], heading[i]
        table[_NEXT_X, k], table[_NEXT_Y, k] = xy[j, 0], xy[j, 1]
        table[_NEXT_HEADING, k] = heading[j]
        table[_ARRIVE, k], table[_DEPART, k], table[_LEAVE, k] = times[i], times[last], times[j]
        table[_LENGTH, k], table[_WIDTH, k], table[_RADIUS, k] = length, width, radius
        table[_SWEPT_X, k] = (xy[i, 0] + xy[j, 0]) / 2
        table[_SWEPT_Y, k] = (xy[i, 1] + xy[j, 1]) / 2
        table[_COS, k], table[_SIN, k] = np.cos(heading[i]), np.sin(heading[i])
        table[_SWEPT_LENGTH, k] = 0.0 if radius > 0.0 else length + stride
        table[_SWEPT_RADIUS, k] = radius + stride if radius > 0.0 else 0.0
        table[_SLACK, k] = sizes[n, 3] * abs(heading[j] - heading[i]) + TOUCH
    return owner, at, reach, table, begin


@compiled
def _find_occupancies(s: FloatArray, origin: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """First samples of places [K + 1], their owners [K], and where each owner's begin [N + 1]."""
    first, owner = np.empty(len(s) + 1, np.intp), np.empty(len(s), np.intp)
    begin, count = np.zeros(len(origin), np.intp), 0
    for n in range(len(origin) - 1):
        for i in range(origin[n], origin[n + 1]):
            if i == origin[n] or np.floor(s[i] / STILL) > np.floor(s[i - 1] / STILL):
                first[count], owner[count] = i, n
                count += 1
        begin[n + 1] = count
    first[count] = len(s)
    return first[: count + 1], owner[:count], begin


@compiled
def _search_encounters(
    first: IntArray,
    second: IntArray,
    places: _Occupancies,
    horizon: float,
    lanes: LaneTable,
) -> list[tuple[int, int, float, float, float]]:
    """What `Encounter` holds, of pairs of movers; they part at gaps along the first one's path."""
    large = _bound_blocks(places.origin, places.table, LARGE)
    blocks = _bound_blocks(places.origin, places.table, BLOCK)
    shared, group = np.zeros(len(places.s), np.bool_), np.full(len(places.s), -1)
    found = [(0, 0, 0.0, 0.0, 0.0) for _ in range(0)]
    for pair in range(len(first)):
        a, b = first[pair], second[pair]
        bounds = _list_blocks(a, b, places.origin, large, blocks, horizon)
        touching = _list_touching_places(a, b, bounds, places, horizon, lanes, shared)
        for k in range(_label_encounters(touching, places.s, group)):
            least, time, other_time = _find_least_lag(
                [each for each in touching if group[each[1]] == k], places.table
            )
            if least < np.inf:
                found.append((a, b, least, time, other_time))
        for _lag, place, _other in touching:
            group[place] = -1
    return found


@compiled_to_write
def _list_touching_places(
    a: int,
    b: int,
    blocks: list[tuple[int, int]],
    places: _Occupancies,
    horizon: float,
    lanes: LaneTable,
    shared: BoolArray,
) -> list[tuple[float, int, int]]:
    """Lower bound of the lag [s], and the two places, of all in these blocks that may touch.

    Two of one class that touch heading the same way may be behind one another in one lane; their
    contacts there do not count.

    Args:
        shared: [K] room to note which places are in such a lane; all false, before and after.
    """
    origin, table, aligned = places.origin, places.table, np.cos(SHARED)
    found = [(0.0, 0, 0) for _ in range(0)]
    open_yet = lanes.is_vehicle[a] == lanes.is_vehicle[b]
    for i, j in blocks:
        for m in range(i, min(i + BLOCK, origin[a + 1])):
            for n in range(j, min(j + BLOCK, origin[b + 1])):
                if shared[m] or shared[n]:
                    continue
                lag = _bound_lag(m, n, places.reach, table, horizon)
                if lag == np.inf:
                    continue
                found.append((lag, m, n))
                facing = table[_COS, m] * table[_COS, n] + table[_SIN, m] * table[_SIN, n]
                if open_yet and facing >= aligned:
                    open_yet = False
                    _mark_shared_lanes(a, b, places, lanes, shared)
                    found = [each for each in found if not (shared[each[1]] or shared[each[2]])]
    shared[origin[a] : origin[a + 1]] = False
    shared[origin[b] : origin[b + 1]] = False
    return found


@compiled_to_write
def _mark_shared_lanes(
    a: int, b: int, places: _Occupancies, lanes: LaneTable, shared: BoolArray
) -> None:
    """Writes which places of two movers are in a stretch that either shares with the other."""
    ones, twos = _find_stretches(a, b, lanes), _find_stretches(b, a, lanes)
    if len(ones) == 0 or len(twos) == 0:
        return
    for mover, stretches in ((a, ones), (b, twos)):
        for k in range(places.origin[mover], places.origin[mover + 1]):
            here = places.s[k]
            shared[k] = ((stretches[:, 0] <= here) & (here <= stretches[:, 1])).any()


@compiled
def _find_stretches(a: int, b: int, lanes: LaneTable) -> FloatArray:
    """[R, 2] where a mover is in one lane with another, past the first 5 m of a merge [m].

    Of runs of points of its path that are near the other's lane, of which any is along it.
    """
    first, end = lanes.begin[a] + LANE_BEFORE // 2, lanes.begin[a + 1] - LANE_AFTER // 2
    beside, nose = (lanes.width[a] + lanes.width[b]) / 2, lanes.nose[a]
    found, count = np.zeros((end - first, 2)), 0
    start, shares, from_start = -1, False, False
    for k in range(first, end):
        s, way = lanes.s[k], lanes.direction[k]
        foot, lateral, facing = project_on_lane(lanes.x[k], lanes.y[k], lanes, b, beside)
        if lateral < beside:
            along = abs((way - facing + np.pi) % (2 * np.pi) - np.pi) <= SHARED
            if start < 0:
                start, from_start = k, along and min(s, foot) < 1.0
            shares = shares or along
        ends = lateral >= beside or k + 1 == end
        if ends and start >= 0:
            last = k - 1 if lateral >= beside else k
            if shares:
                before = lanes.s[start] + MERGE_LENGTH + nose
                found[count, 0] = -np.inf if from_start else before
                found[count, 1] = lanes.s[last] + nose + 1.0
                count += 1
            start, shares = -1, False
    return found[:count]


@compiled
def _list_blocks(
    a: int, b: int, origin: IntArray, large: FloatArray, blocks: FloatArray, horizon: float
) -> list[tuple[int, int]]:
    """Where blocks of two movers begin that may touch; no place of large blocks that do not may."""
    found = []
    for wide in range(origin[a], origin[a + 1], LARGE):
        for other in range(origin[b], origin[b + 1], LARGE):
            if _may_touch(large[:, wide], large[:, other], horizon):
                for i in range(wide, min(wide + LARGE, origin[a + 1]), BLOCK):
                    for j in range(other, min(other + LARGE, origin[b + 1]), BLOCK):
                        if _may_touch(blocks[:, i], blocks[:, j], horizon):
                            found.append((i, j))  # noqa: PERF401
    return found


@compiled
def _bound_blocks(origin: IntArray, table: FloatArray, size: int) -> FloatArray:
    """[8, K] what bounds the block that begins at a place.

    From when until when it is there [s]; and a box: x and y of its middle, cosine and sine of its
    heading, half its length and width [m], with all that `is_in_touch` allows for at the corners.
    """
    blocks = np.empty((8, len(table[0])))
    for owner in range(len(origin) - 1):
        for i in range(origin[owner], origin[owner + 1], size):
            end = min(i + size, origin[owner + 1])
            k = (i + end) // 2
            x, y, cos, sin = table[_SWEPT_X, k], table[_SWEPT_Y, k], table[_COS, k], table[_SIN, k]
            front, rear, left, right = -np.inf, np.inf, -np.inf, np.inf
            for k in range(i, end):
                dx, dy = table[_SWEPT_X, k] - x, table[_SWEPT_Y, k] - y
                along, aside = cos * dx + sin * dy, cos * dy - sin * dx
                turned = abs(cos * table[_COS, k] + sin * table[_SIN, k])
                across = abs(cos * table[_SIN, k] - sin * table[_COS, k])
                length, width = table[_SWEPT_LENGTH, k], table[_WIDTH, k]
                room = 1.5 * (table[_SWEPT_RADIUS, k] + table[_SLACK, k])
                long, wide = length * turned + width * across, length * across + width * turned
                front, rear = max(front, along + long + room), min(rear, along - long - room)
                left, right = max(left, aside + wide + room), min(right, aside - wide - room)
            along, aside = (front + rear) / 2, (left + right) / 2
            blocks[0, i], blocks[1, i] = table[_ARRIVE, i], table[_DEPART, end - 1] + STEP
            blocks[2, i], blocks[3, i] = (
                x + cos * along - sin * aside,
                y + sin * along + cos * aside,
            )
            blocks[4, i], blocks[5, i] = cos, sin
            blocks[6, i], blocks[7, i] = (front - rear) / 2, (left - right) / 2
    return blocks


@compiled
def _may_touch(a: FloatArray, b: FloatArray, horizon: float) -> bool:
    """Whether the boxes of two blocks overlap, with a lag within the horizon [s]."""
    if max(a[0] - b[1], b[0] - a[1]) > horizon:
        return False
    one, two = (a[2], a[3], a[4], a[5]), (b[2], b[3], b[4], b[5])
    return is_in_touch(one, (a[6], a[7], 0.0), two, (b[6], b[7], 0.0), TOUCH)


@compiled
def _bound_lag(i: int, j: int, reach: FloatArray, table: FloatArray, horizon: float) -> float:
    """Lower bound of the lag of two places [s]; infinite where they do not touch in time."""
    dx, dy = table[_SWEPT_X, i] - table[_SWEPT_X, j], table[_SWEPT_Y, i] - table[_SWEPT_Y, j]
    room = reach[i] + reach[j]
    if dx * dx + dy * dy > room * room:
        return np.inf
    lag = max(table[_ARRIVE, i] - (table[_DEPART, j] + STEP),
              table[_ARRIVE, j] - (table[_DEPART, i] + STEP))  # fmt: skip
    if lag > horizon:
        return np.inf
    slack = table[_SLACK, i] + table[_SLACK, j]
    touch = is_in_touch(*_get_swept_footprint(table, i), *_get_swept_footprint(table, j), slack)
    return max(lag, 0.0) if touch else np.inf


@compiled
def _get_swept_footprint(table: FloatArray, i: int) -> tuple[Pose, Box]:
    """The footprint midway to the next place, lengthened by the way."""
    return (
        (table[_SWEPT_X, i], table[_SWEPT_Y, i], table[_COS, i], table[_SIN, i]),
        (table[_SWEPT_LENGTH, i], table[_WIDTH, i], table[_SWEPT_RADIUS, i]),
    )


@compiled_to_write
def _label_encounters(
    touching: list[tuple[float, int, int]], s: FloatArray, group: IntArray
) -> int:
    """Writes in which encounter every place of a pair's first is; returns how many there are."""
    low, high = len(s), -1
    for _lag, place, _other in touching:
        group[place] = 0
        low, high = min(low, place), max(high, place)
    count, last = 0, -1
    for place in range(low, high + 1):
        if group[place] >= 0:
            if last < 0 or s[place] - s[last] > SPLIT:
                count += 1
            group[place], last = count - 1, place
    return count


@compiled
def _find_least_lag(
    touching: list[tuple[float, int, int]], table: FloatArray
) -> tuple[float, float, float]:
    """Least lag of one encounter, to 4 ms, and when either is there [s]; inf where they never are.

    The most promising places are tried first, a few at a time, until no other can be better.
    """
    heapq.heapify(touching)
    best, i, j, tried = (np.inf, 0.0, 0.0, 0, 0), 0, 0, 0
    while len(touching) > 0 and (tried % BATCH > 0 or touching[0][0] < best[0]):
        _, p, q = heapq.heappop(touching)
        near = _compare_places(p, q, table, _PARTS, _PARTS)
        tried += 1
        if near[0] < best[0]:
            best, i, j = near, p, q
    if 0.0 < best[0] < np.inf:
        part, other_part = _PARTS[best[3]] + _AROUND, _PARTS[best[4]] + _AROUND
        finer = _compare_places(i, j, table, np.clip(part, 0.0, 1.0), np.clip(other_part, 0.0, 1.0))
        best = finer if finer[0] < best[0] else best
    return best[:3]


@compiled
def _compare_places(
    i: int, j: int, table: FloatArray, part: FloatArray, other_part: FloatArray
) -> tuple[float, float, float, int, int]:
    """Least lag of two places and the two times [s], inf where they do not touch.

    Args:
        part, other_part: parts of the way to the next place that are tried; those that give the
            least lag are returned by their positions.
    """
    least, time, other_time, first, second = np.inf, 0.0, 0.0, 0, 0
    for m in range(len(part)):
        place, begin, end = _compute_footprint_underway(table, i, part[m])
        for n in range(len(other_part)):
            other, other_begin, other_end = _compute_footprint_underway(table, j, other_part[n])
            lag = max(begin - other_end, other_begin - end, 0.0)
            if lag < least and is_in_touch(
                place, _get_size(table, i), other, _get_size(table, j), TOUCH
            ):
                least, first, second = lag, m, n
                time = min(max(other_begin, begin), end)
                other_time = min(max(begin, other_begin), other_end)
    return least, time, other_time, first, second


@compiled
def _get_size(table: FloatArray, i: int) -> Box:
    return table[_LENGTH, i], table[_WIDTH, i], table[_RADIUS, i]


@compiled
def _compute_footprint_underway(
    table: FloatArray, i: int, part: float
) -> tuple[Pose, float, float]:
    """The footprint a part of the way to the next place, and from when until when it is there."""
    x = table[_X, i] + part * (table[_NEXT_X, i] - table[_X, i])
    y = table[_Y, i] + part * (table[_NEXT_Y, i] - table[_Y, i])
    heading = table[_HEADING, i] + part * (table[_NEXT_HEADING, i] - table[_HEADING, i])
    end = table[_DEPART, i] + part * (table[_LEAVE, i] - table[_DEPART, i])
    begin = end if part > 0.0 else table[_ARRIVE, i]
    return (x, y, np.cos(heading), np.sin(heading)), begin, end
