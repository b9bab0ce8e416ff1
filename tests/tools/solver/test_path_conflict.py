"""Meetings of two motions against hand calculation, shapely and brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from scenewright.geometry.driving_profile import StopCommand, compute_motion
from scenewright.scene.track import PEDESTRIAN, Shape, get_vehicle_shape
from scenewright.tools.solver.path_conflict import (
    FOREVER,
    compute_clearance,
    compute_gap,
    find_close_nodes,
    find_conflict_intervals,
    find_path_conflict,
)
from solver_agents import (
    CAR,
    EAST,
    NORTH,
    actor,
    brute_offsets,
    candidate,
    distances,
    footprints,
    law,
    straight,
    walker,
)

CROSSING = (straight((-50.0, 0.0), EAST, 100.0), straight((0.0, -50.0), NORTH, 100.0))
FINE = (0.25, 0.25)
SHAPES = st.sampled_from(
    [PEDESTRIAN, CAR, get_vehicle_shape("bus"), get_vehicle_shape("motorcycle")]
)
POSES = st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-7, 7))


def offsets(a, b, *, c=0.0, exact=True, reach=0.1, spacing=FINE):
    pair = find_path_conflict(
        a.candidate.path,
        b.candidate.path,
        shapes=(a.candidate.shape, b.candidate.shape),
        reach=max(reach, c),
        spacing=spacing,
    )
    return find_conflict_intervals(pair, a, b, c=c, exact=exact)


@given(SHAPES, SHAPES, POSES, POSES)
@settings(max_examples=400)
def test_clearance_is_shapelys_distance_and_negative_only_inside(first, second, a, b):
    shapes = (first, second)
    mine = compute_clearance(np.array([a]), np.array([b]), shapes=shapes)[0]
    true = distances(np.array([a]), np.array([b]), shapes)[0]
    if true > 1e-9:
        assert mine == pytest.approx(true, abs=1e-9)
    elif "pedestrian" in (first.type, second.type):
        assert mine <= 1e-9
    else:
        shared = shapely.intersection(footprints(a, first), footprints(b, second))[0]
        assert mine <= 1e-9
        assert (mine < 0) == (shared.area > 1e-12) or abs(mine) < 1e-9


@given(SHAPES, SHAPES, POSES, POSES, st.floats(-3, 3))
def test_clearance_is_symmetric_and_turns_with_the_world(first, second, a, b, turn):
    def turned(pose):
        x, y, heading = pose
        cos, sin = np.cos(turn), np.sin(turn)
        return np.array([[x * cos - y * sin, x * sin + y * cos, heading + turn]])

    one = compute_clearance(np.array([a]), np.array([b]), shapes=(first, second))
    other = compute_clearance(turned(b), turned(a), shapes=(second, first))
    if one[0] > 0:
        assert other == pytest.approx(one, abs=1e-9)
    else:
        assert other[0] <= 1e-9


@pytest.mark.parametrize(
    ("spot", "expected"),
    [((3.3, 0.0), 0.7), ((0.0, 1.925), 0.7), ((5.3, 4.925), 4.7), ((-2.3, 0.0), -0.3)],
)
def test_a_disc_beside_a_box(spot, expected):
    box, disc = np.array([[0.0, 0.0, 0.0]]), np.array([[*spot, 0.0]])
    assert compute_clearance(box, disc, shapes=(CAR, PEDESTRIAN)) == pytest.approx([expected])
    assert compute_clearance(disc, box, shapes=(PEDESTRIAN, CAR)) == pytest.approx([expected])


@given(
    st.floats(4.0, 15.0),
    st.floats(4.0, 15.0),
    st.floats(3.0, 12.0),
    st.floats(3.0, 12.0),
    st.floats(0.6, 2.5),
    st.floats(0.6, 2.5),
)
def test_perpendicular_crossing_by_hand(v_a, v_b, long_a, long_b, wide_a, wide_b):
    """They overlap while a is within (L_a + W_b) / 2 of the middle, b within (L_b + W_a) / 2."""
    a = compute_motion(
        candidate(CROSSING[0], time_law=law(v_a), shape=Shape("vehicle", long_a, wide_a))
    )
    b = compute_motion(
        candidate(CROSSING[1], time_law=law(v_b), shape=Shape("vehicle", long_b, wide_b))
    )
    half_a, half_b = (long_a + wide_b) / 2, (long_b + wide_a) / 2
    low = (50 - half_a) / v_a - (50 + half_b) / v_b
    high = (50 + half_a) / v_a - (50 - half_b) / v_b
    slack = 0.25 / v_a + 0.25 / v_b + 0.01
    [[measured_low, measured_high]] = offsets(a, b)
    assert low - 0.01 <= measured_low <= low + slack
    assert high - slack <= measured_high <= high + 0.01
    [[safe_low, safe_high]] = offsets(a, b, exact=False)
    assert low - slack <= safe_low <= low + slack / 2
    assert high - slack / 2 <= safe_high <= high + slack


def test_the_set_grows_with_the_clearance():
    a, b = (compute_motion(candidate(path)) for path in CROSSING)
    widths = [float(np.ptp(offsets(a, b, c=c))) for c in (0.0, 0.5, 1.0, 2.0)]
    assert widths == sorted(widths)
    # 1 m on either side of both at 10 m/s
    assert widths[2] - widths[0] == pytest.approx(0.4, abs=0.12)


def test_in_one_lane_they_meet_unless_a_length_apart():
    a = b = compute_motion(candidate(straight((0.0, 0.0), EAST, 100.0), time_law=law(8.0)))
    [[low, high]] = offsets(a, b)
    assert (low, high) == pytest.approx((-CAR.length / 8, CAR.length / 8), abs=0.04)


def test_roads_apart_never_meet():
    a = compute_motion(candidate(straight((0.0, 0.0), EAST, 100.0)))
    b = compute_motion(candidate(straight((0.0, 3.5), EAST, 100.0)))
    assert offsets(a, b).shape == (0, 2)
    assert offsets(a, b, c=1.5).shape == (0, 2)
    assert len(offsets(a, b, c=1.7))
    assert compute_gap(offsets(a, b), 0.0) == float("inf")


def test_who_stands_in_the_way_is_met_for_as_long():
    car, other = candidate(CROSSING[0]), compute_motion(candidate(CROSSING[1]))
    held = compute_motion(car, holds=(StopCommand(50.0, release=40.0),))
    half = (CAR.length + CAR.width) / 2
    met = offsets(held, other)
    into, out = (50 - half) / 10, (50 + half) / 10
    assert met[0, 0] == pytest.approx(held.find_time_at(50 - half) - out, abs=0.1)
    assert met[-1, 1] == pytest.approx(held.find_time_at(50 + half) - into, abs=0.1)
    assert met[-1, 1] > 40.0 - into
    between = np.linspace(met[0, 0], met[-1, 1], 200)
    assert max(compute_gap(met, delta) for delta in between) < 0.3
    assert len(offsets(held, other, exact=False)) == 1


def test_a_wreck_stays_in_the_way_for_good():
    wreck = compute_motion(candidate(CROSSING[0])).cut(50)
    other = compute_motion(candidate(CROSSING[1]))
    met = offsets(wreck, other, exact=False)
    assert compute_gap(met, 300.0) == 0.0
    assert compute_gap(met, FOREVER / 2) == 0.0
    assert compute_gap(met, -20.0) > 10.0


def test_who_ends_before_the_crossing_is_never_met():
    wreck = compute_motion(candidate(CROSSING[0])).cut(30)
    assert not len(offsets(wreck, compute_motion(candidate(CROSSING[1])), exact=False))


@given(st.floats(0.5, 2.6), st.floats(4.0, 12.0), st.floats(4.0, 12.0), st.floats(-8.0, 8.0))
@settings(max_examples=10)
def test_pet_is_what_a_dense_scan_finds(angle, v_a, v_b, delta):
    a = actor(candidate(straight((-30.0, 0.0), EAST, 60.0), time_law=law(v_a)))
    start = (-30.0 * np.cos(angle), -30.0 * np.sin(angle))
    b = actor(candidate(straight(start, angle, 60.0), time_law=law(v_b)))
    found = brute_offsets(a, b, step=0.04)
    expected = float(np.abs(found - delta).min())
    measured = compute_gap(offsets(a.motion, b.motion), delta)
    assert measured == pytest.approx(expected, abs=0.12)


@given(st.floats(0.0, 30.0), st.floats(20.0, 28.0))
@settings(max_examples=10)
def test_the_safe_set_misses_no_meeting_with_somebody_who_waits(release, stands):
    """At the crowd's spacing, C(0.8) holds every meeting within the 0.5 m of the certificate."""
    car = candidate(straight((-30.0, 0.0), EAST, 60.0))
    a = replace(actor(car), motion=compute_motion(car, holds=(StopCommand(stands, release),)))
    b = actor(walker(straight((0.0, -8.0), NORTH, 16.0)))
    met = offsets(a.motion, b.motion, c=0.8, exact=False, spacing=(0.6, 0.25))
    found = brute_offsets(a, b, within=0.5, step=0.1)
    assert max(compute_gap(met, each) for each in found[:: max(1, len(found) // 300)]) == 0.0
    wide = brute_offsets(a, b, within=1.6, step=0.1)
    assert all(np.abs(wide - edge).min() < 0.3 for edge in met.ravel())


def test_only_the_start_of_a_shared_lane_is_the_conflict():
    lane = straight((0.0, 0.0), EAST, 100.0)
    pair = find_path_conflict(lane, lane, shapes=(CAR, CAR), reach=0.0)
    first = pair.keep_first_metres(5.0)
    assert first.s_a[first.i].max() <= 5.0
    assert pair.s_a[pair.i].max() == 100.0


@given(st.lists(st.tuples(st.floats(-50, 50), st.floats(0, 5)), min_size=1), st.floats(-60, 60))
def test_gap_to_is_the_distance_from_a_union(spans, delta):
    intervals = np.array([(low, low + width) for low, width in spans])
    expected = min(max(low - delta, delta - high, 0.0) for low, high in intervals)
    assert compute_gap(intervals, delta) == pytest.approx(expected)


@given(
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=3, max_size=40),
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=3, max_size=40),
    st.floats(0.5, 12.0),
)
@settings(max_examples=200)
def test_no_close_pair_of_nodes_is_skipped(way_a, way_b, radius):
    a, b = (np.cumsum(np.array(way), axis=0).T for way in (way_a, way_b))
    steps = tuple(max(float(np.hypot(*np.diff(nodes, axis=1)).max()), 0.1) for nodes in (a, b))
    away = np.hypot(a[0][:, None] - b[0], a[1][:, None] - b[1])
    found = set(
        zip(*(each.tolist() for each in find_close_nodes(a, b, radius, steps)), strict=True)
    )
    must = set(zip(*(each.tolist() for each in np.nonzero(away <= radius)), strict=True))
    may = set(zip(*(each.tolist() for each in np.nonzero(away <= radius + 0.011)), strict=True))
    assert must <= found <= may
