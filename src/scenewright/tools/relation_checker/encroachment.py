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
from typing import Any

import numpy as np

from scenewright.compiled import compiled, compiled_to_write
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.conflict_zones import MERGE_LENGTH, SHARED
from scenewright.tools.relation_checker.contact import TOUCH
from scenewright.tools.relation_checker.footprints import (
    BoolArray,
    IntArray,
    Pose,
    interpolate_pose,
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


Places = np.ndarray[tuple[int], np.dtype[np.void]]
"""[K] places of all movers, one after another, see `_list_places`."""


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
    among = np.stack(np.triu_indices(len(tracks), 1), axis=1) if among is None else among
    first, second = among[_find_overlapping_boxes(tracks, asked, among)].T
    lanes = get_lane_table(tracks)
    found = _search_encounters(first, second, *_list_places(tracks), horizon, lanes)
    return tuple(Encounter(*row) for row in found if row[2] <= horizon)


def _list_places(tracks: tuple[Trajectory, ...]) -> tuple[Places, IntArray]:
    """All movers' places by named columns, and where each mover's begin [N+1].

    Columns: arc length `s`; position and heading at the first sample there, and at the first of the
    next place (`next_`; at the end of a track, of the last sample); the times of the first and the
    last sample there and of the next place; half length, half width and radius; midway to the next
    place the position and, lengthened by the way, half length, radius and the reach round both; and
    by how much the footprint may turn on the way (`slack`) [m].
    """
    xy, heading, origin = concatenate_samples(tracks)
    times, s = (np.concatenate([getattr(m, name) for m in tracks]) for name in ("times", "s"))
    stretch = np.floor(s / STILL)
    begins = np.append(True, stretch[1:] > stretch[:-1])
    begins[origin[:-1]] = True
    first = np.flatnonzero(begins)
    last, owner = np.append(first[1:], len(s)) - 1, np.searchsorted(origin, first, "right") - 1
    after = np.minimum(last + 1, origin[owner + 1] - 1)
    length, width, radius, reach = np.array([(*m.box, m.reach) for m in tracks])[owner].T
    (x, y), (next_x, next_y) = xy[first].T, xy[after].T
    half_way = np.hypot(next_x - x, next_y - y) / 2
    columns = {
        "s": s[first], "x": x, "y": y, "heading": heading[first],
        "next_x": next_x, "next_y": next_y, "next_heading": heading[after],
        "arrive": times[first], "depart": times[last], "leave": times[after],
        "length": length, "width": width, "radius": radius,
        "cos": np.cos(heading[first]), "sin": np.sin(heading[first]),
        "mid_x": (x + next_x) / 2, "mid_y": (y + next_y) / 2,
        "swept_length": np.where(radius > 0.0, 0.0, length + half_way),
        "swept_radius": np.where(radius > 0.0, radius + half_way, 0.0), "reach": reach + half_way,
        "slack": reach * np.abs(heading[after] - heading[first]) + TOUCH,
    }  # fmt: skip
    places = np.empty(len(first), [(name, np.float64) for name in columns])
    for name, values in columns.items():
        places[name] = values
    return places, np.searchsorted(first, origin)


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


# ---- as machine code, on the places -------------------------------------------------------------


@compiled
def _search_encounters(
    first: IntArray,
    second: IntArray,
    places: Places,
    origin: IntArray,
    horizon: float,
    lanes: LaneTable,
) -> list[tuple[int, int, float, float, float]]:
    """What `Encounter` holds, of pairs of movers; they part at gaps along the first one's path."""
    large, blocks = _bound_blocks(origin, places, LARGE), _bound_blocks(origin, places, BLOCK)
    shared, group = np.zeros(len(places), np.bool_), np.full(len(places), -1)
    found = [(0, 0, 0.0, 0.0, 0.0) for _ in range(0)]
    for pair in range(len(first)):
        a, b = first[pair], second[pair]
        near = _list_blocks(a, b, origin, large, blocks, horizon)
        touching = _list_touching_places(a, b, near, places, origin, horizon, lanes, shared)
        for k in range(_label_encounters(touching, places, group)):
            least, time, other_time = _find_least_lag(
                [each for each in touching if group[each[1]] == k], places
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
    places: Places,
    origin: IntArray,
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
    found, aligned = [(0.0, 0, 0) for _ in range(0)], np.cos(SHARED)
    open_yet = lanes.is_vehicle[a] == lanes.is_vehicle[b]
    for i, j in blocks:
        for m in range(i, min(i + BLOCK, origin[a + 1])):
            for n in range(j, min(j + BLOCK, origin[b + 1])):
                if shared[m] or shared[n]:
                    continue
                here, there = places[m], places[n]
                lag = _bound_lag(here, there, horizon)
                if lag == np.inf:
                    continue
                found.append((lag, m, n))
                facing = here.cos * there.cos + here.sin * there.sin
                if open_yet and facing >= aligned:
                    open_yet = False
                    _mark_shared_lanes(a, b, places, origin, lanes, shared)
                    found = [each for each in found if not (shared[each[1]] or shared[each[2]])]
    shared[origin[a] : origin[a + 1]] = False
    shared[origin[b] : origin[b + 1]] = False
    return found


@compiled_to_write
def _mark_shared_lanes(
    a: int, b: int, places: Places, origin: IntArray, lanes: LaneTable, shared: BoolArray
) -> None:
    """Writes which places of two movers are in a stretch that either shares with the other."""
    ones, twos = _find_stretches(a, b, lanes), _find_stretches(b, a, lanes)
    if len(ones) == 0 or len(twos) == 0:
        return
    for mover, stretches in ((a, ones), (b, twos)):
        for k in range(origin[mover], origin[mover + 1]):
            s = places[k].s
            shared[k] = ((stretches[:, 0] <= s) & (s <= stretches[:, 1])).any()


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
def _bound_blocks(origin: IntArray, places: Places, size: int) -> FloatArray:
    """[8, K] what bounds the block that begins at a place.

    From when until when it is there [s]; and a box: x and y of its middle, cosine and sine of its
    heading, half its length and width [m], with all that `is_in_touch` allows for at the corners.
    """
    blocks = np.empty((8, len(places)))
    for owner in range(len(origin) - 1):
        for i in range(origin[owner], origin[owner + 1], size):
            end = min(i + size, origin[owner + 1])
            middle = places[(i + end) // 2]
            x, y, cos, sin = middle.mid_x, middle.mid_y, middle.cos, middle.sin
            front, rear, left, right = -np.inf, np.inf, -np.inf, np.inf
            for k in range(i, end):
                place = places[k]
                dx, dy = place.mid_x - x, place.mid_y - y
                along, aside = cos * dx + sin * dy, cos * dy - sin * dx
                turned = abs(cos * place.cos + sin * place.sin)
                across = abs(cos * place.sin - sin * place.cos)
                length, width = place.swept_length, place.width
                room = 1.5 * (place.swept_radius + place.slack)
                long, wide = length * turned + width * across, length * across + width * turned
                front, rear = max(front, along + long + room), min(rear, along - long - room)
                left, right = max(left, aside + wide + room), min(right, aside - wide - room)
            along, aside = (front + rear) / 2, (left + right) / 2
            blocks[0, i], blocks[1, i] = places[i].arrive, places[end - 1].depart + STEP
            blocks[2, i] = x + cos * along - sin * aside
            blocks[3, i] = y + sin * along + cos * aside
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
def _bound_lag(one: Any, two: Any, horizon: float) -> float:
    """Lower bound of the lag of two places [s]; infinite where they do not touch in time."""
    dx, dy, room = one.mid_x - two.mid_x, one.mid_y - two.mid_y, one.reach + two.reach
    if dx * dx + dy * dy > room * room:
        return np.inf
    lag = max(one.arrive - (two.depart + STEP), two.arrive - (one.depart + STEP))
    if lag > horizon:
        return np.inf
    # The footprints midway to the next places, lengthened by the way.
    pose = (one.mid_x, one.mid_y, one.cos, one.sin)
    other_pose = (two.mid_x, two.mid_y, two.cos, two.sin)
    size = (one.swept_length, one.width, one.swept_radius)
    other_size = (two.swept_length, two.width, two.swept_radius)
    touch = is_in_touch(pose, size, other_pose, other_size, one.slack + two.slack)
    return max(lag, 0.0) if touch else np.inf


@compiled_to_write
def _label_encounters(
    touching: list[tuple[float, int, int]], places: Places, group: IntArray
) -> int:
    """Writes in which encounter every place of a pair's first is; returns how many there are."""
    low, high = len(places), -1
    for _lag, place, _other in touching:
        group[place] = 0
        low, high = min(low, place), max(high, place)
    count, last = 0, -1
    for place in range(low, high + 1):
        if group[place] >= 0:
            if last < 0 or places[place].s - places[last].s > SPLIT:
                count += 1
            group[place], last = count - 1, place
    return count


@compiled
def _find_least_lag(
    touching: list[tuple[float, int, int]], places: Places
) -> tuple[float, float, float]:
    """Least lag of one encounter, to 4 ms, and when either is there [s]; inf where they never are.

    The most promising places are tried first, a few at a time, until no other can be better.
    """
    heapq.heapify(touching)
    best, i, j, tried = (np.inf, 0.0, 0.0, 0, 0), 0, 0, 0
    while len(touching) > 0 and (tried % BATCH > 0 or touching[0][0] < best[0]):
        _, p, q = heapq.heappop(touching)
        near = _compare_places(places[p], places[q], _PARTS, _PARTS)
        tried += 1
        if near[0] < best[0]:
            best, i, j = near, p, q
    if 0.0 < best[0] < np.inf:
        part, other_part = _PARTS[best[3]] + _AROUND, _PARTS[best[4]] + _AROUND
        finer = _compare_places(
            places[i], places[j], np.clip(part, 0.0, 1.0), np.clip(other_part, 0.0, 1.0)
        )
        best = finer if finer[0] < best[0] else best
    return best[:3]


@compiled
def _compare_places(
    one: Any, two: Any, part: FloatArray, other_part: FloatArray
) -> tuple[float, float, float, int, int]:
    """Least lag of two places and the two times [s], inf where they do not touch.

    Args:
        part, other_part: parts of the way to the next place that are tried; those that give the
            least lag are returned by their positions.
    """
    least, time, other_time, first, second = np.inf, 0.0, 0.0, 0, 0
    size, other_size = (one.length, one.width, one.radius), (two.length, two.width, two.radius)
    for m in range(len(part)):
        pose, begin, end = _compute_footprint_underway(one, part[m])
        for n in range(len(other_part)):
            other_pose, other_begin, other_end = _compute_footprint_underway(two, other_part[n])
            lag = max(begin - other_end, other_begin - end, 0.0)
            if lag < least and is_in_touch(pose, size, other_pose, other_size, TOUCH):
                least, first, second = lag, m, n
                time = min(max(other_begin, begin), end)
                other_time = min(max(begin, other_begin), other_end)
    return least, time, other_time, first, second


@compiled
def _compute_footprint_underway(place: Any, part: float) -> tuple[Pose, float, float]:
    """The footprint a part of the way to the next place, and from when until when it is there."""
    here = place.x, place.y, place.heading
    pose = interpolate_pose(part, (here, (place.next_x, place.next_y, place.next_heading)))
    end = place.depart + part * (place.leave - place.depart)
    return pose, end if part > 0.0 else place.arrive, end
