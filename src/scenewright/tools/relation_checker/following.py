"""Following: leader and follower in one lane, at what gap and headway (SEMANTICS section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.compiled import compiled, compiled_to_write
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.contact import GridTable, PairGrid
from scenewright.tools.relation_checker.footprints import (
    BoolArray,
    IntArray,
    compute_angle_between,
    double_room,
)
from scenewright.tools.relation_checker.track_path import project_each
from scenewright.tools.relation_checker.trajectory import get_lane_table

LOOK_AHEAD = 60.0
ROOM = 1_000_000
"""Samples of followers that are looked at in one go."""
STRIDE, SPARSE = 2, 4
"""Every so many samples it is measured who leads whom, and looked who may."""
MIN_DURATION = 3.0
HEADWAY = (0.5, 4.0)
STANDING_GAP = (0.5, 5.0)
CREEP = 1.0
"""Below this speed [m/s] the gap counts, above it the headway."""


@dataclass(frozen=True, eq=False)
class LaneGaps:
    """How far the next agent ahead in one lane is, every 0.2 s.

    Attributes:
        follower: index of the mover; times: [n] [s].
        leader: [n] index of the nearest mover ahead, -1 where there is none within 60 m.
        gap: [n] from its front to the leader's rear along its path [m]; inf where none.
        speed: [n] of the follower [m/s].
    """

    follower: int
    times: FloatArray
    leader: np.ndarray[tuple[int], np.dtype[np.intp]]
    gap: FloatArray
    speed: FloatArray

    @property
    def headway(self) -> FloatArray:
        """[n] time headway: gap / speed of the follower [s]; inf at standstill."""
        return np.asarray(self.gap / np.maximum(self.speed, 1e-6))


@dataclass(frozen=True)
class Following:
    """A stretch of following.

    Attributes:
        follower, leader: indices of movers; start, end [s].
        least_gap [m]; least_headway [s], None if it never drove faster than 1 m/s.
    """

    follower: int
    leader: int
    start: float
    end: float
    least_gap: float
    least_headway: float | None


def measure_lane_gaps(grid: PairGrid) -> tuple[LaneGaps, ...]:
    """Leaders and gaps of all movers that have another ahead at some time."""
    # Pairs of which the second is at some time ahead of the first, in order.
    vehicle = np.array([m.is_vehicle for m in grid.tracks])
    alike = vehicle[grid.pairs[:, 0]] == vehicle[grid.pairs[:, 1]]
    pairs = grid.pairs[alike]
    cos, sin = np.cos(grid.heading), np.sin(grid.heading)
    ahead, behind = _find_possible_leaders(grid.table, alike, cos, sin)[alike].T
    both = np.concatenate((pairs[ahead], pairs[behind][:, ::-1]))
    followers, others = both[np.lexsort((both[:, 1], both[:, 0]))].T
    if len(followers) == 0:
        return ()
    least = np.full(len(grid.xy), np.inf)
    leader = np.full(len(grid.xy), -1, dtype=np.intp)
    # Portion by portion, for the memory's sake.
    size = np.cumsum(np.diff(grid.origin)[followers])
    for part in np.split(np.arange(len(size)), np.flatnonzero(np.diff(size // ROOM)) + 1):
        _measure_gaps(grid, followers[part], others[part], least, leader)
    found = []
    for n in dict.fromkeys(followers.tolist()):
        track, own = grid.tracks[n], slice(grid.origin[n], grid.origin[n + 1], STRIDE)
        if (leader[own] >= 0).any():
            lane = LaneGaps(
                n, track.times[::STRIDE], leader[own], least[own], track.speed[::STRIDE]
            )
            found.append(lane)
    return tuple(found)


def _measure_gaps(
    grid: PairGrid, followers: IntArray, others: IntArray, least: FloatArray, leader: IntArray
) -> None:
    """Notes where another is the nearest ahead so far of a follower, and its gap, by sample [S].

    Looked at every 0.2 s from each follower's start.
    """
    row, mine, theirs = _list_near_samples(followers, others, grid.table)
    n, k = followers[row], others[row]
    nose, width = np.array([(m.nose, m.width) for m in grid.tracks]).T
    driven = np.concatenate([m.s for m in grid.tracks])[mine]
    beside = (width[n] + width[k]) / 2
    lanes = get_lane_table(grid.tracks)
    foot = project_each(grid.xy[theirs], lanes, n, within=beside)
    gap = foot.s - driven - nose[n] - nose[k]
    inside = (foot.lateral < beside) & (gap > -nose[n]) & (foot.s > driven)
    inside &= compute_angle_between(grid.heading[theirs], foot.direction) <= np.deg2rad(30.0)
    _keep_least(mine[inside], k[inside], gap[inside], least, leader)


@compiled
def _find_possible_leaders(
    grid: GridTable, alike: BoolArray, cos: FloatArray, sin: FloatArray
) -> BoolArray:
    """[M, 2] whether the second is ahead of the first every 0.4 s, and the first of the second.

    Of pairs of one kind.
    """
    found, xy = np.zeros((len(grid.pairs), 2), np.bool_), grid.xy
    for row in np.flatnonzero(alike):
        a, b = grid.pairs[row]
        begin, end = grid.common[row, 0], grid.common[row, 0] + grid.common[row, 1]
        for column in range(begin + -begin % SPARSE, end, SPARSE):
            i, j = grid.shift[a] + column, grid.shift[b] + column
            dx, dy = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
            apart = dx * dx + dy * dy > LOOK_AHEAD**2
            if apart or not cos[i] * cos[j] + sin[i] * sin[j] >= 0.5:
                continue
            found[row, 0] |= dx * cos[i] + dy * sin[i] > 0
            found[row, 1] |= dx * cos[j] + dy * sin[j] < 0
    return found


@compiled
def _list_near_samples(
    followers: IntArray, others: IntArray, grid: GridTable
) -> tuple[IntArray, IntArray, IntArray]:
    """Rows, samples of the follower and of the other, while they are within 60 m of one another."""
    row: IntArray = np.empty(64, np.intp)
    mine: IntArray = np.empty(64, np.intp)
    theirs: IntArray = np.empty(64, np.intp)
    origin, shift, xy = grid.origin, grid.shift, grid.xy
    count = 0
    for k in range(len(followers)):
        a, b = followers[k], others[k]
        end = origin[b + 1]
        for i in range(origin[a], origin[a + 1], STRIDE):
            j = i - shift[a] + shift[b]
            if not origin[b] <= j < end:
                continue
            dx, dy = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
            if dx * dx + dy * dy > LOOK_AHEAD**2:
                continue
            if count == len(row):
                row, mine, theirs = double_room(row), double_room(mine), double_room(theirs)
            row[count], mine[count], theirs[count] = k, i, j
            count += 1
    return row[:count], mine[:count], theirs[:count]


@compiled_to_write
def _keep_least(
    sample: IntArray, other: IntArray, gap: FloatArray, least: FloatArray, leader: IntArray
) -> None:
    """Writes the least gap of every sample, and whose it is; of equals the first."""
    for k in range(len(sample)):
        if gap[k] < least[sample[k]]:
            least[sample[k]], leader[sample[k]] = gap[k], other[k]


def find_followings(lanes: tuple[LaneGaps, ...]) -> tuple[Following, ...]:
    """All stretches of at least 3 s with headway 0.5-4 s, or a standing gap of 0.5-5 m."""
    found: list[Following] = []
    for lane in lanes:
        moving = lane.speed > CREEP
        fine = np.where(
            moving,
            (lane.headway >= HEADWAY[0]) & (lane.headway <= HEADWAY[1]),
            (lane.gap >= STANDING_GAP[0]) & (lane.gap <= STANDING_GAP[1]),
        )
        tag = np.where(fine, lane.leader, -1)
        runs = np.split(np.arange(len(tag)), np.flatnonzero(np.diff(tag)) + 1)
        for run in runs:
            if tag[run[0]] < 0 or (len(run) - 1) * STRIDE * STEP < MIN_DURATION - 1e-6:
                continue
            headways = lane.headway[run[moving[run]]]
            found.append(Following(
                lane.follower, int(lane.leader[run[0]]),
                float(lane.times[run[0]]), float(lane.times[run[-1]]), float(lane.gap[run].min()),
                float(headways.min()) if len(headways) else None,
            ))  # fmt: skip
    return tuple(found)
