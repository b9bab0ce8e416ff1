"""Following: leader and follower in one lane, at what gap and headway (SEMANTICS section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.contact import PairGrid
from scenewright.tools.relation_checker.footprints import BoolArray, IntArray, compute_angle_between
from scenewright.tools.relation_checker.track_path import project_each
from scenewright.tools.relation_checker.trajectory import get_lane_table

LOOK_AHEAD = 60.0
ROOM = 1_000_000
"""Pairs times samples that are looked at in one go."""
STRIDE = 2
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
    followers, others = np.nonzero(_may_lead(grid))
    if len(followers) == 0:
        return ()
    # Portion by portion, for the memory's sake; a follower's pairs stay together.
    begin = np.searchsorted(followers, followers)
    cuts = np.flatnonzero(np.diff(begin // max(ROOM // len(grid.times), 1))) + 1
    found: list[LaneGaps | None] = []
    for part in np.split(np.arange(len(followers)), cuts):
        n, k = followers[part], others[part]
        gaps = _measure_gaps(grid, n, k)
        found += [
            _find_nearest_leader(grid, m, k[n == m], gaps[n == m])
            for m in dict.fromkeys(n.tolist())
        ]
    return tuple(lane for lane in found if lane is not None)


def _may_lead(grid: PairGrid) -> BoolArray:
    """[N, N] whether k is somewhere ahead of n and heads roughly the same way; generous."""
    vehicle = np.array([m.is_vehicle for m in grid.tracks])
    n, k = grid.pairs[vehicle[grid.pairs[:, 0]] == vehicle[grid.pairs[:, 1]]].T
    xy, heading, here = (a[:, ::4] for a in (grid.xy, grid.heading, grid.present))
    x, y, cos, sin = xy[..., 0], xy[..., 1], np.cos(heading), np.sin(heading)
    dx, dy = x[k] - x[n], y[k] - y[n]
    together = here[n] & here[k] & (dx * dx + dy * dy <= LOOK_AHEAD**2)
    together &= cos[n] * cos[k] + sin[n] * sin[k] >= 0.5
    result = np.zeros((len(vehicle), len(vehicle)), dtype=np.bool_)
    result[n, k] = (together & (dx * cos[n] + dy * sin[n] > 0)).any(axis=1)
    result[k, n] = (together & (dx * cos[k] + dy * sin[k] < 0)).any(axis=1)
    return result


def _measure_gaps(grid: PairGrid, followers: IntArray, others: IntArray) -> FloatArray:
    """[M, T] gap of each follower to the other on the common time grid, inf where it is not ahead.

    Looked at every 0.2 s from each follower's start.
    """
    gaps = np.full((len(followers), len(grid.times)), np.inf)
    sample = np.arange(len(grid.times)) - grid.first[followers, None]
    away = grid.xy[others] - grid.xy[followers]
    near = np.square(away[..., 0]) + np.square(away[..., 1]) <= LOOK_AHEAD**2
    near &= grid.present[followers] & grid.present[others] & (sample % STRIDE == 0)
    row, column = np.nonzero(near)
    if len(row) == 0:
        return gaps
    n, k = followers[row], others[row]
    nose, width = np.array([(m.nose, m.width) for m in grid.tracks]).T
    driven = np.concatenate([m.s for m in grid.tracks])[grid.origin[n] + sample[row, column]]
    beside = (width[n] + width[k]) / 2
    lanes = get_lane_table(grid.tracks)
    foot = project_each(grid.xy[k, column], lanes, n, within=beside)
    gap = foot.s - driven - nose[n] - nose[k]
    inside = (foot.lateral < beside) & (gap > -nose[n]) & (foot.s > driven)
    inside &= compute_angle_between(grid.heading[k, column], foot.direction) <= np.deg2rad(30.0)
    gaps[row[inside], column[inside]] = gap[inside]
    return gaps


def _find_nearest_leader(
    grid: PairGrid, n: int, others: IntArray, gaps: FloatArray
) -> LaneGaps | None:
    """The nearest of the others ahead of mover n; None if none of them ever is."""
    track, first = grid.tracks[n], int(grid.first[n])
    gaps = gaps[:, first : first + len(track) : STRIDE]
    nearest = gaps.argmin(axis=0)
    gap = gaps[nearest, np.arange(gaps.shape[1])]
    ahead = np.isfinite(gap)
    if not ahead.any():
        return None
    leader = np.where(ahead, others[nearest], -1)
    return LaneGaps(n, track.times[::STRIDE], leader, gap, track.speed[::STRIDE])


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
        found += [
            _build_following(lane, run)
            for run in runs
            if tag[run[0]] >= 0 and (len(run) - 1) * STRIDE * STEP >= MIN_DURATION - 1e-6
        ]
    return tuple(found)


def _build_following(lane: LaneGaps, run: np.ndarray[tuple[int], np.dtype[np.intp]]) -> Following:
    moving = run[lane.speed[run] > CREEP]
    return Following(
        lane.follower, int(lane.leader[run[0]]),
        float(lane.times[run[0]]), float(lane.times[run[-1]]), float(lane.gap[run].min()),
        float(lane.headway[moving].min()) if len(moving) else None,
    )  # fmt: skip
