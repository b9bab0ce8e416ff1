"""Yielding: the agent that gave way, and whether the other was the cause (SEMANTICS section 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.conflict_zones import ZoneOccupancy
from scenewright.tools.relation_checker.footprints import IntArray, compute_angle_between
from scenewright.tools.relation_checker.track_path import compute_curvature, project
from scenewright.tools.relation_checker.trajectory import Trajectory

COMFORT = 2.0
"""Acceleration and braking with which free speed is reached [m/s^2]."""
CURVE_COMFORT = 3.0
"""Lateral acceleration at free speed [m/s^2]."""
MAX_PET = 8.0
RESUME_WITHIN = 4.0
STANDING = 0.3
STANDING_TIME = 0.5
MARGIN = 2.0
LATE = 0.5
"""How long after the other has left the zone the yielding agent may be slowest [s]."""


@dataclass(frozen=True)
class _ClassLimits:
    """Figures of one class of road users."""

    upstream: float
    approach: float
    moving: float
    resumed: float
    ripple: float


LIMITS = {
    "vehicle": _ClassLimits(20.0, 40.0, 2.0, 1.0, 0.5),
    "pedestrian": _ClassLimits(5.0, 5.0, 0.5, 0.5, 0.2),
    "cyclist": _ClassLimits(20.0, 40.0, 2.0, 1.0, 0.5),
    "scooter": _ClassLimits(20.0, 40.0, 2.0, 1.0, 0.5),
}


@dataclass(frozen=True)
class YieldEvent:
    """A yield that was found.

    Attributes:
        time: of lowest speed, or the start of standstill [s]; place [m].
        begin: when the agent began to slow [s].
        lowest, approach: speeds [m/s]; braking: hardest in this spell [m/s^2].
        enter: when it enters the zone, None if its track ends before.
        cleared: when the other left the zone [s].
        arrival: when it would have entered at its free speed [s].
    """

    time: float
    place: tuple[float, float]
    begin: float
    lowest: float
    approach: float
    braking: float
    enter: float | None
    cleared: float
    arrival: float


def find_slowing_start(speed: FloatArray, lowest: int, *, ripple: float) -> int:
    """Sample at which the slowing that ends at `lowest` begins.

    Backwards from the lowest speed, as long as speed rises (ripples below `ripple` m/s aside); the
    last sample within 0.6 ripples of the peak found.
    """
    back = speed[lowest::-1]
    peak = np.maximum.accumulate(back)
    dips = np.flatnonzero(back < peak - ripple)
    top = peak[dips[0]] if len(dips) else peak[-1]
    return lowest - int(np.argmax(back >= top - 0.6 * ripple))


def compute_approach_speed(track: Trajectory, *, begin: int) -> float:
    """Largest speed in the 40 m (pedestrian 5 m) up to the sample where slowing begins [m/s]."""
    distance = LIMITS[track.type].approach
    before = track.s[: begin + 1] >= track.s[begin] - distance
    return float(track.speed[: begin + 1][before].max())


@dataclass(frozen=True, eq=False)
class FreeSpeedProfile:
    """What an agent would have driven for the road alone.

    Attributes:
        s: [P] arc length [m]; speed: [P] [m/s]; time: [P] of being there [s].
    """

    s: FloatArray
    speed: FloatArray
    time: FloatArray


def compute_free_speed_profile(track: Trajectory, *, begin: int) -> FreeSpeedProfile:
    """Free speed from the sample where slowing begins to the end of the path.

    min(approach speed, sqrt(3 / |curvature|)), reached with at most 2 m/s^2 either way, starting
    at the speed driven there.
    """
    path = track.path
    start = float(track.s[begin])
    keep = path.s > start + 1e-6
    s = np.concatenate(([start], path.s[keep]))
    curvature = compute_curvature(path)
    bend = np.abs(np.concatenate((curvature[~keep][-1:], curvature[keep])))
    approach = compute_approach_speed(track, begin=begin)
    cap = np.minimum(approach**2, CURVE_COMFORT / np.maximum(bend, 1e-6))
    # Squares of speed change by at most 2 * 2 m/s^2 per metre: running minima of w -/+ 4 s.
    climb = np.concatenate(([0.0], np.cumsum(2 * COMFORT * np.diff(s))))
    backward = np.minimum.accumulate((cap + climb)[::-1])[::-1] - climb
    backward[0] = min(backward[0], float(track.speed[begin]) ** 2)
    square = np.minimum.accumulate(backward - climb) + climb
    speed = np.sqrt(np.maximum(square, 0.01))
    time = np.concatenate(([0.0], np.cumsum(2 * np.diff(s) / (speed[1:] + speed[:-1]))))
    return FreeSpeedProfile(s, speed, track.times[begin] + time)


@dataclass(frozen=True)
class ZonePassage:
    """The giver and the zone that it may have left to the other first.

    Attributes:
        giver: with a guessed continuation after `real_end`, where that is given.
        stay, other: when the giver and the other are in the zone.
        red, leader, excused: whether a red or yellow light holds the giver in a span of time [s];
            another agent ahead in its lane, at a time; another one bound to it by a relation.
        on_crosswalk: whether the other is on the crosswalk of the zone at a time.
        real_end: end of the giver's own track [s], if what follows is a guess.
        other_start: when the other's track begins [s]: no agent slows for an absent one; None
            where that, and braking for one that has gone, is not checked.
    """

    giver: Trajectory
    stay: ZoneOccupancy
    other: ZoneOccupancy
    red: Callable[[float, float], bool]
    leader: Callable[[float], bool]
    excused: Callable[[float], bool]
    on_crosswalk: Callable[[float], bool]
    real_end: float | None = None
    other_start: float | None = None

    @property
    def until(self) -> float:
        """When the giver's wait is over at the latest: it enters, or its track ends [s]."""
        return self.stay.enter if self.real_end is None else self.real_end


def find_yield(passage: ZonePassage) -> YieldEvent | None:
    """Whether the giver let the other pass the zone, and why.

    Returns:
        The spell of slowing that meets every clause of SEMANTICS section 4 except clearance and
        PET, which belong to the pair; None if there is none.
    """
    stay, other = passage.stay, passage.other
    if other.ends_inside or stay.begins_inside or other.enter >= stay.enter:
        return None
    if passage.real_end is None and other.leave > stay.enter:
        return None
    if passage.real_end is not None and other.enter > passage.real_end + MARGIN:
        return None
    spells = (_check_slowing(passage, k) for k in _find_lowest_points(passage.giver, passage.until))
    return next((s for s in spells if s is not None), None)


def is_held_throughout(
    giver: Trajectory, until: float, red: Callable[[float, float], bool]
) -> bool:
    """Whether a light explains all of a giver's slowing up to a time, so that it does not yield.

    Needs no zone, and therefore little time; see `find_yield`.
    """
    times, last = giver.times, giver.index(until)
    for lowest in _find_lowest_points(giver, until):
        begin = find_slowing_start(giver.speed, lowest, ripple=LIMITS[giver.type].ripple)
        moments = {lowest, _find_standstill(giver, begin, lowest, last)[0]}
        if not all(red(float(times[begin]), float(times[k])) for k in moments):
            return False
    return True


def _find_lowest_points(giver: Trajectory, until: float) -> list[int]:
    """Samples of lowest speed, one for each spell of slowing, deepest first."""
    limits, last = LIMITS[giver.type], giver.index(until)
    speed = giver.speed[: last + 1]
    upstream = giver.s[last] - limits.upstream - giver.nose
    peak = np.maximum.accumulate(speed)
    deep = [
        k
        for k in find_valleys(speed, limits.ripple).tolist()
        if giver.s[k] >= upstream and speed[k] <= 0.6 * peak[k]
    ]
    return sorted(deep, key=lambda k: float(speed[k]))


@compiled
def find_valleys(speed: FloatArray, ripple: float) -> IntArray:
    """Samples of least speed between rises of at least `ripple` m/s; the first of equal ones."""
    found, count = np.empty(len(speed), np.intp), 0
    low, high, falling = 0, speed[0], True
    for k in range(len(speed)):
        if falling:
            low = k if speed[k] < speed[low] else low
            if speed[k] > speed[low] + ripple:
                found[count] = low
                count += 1
                falling, high = False, speed[k]
        else:
            high = max(high, speed[k])
            if speed[k] < high - ripple:
                falling, low = True, k
    if falling:
        found[count] = low
        count += 1
    return found[:count]


def _check_slowing(passage: ZonePassage, lowest: int) -> YieldEvent | None:
    giver, other, limits = passage.giver, passage.other, LIMITS[passage.giver.type]
    begin = find_slowing_start(giver.speed, lowest, ripple=limits.ripple)
    if (
        compute_approach_speed(giver, begin=begin) < limits.moving
        or giver.times[begin] >= other.leave
    ):
        return None
    drive = compute_free_speed_profile(giver, begin=begin)
    low = _find_slow_moment(passage, begin, lowest, drive)
    if low is None:
        return None
    # When it would have entered and left the zone at its free speed.
    s = np.interp((passage.stay.enter, passage.stay.leave), giver.times, giver.s)
    arrival, leaving = np.interp(s, drive.s, drive.time).tolist()
    leaving = np.inf if passage.stay.ends_inside else leaving
    caused = arrival <= other.leave + MARGIN and leaving >= other.enter - MARGIN
    if not (caused or passage.on_crosswalk(float(giver.times[begin]))):
        return None
    if passage.other_start is not None:
        # It slows for an agent not there yet, or is slowest once the other has gone.
        early = giver.times[begin] < passage.other_start - STEP / 2
        if early or giver.times[low] > other.leave + LATE + 1e-6:
            return None
    # It moves again within 4 s after the other cleared, or has an excuse not to.
    limit = other.leave + RESUME_WITHIN
    end = giver.end if passage.real_end is None else passage.real_end
    after = (giver.times > giver.times[low]) & (giver.times <= min(limit, end) + 1e-6)
    resumes = giver.speed[after & (giver.times >= other.leave)] > limits.resumed
    excused = end <= limit + 1e-6 or passage.red(other.leave, limit)
    if not (resumes.any() or excused or passage.excused(limit)):
        return None
    until = max(giver.index(passage.until), low) + 1
    x, y = giver.xy[low]
    found = YieldEvent(
        time=float(giver.times[low]), place=(float(x), float(y)),
        begin=float(giver.times[begin]), lowest=float(giver.speed[low:until].min()),
        approach=compute_approach_speed(giver, begin=begin),
        braking=float(-giver.acceleration[begin:until].min()),
        enter=passage.stay.enter if passage.real_end is None else None,
        cleared=passage.other.leave, arrival=arrival,
    )  # fmt: skip
    if passage.red(found.begin, found.time):
        return None
    # A queue in its own lane explains the slowing.
    last = max(found.time, min(found.cleared, found.enter or found.cleared))
    return None if passage.leader(found.time) and passage.leader(last) else found


def _find_slow_moment(
    passage: ZonePassage, begin: int, lowest: int, drive: FreeSpeedProfile
) -> int | None:
    """Start of standstill, or the lowest speed, if either is low enough upstream of the zone."""
    giver, limits = passage.giver, LIMITS[passage.giver.type]
    if giver.s[lowest] < np.interp(passage.stay.enter, giver.times, giver.s) - limits.upstream:
        return None
    first, after = _find_standstill(giver, begin, lowest, giver.index(passage.until))
    if giver.speed[lowest] <= STANDING and (after - first) * STEP >= STANDING_TIME - 1e-9:
        return first
    free = float(np.interp(giver.s[lowest], drive.s, drive.speed))
    return lowest if giver.speed[lowest] <= free / 2 else None


def _find_standstill(giver: Trajectory, begin: int, lowest: int, last: int) -> tuple[int, int]:
    """First and last sample of the standstill around the lowest speed, if it stands there."""
    moving = np.flatnonzero(giver.speed[begin : last + 1] > STANDING) + begin
    before, after = moving[moving < lowest], moving[moving > lowest]
    first = int(before[-1]) + 1 if len(before) else begin
    return first, int(after[0]) - 1 if len(after) else last


def is_leading(giver: Trajectory, other: Trajectory, *, time: float, before: float) -> bool:
    """Whether `other` is ahead of `giver` in its lane, near enough to hold it, and no faster.

    Near enough: 5 m, or 3 s at the giver's speed; and not already past arc length `before` [m] of
    the giver's path, where the zone begins.
    """
    if not other.start <= time <= other.end or other.is_vehicle != giver.is_vehicle:
        return False
    i, j = giver.index(time), other.index(time)
    away = other.xy[j] - giver.xy[i]
    if float(np.hypot(*away)) > 3.0 * float(giver.speed[i]) + 5.0 + giver.nose + other.nose:
        return False
    foot = project(other.xy[j], giver.path.extend(15.0))
    gap = float(foot.s) - float(giver.s[i]) - giver.nose - other.nose
    speed = float(giver.speed[i])
    return bool(
        -0.5 <= gap <= max(5.0, 3.0 * speed)
        and float(foot.s) - other.nose <= before + 0.5
        and foot.lateral < (giver.width + other.width) / 2
        and compute_angle_between(other.heading[j], foot.direction) <= np.deg2rad(30.0)
        and other.speed[j] <= speed + 1.0
    )
