"""What is computed for many movers in one pass is what each of them gives alone."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from checker_tracks import EAST, NORTH, along, bend, distance, light, line, plus_map, walk
from scenewright.tools.relation_checker import (
    RoadUser,
    build_pair_grid,
    build_trajectories,
    build_trajectory,
    measure_lane_gaps,
)
from scenewright.tools.relation_checker.signals import SignalPlan
from scenewright.tools.relation_checker.track_path import (
    TrackPath,
    project,
    project_on_lane,
)
from scenewright.tools.relation_checker.trajectory import get_lane_table

LENGTHS = st.lists(st.integers(1, 30), min_size=1, max_size=6)


def wanderers(lengths: list[int], seed: int) -> list[RoadUser]:
    """Cars on wandering tracks of given numbers of samples; every third one mostly stands."""
    rng = np.random.default_rng(seed)
    users = []
    for n, length in enumerate(lengths):
        turn = np.cumsum(rng.normal(0.0, 0.3, length)) + rng.uniform(-4.0, 4.0)
        steps = rng.uniform(0.0, 1.2, length) * (rng.random(length) > (0.9 if n % 3 == 2 else 0.2))
        way = np.cumsum(steps[:, None] * np.stack((np.cos(turn), np.sin(turn)), axis=1), axis=0)
        user = line(n, (0.0, 0.0), 0.0, np.zeros(length), at=0.1 * n)
        track = type(user.track)(np.round(way, 3), np.unwrap(turn), user.track.start)
        users.append(RoadUser(n, track, user.shape))
    return users


@given(LENGTHS, st.integers(0, 10_000))
def test_kinematics_paths_and_lanes(lengths: list[int], seed: int) -> None:
    users = wanderers(lengths, seed)
    tracks = build_trajectories(users)
    lanes = get_lane_table(tracks)
    for n, (together, user) in enumerate(zip(tracks, users, strict=True)):
        alone = build_trajectory(user)
        for name in ("steps", "velocity", "speed", "acceleration", "lateral_acceleration"):
            np.testing.assert_array_equal(getattr(together, name), getattr(alone, name), name)
        lane, own = slice(lanes.begin[n], lanes.begin[n + 1]), get_lane_table((alone,))
        for values, expected in (
            (together.path.xy, alone.path.xy), (together.path.s, alone.path.s),
            (lanes.x[lane], own.x), (lanes.y[lane], own.y), (lanes.s[lane], own.s),
        ):  # fmt: skip
            np.testing.assert_allclose(values, expected, atol=1e-9)
        assert len(together.path.direction) == len(alone.path.direction)
        assert len(lanes.direction[lane]) == len(own.direction)


@given(LENGTHS, st.integers(0, 10_000))
def test_a_path_goes_through_its_track(lengths: list[int], seed: int) -> None:
    for track in build_trajectories(wanderers(lengths, seed)):
        path = track.path
        if track.s[-1] < 0.05:
            assert len(path.s) == 1
            continue
        assert path.s[-1] == pytest.approx(track.s[-1])
        for k in (0, 1):
            expected = np.interp(path.s, track.s, track.xy[:, k])
            np.testing.assert_allclose(path.xy[:, k], expected, atol=2e-4)


def test_the_acceleration_at_the_ends_is_that_of_the_nearest_fifth_of_a_second() -> None:
    (track,) = build_trajectories([line(1, (0.0, 0.0), EAST, distance(2.0, (1.5, 3.0)))])
    assert track.acceleration == pytest.approx(np.full(len(track), 1.5), abs=0.06)
    for phases, ends in (
        (((0.0, 3.0), (-12.0, 0.3)), slice(-3, None)),
        (((-12.0, 0.3), (0.0, 3.0)), slice(0, 3)),
    ):
        (track,) = build_trajectories([line(1, (0.0, 0.0), EAST, distance(10.0, *phases))])
        assert track.acceleration[ends] == pytest.approx(np.full(3, -10.5), abs=0.06)


@given(st.integers(0, 10_000))
def test_each_point_on_a_lane_of_its_own(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turning = along(1, bend((-20.0, 0.0), EAST, 20.0, 10.0, 1.5, 30.0), distance(6.0, (0.0, 9.0)))
    straight = line(2, (3.0, -40.0), NORTH, distance(8.0, (0.0, 9.0)))
    table = get_lane_table(build_trajectories([turning, straight]))
    ends = (slice(*ends) for ends in pairwise(table.begin))
    points = np.stack((table.x, table.y), axis=1)
    lanes = [TrackPath(table.s[k], points[k], table.direction[k]) for k in ends]
    for x, y in rng.uniform(-40.0, 40.0, (60, 2)):
        n = int(rng.integers(0, 2))
        s, lateral, direction = project_on_lane(x, y, table, n, 5.0)
        one = project(np.array((x, y)), lanes[n])
        if one.lateral < 5.0:
            assert s == pytest.approx(float(one.s))
            assert lateral == pytest.approx(float(one.lateral))
            assert direction == pytest.approx(float(one.direction))
        else:
            assert lateral >= 5.0


def test_gaps_in_one_lane_do_not_depend_on_who_else_is_there() -> None:
    s = distance(8.0, (0.0, 6.0))
    pair = [line(1, (0.0, 0.0), EAST, s), line(2, (-16.6, 0.0), EAST, s, at=0.3)]
    others = [line(3, (0.0, 30.0), EAST, s), line(4, (-12.0, 30.0), EAST, s), walk(5, (0, 9), 0, s)]
    (alone,) = measure_lane_gaps(build_pair_grid(build_trajectories(pair)))
    second, _ = measure_lane_gaps(
        build_pair_grid(build_trajectories([*others[:1], *pair, *others[1:]]))
    )
    assert (alone.follower, second.follower) == (1, 2)
    np.testing.assert_allclose(alone.times, second.times)
    np.testing.assert_allclose(alone.gap, second.gap)
    assert second.leader.tolist() == np.where(alone.leader == 0, 1, -1).tolist()
    assert (second.leader == 1).sum() > 20


def test_crossings_of_many_are_those_of_each() -> None:
    ground, s = plus_map(), distance(9.0, (0.0, 12.0))
    plan = [light("green", 0.0, 30.0), light("green", 0.0, 30.0, crosswalk=True)]
    users = [
        *(line(n, (-60.0 - 7.0 * n, -1.75), EAST, s) for n in range(4)),
        *(walk(n, (x, -9.0), NORTH, s / 6) for n, x in enumerate((-8.0, -9.0, 40.0), start=4)),
    ]
    tracks, together = build_trajectories(users), SignalPlan(plan, ground)
    for track in tracks:
        assert together.find_crossings(track) == SignalPlan(plan, ground).find_crossings(track)
    # the front, 2.3 m ahead of the centre, reaches the line at x = -12 after 45.7 + 7 n metres
    times = [c.time for track in tracks[:4] for c in together.find_crossings(track)]
    assert times == pytest.approx([(45.7 + 7.0 * n) / 9.0 for n in range(4)], abs=2e-3)
    assert [len(together.find_crossings(track)) for track in tracks[4:]] == [1, 1, 0]
