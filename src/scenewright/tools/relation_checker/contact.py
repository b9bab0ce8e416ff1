"""Clearance over time and the first contact of two footprints, in continuous time."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.footprints import (
    BoolArray,
    IntArray,
    compute_corners,
    compute_gap,
    compute_gaps,
    get_box,
    get_step,
    interpolate_pose,
    make_pose,
)
from scenewright.tools.relation_checker.planar import Area, geos
from scenewright.tools.relation_checker.trajectory import Trajectory, concatenate_samples

EXACT_BELOW = 1.2
"""Clearances below this are exact [m], others lower bounds."""
TOUCH = 1e-3
"""Footprints nearer than this are in contact [m]: the rounding of positions in scene files."""
IMPACT = 1.5
"""A velocity that changes by more within 0.1 s [m/s] was changed by an impact, not by driving."""
NEAR_IN_TIME, NEAR_IN_PLACE = 10.0, 150.0
"""Tracks further apart than this [s, m] have no event: more than the longest PET and look ahead."""


@dataclass(frozen=True)
class FirstContact:
    """First contact of two movers.

    Attributes:
        time: [s]; initial: whether they touch already when the second of them appears.
    """

    time: float
    initial: bool


def find_common_times(first: Trajectory, second: Trajectory) -> FloatArray:
    """Sample times [s] at which both are present; empty if they never are."""
    start, end = max(first.start, second.start), min(first.end, second.end)
    count = max(round((end - start) / STEP) + 1, 0)
    return np.asarray(start + STEP * np.arange(count), dtype=np.float64)


def compute_gaps_at(first: Trajectory, second: Trajectory, *, times: FloatArray) -> FloatArray:
    """Signed distance of the two footprints [m]."""
    return compute_gaps(*first.at(times), first.box, *second.at(times), second.box)


def compute_clearance(first: Trajectory, second: Trajectory, *, times: FloatArray) -> FloatArray:
    """Distance between the two footprints [m], 0 in contact (SEMANTICS section 4, *Clearance*)."""
    return np.maximum(compute_gaps_at(first, second, times=times), 0.0)


def find_first_contact(first: Trajectory, second: Trajectory) -> FirstContact | None:
    """The first contact of two movers, also between samples; None if they never touch.

    Positions and headings are linear between samples. Within a step the search advances by the gap
    divided by the fastest possible approach, so it cannot jump over a contact; it ends within 1 mm.
    """
    return measure_pair_gaps(build_pair_grid((first, second))).contacts.get(0)


def find_least_clearance(
    first: Trajectory, second: Trajectory, *, within: tuple[float, float] | None = None
) -> tuple[float, float] | None:
    """Time [s] and clearance [m] of the closest approach, to 0.01 s; None if never both present."""
    times = find_common_times(first, second)
    if within is not None:
        times = times[(times >= within[0]) & (times <= within[1])]
    if len(times) == 0:
        return None
    gaps = compute_gaps_at(first, second, times=times)
    best = float(times[int(np.argmin(gaps))])
    fine = np.clip(best + np.linspace(-STEP, STEP, 21), times[0], times[-1])
    gaps = compute_gaps_at(first, second, times=fine)
    k = int(np.argmin(gaps))
    return float(fine[k]), max(float(gaps[k]), 0.0)


def find_contact_point(
    first: Trajectory, second: Trajectory, *, time: float, other_time: float | None = None
) -> tuple[float, float]:
    """Middle of the contact [m]; of the shortest line between the footprints if they are apart.

    Args:
        other_time: when the second one is looked at [s]; None: at the same time.
    """
    one = _build_outline(first, time)
    two = _build_outline(second, time if other_time is None else other_time)
    if one.distance(two) > 0.05:
        middle = geos.shortest_line(one, two).interpolate(0.5, normalized=True)
    else:
        middle = one.buffer(0.05, quad_segs=2).intersection(two.buffer(0.05, quad_segs=2)).centroid
    return float(middle.x), float(middle.y)


def _build_outline(track: Trajectory, time: float) -> Area:
    xy, heading = track.at(np.array([time]))
    if not track.is_vehicle:
        return geos.Point(xy[0]).buffer(track.radius)
    return geos.Polygon(compute_corners(xy, heading, length=track.length, width=track.width)[0])


def estimate_velocity_before(track: Trajectory, *, time: float) -> FloatArray:
    """[2] velocity just before a time [m/s].

    Linear extrapolation from the last two whole steps before it, so that an abrupt stop at the
    contact itself does not blur the impact speed; from the last alone if an impact lies between.
    """
    k = min(int(np.floor((time - track.start) / STEP + 1e-6)), len(track) - 1)
    if k < 1:
        return np.asarray(track.velocity[0])
    last = (track.xy[k] - track.xy[k - 1]) / STEP
    if k < 2:
        return np.asarray(last)
    change = last - (track.xy[k - 1] - track.xy[k - 2]) / STEP
    if float(np.hypot(*change)) > IMPACT:
        return np.asarray(last)
    return np.asarray(last + change * ((time - track.start) / STEP - k + 0.5))


class GridTable(NamedTuple):
    """Samples of N movers on one time grid, and M pairs of them, for machine code.

    Attributes:
        pairs: [M, 2] indices of all pairs, or of those that may have to do with one another.
        common: [M, 2] first column of the grid at which both are present, and how many there are.
        shift: [N] what a column of the grid is short of its sample, where the mover is present.
        origin: [N+1] where each mover's samples begin, the last entry being S.
        times: [T] of the grid [s]; starts: [N] of the tracks [s].
        xy: [S, 2] [m] and heading: [S] [rad] of all samples, track after track.
        reach: [N] radius of the circle round each footprint [m].
        sizes: [3, N] half length, half width and radius of each footprint [m].
    """

    pairs: IntArray
    common: IntArray
    shift: IntArray
    origin: IntArray
    times: FloatArray
    starts: FloatArray
    xy: FloatArray
    heading: FloatArray
    reach: FloatArray
    sizes: FloatArray


@dataclass(frozen=True, eq=False)
class PairGrid:
    """All movers on one time grid."""

    tracks: tuple[Trajectory, ...]
    table: GridTable

    def find_rows(self, pairs: Collection[tuple[int, int]]) -> BoolArray:
        """[M] whether the pair of a row is one of these pairs of positions, in either order."""
        rows = np.sort(np.array([*pairs], dtype=np.intp).reshape(-1, 2))
        weights = np.array((len(self.tracks), 1))
        return np.isin(self.table.pairs @ weights, rows @ weights)

    def list_near(self, place: FloatArray, time: float, *, within: float) -> list[Trajectory]:
        """Movers that are present about a time [s] no further than this from a place [m]."""
        table, last = self.table, np.diff(self.table.origin) - 1
        k = round((time - table.times[0]) / STEP) + table.shift - table.origin[:-1]
        there = np.flatnonzero((k >= -1) & (k <= last + 1))
        sample = table.origin[there] + np.minimum(np.maximum(k[there], 0), last[there])
        away = table.xy[sample] - place
        return [self.tracks[n] for n in there[np.hypot(*away.T) <= within].tolist()]


def build_pair_grid(tracks: tuple[Trajectory, ...], *, near_only: bool = False) -> PairGrid:
    """Puts movers on one grid from the first start to the last end.

    Args:
        near_only: leave out pairs that are never near one another (`find_near_pairs`).
    """
    spans = np.array([(m.start, m.end) for m in tracks]).reshape(-1, 2)
    start, end = (float(spans[:, 0].min()), float(spans[:, 1].max())) if len(tracks) else (0.0, 0.0)
    times = np.asarray(start + STEP * np.arange(round((end - start) / STEP) + 1), dtype=np.float64)
    xy, heading, origin = concatenate_samples(tracks)
    first = np.rint((spans[:, 0] - start) / STEP).astype(np.intp)
    last = first + np.diff(origin)
    if near_only:
        pairs = find_near_pairs(spans, np.array([m.bounds for m in tracks]).reshape(-1, 4))
    else:
        pairs = np.stack(np.triu_indices(len(tracks), 1), axis=1)
    a, b = pairs.T
    begin = np.maximum(first[a], first[b])
    common = np.stack((begin, np.maximum(np.minimum(last[a], last[b]) - begin, 0)), axis=1)
    sizes = np.ascontiguousarray(np.array([m.box for m in tracks]).reshape(-1, 3).T)
    reach = np.array([m.reach for m in tracks])
    return PairGrid(tracks, GridTable(
        pairs, common, origin[:-1] - first, origin, times, spans[:, 0].copy(), xy, heading, reach,
        sizes,
    ))  # fmt: skip


@dataclass(frozen=True, eq=False)
class PairGaps:
    """How near all pairs of a grid come.

    Attributes:
        least: [M] least gap of each pair [m], exact below `EXACT_BELOW`, else a lower bound; inf
            where they are never both present.
        contacts: first contact of each pair that has one, by row of `GridTable.pairs`.
    """

    least: FloatArray
    contacts: dict[int, FirstContact]


def measure_pair_gaps(grid: PairGrid) -> PairGaps:
    """Least gaps and first contacts of all pairs; exact footprints only where centres are near."""
    least, contact = _measure_pairs(grid.table)
    contacts = {}
    for row in np.flatnonzero(~np.isnan(contact)).tolist():
        initial, both = contact[row] == -np.inf, grid.table.starts[grid.table.pairs[row]]
        contacts[row] = FirstContact(float(both.max() if initial else contact[row]), bool(initial))
    return PairGaps(least, contacts)


# ---- as machine code ----------------------------------------------------------------------------


@compiled
def _find_contact_in_step(grid: GridTable, row: int, k: int) -> float:
    """The first contact within the step from a pair's k-th common sample [s], NaN if none."""
    a, b, i, j = _find_samples(grid, row, k)
    start = grid.times[grid.common[row, 0] + k]
    step, other_step = get_step(grid.xy, grid.heading, i), get_step(grid.xy, grid.heading, j)
    size, other_size = get_box(grid.sizes, a), get_box(grid.sizes, b)
    dx = (other_step[1][0] - step[1][0]) - (other_step[0][0] - step[0][0])
    dy = (other_step[1][1] - step[1][1]) - (other_step[0][1] - step[0][1])
    bound = np.hypot(dx, dy) + grid.reach[a] * abs(step[1][2] - step[0][2])
    bound += grid.reach[b] * abs(other_step[1][2] - other_step[0][2])
    part = 0.0
    for _ in range(200):
        one, two = interpolate_pose(part, step), interpolate_pose(part, other_step)
        gap = compute_gap(one, size, two, other_size)
        if gap <= TOUCH:
            return float(start + part * STEP)
        part += max(gap / max(bound, 1e-9), 1e-3)
        if part > 1.0:
            break
    one, two = interpolate_pose(1.0, step), interpolate_pose(1.0, other_step)
    return float(start + STEP if compute_gap(one, size, two, other_size) <= TOUCH else np.nan)


def find_near_pairs(spans: FloatArray, bounds: FloatArray) -> IntArray:
    """[M, 2] pairs whose tracks come near enough in time and place for any event between them.

    Args:
        spans: [N, 2] start and end [s]; bounds: [N, 4] west, south, east and north [m].
    """
    room = np.array((-NEAR_IN_PLACE, -NEAR_IN_PLACE, NEAR_IN_PLACE, NEAR_IN_PLACE))
    near = geos.STRtree(geos.box(*bounds.T)).query(geos.box(*(bounds + room).T))
    first, second = near[:, near[0] < near[1]]
    pause = np.maximum(spans[first, 0], spans[second, 0]) - spans[[first, second], 1].min(axis=0)
    pairs = np.stack((first, second), axis=1)[pause <= NEAR_IN_TIME]
    return np.asarray(pairs[np.lexsort(pairs.T[::-1])])


@compiled
def _measure_pairs(grid: GridTable) -> tuple[FloatArray, FloatArray]:
    """[M] `PairGaps.least`, and [M] times of first contact: -inf from the start, NaN where none.

    Steps in which a gap may close, after a look at their middle, get the continuous search; those
    in which two are too far apart for it are passed over.
    """
    least, contact = np.full(len(grid.pairs), np.inf), np.full(len(grid.pairs), np.nan)
    fastest = np.full(len(grid.reach), 4 * TOUCH)
    for n in range(len(fastest)):
        for k in range(grid.origin[n], grid.origin[n + 1] - 1):
            fastest[n] = max(fastest[n], _bound_motion(grid, k, n))
    for row in range(len(grid.pairs)):
        most = fastest[grid.pairs[row, 0]] + fastest[grid.pairs[row, 1]]
        k, before = 0, np.inf
        while k < grid.common[row, 1]:
            gap = compute_gap_at(grid, row, k)
            least[row] = min(least[row], gap)
            if k == 0 and gap <= TOUCH:
                contact[row] = -np.inf
            open_yet = np.isnan(contact[row]) and before < np.inf
            if open_yet and _closes(grid, row, k - 1, before, gap):
                contact[row] = _find_contact_in_step(grid, row, k - 1)
            ahead = int(min((gap - EXACT_BELOW) / most, gap / most - 0.5) - 1e-6)
            before = gap if ahead <= 1 else np.inf
            k += max(ahead, 1)
    return least, contact


@compiled
def _find_samples(grid: GridTable, row: int, k: int) -> tuple[int, int, int, int]:
    """The movers of a pair, and the samples of both at their k-th common time."""
    a, b = grid.pairs[row, 0], grid.pairs[row, 1]
    column = grid.common[row, 0] + k
    return a, b, grid.shift[a] + column, grid.shift[b] + column


@compiled
def compute_gap_at(grid: GridTable, row: int, k: int) -> float:
    """Gap of a pair at its k-th common time [m], exact below `EXACT_BELOW`, else a lower bound."""
    a, b, i, j = _find_samples(grid, row, k)
    dx, dy = grid.xy[j, 0] - grid.xy[i, 0], grid.xy[j, 1] - grid.xy[i, 1]
    gap = np.sqrt(dx * dx + dy * dy) - (grid.reach[a] + grid.reach[b])
    if gap < EXACT_BELOW:
        one = make_pose(grid.xy[i, 0], grid.xy[i, 1], grid.heading[i])
        two = make_pose(grid.xy[j, 0], grid.xy[j, 1], grid.heading[j])
        gap = compute_gap(one, get_box(grid.sizes, a), two, get_box(grid.sizes, b))
    return float(gap)


@compiled
def _closes(grid: GridTable, row: int, k: int, before: float, after: float) -> bool:
    """Whether a pair's gap may close between two common times, by a look at the middle."""
    a, b, i, j = _find_samples(grid, row, k)
    most = _bound_motion(grid, i, a) + _bound_motion(grid, j, b)
    if before + after > most:
        return False
    one = interpolate_pose(0.5, get_step(grid.xy, grid.heading, i))
    two = interpolate_pose(0.5, get_step(grid.xy, grid.heading, j))
    middle = compute_gap(one, get_box(grid.sizes, a), two, get_box(grid.sizes, b))
    return bool(min(middle, middle + min(before, after) - most / 2) <= 0)


@compiled
def _bound_motion(grid: GridTable, k: int, n: int) -> float:
    """Most that any point of a mover's footprint moves from a sample to the next [m], and some."""
    dx, dy = grid.xy[k + 1, 0] - grid.xy[k, 0], grid.xy[k + 1, 1] - grid.xy[k, 1]
    turn = grid.reach[n] * abs(grid.heading[k + 1] - grid.heading[k])
    return float(np.sqrt(dx * dx + dy * dy) + turn + 2 * TOUCH)
