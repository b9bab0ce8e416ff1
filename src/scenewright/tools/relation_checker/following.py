"""Following: who is behind whom in one lane, at what gap and headway (SEMANTICS section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.contact import Crowd
from scenewright.tools.relation_checker.curve import project
from scenewright.tools.relation_checker.footprints import BoolArray, angle_between
from scenewright.tools.relation_checker.motion import Mover

LOOK_AHEAD = 60.0
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


def lane_gaps(crowd: Crowd) -> tuple[LaneGaps, ...]:
    """Leaders and gaps of all movers that have someone ahead at some time."""
    movers, may_lead = crowd.movers, _may_lead(crowd)
    found = []
    for n, mover in enumerate(movers):
        gaps = np.full((len(movers), len(mover.times[::STRIDE])), np.inf)
        for k in np.flatnonzero(may_lead[n]):
            gaps[k] = _gaps_to(mover, movers[k])
        if np.isfinite(gaps).any():
            found.append(_nearest(n, mover, gaps))
    return tuple(found)


def _may_lead(crowd: Crowd) -> BoolArray:
    """[N, N] whether k is somewhere ahead of n and heads roughly the same way; generous."""
    xy, heading, here = (a[:, ::4] for a in (crowd.xy, crowd.heading, crowd.present))
    x, y = xy[..., 0], xy[..., 1]
    dx, dy = x[None] - x[:, None], y[None] - y[:, None]
    c, s = np.cos(heading), np.sin(heading)
    ahead = dx * c[:, None] + dy * s[:, None] > 0
    near = dx * dx + dy * dy <= LOOK_AHEAD**2
    same_way = c[:, None] * c + s[:, None] * s >= 0.5
    kind = np.array([m.is_vehicle for m in crowd.movers])
    result = (ahead & near & same_way & here[:, None] & here).any(axis=2)
    return np.asarray(result & (kind[:, None] == kind) & ~np.eye(len(kind), dtype=np.bool_))


def _common(mover: Mover, other: Mover) -> tuple[int, int, int]:
    """First common sample in either track, and how many there are."""
    shift = round((other.start - mover.start) / STEP)
    i, j = max(shift, 0), max(-shift, 0)
    return i, j, min(len(mover) - i, len(other) - j)


def _gaps_to(mover: Mover, other: Mover) -> FloatArray:
    i, j, n = _common(mover, other)
    result = np.full(len(mover), np.inf)
    k = np.arange(i + (-i) % STRIDE, i + n, STRIDE)
    away = other.xy[k - i + j] - mover.xy[k]
    k = k[away[:, 0] ** 2 + away[:, 1] ** 2 <= LOOK_AHEAD**2]
    if len(k) == 0:
        return result[::STRIDE]
    foot = project(other.xy[k - i + j], mover.lane)
    gap = foot.s - mover.s[k] - mover.nose - other.nose
    inside = foot.lateral < (mover.width + other.width) / 2
    inside &= angle_between(other.heading[k - i + j], foot.direction) <= np.deg2rad(30.0)
    inside &= (gap > -mover.nose) & (foot.s > mover.s[k])
    result[k[inside]] = gap[inside]
    return result[::STRIDE]


def _nearest(n: int, mover: Mover, gaps: FloatArray) -> LaneGaps:
    leader = np.argmin(gaps, axis=0)
    gap = np.take_along_axis(gaps, leader[None], axis=0)[0]
    leader[~np.isfinite(gap)] = -1
    return LaneGaps(n, mover.times[::STRIDE], leader, gap, mover.speed[::STRIDE])


def followings(lanes: tuple[LaneGaps, ...]) -> tuple[Following, ...]:
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
            _following(lane, run)
            for run in runs
            if tag[run[0]] >= 0 and (len(run) - 1) * STRIDE * STEP >= MIN_DURATION - 1e-6
        ]
    return tuple(found)


def _following(lane: LaneGaps, run: np.ndarray[tuple[int], np.dtype[np.intp]]) -> Following:
    moving = run[lane.speed[run] > CREEP]
    return Following(
        lane.follower, int(lane.leader[run[0]]),
        float(lane.times[run[0]]), float(lane.times[run[-1]]), float(lane.gap[run].min()),
        float(lane.headway[moving].min()) if len(moving) else None,
    )  # fmt: skip
