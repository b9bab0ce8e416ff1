"""The measures below the events, against answers worked out by hand or by brute force."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import given, settings
from hypothesis import strategies as st

from checker_tracks import EAST, NORTH, WEST, along, bend, distance, line, mirrored, moved, walk
from scenewright.tools.relation_checker import (
    RoadUser,
    Trajectory,
    build_pair_grid,
    build_trajectories,
    build_trajectory,
    compute_approach_speed,
    compute_clearance,
    compute_drac,
    compute_free_speed_profile,
    compute_path_ttc,
    compute_pet,
    compute_ttc_2d,
    find_conflict_zones,
    find_first_contact,
    find_followings,
    find_least_clearance,
    find_zone_occupancy,
    measure_lane_gaps,
)
from scenewright.tools.relation_checker.events import observe


def cars(lag: float = 2.0) -> tuple[Trajectory, ...]:
    s = distance(10.0, (0.0, 12.0))
    return build_trajectories(
        [line(1, (-50.0, 0.0), EAST, s), line(2, (0.0, -50.0 - 10 * lag), NORTH, s)]
    )


def test_clearance_of_parallel_cars_is_the_gap_between_their_sides() -> None:
    s = distance(10.0, (0.0, 5.0))
    one, two = build_trajectories([line(1, (0.0, 0.0), EAST, s), line(2, (1.0, 3.0), EAST, s)])
    assert compute_clearance(one, two, times=np.array([1.0, 2.5])) == pytest.approx(
        3.0 - 1.85, abs=2e-3
    )


def test_closest_approach_of_a_car_and_a_walker() -> None:
    # side of the car at y = 0.925, walker's disc stands at y = 3
    car = line(1, (-30.0, 0.0), EAST, distance(9.3, (0.0, 7.0)))
    one, two = build_trajectories([car, walk(2, (0.0, 3.0), WEST, np.zeros(71))])
    found = find_least_clearance(one, two)
    assert found is not None
    assert found[1] == pytest.approx(3.0 - 0.925 - 0.3, abs=2e-3)


def test_contact_time_between_samples() -> None:
    # gap 0 when -20 + 7.3 t + 4.6 = 0
    car = line(1, (-20.0, 0.0), EAST, distance(7.3, (0.0, 4.0)))
    one, two = build_trajectories([car, line(2, (0.0, 0.0), EAST, np.zeros(41))])
    contact = find_first_contact(one, two)
    assert contact is not None
    assert contact.time == pytest.approx(15.4 / 7.3, abs=2e-3)


def test_the_conflict_zone_of_crossing_lanes_is_a_square() -> None:
    one, two = cars()
    (zone,) = find_conflict_zones(one, two)
    assert zone.bounds == pytest.approx((-0.925, -0.925, 0.925, 0.925), abs=1e-6)
    stay = find_zone_occupancy(one, zone)
    assert stay is not None
    # front at -47.7 + 10 t touches -0.925; rear at -52.3 + 10 t leaves 0.925
    assert (stay.enter, stay.leave) == pytest.approx((4.6775, 5.3225), abs=0.011)


def test_a_merge_is_a_conflict_zone_for_five_metres_only() -> None:
    straight = line(1, (-40.0, 0.0), EAST, distance(8.0, (0.0, 14.0)))
    path = bend((0.0, -40.0), NORTH, 32.0, 8.0, -np.pi / 2, 60.0)
    one, two = build_trajectories([straight, along(2, path, distance(8.0, (0.0, 13.0)))])
    (zone,) = find_conflict_zones(one, two)
    west, _, east, _ = zone.bounds
    assert east - west == pytest.approx(5.0, abs=0.1)


def test_one_lane_has_no_conflict_zone_and_no_pet() -> None:
    s = distance(10.0, (0.0, 10.0))
    one, two = build_trajectories([line(1, (-50.0, 0.0), EAST, s), line(2, (-62.0, 0.0), EAST, s)])
    assert find_conflict_zones(one, two) == ()
    assert compute_pet(one, two) is None


def test_pet_of_a_merge_counts_where_the_paths_join() -> None:
    # the turning car is on the same spot 2.0 s later; both drive 8 m/s
    straight = line(1, (-40.0, 0.0), EAST, distance(8.0, (0.0, 14.0)))
    path = bend((0.0, -40.0), NORTH, 32.0, 8.0, -np.pi / 2, 60.0)
    before = 32.0 + 8.0 * np.pi / 2
    delay = (48.0 - before) / 8.0 + 2.0
    one, two = build_trajectories(
        [straight, along(2, path, distance(8.0, (0.0, 13.0)), at=round(delay, 1))]
    )
    pet = compute_pet(one, two)
    assert pet is not None
    assert 2.0 - 4.6 / 8.0 - 0.25 < pet < 2.0


def test_paths_that_never_meet_have_no_pet() -> None:
    s = distance(10.0, (0.0, 10.0))
    one, two = build_trajectories([line(1, (0.0, 0.0), EAST, s), line(2, (0.0, 10.0), EAST, s)])
    assert compute_pet(one, two) is None


def test_time_to_contact_by_hand() -> None:
    slow = line(1, (0.0, 0.0), EAST, distance(4.0, (0.0, 6.0)))
    fast = line(2, (-30.0, 0.0), EAST, distance(10.0, (0.0, 4.0)))
    one, two = build_trajectories([slow, fast])
    at = np.array([1.0])
    expected = (30.0 - 6.0 - 4.6) / 6.0
    assert compute_path_ttc(one, two, times=at) == pytest.approx(expected, abs=0.02)
    assert compute_ttc_2d(one, two, times=at) == pytest.approx(expected, abs=0.02)
    assert compute_drac(one, two, times=at) == pytest.approx(6.0 / (2 * expected), abs=0.02)


def test_path_ttc_follows_the_bend_where_straight_lines_would_miss() -> None:
    path = bend((-20.0, 0.0), EAST, 20.0, 10.0, np.pi / 2, 40.0)
    turning = along(1, path, distance(6.0, (0.0, 9.0)))
    parked = line(2, (10.0, 25.0), NORTH, np.zeros(91))
    one, two = build_trajectories([turning, parked])
    at = np.array([1.0])
    gap = 20.0 + 10.0 * np.pi / 2 + 15.0 - 6.0 - 4.6
    assert compute_path_ttc(one, two, times=at, horizon=8.0) == pytest.approx(gap / 6.0, abs=0.03)
    assert np.isinf(compute_ttc_2d(one, two, times=at, horizon=8.0)).all()


def test_headway_is_the_gap_over_the_followers_speed() -> None:
    s = distance(8.0, (0.0, 6.0))
    tracks = build_trajectories([line(1, (0.0, 0.0), EAST, s), line(2, (-16.6, 0.0), EAST, s)])
    (lane,) = measure_lane_gaps(build_pair_grid(tracks))
    assert lane.follower == 1
    assert lane.headway == pytest.approx(1.5, abs=0.01)
    (found,) = find_followings((lane,))
    assert (found.leader, found.start, found.end) == (0, 0.0, pytest.approx(6.0))


@pytest.mark.parametrize(("seconds", "metres"), [(2.6, 16.6), (6.0, 6.0), (6.0, 45.0)])
def test_too_short_too_close_or_too_far_is_not_following(seconds: float, metres: float) -> None:
    s = distance(8.0, (0.0, seconds))
    tracks = build_trajectories([line(1, (0.0, 0.0), EAST, s), line(2, (-metres, 0.0), EAST, s)])
    assert find_followings(measure_lane_gaps(build_pair_grid(tracks))) == ()


def test_free_speed_in_a_bend_is_limited_by_comfort() -> None:
    path = bend((-50.0, 0.0), EAST, 50.0, 12.0, np.pi / 2, 40.0)
    track = build_trajectory(along(1, path, distance(10.0, (0.0, 10.0))))
    drive = compute_free_speed_profile(track, begin=1)
    inside = (drive.s > 52.0) & (drive.s < 66.0)
    assert drive.speed[inside] == pytest.approx(np.sqrt(3.0 * 12.0), rel=0.05)
    # braking at 2 m/s^2 before it, and no faster than the approach
    before = np.interp(50.0 - 16.0, drive.s, drive.speed)
    assert before == pytest.approx(np.sqrt(min(100.0, 36.0 + 4.0 * 16.0)), rel=0.05)
    assert drive.speed.max() <= 10.05


def test_approach_speed_looks_back_forty_metres() -> None:
    track = build_trajectory(line(1, (0.0, 0.0), EAST, distance(12.0, (-2.0, 2.0), (0.0, 10.0))))
    assert compute_approach_speed(track, begin=110) == pytest.approx(8.0, abs=0.01)
    assert compute_approach_speed(track, begin=30) == pytest.approx(12.0, abs=0.15)


angles = st.floats(0.0, 6.28)
speeds = st.floats(1.0, 14.0)


def crossing_users(angle: float, one: float, two: float, lag: float) -> list[RoadUser]:
    """Two cars through the origin, at 0 and at `angle`, `lag` seconds apart."""
    begin = np.array((np.cos(angle), np.sin(angle))) * -two * (4.0 + lag)
    return [
        line(1, (-one * 4.0, 0.0), EAST, distance(one, (0.0, 9.0))),
        line(2, (float(begin[0]), float(begin[1])), angle, distance(two, (0.0, 9.0))),
    ]


@settings(max_examples=40, deadline=None, derandomize=True)
@given(angles, speeds, speeds, st.floats(-2.0, 2.0), angles)
def test_pet_is_symmetric_and_blind_to_where_north_is(
    angle: float, one: float, two: float, lag: float, turn: float
) -> None:
    users = crossing_users(angle, one, two, lag)
    pet = compute_pet(*build_trajectories(users))
    assert compute_pet(*build_trajectories(users[::-1])) == pet
    for other in ([moved(u, turn=turn) for u in users], [mirrored(u) for u in users]):
        again = compute_pet(*build_trajectories(other))
        assert (again is None) == (pet is None)
        assert again is None or again == pytest.approx(pet, abs=0.05)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.floats(0.6, 2.5), speeds, speeds, st.floats(-2.0, 2.0))
def test_pet_against_every_pair_of_times(angle: float, one: float, two: float, lag: float) -> None:
    tracks = build_trajectories(crossing_users(angle, one, two, lag))
    shapes = []
    for track in tracks:
        times = np.arange(track.start, track.end, 0.04)
        xy, heading = track.at(times)
        box = shapely.box(-2.3, -0.925, 2.3, 0.925)
        boxes = [
            shapely.affinity.translate(
                shapely.affinity.rotate(box, h, (0, 0), use_radians=True), *p
            )
            for h, p in zip(heading, xy, strict=True)
        ]
        shapes.append((times, np.array(boxes)))
    i, j = shapely.STRtree(shapes[0][1]).query(shapes[1][1], predicate="intersects")[::-1]
    expected = np.abs(shapes[0][0][i] - shapes[1][0][j]).min() if len(i) else None
    pet = compute_pet(*tracks)
    assert (pet is None) == (expected is None)
    assert expected is None or pet == pytest.approx(expected, abs=0.09)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(angles, speeds, speeds, st.floats(-0.4, 0.4))
def test_contact_and_zero_pet_go_together(angle: float, one: float, two: float, lag: float) -> None:
    tracks = build_trajectories(crossing_users(angle, one, two, lag))
    contact = find_first_contact(*tracks)
    pet = compute_pet(*tracks)
    shared = np.deg2rad(31.0)  # within 30 degrees they are in one lane: headway, no PET
    if contact is not None and shared < angle < 2 * np.pi - shared:
        assert pet == pytest.approx(0.0, abs=0.03)


def test_walkers_that_pass_closely_are_an_event_only_if_asked_for() -> None:
    """One walks east, the other north across its way 0.8 s later."""
    way = distance(1.4, (0.0, 8.0))
    users = [walk(1, (0.0, 0.0), EAST, way), walk(2, (5.0, -6.12), NORTH, way)]
    assert not observe(users).events
    (event,) = observe(users, asked=[(1, 2)]).events
    assert (event.type, event.kind) == ("near_miss", None)
    assert event.evidence["pet"] <= 1.5
