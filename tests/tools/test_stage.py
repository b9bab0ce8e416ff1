"""Every clause, staged, against conditions computed independently by shapely."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from solver_actors import (
    BARE,
    CAR,
    EAST,
    NORTH,
    SOUTH,
    WESTBOUND,
    actor,
    brute_offsets,
    brute_pet,
    candidate,
    clearances,
    footprints,
    law,
    straight,
    walker,
)

from scenewright.scene.constraints import Contact, GivesWay, Headway, TimeGap
from scenewright.scene.track import STEP
from scenewright.tools.dsl_validator.impact import first_contact, least_clearance
from scenewright.tools.dsl_validator.stage import Stage, Staging, demands
from scenewright.tools.landmarks import Landmarks

CAR_1, CAR_2, CAR_3, WALKER = "vehicle-1", "vehicle-2", "vehicle-3", "pedestrian-1"
AT_LIGHT = Landmarks(line=45.0, crosswalks=(), group="avenue")

EASTWARDS = candidate(straight((-60.0, 0.0), EAST, 120.0))
NORTHWARDS = candidate(straight((0.0, -60.0), NORTH, 120.0), route=WESTBOUND, time_law=law(8.0))
FURTHER = candidate(straight((20.0, -60.0), NORTH, 120.0), route=WESTBOUND, time_law=law(9.0))
BEHIND = candidate(straight((-60.0, 0.0), EAST, 120.0))
ON_FOOT = walker(straight((5.0, 12.0), SOUTH, 24.0))


def stagings(clauses, candidates, *, marks=None, seed=0, most=4):
    marks = marks or dict.fromkeys(candidates, BARE)
    stage = Stage(candidates, marks, np.random.default_rng(seed))
    found = list(islice(stage.play(tuple(clauses), Staging()), most))
    assert found, "nothing was staged"
    return found


def upstream(of, zone) -> float:
    """Arc length at which the front of a straight driver or walker enters a zone."""
    path, shape = of.candidate.path, of.candidate.shape
    inside = [
        s
        for s, pose in zip(path.s, np.column_stack([path.xy, path.heading]), strict=True)
        if shapely.intersects(footprints(pose, shape), zone)[0]
    ]
    return min(inside)


def swept(of):
    return shapely.LineString(of.candidate.path.xy).buffer(
        of.candidate.shape.width / 2, cap_style="flat"
    )


@pytest.mark.parametrize("seed", range(4))
def test_contact_begins_when_it_says_and_not_before(seed):
    clause = Contact(first=CAR_1, second=CAR_2, kind="angle")
    for staging in stagings([clause], {CAR_1: EASTWARDS, CAR_2: NORTHWARDS}, seed=seed):
        a, b = staging.actors[CAR_1], staging.actors[CAR_2]
        [happening] = staging.happenings
        times, apart = clearances(a, b, step=0.01)
        assert (apart[times < happening.time - 0.03] > 0).all()
        assert (apart[times > happening.time + 0.01] <= 0).all()
        for each in (a, b):
            assert each.contact == happening.time
            assert happening.time - 1e-6 <= each.leaves <= happening.time + STEP
        touching = shapely.intersection(
            footprints(a.at(np.array([a.leaves])), CAR), footprints(b.at(np.array([b.leaves])), CAR)
        )[0]
        assert touching.distance(shapely.Point(happening.location)) < 1.0


def test_a_pedestrian_is_struck_by_a_moving_car():
    clause = Contact(first=CAR_1, second=WALKER, kind="pedestrian_strike")
    for staging in stagings([clause], {CAR_1: EASTWARDS, WALKER: ON_FOOT}):
        a, b = staging.actors[CAR_1], staging.actors[WALKER]
        time = staging.happenings[0].time
        times, apart = clearances(a, b, step=0.01)
        assert (apart[times < time - 0.03] > 0).all()
        assert (apart[times > time + 0.01] <= 0).all()
        speed = np.ptp(a.at(np.array([time - 0.1, time]))[:, 0]) / 0.1
        assert 2.0 <= speed <= 10.0 + 1e-6


def test_a_first_contact_is_described_as_seen():
    """The walker is in the middle of the lane as the car comes there, at its own speed."""
    car = actor(EASTWARDS)
    person = actor(ON_FOOT, enters=round(car.motion.time_at(63.0) - 12.0 / 1.4, 1))
    found = first_contact(car, person)
    assert found.kind == "pedestrian_strike"
    assert found.frontal
    assert found.speed == pytest.approx(10.0, abs=0.01)
    assert found.closing == pytest.approx(np.hypot(10.0, 1.4), abs=0.1)
    times, apart = clearances(car, person, step=0.01)
    assert found.time == pytest.approx(times[np.argmax(apart <= 0)], abs=0.02)


def test_a_speed_asked_for_is_braked_down_to():
    wanted = Contact(first=CAR_1, second=CAR_2, speed=6.0)
    for staging in stagings([wanted], {CAR_1: EASTWARDS, CAR_2: NORTHWARDS}):
        a, time = staging.actors[CAR_1], staging.happenings[0].time
        speed = np.ptp(a.at(np.array([time - 0.05, time]))[:, 0]) / 0.05
        assert speed == pytest.approx(6.0, abs=1.0)


def test_a_wish_for_a_speed_out_of_reach_stages_nothing():
    clause = Contact(first=CAR_1, second=CAR_2, speed=14.0)
    stage = Stage(
        {CAR_1: EASTWARDS, CAR_2: NORTHWARDS},
        dict.fromkeys((CAR_1, CAR_2), BARE),
        np.random.default_rng(0),
    )
    assert list(stage.play((clause,), Staging())) == []


def test_a_rear_end_is_the_follower_running_into_a_leader_that_stops():
    clause = Contact(first=CAR_1, second=CAR_2, kind="rear_end")
    marks = {CAR_1: AT_LIGHT, CAR_2: AT_LIGHT}
    seen_standing, reasons = 0, set()
    for staging in stagings([clause], {CAR_1: BEHIND, CAR_2: EASTWARDS}, marks=marks, most=40):
        a, b = staging.actors[CAR_1], staging.actors[CAR_2]
        time = staging.happenings[0].time
        reasons.add(b.stops[0].reason)
        around = np.array([time - 0.1, time])
        front, rear = a.at(around)[:, 0] + CAR.length / 2, b.at(around)[:, 0] - CAR.length / 2
        assert front[1] == pytest.approx(rear[1], abs=0.15)
        assert (np.ptp(front) - np.ptp(rear)) / 0.1 >= 1.2
        seen_standing += np.ptp(rear) < 1e-6
    assert seen_standing
    assert reasons == {"red_light", "brakes"}


@given(st.floats(0.4, 3.0), st.floats(0.05, 0.6), st.integers(0, 99))
@settings(max_examples=8)
def test_time_gap_is_the_pet_of_a_dense_scan(low, width, seed):
    clause = TimeGap(first=CAR_1, second=CAR_2, low=low, high=low + width)
    candidates = {CAR_1: EASTWARDS, CAR_2: NORTHWARDS}
    for staging in stagings([clause], candidates, seed=seed, most=2):
        a, b = staging.actors[CAR_1], staging.actors[CAR_2]
        assert low - 0.15 <= brute_pet(a, b) <= low + width + 0.15
        times, apart = clearances(a, b)
        assert apart.min() > 0.05
        clearance, when, _ = least_clearance(a, b)
        assert clearance == pytest.approx(apart.min(), abs=0.1)
        assert abs(when - times[np.argmin(apart)]) <= 0.15


@pytest.mark.parametrize("seed", range(3))
def test_headway_is_the_time_between_rear_and_front_at_one_place(seed):
    clause = Headway(first=CAR_1, second=CAR_2, low=1.0, high=2.0)
    for staging in stagings([clause], {CAR_1: BEHIND, CAR_2: EASTWARDS}, seed=seed):
        a, b = staging.actors[CAR_1], staging.actors[CAR_2]
        assert 0.9 <= a.enters - (b.enters + CAR.length / 10.0) <= 2.1
        times, apart = clearances(a, b)
        assert apart.min() > 0.5
        assert (a.at(times)[:, 0] < b.at(times)[:, 0]).all()
        assert np.ptp(times) >= 3.0


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("first", "second", "before"),
    [(NORTHWARDS, EASTWARDS, 20.0), (EASTWARDS, ON_FOOT, 20.0), (ON_FOOT, EASTWARDS, 5.0)],
    ids=["car to car", "car to walker", "walker to car"],
)
def test_who_gives_way_stands_upstream_until_the_other_has_left(first, second, before, seed):
    names = ("first-1", "second-1")
    names = (
        WALKER if first is ON_FOOT else CAR_1,
        WALKER if second is ON_FOOT else CAR_2,
    )
    clause = GivesWay(first=names[0], second=names[1])
    for staging in stagings([clause], dict(zip(names, (first, second), strict=True)), seed=seed):
        a, b = (staging.actors[name] for name in names)
        zone = shapely.intersection(swept(a), swept(b))
        times = np.arange(max(a.enters, b.enters), min(a.leaves, b.leaves), 0.05)
        in_zone = [
            shapely.distance(footprints(each.at(times), each.candidate.shape), zone)
            <= (0.3 if each.candidate.shape.type == "pedestrian" else 0.0)
            for each in (a, b)
        ]
        assert in_zone[0].any()
        assert in_zone[1].any()
        left = times[in_zone[1]].max()
        assert times[in_zone[0]].min() > left
        [stop] = a.stops
        s = a.motion.position(times - a.enters)
        standing = np.abs(s - stop.s) < 1e-6
        assert standing.sum() * 0.05 >= 0.5
        assert stop.until >= left
        ahead = upstream(a, zone) - stop.s
        assert 0.0 < ahead <= before
        assert clearances(a, b)[1].min() >= 0.3
        assert 0.5 <= brute_pet(a, b) <= 7.2


@pytest.mark.parametrize("seed", range(3))
def test_who_gives_way_would_have_been_in_the_way(seed):
    """Unheld, the two would have met within 2 s: the cause that a yield needs."""
    clause = GivesWay(first=CAR_1, second=CAR_2)
    for staging in stagings([clause], {CAR_1: NORTHWARDS, CAR_2: EASTWARDS}, seed=seed):
        unheld = actor(NORTHWARDS, enters=staging.actors[CAR_1].enters)
        assert np.abs(brute_offsets(unheld, staging.actors[CAR_2])).min() <= 2.0


def test_later_clauses_keep_the_agents_already_placed():
    clauses = [
        TimeGap(first=CAR_1, second=CAR_2, low=2.0, high=2.4),
        TimeGap(first=CAR_1, second=CAR_3, low=1.0, high=1.4),
    ]
    candidates = {CAR_1: EASTWARDS, CAR_2: NORTHWARDS, CAR_3: FURTHER}
    for staging in stagings(clauses, candidates):
        placed = staging.actors
        assert 1.85 <= brute_pet(placed[CAR_1], placed[CAR_2]) <= 2.55
        assert 0.85 <= brute_pet(placed[CAR_1], placed[CAR_3]) <= 1.55
        first, second = staging.happenings
        assert second.time > first.time


def test_a_clause_about_two_agents_already_placed_is_still_kept():
    """Three cars on three roads: two gaps fix the third, which is not 20 s."""
    slanting = candidate(straight((-45.0, -50.0), np.pi / 4, 140.0), time_law=law(9.0))
    candidates = {CAR_1: EASTWARDS, CAR_2: NORTHWARDS, CAR_3: slanting}
    clauses = (
        TimeGap(first=CAR_1, second=CAR_2, low=0.8, high=0.9),
        TimeGap(first=CAR_1, second=CAR_3, low=5.0, high=5.1),
        TimeGap(first=CAR_2, second=CAR_3, low=20.0, high=20.1),
    )
    stage = Stage(candidates, dict.fromkeys(candidates, BARE), np.random.default_rng(0))
    assert list(islice(stage.play(clauses, Staging()), 1)) == []


def test_everybody_obeys_but_who_runs_the_light():
    car = actor(EASTWARDS, enters=2.0, marks=AT_LIGHT)
    crosses = 2.0 + 4.5
    [green] = demands(car, violates=False, until=30.0)
    assert green.colours == ("green",)
    assert green.start <= crosses <= green.end
    [red] = demands(car, violates=True, until=30.0)
    assert red.colours == ("red",)
    assert red.start <= crosses <= red.end
    assert demands(car, violates=False, until=5.0) == ()
    assert demands(actor(EASTWARDS), violates=False, until=30.0) == ()


@given(st.integers(-100, 100))
@settings(max_examples=10)
def test_shifting_a_staging_shifts_everything(steps):
    clause = GivesWay(first=CAR_1, second=CAR_2)
    [staging] = stagings([clause], {CAR_1: NORTHWARDS, CAR_2: EASTWARDS}, most=1)
    later = staging.shifted(steps * STEP)
    for name, before in staging.actors.items():
        after = later.actors[name]
        assert after.enters == pytest.approx(before.enters + steps * STEP)
        times = np.arange(before.enters, before.leaves, 0.5)
        assert after.at(times + steps * STEP) == pytest.approx(before.at(times), abs=1e-6)
        for one, other in zip(before.stops, after.stops, strict=True):
            assert other.until - one.until == pytest.approx(steps * STEP)
    assert later.happenings[0].time - staging.happenings[0].time == pytest.approx(steps * STEP)
