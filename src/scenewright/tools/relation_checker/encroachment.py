"""Post-encroachment time of footprints, encounter by encounter (SEMANTICS section 4, *PET*).

The PET of a pair is the least |t_a - t_b| over all times at which footprint a(t_a) would touch
footprint b(t_b). The search works on *places*: runs of samples at which an agent stays within
2 cm. Blocks of places are discarded by circles, the rest tested place by place with footprints
lengthened by the way to the next place, and the pairs of places that can hold the least lag are
resolved to 0.01 s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.contact import TOUCH
from scenewright.tools.relation_checker.curve import project_each
from scenewright.tools.relation_checker.footprints import (
    BoolArray,
    Box,
    Place,
    angle_between,
    doubled,
    in_touch,
)
from scenewright.tools.relation_checker.motion import Mover, lane_table, strung
from scenewright.tools.relation_checker.paths import MERGE_LENGTH, SHARED

IntArray = np.ndarray[tuple[int, ...], np.dtype[np.intp]]

STILL = 0.02
BLOCK = 8
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


@dataclass(frozen=True, eq=False)
class _Places:
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


@dataclass(frozen=True, eq=False)
class _Cells:
    """Pairs of places that may touch, with a lower bound of their lag [s]."""

    p: IntArray
    q: IntArray
    lag: FloatArray

    def __getitem__(self, rows: IntArray | BoolArray) -> _Cells:
        return _Cells(self.p[rows], self.q[rows], self.lag[rows])


def post_encroachment_time(first: Mover, second: Mover) -> float | None:
    """PET of a pair [s], 0 where they are in contact; None where they never would be.

    Agents behind one another in one lane have headway, not PET: contacts on a stretch that both
    drive in one direction count only in its first 5 m, and not at all where they begin on it.
    """
    found = encounters((first, second), horizon=None, pedestrians=True)
    return min((e.pet for e in found), default=None)


def encounters(
    movers: tuple[Mover, ...], *, horizon: float | None = 8.5, pedestrians: bool = False
) -> tuple[Encounter, ...]:
    """All encounters with a lag of at most `horizon` seconds, pairs of pedestrians if asked for."""
    if len(movers) < 2:
        return ()
    places = _places(movers)
    cells = _without_lanes(places, movers, _touching(places, movers, horizon, pedestrians))
    found = _resolved(places, *_grouped(places, cells))
    return tuple(e for e in found if horizon is None or e.pet <= horizon)


def _places(movers: tuple[Mover, ...]) -> _Places:
    xy, heading, origin = strung(movers)
    times = np.concatenate([m.times for m in movers])
    s = np.concatenate([m.s for m in movers])
    sizes = np.array([(m.half_length, m.half_width, m.radius, m.reach) for m in movers])
    return _Places(*_all_places(xy, heading, times, s, origin, sizes))


def _touching(
    places: _Places, movers: tuple[Mover, ...], horizon: float | None, pedestrians: bool
) -> _Cells:
    """Pairs of places that may touch within the horizon, blocks of places looked at first."""
    first, second = np.nonzero(_box_pairs(movers, pedestrians))
    longest = np.inf if horizon is None else horizon
    return _Cells(*_met(first, second, places.origin, places.reach, places.table, longest))


def _box_pairs(movers: tuple[Mover, ...], pedestrians: bool) -> BoolArray:
    """[N, N] whether the boxes of two tracks overlap, above the diagonal."""
    west, south, east, north = np.array([m.bounds for m in movers]).T
    reach = np.array([m.reach for m in movers])
    result = np.ones((len(movers), len(movers)), dtype=np.bool_)
    for low, high in ((west - reach, east + reach), (south - reach, north + reach)):
        result &= (low[:, None] <= high) & (low <= high[:, None])
    if not pedestrians:
        vehicle = np.array([m.is_vehicle for m in movers])
        result &= vehicle | vehicle[:, None]
    return np.triu(result, 1)


def _without_lanes(places: _Places, movers: tuple[Mover, ...], cells: _Cells) -> _Cells:
    """Drops contacts of two of one class that are behind one another in one lane."""
    a, b = places.owner[cells.p], places.owner[cells.q]
    pair = a * len(movers) + b
    alike = np.array([m.is_vehicle for m in movers])
    cos, sin = places.table[_COS], places.table[_SIN]
    parallel = cos[cells.p] * cos[cells.q] + sin[cells.p] * sin[cells.q] >= np.cos(SHARED)
    keep = np.ones(len(pair), dtype=np.bool_)
    codes = np.flatnonzero(np.bincount(pair[parallel & (alike[a] == alike[b])]))
    first, second = np.divmod(codes, len(movers))
    for code, one, two in zip(codes, *_lane_parts(movers, first, second), strict=True):
        rows = np.flatnonzero(pair == code)
        if one is not None and two is not None:
            in_lane = one.beyond(places.s[cells.p[rows]]) | two.beyond(places.s[cells.q[rows]])
            keep[rows[in_lane]] = False
    return cells[keep]


@dataclass(frozen=True, eq=False)
class _LanePart:
    """Stretches of one path that are shared with another, as arc lengths [m] of its centre."""

    begin: FloatArray
    end: FloatArray

    def beyond(self, s: FloatArray) -> BoolArray:
        """Which positions lie in a shared stretch after its conflict zone."""
        inside = (s[:, None] >= self.begin) & (s[:, None] <= self.end)
        return np.asarray(inside.any(axis=1))


def _lane_parts(
    movers: tuple[Mover, ...], first: IntArray, second: IntArray
) -> tuple[list[_LanePart | None], list[_LanePart | None]]:
    """For pairs of movers, where the first is in the lane of the second, and the second in its."""
    if len(first) == 0:
        return [], []
    lanes = lane_table(movers)
    pairs = [*zip(first, second, strict=True), *zip(second, first, strict=True)]
    paths = [movers[i].path.coarser() for i, _ in pairs]
    size = [len(path.s) for path in paths]
    beside = np.array([(movers[i].width + movers[j].width) / 2 for i, j in pairs])
    foot = project_each(
        np.concatenate([path.xy for path in paths]), lanes,
        np.repeat([j for _, j in pairs], size), within=np.repeat(beside, size),
    )  # fmt: skip
    near = foot.lateral < np.repeat(beside, size)
    direction = np.concatenate([path.direction for path in paths])
    along = near & (angle_between(direction, foot.direction) <= SHARED)
    end = np.cumsum(size)
    parts = [
        _lane_part(movers[i], path.s, foot.s[k - n : k], near[k - n : k], along[k - n : k])
        for (i, _), path, n, k in zip(pairs, paths, size, end, strict=True)
    ]
    return parts[: len(first)], parts[len(first) :]


def _lane_part(
    mover: Mover, s: FloatArray, foot: FloatArray, near: BoolArray, along: BoolArray
) -> _LanePart | None:
    """Where the mover is in one lane with another, past the first 5 m of a merge."""
    if not along.any():
        return None
    edges = np.flatnonzero(np.diff(np.concatenate(([False], near, [False])).astype(np.int8)))
    runs = [(i, j - 1) for i, j in edges.reshape(-1, 2) if along[i:j].any()]
    stretches = [_beyond_merge(mover, s, foot, along, run) for run in runs]
    begin, end = np.array(stretches).T
    return _LanePart(begin, end)


def _beyond_merge(
    mover: Mover, s: FloatArray, foot: FloatArray, along: BoolArray, run: tuple[int, int]
) -> tuple[float, float]:
    i, j = run
    from_the_start = along[i] and (s[i] < 1.0 or foot[i] < 1.0)
    begin = -np.inf if from_the_start else s[i] + MERGE_LENGTH + mover.nose
    return float(begin), float(s[j] + mover.nose + 1.0)


def _grouped(places: _Places, cells: _Cells) -> tuple[_Cells, IntArray]:
    """Cells in the order of encounters, most promising first, and where each encounter begins.

    A pair's contacts are split into encounters at gaps along the first one's path.
    """
    if len(cells.p) == 0:
        return cells, np.zeros(1, dtype=np.intp)
    order = np.lexsort((cells.p, places.owner[cells.q], places.owner[cells.p]))
    p, q = cells.p[order], cells.q[order]
    new = (np.diff(places.owner[q]) != 0) | (np.diff(places.owner[p]) != 0)
    new |= np.diff(places.s[p]) > SPLIT
    group = np.concatenate(([0], np.cumsum(new)))
    by_lag = np.lexsort((cells.lag[order], group))
    begin = np.searchsorted(group, np.arange(group[-1] + 2))
    return cells[order[by_lag]], begin


def _resolved(places: _Places, cells: _Cells, begin: IntArray) -> list[Encounter]:
    """Exact least lag of every encounter: a few cells at a time, until none can be better."""
    count = len(begin) - 1
    best = np.full((count, 3), np.inf)
    place = np.full((count, 3), 0)
    done = np.zeros(count, dtype=np.intp)
    open_ = np.arange(count)
    while len(open_):
        rows = (begin[open_] + done[open_])[:, None] + np.arange(BATCH)
        inside = rows < begin[open_ + 1][:, None]
        group = np.broadcast_to(open_[:, None], rows.shape)[inside]
        lag, part = _exact_lags(places, cells[rows[inside]], *_WHOLE)
        order = np.lexsort((lag[:, 0], group))
        first = order[np.searchsorted(group[order], open_)]
        better = lag[first, 0] < best[open_, 0]
        best[open_[better]] = lag[first[better]]
        place[open_[better]] = np.column_stack((rows[inside], part))[first[better]]
        done[open_] += BATCH
        left = open_[begin[open_] + done[open_] < begin[open_ + 1]]
        open_ = left[cells.lag[begin[left] + done[left]] < best[left, 0]]
    best = _refined(places, cells, best, place)
    owner = places.owner
    return [
        Encounter(int(owner[cells.p[k]]), int(owner[cells.q[k]]), *(float(v) for v in row))
        for k, row in zip(begin[:-1], best, strict=True)
        if np.isfinite(row[0])
    ]


def _refined(places: _Places, cells: _Cells, best: FloatArray, place: IntArray) -> FloatArray:
    """The least lags to 4 ms, by trying the surroundings of the best pairs of parts."""
    found = np.isfinite(best[:, 0]) & (best[:, 0] > 0)
    if not found.any():
        return best
    step = 1.0 / (SUBSTEPS - 1)
    fine = np.linspace(-step, step, 2 * FINER + 1)
    parts = [np.clip(place[found, k, None] * step + fine, 0.0, 1.0) for k in (1, 2)]
    lag, _ = _exact_lags(places, cells[place[found, 0]], *parts)
    best[found] = np.where(lag[:, :1] < best[found, :1], lag, best[found])
    return best


def _exact_lags(
    places: _Places, cells: _Cells, part: FloatArray, other_part: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Least lag of pairs of places and the two times [n, 3] [s], inf where they do not touch.

    Args:
        part, other_part: [n or 1, k] parts of the way to the next place that are tried.

    Returns:
        The lags, and [n, 2] which of the parts give them.
    """
    return _lags(cells.p, cells.q, places.table, part, other_part)


# ---- as machine code, on the table of places ----------------------------------------------------

(
    _X, _Y, _HEADING, _NEXT_X, _NEXT_Y, _NEXT_HEADING, _ARRIVE, _DEPART, _LEAVE, _LENGTH, _WIDTH,
    _RADIUS, _SWEPT_X, _SWEPT_Y, _COS, _SIN, _SWEPT_LENGTH, _SWEPT_RADIUS, _SLACK,
) = range(19)  # fmt: skip


@compiled
def _all_places(
    xy: FloatArray,
    heading: FloatArray,
    times: FloatArray,
    s: FloatArray,
    origin: IntArray,
    sizes: FloatArray,
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """What `_Places` holds, of samples one after another and sizes [N, 4] (reach the last)."""
    first, owner, begin = _runs_of_rest(s, origin)
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
def _runs_of_rest(s: FloatArray, origin: IntArray) -> tuple[IntArray, IntArray, IntArray]:
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
def _met(
    first: IntArray,
    second: IntArray,
    origin: IntArray,
    reach: FloatArray,
    table: FloatArray,
    horizon: float,
) -> tuple[IntArray, IntArray, FloatArray]:
    """Pairs of places of pairs of movers that may touch, and a lower bound of their lag [s]."""
    blocks = _blocks(origin, reach, table)
    p: IntArray = np.empty(256, np.intp)
    q: IntArray = np.empty(256, np.intp)
    lags: FloatArray = np.empty(256)
    count = 0
    for pair in range(len(first)):
        a, b = first[pair], second[pair]
        for i in range(origin[a], origin[a + 1], BLOCK):
            for j in range(origin[b], origin[b + 1], BLOCK):
                if not _come_near(blocks[:, i], blocks[:, j], horizon):
                    continue
                for m in range(i, min(i + BLOCK, origin[a + 1])):
                    for n in range(j, min(j + BLOCK, origin[b + 1])):
                        lag = _lag_if_touching(m, n, reach, table, horizon)
                        if lag == np.inf:
                            continue
                        if count == len(p):
                            p, q, lags = doubled(p), doubled(q), doubled(lags)
                        p[count], q[count], lags[count] = m, n, lag
                        count += 1
    return p[:count], q[:count], lags[:count]


@compiled
def _blocks(origin: IntArray, reach: FloatArray, table: FloatArray) -> FloatArray:
    """[5, K] circle round the block that begins at a place, and from when until when it is there.

    Of the circle twice the middle's x and y and twice the radius [m].
    """
    blocks = np.empty((5, len(reach)))
    for owner in range(len(origin) - 1):
        for i in range(origin[owner], origin[owner + 1], BLOCK):
            end = min(i + BLOCK, origin[owner + 1])
            west = east = table[_SWEPT_X, i]
            south = north = table[_SWEPT_Y, i]
            widest = reach[i]
            for k in range(i + 1, end):
                west, east = min(west, table[_SWEPT_X, k]), max(east, table[_SWEPT_X, k])
                south, north = min(south, table[_SWEPT_Y, k]), max(north, table[_SWEPT_Y, k])
                widest = max(widest, reach[k])
            blocks[0, i], blocks[1, i] = west + east, south + north
            blocks[2, i] = np.hypot(east - west, north - south) + 2 * widest
            blocks[3, i], blocks[4, i] = table[_ARRIVE, i], table[_DEPART, end - 1] + STEP
    return blocks


@compiled
def _come_near(a: FloatArray, b: FloatArray, horizon: float) -> bool:
    """Whether the circles of two blocks overlap, with a lag within the horizon [s]."""
    dx, dy, room = a[0] - b[0], a[1] - b[1], a[2] + b[2]
    soon = max(a[3] - b[4], b[3] - a[4]) <= horizon
    return bool(soon and dx * dx + dy * dy <= room * room)


@compiled
def _lag_if_touching(i: int, j: int, reach: FloatArray, table: FloatArray, horizon: float) -> float:
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
    touch = in_touch(*_swept(table, i), *_swept(table, j), slack)
    return max(lag, 0.0) if touch else np.inf


@compiled
def _swept(table: FloatArray, i: int) -> tuple[Place, Box]:
    """The footprint midway to the next place, lengthened by the way."""
    return (
        (table[_SWEPT_X, i], table[_SWEPT_Y, i], table[_COS, i], table[_SIN, i]),
        (table[_SWEPT_LENGTH, i], table[_WIDTH, i], table[_SWEPT_RADIUS, i]),
    )


@compiled
def _lags(
    p: IntArray, q: IntArray, table: FloatArray, part: FloatArray, other_part: FloatArray
) -> tuple[FloatArray, IntArray]:
    """See `_exact_lags`."""
    best, where = np.empty((len(p), 3)), np.zeros((len(p), 2), np.intp)
    for k in range(len(p)):
        i, j = p[k], q[k]
        least = np.inf
        mine, others = part[min(k, len(part) - 1)], other_part[min(k, len(other_part) - 1)]
        for m in range(len(mine)):
            place, begin, end = _under_way(table, i, mine[m])
            for n in range(len(others)):
                other, other_begin, other_end = _under_way(table, j, others[n])
                lag = max(begin - other_end, other_begin - end, 0.0)
                first = m == 0 and n == 0
                hit = lag < least and in_touch(
                    place, _size(table, i), other, _size(table, j), TOUCH
                )
                if hit or first:
                    least = lag if hit else np.inf
                    where[k, 0], where[k, 1] = m, n
                    best[k, 0] = least
                    best[k, 1] = min(max(other_begin, begin), end)
                    best[k, 2] = min(max(begin, other_begin), other_end)
    return best, where


@compiled
def _size(table: FloatArray, i: int) -> Box:
    return table[_LENGTH, i], table[_WIDTH, i], table[_RADIUS, i]


@compiled
def _under_way(table: FloatArray, i: int, part: float) -> tuple[Place, float, float]:
    """The footprint a part of the way to the next place, and from when until when it is there."""
    x = table[_X, i] + part * (table[_NEXT_X, i] - table[_X, i])
    y = table[_Y, i] + part * (table[_NEXT_Y, i] - table[_Y, i])
    heading = table[_HEADING, i] + part * (table[_NEXT_HEADING, i] - table[_HEADING, i])
    end = table[_DEPART, i] + part * (table[_LEAVE, i] - table[_DEPART, i])
    begin = end if part > 0.0 else table[_ARRIVE, i]
    return (x, y, np.cos(heading), np.sin(heading)), begin, end
