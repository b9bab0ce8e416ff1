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

from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.contact import TOUCH
from scenewright.tools.relation_checker.curve import project
from scenewright.tools.relation_checker.footprints import (
    BoolArray,
    Extent,
    Pose,
    angle_between,
    pose,
    touch,
)
from scenewright.tools.relation_checker.motion import Mover
from scenewright.tools.relation_checker.paths import MERGE_LENGTH, SHARED

IntArray = np.ndarray[tuple[int, ...], np.dtype[np.intp]]

STILL = 0.02
BLOCK = 8
SUBSTEPS = 5
FINER = 3
BATCH = 4
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
        owner: [K] mover; xy, heading: at the place; next_xy, next_heading: one sample after it.
        arrive, depart: [K] first and last sample time there [s]; s: [K] arc length [m].
        size: footprints; swept: footprints lengthened by the way to the next place.
        origin: [N+1] where each mover's places begin.
    """

    owner: IntArray
    xy: FloatArray
    heading: FloatArray
    next_xy: FloatArray
    next_heading: FloatArray
    arrive: FloatArray
    depart: FloatArray
    s: FloatArray
    size: Extent
    swept: Extent
    slack: FloatArray
    reach: FloatArray
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
    near = _candidates(places, movers, horizon, pedestrians)
    cells = _without_lanes(places, movers, _touching(places, *near, horizon=horizon))
    found = _resolved(places, *_grouped(places, cells))
    return tuple(e for e in found if horizon is None or e.pet <= horizon)


def _places(movers: tuple[Mover, ...]) -> _Places:
    parts, origin = [], [0]
    for n, mover in enumerate(movers):
        key = np.floor(mover.s / STILL)
        first = np.flatnonzero(np.concatenate(([True], np.diff(key) > 0)))
        last = np.append(first[1:], len(mover)) - 1
        after = np.minimum(last + 1, len(mover) - 1)
        parts.append((
            np.full(len(first), n), mover.xy[first], mover.heading[first], mover.xy[after],
            mover.heading[after], mover.times[first], mover.times[last], mover.s[first],
        ))  # fmt: skip
        origin.append(origin[-1] + len(first))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    owner, xy, heading, next_xy, next_heading, arrive, depart, s = columns
    stride = np.hypot(*(next_xy - xy).T) / 2
    table = np.array([(m.half_length, m.half_width, m.radius) for m in movers])
    length, width, radius = table[owner].T
    disc = radius > 0
    reach = np.array([m.reach for m in movers])[owner]
    return _Places(
        owner, xy, heading, next_xy, next_heading, arrive, depart, s,
        size=Extent(length, width, radius),
        swept=Extent(
            np.where(disc, 0.0, length + stride), width, np.where(disc, radius + stride, 0.0)
        ),
        slack=reach * np.abs(next_heading - heading) + TOUCH,
        reach=reach + stride, origin=np.array(origin),
    )  # fmt: skip


def _candidates(
    places: _Places, movers: tuple[Mover, ...], horizon: float | None, pedestrians: bool
) -> tuple[IntArray, IntArray]:
    """Pairs of places whose circles overlap; blocks of places first, within the horizon."""
    begin = np.concatenate(
        [np.arange(a, b, BLOCK) for a, b in zip(places.origin, places.origin[1:], strict=False)]
    )
    end = np.minimum(begin + BLOCK, places.origin[places.owner[begin] + 1])
    middle = (places.xy + places.next_xy) / 2
    low, high = (f.reduceat(middle, begin, axis=0) for f in (np.minimum, np.maximum))
    radius = np.hypot(*((high - low) / 2).T) + np.maximum.reduceat(places.reach, begin)
    i, j = _block_pairs(places, movers, begin, pedestrians)
    away = (low + high)[i] - (low + high)[j]
    near = np.square(away[:, 0]) + np.square(away[:, 1]) <= np.square(2 * (radius[i] + radius[j]))
    i, j = i[near], j[near]
    if horizon is not None:
        arrive, depart = places.arrive[begin], places.depart[end - 1] + STEP
        soon = np.maximum(arrive[i] - depart[j], arrive[j] - depart[i]) <= horizon
        i, j = i[soon], j[soon]
    return _expanded(places, middle, begin, end, np.stack((i, j)))


def _block_pairs(
    places: _Places, movers: tuple[Mover, ...], begin: IntArray, pedestrians: bool
) -> tuple[IntArray, IntArray]:
    """Pairs of blocks of two movers whose tracks' boxes overlap, the earlier mover first."""
    blocks = np.searchsorted(places.owner[begin], np.arange(len(movers) + 1))
    boxes = [(*(m.xy.min(axis=0) - m.reach), *(m.xy.max(axis=0) + m.reach)) for m in movers]
    first, second = [], []
    for a in range(len(movers)):
        for b in range(a + 1, len(movers)):
            walking = not (pedestrians or movers[a].is_vehicle or movers[b].is_vehicle)
            if walking or _disjoint(boxes[a], boxes[b]):
                continue
            first.append(np.repeat(np.arange(blocks[a], blocks[a + 1]), blocks[b + 1] - blocks[b]))
            second.append(np.tile(np.arange(blocks[b], blocks[b + 1]), blocks[a + 1] - blocks[a]))
    if not first:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    return np.concatenate(first), np.concatenate(second)


def _disjoint(one: tuple[float, ...], two: tuple[float, ...]) -> bool:
    return one[0] > two[2] or two[0] > one[2] or one[1] > two[3] or two[1] > one[3]


def _expanded(
    places: _Places, middle: FloatArray, begin: IntArray, end: IntArray, pairs: IntArray
) -> tuple[IntArray, IntArray]:
    """Pairs of places of pairs of blocks [2, n] whose own circles overlap."""
    member = begin[:, None] + np.arange(BLOCK)
    k = np.minimum(member, len(middle) - 1)
    x, y, reach = middle[k, 0], middle[k, 1], places.reach[k]
    x[member >= end[:, None]] = np.nan
    i, j = pairs
    away = np.square(x[i][:, :, None] - x[j][:, None, :])
    away += np.square(y[i][:, :, None] - y[j][:, None, :])
    row, one, two = np.nonzero(away <= np.square(reach[i][:, :, None] + reach[j][:, None, :]))
    return member[i[row], one], member[j[row], two]


def _touching(places: _Places, p: IntArray, q: IntArray, *, horizon: float | None = None) -> _Cells:
    leaving = places.depart + STEP
    lag = np.maximum(places.arrive[p] - leaving[q], places.arrive[q] - leaving[p])
    if horizon is not None:
        soon = lag <= horizon
        p, q, lag = p[soon], q[soon], lag[soon]
    middle = np.ascontiguousarray(((places.xy + places.next_xy) / 2).T)
    lengthened = pose(middle.T, places.heading, places.swept)
    beside = _beside(places, lengthened, p, q)
    p, q, lag = p[beside], q[beside], lag[beside]
    slack = places.slack[p] + places.slack[q]
    near = touch(lengthened.rows(p), lengthened.rows(q), tolerance=slack)
    return _Cells(p[near], q[near], np.maximum(lag[near], 0.0))


def _beside(places: _Places, at: Pose, p: IntArray, q: IntArray) -> BoolArray:
    """Cheap and necessary: q reaches the strip that p drives in."""
    sin, cos = at.sin[p], at.cos[p]
    across = np.abs(cos * (at.y[q] - at.y[p]) - sin * (at.x[q] - at.x[p]))
    strip = np.asarray(at.size.width) + at.size.radius + places.slack
    turned = np.abs(cos * at.sin[q] - sin * at.cos[q])
    length = np.asarray(at.size.length)
    return np.asarray(across <= strip[p] + strip[q] + turned * length[q])


def _without_lanes(places: _Places, movers: tuple[Mover, ...], cells: _Cells) -> _Cells:
    """Drops contacts of two of one class that are behind one another in one lane."""
    a, b = places.owner[cells.p], places.owner[cells.q]
    pair = a * len(movers) + b
    alike = np.array([m.is_vehicle for m in movers])
    parallel = angle_between(places.heading[cells.p], places.heading[cells.q]) <= SHARED
    keep = np.ones(len(pair), dtype=np.bool_)
    for code in np.unique(pair[parallel & (alike[a] == alike[b])]):
        i, j = divmod(int(code), len(movers))
        rows = np.flatnonzero(pair == code)
        one, two = _lane_part(movers[i], movers[j]), _lane_part(movers[j], movers[i])
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


def _lane_part(mover: Mover, other: Mover) -> _LanePart | None:
    """Where the mover is in one lane with the other, past the first 5 m of a merge."""
    path = mover.path.coarser()
    foot = project(path.xy, other.lane)
    near = foot.lateral < (mover.width + other.width) / 2
    along = near & (angle_between(path.direction, foot.direction) <= SHARED)
    if not along.any():
        return None
    edges = np.flatnonzero(np.diff(np.concatenate(([False], near, [False])).astype(np.int8)))
    runs = [(i, j - 1) for i, j in edges.reshape(-1, 2) if along[i:j].any()]
    stretches = [_beyond_merge(mover, path.s, foot.s, along, run) for run in runs]
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
        lag, part = _exact_lags(places, cells[rows[inside]], *_whole(int(inside.sum())))
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


def _whole(count: int) -> tuple[FloatArray, FloatArray]:
    """Parts of the way to the next place that are tried first, for either agent."""
    part = np.broadcast_to(np.linspace(0.0, 1.0, SUBSTEPS), (count, SUBSTEPS))
    return part, part


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
        part, other_part: [n, k] parts of the way to the next place that are tried.

    Returns:
        The lags, and [n, 2] which of the parts give them.
    """
    shape = (len(cells.p), part.shape[1], other_part.shape[1])
    one = _on_the_way(places, cells.p, part, axis=2)
    two = _on_the_way(places, cells.q, other_part, axis=1)
    hit = touch(one.pose, two.pose, tolerance=TOUCH)
    lag = np.maximum(np.maximum(one.begin - two.end, two.begin - one.end), 0.0)
    flat = np.where(hit, lag, np.inf).reshape(len(cells.p), -1)
    k = np.argmin(flat, axis=1)
    row = np.arange(len(k))
    a0, a1, b0, b1 = (
        np.broadcast_to(t, shape).reshape(len(k), -1)[row, k]
        for t in (one.begin, one.end, two.begin, two.end)
    )
    times = np.clip(b0, a0, a1), np.clip(a0, b0, b1)
    return np.stack((flat[row, k], *times), axis=1), np.stack(np.divmod(k, shape[2]), axis=1)


@dataclass(frozen=True, eq=False)
class _Way:
    """Footprints between places: standing there (begin to end), then moving on."""

    pose: Pose
    begin: FloatArray
    end: FloatArray


def _on_the_way(places: _Places, k: IntArray, part: FloatArray, *, axis: int) -> _Way:
    xy, way = places.xy[k][:, None], (places.next_xy - places.xy)[k][:, None]
    turn = (places.next_heading - places.heading)[k][:, None]
    end = places.depart[k][:, None] + part * STEP
    begin = np.where(part > 0, end, places.arrive[k][:, None])
    return _Way(
        pose(
            np.expand_dims(xy + part[..., None] * way, axis),
            np.expand_dims(places.heading[k][:, None] + part * turn, axis),
            places.size.rows(k[:, None, None]),
        ),
        np.expand_dims(begin, axis), np.expand_dims(end, axis),
    )  # fmt: skip
