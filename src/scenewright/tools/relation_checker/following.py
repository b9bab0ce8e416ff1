"""Leader and follower in one lane, at what gap and headway; close overtaking (SEMANTICS 4, 8)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.contact import (
    GridTable,
    PairGrid,
    find_common_times,
    find_least_clearance,
)
from scenewright.tools.relation_checker.footprints import (
    IntArray,
    compute_angle_between,
    compute_offsets,
)
from scenewright.tools.relation_checker.track_path import LaneTable, project_on_lane
from scenewright.tools.relation_checker.trajectory import Trajectory, get_lane_table

LOOK_AHEAD = 60.0
ALONG = np.deg2rad(30.0)
"""A leader's heading is no further off the follower's path than this [rad]."""
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
        least: `least_gap` [m] and, unless it never drove faster than 1 m/s, `least_headway` [s],
            with the time at which either is measured [s].
    """

    follower: int
    leader: int
    start: float
    end: float
    least: dict[str, tuple[float, float]]


def measure_lane_gaps(grid: PairGrid) -> tuple[LaneGaps, ...]:
    """Leaders and gaps of all movers that have another ahead at some time."""
    if not len(grid.tracks):
        return ()
    table, driven = grid.table, np.concatenate([m.s for m in grid.tracks])
    ways = np.stack((np.cos(table.heading), np.sin(table.heading), table.heading, driven))
    least, leader = _measure_gaps(table, ways, get_lane_table(grid.tracks))
    found = []
    for n, track in enumerate(grid.tracks):
        own = slice(table.origin[n], table.origin[n + 1], STRIDE)
        if (leader[own] >= 0).any():
            lane = LaneGaps(
                n, track.times[::STRIDE], leader[own], least[own], track.speed[::STRIDE]
            )
            found.append(lane)
    return tuple(found)


@compiled
def _measure_gaps(
    grid: GridTable, ways: FloatArray, lanes: LaneTable
) -> tuple[FloatArray, IntArray]:
    """By sample [S] the gap to the nearest ahead [m], inf where none, and whose it is, else -1.

    Looked at every 0.2 s from each follower's start, of equals the first is kept. Others are of one
    kind and at some time ahead, looked at every 0.4 s.

    Args:
        ways: [4, S] cosine and sine of the heading, heading [rad] and arc length [m].
    """
    least, leader = np.full(len(grid.xy), np.inf), np.full(len(grid.xy), -1)
    cos, sin, heading, driven = ways[0], ways[1], ways[2], ways[3]
    for row in range(len(grid.pairs)):
        for side in range(2):
            n, k = grid.pairs[row, side], grid.pairs[row, 1 - side]
            alike = lanes.is_vehicle[n] == lanes.is_vehicle[k]
            if not alike or not _may_lead(grid, row, n, k, cos, sin):
                continue
            beside, own, noses = (lanes.width[n] + lanes.width[k]) / 2, lanes.nose[n], lanes.nose[k]
            foot, lateral, way, before = 0.0, np.inf, 0.0, -1
            for i in range(grid.origin[n], grid.origin[n + 1], STRIDE):
                j = i - grid.shift[n] + grid.shift[k]
                if not grid.origin[k] <= j < grid.origin[k + 1] or _is_apart(grid.xy, i, j):
                    continue
                x, y = grid.xy[j]
                if before < 0 or x != grid.xy[before, 0] or y != grid.xy[before, 1]:
                    foot, lateral, way = project_on_lane(x, y, lanes, n, beside)
                before = j
                gap = foot - driven[i] - own - noses
                if not (lateral < beside and gap > -own and foot > driven[i]):
                    continue
                turn = abs((heading[j] - way + np.pi) % (2 * np.pi) - np.pi)
                if turn <= ALONG and gap < least[i]:
                    least[i], leader[i] = gap, k
    return least, leader


@compiled
def _may_lead(grid: GridTable, row: int, n: int, k: int, cos: FloatArray, sin: FloatArray) -> bool:
    """Whether one of a pair, k, is ahead of the other, n, at a time when both are there."""
    begin, count = grid.common[row]
    for column in range(begin + -begin % SPARSE, begin + count, SPARSE):
        i, j = grid.shift[n] + column, grid.shift[k] + column
        if _is_apart(grid.xy, i, j) or not cos[i] * cos[j] + sin[i] * sin[j] >= 0.5:
            continue
        dx, dy = grid.xy[j, 0] - grid.xy[i, 0], grid.xy[j, 1] - grid.xy[i, 1]
        if dx * cos[i] + dy * sin[i] > 0:
            return True
    return False


@compiled
def _is_apart(xy: FloatArray, i: int, j: int) -> bool:
    """Whether two samples are further apart than a leader is looked for."""
    dx, dy = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
    return bool(dx * dx + dy * dy > LOOK_AHEAD**2)


def find_followings(lanes: tuple[LaneGaps, ...]) -> tuple[Following, ...]:
    """All stretches of at least 3 s with headway 0.5-4 s, or a standing gap of 0.5-5 m."""
    found: list[Following] = []
    for lane in lanes:
        moving, headway = lane.speed > CREEP, lane.headway
        fine = np.where(
            moving,
            (headway >= HEADWAY[0]) & (headway <= HEADWAY[1]),
            (lane.gap >= STANDING_GAP[0]) & (lane.gap <= STANDING_GAP[1]),
        )
        tag = np.where(fine, lane.leader, -1)
        edges = [0, *(np.flatnonzero(tag[1:] != tag[:-1]) + 1).tolist(), len(tag)]
        for begin, end in pairwise(edges):
            if tag[begin] < 0 or (end - 1 - begin) * STRIDE * STEP < MIN_DURATION - 1e-6:
                continue
            near = begin + int(lane.gap[begin:end].argmin())
            least = {"least_gap": (float(lane.gap[near]), float(lane.times[near]))}
            close = begin + int(np.where(moving, headway, np.inf)[begin:end].argmin())
            if moving[close]:
                least["least_headway"] = float(headway[close]), float(lane.times[close])
            start, last = float(lane.times[begin]), float(lane.times[end - 1])
            found.append(Following(lane.follower, int(lane.leader[begin]), start, last, least))
    return tuple(found)


CLOSE = 1.5
"""Least clearance with which a vehicle may overtake a rider [m]."""
SAME_WAY = np.deg2rad(30.0)
MOVING = 1.0
"""A vehicle slower than this [m/s] is passed, not overtaken."""
BESIDE = 4.0
"""Farthest to the side [m] that the vehicle's centre is still in the rider's company."""
AROUND = 2.0
"""How long before and after it is abreast the clearance counts [s]."""


def find_close_overtaking(
    first: Trajectory, second: Trajectory, *, left_hand: bool = False
) -> tuple[float, float] | None:
    """Time [s] and clearance [m] of a vehicle's close overtaking of a rider; None without one.

    It comes from behind, goes ahead on the side away from the kerb, and both are moving.

    Args:
        left_hand: people drive on the left, and overtake on the right.
    """
    if first.is_rider == second.is_rider or "pedestrian" in (first.type, second.type):
        return None
    rider, vehicle = (first, second) if first.is_rider else (second, first)
    times = find_common_times(vehicle, rider)
    if len(times) < 2:
        return None
    i, j = vehicle.find_indices(times), rider.find_indices(times)
    along, aside = compute_offsets(vehicle.xy[i], rider.xy[j], rider.heading[j])
    aside = -aside if left_hand else aside
    passes = np.flatnonzero((along[:-1] < 0.0) & (along[1:] >= 0.0)) + 1
    for k in passes.tolist():
        alike = compute_angle_between(vehicle.heading[i[k : k + 1]], rider.heading[j[k : k + 1]])
        slower = min(float(vehicle.speed[i[k]]), float(rider.speed[j[k]]))
        if alike[0] > SAME_WAY or slower < MOVING or not 0.0 < aside[k] <= BESIDE:
            continue
        time = float(times[k])
        nearest = find_least_clearance(first, second, within=(time - AROUND, time + AROUND))
        if nearest is not None and nearest[1] < CLOSE:
            return nearest
    return None
