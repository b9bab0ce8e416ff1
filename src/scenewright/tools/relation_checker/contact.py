"""Clearance over time and the first contact of two footprints, in continuous time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.footprints import (
    BoolArray,
    IntArray,
    Pose,
    compute_corners,
    compute_gap,
    compute_gaps,
    double_room,
    get_box,
    get_extent,
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


def compute_gaps_at(
    first: Trajectory,
    second: Trajectory,
    *,
    times: FloatArray,
    second_times: FloatArray | None = None,
) -> FloatArray:
    """Signed distance [m] of footprint first(t) and second(t), or second(t') for other times t'."""
    xy, heading = first.at(times)
    other_xy, other_heading = second.at(times if second_times is None else second_times)
    return compute_gaps(
        xy, heading, get_extent(first),
        other_xy=other_xy, other_heading=other_heading, other_size=get_extent(second),
    )  # fmt: skip


def compute_clearance(first: Trajectory, second: Trajectory, *, times: FloatArray) -> FloatArray:
    """Distance between the two footprints [m], 0 in contact (SEMANTICS section 4, *Clearance*)."""
    return np.maximum(compute_gaps_at(first, second, times=times), 0.0)


def find_first_contact(first: Trajectory, second: Trajectory) -> FirstContact | None:
    """The first contact of two movers, also between samples; None if they never touch.

    Positions and headings are linear between samples. Within a step the search advances by the gap
    divided by the fastest possible approach, so it cannot jump over a contact; it ends within 1 mm.
    """
    return measure_pair_gaps(build_pair_grid((first, second))).contacts.get(0)


def _find_contact_in_step(first: Trajectory, second: Trajectory, start: float) -> float | None:
    """The first contact within the step that begins at a sample time [s], None if there is none."""
    ends = start + np.array((0.0, STEP))
    states = [track.at(ends) for track in (first, second)]
    dx, dy = np.diff(states[1][0] - states[0][0], axis=0)[0]
    turn, other_turn = (np.abs(heading[1] - heading[0]) for _, heading in states)
    bound = float(np.hypot(dx, dy) + first.reach * turn + second.reach * other_turn)
    part = 0.0
    for _ in range(200):
        distance = _compute_gap_within_step(first, second, states, part)
        if distance <= TOUCH:
            return start + part * STEP
        part += max(distance / max(bound, 1e-9), 1e-3)
        if part > 1.0:
            break
    return start + STEP if _compute_gap_within_step(first, second, states, 1.0) <= TOUCH else None


def _compute_gap_within_step(
    first: Trajectory,
    second: Trajectory,
    states: Sequence[tuple[FloatArray, FloatArray]],
    part: float,
) -> float:
    """Gap [m] at a part of a step, from positions and headings at its two ends."""
    (xy, heading), (other_xy, other_heading) = (
        (xy[0] + part * (xy[1] - xy[0]), heading[0] + part * (heading[1] - heading[0]))
        for xy, heading in states
    )
    return float(compute_gaps(
        xy, heading, get_extent(first),
        other_xy=other_xy, other_heading=other_heading, other_size=get_extent(second),
    ))  # fmt: skip


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
    first: Trajectory, second: Trajectory, *, time: float
) -> tuple[float, float]:
    """Middle of the contact [m]; of the shortest line between the footprints if they are apart."""
    one, two = _build_outline(first, time), _build_outline(second, time)
    if one.distance(two) > 0.05:
        line = geos.shortest_line(one, two)
        middle = line.interpolate(0.5, normalized=True)
        return float(middle.x), float(middle.y)
    overlap = one.buffer(0.05, quad_segs=2).intersection(two.buffer(0.05, quad_segs=2))
    middle = overlap.centroid
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


@dataclass(frozen=True, eq=False)
class PairGrid:
    """All movers on one time grid.

    Attributes:
        tracks: N of them; times: [T] [s].
        xy: [N, T, 2] and heading: [N, T], held outside of a track's own time.
        present: [N, T] bool; first: [N] column of each track's first sample.
        origin: [N+1] where each track's samples begin when all are concatenated.
        pairs: [M, 2] indices of all pairs, or of those that may have to do with one another.
    """

    tracks: tuple[Trajectory, ...]
    times: FloatArray
    xy: FloatArray
    heading: FloatArray
    present: BoolArray
    first: IntArray
    origin: IntArray
    pairs: IntArray

    @cached_property
    def sizes(self) -> FloatArray:
        """[3, N] half length, half width and radius of each footprint [m]."""
        rows = [(m.half_length, m.half_width, m.radius) for m in self.tracks]
        return np.ascontiguousarray(np.array(rows).reshape(-1, 3).T)

    @cached_property
    def reach(self) -> FloatArray:
        """[N] radius of the circle round each footprint [m]."""
        return np.array([m.reach for m in self.tracks])


def build_pair_grid(tracks: tuple[Trajectory, ...], *, near_only: bool = False) -> PairGrid:
    """Puts movers on one grid from the first start to the last end.

    Args:
        near_only: leave out pairs that are never near one another (`find_near_pairs`).
    """
    start = min((m.start for m in tracks), default=0.0)
    end = max((m.end for m in tracks), default=0.0)
    times = np.asarray(start + STEP * np.arange(round((end - start) / STEP) + 1), dtype=np.float64)
    xy, heading, origin = concatenate_samples(tracks)
    first = np.array([round((m.start - start) / STEP) for m in tracks], dtype=np.intp)
    sample = np.arange(len(times)) - first[:, None]
    last = np.diff(origin)[:, None] - 1
    held = np.minimum(np.maximum(sample, 0), last)
    rows = origin[:-1, None] + held
    pairs = np.stack(np.triu_indices(len(tracks), 1), axis=1)
    if near_only:
        spans = np.array([(m.start, m.end) for m in tracks])
        pairs = find_near_pairs(spans, np.array([m.bounds for m in tracks]))
    return PairGrid(tracks, times, xy[rows], heading[rows], held == sample, first, origin, pairs)


def find_near_pairs(spans: FloatArray, bounds: FloatArray) -> IntArray:
    """[M, 2] pairs whose tracks come near enough in time and place for any event between them.

    Args:
        spans: [N, 2] start and end [s]; bounds: [N, 4] west, south, east and north [m].
    """
    first, second = np.triu_indices(len(spans), 1)
    start, end = spans.reshape(-1, 2).T
    west, south, east, north = bounds.reshape(-1, 4).T
    pause = np.maximum(start[first], start[second]) - np.minimum(end[first], end[second])
    apart = [
        np.maximum(low[first], low[second]) - np.minimum(high[first], high[second])
        for low, high in ((west, east), (south, north))
    ]
    near = (pause <= NEAR_IN_TIME) & (np.maximum(*apart) <= NEAR_IN_PLACE)
    return np.stack((first[near], second[near]), axis=1)


@dataclass(frozen=True, eq=False)
class PairGaps:
    """Gaps of all pairs at all times.

    Attributes:
        gaps: [M, T] signed distance [m], exact below `EXACT_BELOW`, else a lower bound; inf where
            one of the two is absent.
        contacts: first contact of each pair that has one, by row of `PairGrid.pairs`.
    """

    gaps: FloatArray
    contacts: dict[int, FirstContact]


def measure_pair_gaps(grid: PairGrid) -> PairGaps:
    """Clearances and first contacts of all pairs; exact footprints only where centres are near."""
    gaps = _compute_all_gaps(
        grid.pairs, grid.xy, grid.heading, grid.present, grid.reach, grid.sizes
    )  # fmt: skip
    return PairGaps(gaps, _find_first_contacts(grid, gaps))


def _find_first_contacts(grid: PairGrid, gaps: FloatArray) -> dict[int, FirstContact]:
    """By row of `PairGrid.pairs`; steps in which a gap may close get the continuous search."""
    found: dict[int, FirstContact] = {}
    for row in np.flatnonzero((gaps <= TOUCH).any(axis=1)).tolist():
        first, second = (grid.tracks[k] for k in grid.pairs[row])
        begin = int(np.argmax(np.isfinite(gaps[row])))
        if gaps[row, begin] <= TOUCH:
            found[row] = FirstContact(max(first.start, second.start), True)
    closing = _find_closing_steps(
        grid.pairs, gaps, grid.xy, grid.heading, grid.reach, grid.sizes
    )  # fmt: skip
    for row, col in zip(*(each.tolist() for each in closing), strict=True):
        if row not in found:
            first, second = (grid.tracks[k] for k in grid.pairs[row])
            time = _find_contact_in_step(first, second, float(grid.times[col]))
            if time is not None:
                found[row] = FirstContact(time, False)
    return dict(sorted(found.items()))


# ---- as machine code ----------------------------------------------------------------------------


@compiled
def _compute_all_gaps(
    pairs: IntArray,
    xy: FloatArray,
    heading: FloatArray,
    present: BoolArray,
    reach: FloatArray,
    sizes: FloatArray,
) -> FloatArray:
    """[M, T] `PairGaps.gaps` of movers [N, T] and their sizes [3, N]."""
    gaps = np.full((len(pairs), xy.shape[1]), np.inf)
    for row in range(len(pairs)):
        a, b = pairs[row, 0], pairs[row, 1]
        for k in range(xy.shape[1]):
            if not (present[a, k] and present[b, k]):
                continue
            dx, dy = xy[b, k, 0] - xy[a, k, 0], xy[b, k, 1] - xy[a, k, 1]
            compute_gaps = np.sqrt(dx * dx + dy * dy) - (reach[a] + reach[b])
            if compute_gaps < EXACT_BELOW:
                one = make_pose(xy[a, k, 0], xy[a, k, 1], heading[a, k])
                two = make_pose(xy[b, k, 0], xy[b, k, 1], heading[b, k])
                compute_gaps = compute_gap(one, get_box(sizes, a), two, get_box(sizes, b))
            gaps[row, k] = compute_gaps
    return gaps


@compiled
def _find_closing_steps(
    pairs: IntArray,
    gaps: FloatArray,
    xy: FloatArray,
    heading: FloatArray,
    reach: FloatArray,
    sizes: FloatArray,
) -> tuple[IntArray, IntArray]:
    """Pairs and steps, in order, in which the gap may close, after a look at their middle."""
    row: IntArray = np.empty(64, np.intp)
    col: IntArray = np.empty(64, np.intp)
    count = 0
    for pair in range(len(pairs)):
        a, b = pairs[pair, 0], pairs[pair, 1]
        for k in range(gaps.shape[1] - 1):
            before, after = gaps[pair, k], gaps[pair, k + 1]
            if before + after == np.inf:
                continue
            most = _bound_motion(a, k, xy, heading, reach) + _bound_motion(b, k, xy, heading, reach)
            if before + after > most:
                continue
            one, two = (
                _compute_pose_halfway(a, k, xy, heading),
                _compute_pose_halfway(b, k, xy, heading),
            )
            middle = compute_gap(one, get_box(sizes, a), two, get_box(sizes, b))
            if min(middle, middle + min(before, after) - most / 2) <= 0:
                if count == len(row):
                    row, col = double_room(row), double_room(col)
                row[count], col[count] = pair, k
                count += 1
    return row[:count], col[:count]


@compiled
def _bound_motion(n: int, k: int, xy: FloatArray, heading: FloatArray, reach: FloatArray) -> float:
    """Most that any point of a footprint moves within a step [m], with some room."""
    dx, dy = xy[n, k + 1, 0] - xy[n, k, 0], xy[n, k + 1, 1] - xy[n, k, 1]
    turn = reach[n] * abs(heading[n, k + 1] - heading[n, k])
    return float(np.sqrt(dx * dx + dy * dy) + turn + 2 * TOUCH)


@compiled
def _compute_pose_halfway(n: int, k: int, xy: FloatArray, heading: FloatArray) -> Pose:
    return make_pose(
        (xy[n, k, 0] + xy[n, k + 1, 0]) / 2,
        (xy[n, k, 1] + xy[n, k + 1, 1]) / 2,
        (heading[n, k] + heading[n, k + 1]) / 2,
    )
