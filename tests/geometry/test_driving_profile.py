"""Time laws against closed forms: when and where a motion is, and what it never does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.geometry.driving_profile import (
    StopCommand,
    compute_arrival,
    compute_motion,
    compute_squared_speed_limit,
    sample_track,
)
from scenewright.scene.selection import Slowing
from scenewright.scene.track import STEP
from solver_agents import NORTH, WALK_NORTH, bend, candidate, law, straight

SMOOTHED = 0.4
"""Half the smoothing window [s]: by so much starts and ends of a standstill are rounded off."""

ROAD = straight((0.0, 0.0), 0.0, 200.0)
SPEEDS = st.floats(3.0, 15.0)
RATES = st.floats(1.0, 3.0)


def accelerations(motion):
    return np.diff(motion.s, 2) / STEP**2


def test_constant_speed_is_left_alone():
    motion = compute_motion(candidate(ROAD, time_law=law(speed=10.0)))
    assert motion.s == pytest.approx(10.0 * STEP * np.arange(201), abs=1e-9)
    assert motion.speed == pytest.approx(np.full(201, 10.0))


def test_a_stop_comes_and_goes_as_by_hand():
    """From 10 m/s at 2.5 m/s^2: 20 m and 4 s of braking, so it stands at 100 m at 12 s."""
    hold = StopCommand(100.0, release=20.0)
    car = candidate(ROAD)
    motion = compute_motion(car, holds=(hold,))
    assert compute_arrival(car, hold) == pytest.approx(12.0, abs=1e-6)
    times = STEP * np.arange(len(motion.s))
    standing = (times >= 12.0 + SMOOTHED) & (times <= 20.0 - SMOOTHED)
    assert motion.s[standing] == pytest.approx(100.0, abs=1e-9)
    for time, s in ((5.0, 50.0), (10.0, 95.0), (22.0, 104.0), (24.0, 116.0), (30.0, 175.0)):
        assert motion.compute_positions(np.array([time])) == pytest.approx([s], abs=0.06)
    assert motion.s[times < 12.0 - SMOOTHED].max() < 100.0
    assert motion.s[times > 20.0 + SMOOTHED].min() > 100.0


def test_a_stop_may_brake_harder_than_the_law():
    motion = compute_motion(candidate(ROAD), holds=(StopCommand(100.0, 20.0, braking=5.0),))
    assert motion.compute_positions(np.array([8.5])) == pytest.approx([85.0], abs=0.01)
    assert accelerations(motion).min() == pytest.approx(-5.0, abs=0.01)


def test_who_arrives_after_the_release_still_comes_to_rest():
    motion = compute_motion(candidate(ROAD), holds=(StopCommand(100.0, 0.0),))
    at = round(12.0 / STEP)
    assert motion.s[at] == pytest.approx(100.0, abs=0.06)
    assert motion.speed[at] < 0.5


def test_two_holds_in_a_row_wait_for_one_another():
    holds = (StopCommand(60.0, 15.0), StopCommand(100.0, 30.0))
    car = candidate(ROAD)
    motion = compute_motion(car, holds=holds[::-1])
    assert motion.s[round(14.0 / STEP)] == pytest.approx(60.0, abs=1e-9)
    assert motion.s[round(29.0 / STEP)] == pytest.approx(100.0, abs=1e-9)
    # from rest over 40 m at +2 and -2.5 m/s^2: peak sqrt(2 * 40 / (1/2 + 1/2.5)) m/s
    peak = np.sqrt(2 * 40 / (1 / 2 + 1 / 2.5))
    expected = 15.0 + peak / 2 + peak / 2.5
    assert compute_arrival(car, holds[1], (holds[0],)) == pytest.approx(expected, abs=0.05)


@given(SPEEDS, RATES, RATES, st.floats(30.0, 150.0), st.floats(0.0, 30.0))
def test_braking_and_acceleration_stay_within_the_law(speed, gain, brake, s, release):
    car = candidate(ROAD, time_law=law(speed, gain, brake))
    hold = StopCommand(s, release)
    motion = compute_motion(car, holds=(hold,))
    change = accelerations(motion)
    assert change.max() <= gain + 0.05
    assert change.min() >= -brake - 0.05
    assert (np.diff(motion.s) >= -1e-12).all()
    assert motion.speed.max() <= speed + 1e-6
    free = s - speed**2 / (2 * brake)
    if free > 0:
        assert compute_arrival(car, hold) == pytest.approx(free / speed + speed / brake, abs=0.06)


@given(st.floats(20.0, 150.0), st.floats(2.0, 12.0))
def test_a_standstill_is_exact_from_arrival_to_release(s, stays):
    car = candidate(ROAD)
    arrives = compute_arrival(car, StopCommand(s, 0.0))
    motion = compute_motion(car, holds=(StopCommand(s, arrives + stays),))
    times = STEP * np.arange(len(motion.s))
    inside = (times >= arrives + SMOOTHED + 0.01) & (times <= arrives + stays - SMOOTHED - 0.01)
    assert motion.s[inside] == pytest.approx(s, abs=1e-9)
    assert (motion.s[times >= arrives + stays + STEP] > s).all()


def test_a_bend_is_taken_at_the_speed_its_curvature_allows():
    path = bend(60.0, 20.0, 60.0)
    motion = compute_motion(candidate(path, time_law=law(speed=12.0, lateral=2.0)))
    turn = 20.0 * np.pi / 2
    inside = (motion.s > 60.0 + 4.0) & (motion.s < 60.0 + turn - 4.0)
    assert motion.speed[inside] == pytest.approx(np.sqrt(2.0 * 20.0), abs=0.05)
    assert motion.speed[motion.s < 20.0] == pytest.approx(12.0)
    assert accelerations(motion).min() >= -2.5 - 0.05


def test_drivers_are_slowest_before_the_middle_of_a_bend_and_walkers_do_not_slow_for_one():
    """A short bend: its speed is kept from 6 m before it on, then rises towards its middle."""
    path = bend(60.0, 8.0, 60.0)
    tight = np.sqrt(2.0 * 8.0)
    early, late = (
        compute_motion(candidate(path, time_law=replace(law(speed=12.0, lateral=2.0), **more)))
        for more in ({}, {"foresight": 0.0})
    )
    assert np.interp(55.0, early.s, early.speed) < tight < np.interp(55.0, late.s, late.speed)
    middle = 60.0 + 8.0 * np.pi / 4
    assert early.s[early.speed.argmin()] < middle - 5.0
    on_foot = candidate(path, route=WALK_NORTH, time_law=law(speed=1.4, lateral=0.1))
    assert compute_squared_speed_limit(on_foot)[path.s < 58.0].min() == pytest.approx(1.4**2)


@given(st.floats(8.0, 40.0), SPEEDS, st.floats(1.5, 3.0))
def test_lateral_acceleration_stays_comfortable(radius, speed, lateral):
    path = bend(60.0, radius, 30.0)
    motion = compute_motion(candidate(path, time_law=law(speed, lateral=lateral)))
    curvature = np.interp(motion.s, path.s, path.curvature)
    # smoothing in time lets in at most a few tenths of a metre per second from the straight
    assert (motion.speed**2 * curvature).max() <= lateral * 1.2 + 0.2


def test_a_slowing_reaches_its_speed_and_goes_on():
    motion = compute_motion(candidate(ROAD), slowings=(Slowing(100.0, 4.0, 3.0),))
    at = motion.find_time_at(100.0)
    # 14 m and 2 s of braking from 10 m/s
    assert at == pytest.approx(8.6 + 2.0, abs=0.1)
    assert motion.speed.min() == pytest.approx(4.4, abs=0.1)
    assert abs(STEP * int(np.argmin(motion.speed)) - at) <= 0.2
    assert motion.speed[-1] == pytest.approx(10.0, abs=0.01)


@given(st.floats(0.5, 199.0))
def test_time_at_and_position_are_inverse(s):
    motion = compute_motion(candidate(ROAD), holds=(StopCommand(80.0, 15.0),))
    assert motion.compute_positions(np.array([motion.find_time_at(s)])) == pytest.approx(
        [s], abs=1e-6
    )


def test_what_is_never_reached_is_reached_at_no_time():
    assert compute_motion(candidate(ROAD)).find_time_at(201.0) == float("inf")


def test_spawned_mid_route_the_track_begins_where_it_then_is():
    track = sample_track(compute_motion(candidate(ROAD)), enters=-5.0, until=10.0)
    assert (track.start, track.end) == (0.0, 10.0)
    assert track.xy[0] == pytest.approx([50.0, 0.0])
    assert track.xy[-1] == pytest.approx([150.0, 0.0])


@given(st.integers(-250, 350), st.integers(100, 300))
def test_a_track_is_the_motion_cut_to_the_scene(enters, until):
    motion = compute_motion(candidate(straight((3.0, 7.0), NORTH, 200.0)))
    track = sample_track(motion, enters=enters * STEP, until=until * STEP)
    first, last = max(0, enters), min(until, enters + 200)
    if last - first < 1:
        assert track is None
        return
    assert track.start == pytest.approx(first * STEP)
    assert track.end == pytest.approx(last * STEP)
    assert track.xy[:, 1] == pytest.approx(7.0 + 10.0 * (track.times - enters * STEP), abs=6e-4)
    assert (np.round(track.xy, 3) == track.xy).all()


def test_a_cut_motion_ends_where_it_was():
    motion = compute_motion(candidate(ROAD)).cut(50)
    assert motion.ended
    assert len(motion.s) == 51
    assert motion.compute_positions(np.array([99.0])) == pytest.approx([50.0])
