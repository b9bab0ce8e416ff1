"""Post-encroachment time of footprints, encounter by encounter (SEMANTICS section 4, *PET*).

The PET of a pair is the least |t_a - t_b| over all times at which footprint a(t_a) would touch
footprint b(t_b). The search works on *places*: runs of samples at which an agent stays within
2 cm. Blocks of places are discarded by boxes round them, the rest tested place by place with
footprints lengthened by the way to the next place, and the pairs of places that can hold the least
lag are resolved to 0.01 s.
"""

from __future__ import annotations

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
    double_room,
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
SUBSTEPS = 5
FINER = 3
BATCH = 8
_WHOLE = (np.linspace(0.0, 1.0, SUBSTEPS)[None],) * 2
"""Parts of the way to the next place that are tried first, for either agent."""
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


class _OccupancyPairs(NamedTuple):
    """Pairs of places that may touch, one pair of movers after another.

    Attributes:
        p, q: [C] the places; lag: [C] a lower bound of their lag [s].
        begin: [M+1] where those of each pair of movers begin.
    """

    p: IntArray
    q: IntArray
    lag: FloatArray
    begin: IntArray


def compute_pet(first: Trajectory, second: Trajectory) -> float | None:
    """PET of a pair [s], 0 where they are in contact; None where they never would be.

    Agents behind one another in one lane have headway, not PET: contacts on a stretch that both
    drive in one direction count only in its first 5 m, and not at all where they begin on it.
    """
    found = find_encounters((first, second), horizon=None, asked={(first.id, second.id)})
    return min((e.pet for e in found), default=None)


def find_encounters(
    tracks: tuple[Trajectory, ...],
    *,
    horizon: float | None = 8.5,
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
    movers = np.array([(m.is_vehicle, m.width, m.nose) for m in tracks])
    pairs = _OccupancyPairs(*_find_touching_pairs(
        first, second, occupancies, np.inf if horizon is None else horizon, movers,
        get_lane_table(tracks),
    ))  # fmt: skip
    # Exact least lag of every encounter, to 4 ms; encounters of a pair part at gaps along the
    # first one's path.
    table = occupancies.table
    best = _find_best_places(pairs, occupancies, *_WHOLE)
    p, q = pairs.p[best], pairs.q[best]
    lag, place = _find_least_lags(p, q, table, *_WHOLE)
    apart = lag[:, 0] > 0
    # The surroundings of the best pairs of parts are tried.
    step = 1.0 / (SUBSTEPS - 1)
    around = np.linspace(-step, step, 2 * FINER + 1)
    parts = [np.clip(place[apart, k, None] * step + around, 0.0, 1.0) for k in (0, 1)]
    finer, _ = _find_least_lags(p[apart], q[apart], table, *parts)
    lag[apart] = np.where(finer[:, :1] < lag[apart, :1], finer, lag[apart])
    owners = zip(occupancies.owner[p].tolist(), occupancies.owner[q].tolist(), strict=True)
    found = (Encounter(*pair, *row) for pair, row in zip(owners, lag.tolist(), strict=True))
    return tuple(e for e in found if horizon is None or e.pet <= horizon)


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
def _find_touching_pairs(
    first: IntArray,
    second: IntArray,
    places: _Occupancies,
    horizon: float,
    movers: FloatArray,
    lanes: LaneTable,
) -> tuple[IntArray, IntArray, FloatArray, IntArray]:
    """What `_OccupancyPairs` holds, of pairs of movers; blocks of places are looked at first.

    Two of one class that touch heading the same way may be behind one another in one lane; their
    contacts there do not count.

    Args:
        movers: [N, 3] whether each is a vehicle, its width and nose [m].
    """
    origin, reach, table = places.origin, places.reach, places.table
    large = _bound_blocks(origin, table, LARGE)
    blocks = _bound_blocks(origin, table, BLOCK)
    p: IntArray = np.empty(256, np.intp)
    q: IntArray = np.empty(256, np.intp)
    lags: FloatArray = np.empty(256)
    count = 0
    begin, shared = np.zeros(len(first) + 1, np.intp), np.zeros(len(reach), np.bool_)
    aligned = np.cos(SHARED)
    for pair in range(len(first)):
        a, b = first[pair], second[pair]
        open_yet = movers[a, 0] == movers[b, 0]
        for i, j in _list_blocks(a, b, origin, large, blocks, horizon):
            for m in range(i, min(i + BLOCK, origin[a + 1])):
                for n in range(j, min(j + BLOCK, origin[b + 1])):
                    if shared[m] or shared[n]:
                        continue
                    lag = _bound_lag(m, n, reach, table, horizon)
                    if lag == np.inf:
                        continue
                    if count == len(p):
                        p, q, lags = double_room(p), double_room(q), double_room(lags)
                    p[count], q[count], lags[count] = m, n, lag
                    count += 1
                    facing = table[_COS, m] * table[_COS, n] + table[_SIN, m] * table[_SIN, n]
                    if open_yet and facing >= aligned:
                        open_yet = False
                        _mark_shared_lanes(a, b, places, movers, lanes, shared)
                        size, count = count, begin[pair]
                        for row in range(begin[pair], size):
                            if not (shared[p[row]] or shared[q[row]]):
                                p[count], q[count], lags[count] = p[row], q[row], lags[row]
                                count += 1
        begin[pair + 1] = count
        shared[origin[a] : origin[a + 1]] = False
        shared[origin[b] : origin[b + 1]] = False
    return p[:count], q[:count], lags[:count], begin


@compiled_to_write
def _mark_shared_lanes(
    a: int, b: int, places: _Occupancies, movers: FloatArray, lanes: LaneTable, shared: BoolArray
) -> None:
    """Writes which places of two movers are in a stretch that either shares with the other."""
    ones, twos = _find_stretches(a, b, movers, lanes), _find_stretches(b, a, movers, lanes)
    if len(ones) == 0 or len(twos) == 0:
        return
    for mover, stretches in ((a, ones), (b, twos)):
        for k in range(places.origin[mover], places.origin[mover + 1]):
            here = places.s[k]
            shared[k] = ((stretches[:, 0] <= here) & (here <= stretches[:, 1])).any()


@compiled
def _find_stretches(a: int, b: int, movers: FloatArray, lanes: LaneTable) -> FloatArray:
    """[R, 2] where a mover is in one lane with another, past the first 5 m of a merge [m].

    Of runs of points of its path that are near the other's lane, of which any is along it.
    """
    first, end = LANE_BEFORE // 2, lanes.size[a] - LANE_AFTER // 2
    beside, nose = (movers[a, 1] + movers[b, 1]) / 2, movers[a, 2]
    found, count = np.zeros((end - first, 2)), 0
    start, shares, from_start = -1, False, False
    for k in range(first, end):
        s, way = lanes.s[a, k], lanes.direction[a, k]
        foot, lateral, facing = project_on_lane(lanes.x[a, k], lanes.y[a, k], lanes, b, beside)
        if lateral < beside:
            along = abs((way - facing + np.pi) % (2 * np.pi) - np.pi) <= SHARED
            if start < 0:
                start, from_start = k, along and min(s, foot) < 1.0
            shares = shares or along
        ends = lateral >= beside or k + 1 == end
        if ends and start >= 0:
            last = k - 1 if lateral >= beside else k
            if shares:
                before = lanes.s[a, start] + MERGE_LENGTH + nose
                found[count, 0] = -np.inf if from_start else before
                found[count, 1] = lanes.s[a, last] + nose + 1.0
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


@compiled
def _find_best_places(
    pairs: _OccupancyPairs, places: _Occupancies, part: FloatArray, other_part: FloatArray
) -> IntArray:
    """[E] of every encounter the pair of places with the least lag.

    The most promising are tried first, a few at a time, until no other can be better.
    """
    found: IntArray = np.empty(64, np.intp)
    p, q, lag, begin = pairs
    s, table = places.s, places.table
    count = longest = 0
    for pair in range(len(begin) - 1):
        longest = max(longest, begin[pair + 1] - begin[pair])
    group, heap = np.full(len(s), -1), np.empty(longest, np.intp)
    for pair in range(len(begin) - 1):
        rows = begin[pair], begin[pair + 1]
        for k in range(_label_encounters(p, s, rows, group)):
            size = _fill_heap(heap, pairs, rows, group, k)
            least, best, tried = np.inf, -1, 0
            while size > 0 and (tried % BATCH > 0 or lag[heap[0]] < least):
                row, tried = heap[0], tried + 1
                near = _find_least_lag(p[row], q[row], table, part[0], other_part[0])[0]
                if near < least:
                    least, best = near, row
                size -= 1
                heap[0] = heap[size]
                _sift_down(heap, 0, size, pairs)
            if best >= 0:
                if count == len(found):
                    found = double_room(found)
                found[count] = best
                count += 1
        for row in range(rows[0], rows[1]):
            group[p[row]] = -1
    return found[:count]


@compiled_to_write
def _label_encounters(p: IntArray, s: FloatArray, rows: tuple[int, int], group: IntArray) -> int:
    """Writes in which encounter every place of a pair's first is; returns how many there are."""
    low, high = len(s), -1
    for row in range(rows[0], rows[1]):
        group[p[row]] = 0
        low, high = min(low, p[row]), max(high, p[row])
    count, last = 0, -1
    for place in range(low, high + 1):
        if group[place] >= 0:
            if last < 0 or s[place] - s[last] > SPLIT:
                count += 1
            group[place], last = count - 1, place
    return count


@compiled_to_write
def _fill_heap(
    heap: IntArray, pairs: _OccupancyPairs, rows: tuple[int, int], group: IntArray, wanted: int
) -> int:
    """Writes a heap of the rows of one encounter, least lag on top; returns how many there are."""
    p, size = pairs.p, 0
    for row in range(rows[0], rows[1]):
        if group[p[row]] == wanted:
            heap[size] = row
            size += 1
    for k in range(size // 2 - 1, -1, -1):
        _sift_down(heap, k, size, pairs)
    return size


@compiled_to_write
def _sift_down(heap: IntArray, k: int, size: int, pairs: _OccupancyPairs) -> None:
    while 2 * k + 1 < size:
        child = 2 * k + 1
        if child + 1 < size and _comes_before(heap[child + 1], heap[child], pairs):
            child += 1
        if not _comes_before(heap[child], heap[k], pairs):
            break
        heap[k], heap[child] = heap[child], heap[k]
        k = child


@compiled
def _comes_before(row: int, other: int, pairs: _OccupancyPairs) -> bool:
    """Whether a pair of places is to be tried before another: by lag, then in order of places."""
    p, q, lag = pairs.p, pairs.q, pairs.lag
    if lag[row] != lag[other]:
        return bool(lag[row] < lag[other])
    return bool(p[row] < p[other] or (p[row] == p[other] and q[row] < q[other]))


@compiled
def _find_least_lags(
    p: IntArray, q: IntArray, table: FloatArray, part: FloatArray, other_part: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Least lag of pairs of places and the two times [n, 3] [s], inf where they do not touch.

    Args:
        part, other_part: [n or 1, k] parts of the way to the next place that are tried.

    Returns:
        The lags, and [n, 2] which of the parts give them.
    """
    best, where = np.empty((len(p), 3)), np.zeros((len(p), 2), np.intp)
    for k in range(len(p)):
        mine, others = part[min(k, len(part) - 1)], other_part[min(k, len(other_part) - 1)]
        lag, time, other_time, m, n = _find_least_lag(p[k], q[k], table, mine, others)
        best[k, 0], best[k, 1], best[k, 2] = lag, time, other_time
        where[k, 0], where[k, 1] = m, n
    return best, where


@compiled
def _find_least_lag(
    i: int, j: int, table: FloatArray, part: FloatArray, other_part: FloatArray
) -> tuple[float, float, float, int, int]:
    """`_find_least_lags` of one pair of places."""
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
