"""Every clause, staged, against conditions computed independently by shapely."""

from __future__ import annotations

from itertools import islice, permutations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.constraints import BrakesFor, Contact, GivesWay, Headway, TimeGap
from scenewright.scene.track import STEP, get_vehicle_shape
from scenewright.tools.solver.context import FailureStage, NearestMiss, NearestMisses, SolverContext
from scenewright.tools.solver.foreground import ForegroundSolver
from scenewright.tools.solver.impact import (
    find_first_contact,
    find_least_clearance,
    name_impact_points,
)
from scenewright.tools.solver.red_lights import list_signal_demands
from scenewright.tools.solver.scheduled_agent import PartialSchedule
from solver_agents import (
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

CAR_1, CAR_2, CAR_3, WALKER = "vehicle-1", "vehicle-2", "vehicle-3", "pedestrian-1"
AT_LIGHT = Landmarks(line=45.0, crosswalks=(), group="avenue")

EASTWARDS = candidate(straight((-60.0, 0.0), EAST, 120.0))
NORTHWARDS = candidate(straight((0.0, -60.0), NORTH, 120.0), route=WESTBOUND, time_law=law(8.0))
FURTHER = candidate(straight((20.0, -60.0), NORTH, 120.0), route=WESTBOUND, time_law=law(9.0))
BEHIND = candidate(straight((-60.0, 0.0), EAST, 120.0))
ON_FOOT = walker(straight((5.0, 12.0), SOUTH, 24.0))


def stagings(clauses, candidates, *, landmarks=None, seed=0, most=4):
    landmarks = landmarks or dict.fromkeys(candidates, BARE)
    stage = ForegroundSolver(SolverContext(candidates, landmarks, np.random.default_rng(seed)))
    found = list(islice(stage.schedule_all(tuple(clauses), PartialSchedule()), most))
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
    for schedule in stagings([clause], {CAR_1: EASTWARDS, CAR_2: NORTHWARDS}, seed=seed):
        a, b = schedule.actors[CAR_1], schedule.actors[CAR_2]
        [event] = schedule.events
        times, apart = clearances(a, b, step=0.01)
        assert (apart[times < event.time - 0.03] > 0).all()
        assert (apart[times > event.time + 0.01] <= 0).all()
        for each in (a, b):
            assert each.contact == event.time
            assert event.time - 1e-6 <= each.leaves <= event.time + STEP
        touching = shapely.intersection(
            footprints(a.get_poses(np.array([a.leaves])), CAR),
            footprints(b.get_poses(np.array([b.leaves])), CAR),
        )[0]
        assert touching.distance(shapely.Point(event.location)) < 1.0


def test_a_pedestrian_is_struck_by_a_moving_car():
    clause = Contact(first=CAR_1, second=WALKER, kind="pedestrian_strike")
    for schedule in stagings([clause], {CAR_1: EASTWARDS, WALKER: ON_FOOT}):
        a, b = schedule.actors[CAR_1], schedule.actors[WALKER]
        time = schedule.events[0].time
        times, apart = clearances(a, b, step=0.01)
        assert (apart[times < time - 0.03] > 0).all()
        assert (apart[times > time + 0.01] <= 0).all()
        speed = np.ptp(a.get_poses(np.array([time - 0.1, time]))[:, 0]) / 0.1
        assert 2.0 <= speed <= 10.0 + 1e-6


@pytest.mark.parametrize(
    ("degrees", "kind"), [(10, "sideswipe"), (28, None), (32, None), (60, "angle")]
)
def test_a_contact_between_two_kinds_has_none_for_sure(degrees, kind):
    """The second drives ahead at an acute angle into the lane of the first."""
    turn = np.radians(degrees)
    start = (-60.0 * np.cos(turn), 2.0 - 60.0 * np.sin(turn))
    found = find_first_contact(actor(EASTWARDS), actor(candidate(straight(start, turn, 120.0))))
    assert found.kind == kind


def test_a_first_contact_is_described_as_seen():
    """The walker is in the middle of the lane as the car comes there, at its own speed."""
    car = actor(EASTWARDS)
    person = actor(ON_FOOT, enters=round(car.motion.find_time_at(63.0) - 12.0 / 1.4, 1))
    found = find_first_contact(car, person)
    assert found.kind == "pedestrian_strike"
    assert found.frontal
    assert found.speed == pytest.approx(10.0, abs=0.01)
    assert found.closing == pytest.approx(np.hypot(10.0, 1.4), abs=0.1)
    times, apart = clearances(car, person, step=0.01)
    assert found.time == pytest.approx(times[np.argmax(apart <= 0)], abs=0.02)


@pytest.mark.parametrize("seed", range(8))
def test_a_slow_car_strikes_a_fast_motorcycle_if_it_is_named_as_the_one_who_strikes(seed):
    """Of 2 s in which they touch there are 0.2 s in which its front is what touches."""
    slow = candidate(straight((-60.0, 0.0), EAST, 120.0), time_law=law(4.0))
    path = straight((0.0, -60.0), NORTH, 120.0)
    short = candidate(
        path, route=WESTBOUND, shape=get_vehicle_shape("motorcycle"), time_law=law(12.0)
    )
    clause = Contact(first=CAR_1, second=CAR_2, kind="angle")
    for schedule in stagings([clause], {CAR_1: slow, CAR_2: short}, seed=seed):
        along, _ = local(schedule.actors[CAR_1], schedule)
        assert along > CAR.length / 2 - 0.6


def test_a_speed_asked_for_is_braked_down_to():
    wanted = Contact(first=CAR_1, second=CAR_2, speed=6.0)
    for schedule in stagings([wanted], {CAR_1: EASTWARDS, CAR_2: NORTHWARDS}):
        a, time = schedule.actors[CAR_1], schedule.events[0].time
        speed = np.ptp(a.get_poses(np.array([time - 0.05, time]))[:, 0]) / 0.05
        assert speed == pytest.approx(6.0, abs=1.0)


def refused(clauses, candidates, *, seed=0, most=1) -> NearestMiss:
    """The nearest miss of clauses that cannot be staged."""
    misses = NearestMisses()
    landmarks = dict.fromkeys(candidates, BARE)
    stage = ForegroundSolver(
        SolverContext(candidates, landmarks, np.random.default_rng(seed), misses=misses)
    )
    assert list(islice(stage.schedule_all(tuple(clauses), PartialSchedule()), most)) == []
    found = misses.find_culprit(clauses)
    assert found is not None
    return found


def test_a_speed_out_of_reach_is_refused_with_the_fastest_there_is():
    """The law's speed is 10 m/s, and nothing slows the car before it strikes."""
    clause = Contact(first=CAR_1, second=CAR_2, speed=14.0)
    found = refused([clause], {CAR_1: EASTWARDS, CAR_2: NORTHWARDS})
    assert found.clause == clause
    assert found.words == (
        "a target impact speed of 14 m/s: the fastest car on this movement strikes at 10.0 m/s"
    )
    assert found.off == pytest.approx(4.0, abs=0.01)


def test_paths_that_never_touch_are_refused_as_such():
    beside = candidate(straight((-60.0, 6.0), EAST, 120.0))
    for clause in (
        Contact(first=CAR_1, second=CAR_2),
        TimeGap(first=CAR_1, second=CAR_2, low=0.5, high=1.0),
        GivesWay(first=CAR_1, second=CAR_2),
        BrakesFor(first=CAR_1, second=CAR_2, low=0.5, high=1.0),
    ):
        found = refused([clause], {CAR_1: EASTWARDS, CAR_2: beside})
        assert found.words == "the paths of vehicle-1 and vehicle-2 never touch"


def test_a_pet_that_the_places_of_two_rule_out_is_refused_with_the_nearest():
    """Two gaps of one car fix the third, which the refusal names: about 5 s."""
    slanting = candidate(straight((-45.0, -50.0), np.pi / 4, 140.0), time_law=law(9.0))
    candidates = {CAR_1: EASTWARDS, CAR_2: NORTHWARDS, CAR_3: slanting}
    clauses = (
        TimeGap(first=CAR_1, second=CAR_2, low=0.8, high=0.9),
        TimeGap(first=CAR_1, second=CAR_3, low=5.0, high=5.1),
        TimeGap(first=CAR_2, second=CAR_3, low=20.0, high=20.1),
    )
    found = refused(clauses, candidates)
    assert found.clause == clauses[2]
    possible = 20.0 - found.off
    assert found.words == f"a PET of 20 to 20.1 s: the nearest possible is {possible:.1f} s"


def test_the_first_clause_that_never_holds_is_the_culprit():
    clauses = (
        TimeGap(first=CAR_1, second=CAR_2, low=1.0, high=1.4),
        Contact(first=CAR_1, second=CAR_3, speed=18.0),
    )
    candidates = {CAR_1: EASTWARDS, CAR_2: NORTHWARDS, CAR_3: FURTHER}
    assert refused(clauses, candidates).clause == clauses[1]


def test_nearer_is_who_failed_later_or_by_less():
    clause = Contact(first=CAR_1, second=CAR_2, speed=14.0)
    misses = [
        NearestMiss(clause, reached, "", off)
        for reached, off in (
            (FailureStage.PATHS, 0.0),
            (FailureStage.MEASURE, 3.0),
            (FailureStage.MEASURE, 1.0),
            (FailureStage.KIND, 0.0),
        )
    ]
    for order in permutations(misses):
        kept = NearestMisses()
        for each in order:
            kept.note(each)
        assert kept.find_culprit([clause]) == misses[2]
    kept.note_met(clause)
    assert kept.find_culprit([clause]) is None


BUS = get_vehicle_shape("bus")


@pytest.mark.parametrize(
    ("along", "across", "names"),
    [
        (2.3, 0.0, {"front"}),
        (2.3, 0.925, {"front", "front_left"}),
        (2.3, -0.925, {"front", "front_right"}),
        (-2.3, 0.925, {"rear", "rear_left"}),
        (-1.9, -0.7, {"rear", "rear_right"}),
        (0.0, 0.925, {"side", "left"}),
        (1.7, -0.925, {"side", "right"}),
        (-2.3, 0.3, {"rear"}),
    ],
)
def test_places_on_a_car_have_the_names_that_people_give_them(along, across, names):
    assert set(name_impact_points(along, across, shape=CAR)) == names


def local(of, schedule) -> tuple[float, float]:
    """Where the contact lies, ahead of and to the left of the centre of one actor [m]."""
    [event] = schedule.events
    x, y, heading = of.get_poses(np.array([event.time]))[0]
    dx, dy = np.subtract(event.location, (x, y))
    return (
        float(dx * np.cos(heading) + dy * np.sin(heading)),
        float(dy * np.cos(heading) - dx * np.sin(heading)),
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("point", "ahead", "left"),
    [
        ("right", (-1.9, 1.9), (-1.2, -0.4)),
        ("front_right", (1.7, 2.4), (-1.2, -0.3)),
        ("side", (-1.9, 1.9), (-1.2, -0.4)),
    ],
)
def test_a_car_is_struck_where_it_shall_be(point, ahead, left, seed):
    """The striking car comes northwards, so from the right of the one that drives east."""
    clause = Contact(first=CAR_2, second=CAR_1, kind="angle", point_second=point)
    for schedule in stagings([clause], {CAR_1: EASTWARDS, CAR_2: NORTHWARDS}, seed=seed):
        along, across = local(schedule.actors[CAR_1], schedule)
        assert ahead[0] <= along <= ahead[1]
        assert left[0] <= across <= left[1]


def test_who_comes_from_the_right_never_strikes_the_left():
    clause = Contact(first=CAR_2, second=CAR_1, kind="angle", point_second="left")
    found = refused([clause], {CAR_1: EASTWARDS, CAR_2: NORTHWARDS})
    assert found.words.startswith("a contact at the left of vehicle-1: found at ")


@pytest.mark.parametrize("point", ["front_left", "front_right"])
def test_a_pedestrian_is_struck_by_one_corner(point):
    clause = Contact(first=CAR_1, second=WALKER, kind="pedestrian_strike", point_first=point)
    for schedule in stagings([clause], {CAR_1: EASTWARDS, WALKER: ON_FOOT}):
        along, across = local(schedule.actors[CAR_1], schedule)
        assert along > CAR.length / 2 - 0.6
        assert (across > 0.3) == (point == "front_left")


def test_a_pedestrian_walks_into_the_side_of_a_bus():
    bus = candidate(straight((-60.0, 0.0), EAST, 120.0), shape=BUS)
    clause = Contact(first=CAR_1, second=WALKER, kind="pedestrian_strike", point_first="side")
    for schedule in stagings([clause], {CAR_1: bus, WALKER: ON_FOOT}):
        along, across = local(schedule.actors[CAR_1], schedule)
        assert abs(along) < BUS.length / 2 - 0.3
        assert across > BUS.width / 2 - 0.3


@pytest.mark.parametrize("pet", [1.8, 2.4, 3.5])
@pytest.mark.parametrize("gap_first", [True, False])
def test_a_pet_asked_for_is_that_of_the_yield(pet, gap_first):
    clauses = [
        GivesWay(first=CAR_1, second=CAR_2),
        TimeGap(first=CAR_1, second=CAR_2, low=pet - 0.05, high=pet + 0.05),
    ]
    clauses = clauses[::-1] if gap_first else clauses
    for schedule in stagings(clauses, {CAR_1: NORTHWARDS, CAR_2: EASTWARDS}, seed=1):
        assert brute_pet(*schedule.actors.values()) == pytest.approx(pet, abs=0.12)
        [event] = schedule.events
        assert event.clause.clause == "gives_way"


def test_a_pet_too_short_for_a_yield_is_refused_with_the_shortest():
    clauses = [
        GivesWay(first=CAR_1, second=CAR_2),
        TimeGap(first=CAR_1, second=CAR_2, low=0.02, high=0.08),
    ]
    found = refused(clauses, {CAR_1: NORTHWARDS, CAR_2: EASTWARDS})
    assert found.clause == clauses[0]
    assert found.words.startswith("a PET of 0.05 s after the yield: the shortest possible is ")


def test_a_rear_end_is_the_follower_running_into_a_leader_that_stops():
    clause = Contact(first=CAR_1, second=CAR_2, kind="rear_end")
    landmarks = {CAR_1: AT_LIGHT, CAR_2: AT_LIGHT}
    seen_standing, reasons = 0, set()
    for schedule in stagings(
        [clause], {CAR_1: BEHIND, CAR_2: EASTWARDS}, landmarks=landmarks, most=40
    ):
        a, b = schedule.actors[CAR_1], schedule.actors[CAR_2]
        time = schedule.events[0].time
        reasons.add(b.stops[0].reason)
        around = np.array([time - 0.1, time])
        front, rear = (
            a.get_poses(around)[:, 0] + CAR.length / 2,
            b.get_poses(around)[:, 0] - CAR.length / 2,
        )
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
    for schedule in stagings([clause], candidates, seed=seed, most=2):
        a, b = schedule.actors[CAR_1], schedule.actors[CAR_2]
        assert low - 0.15 <= brute_pet(a, b) <= low + width + 0.15
        times, apart = clearances(a, b)
        assert apart.min() > 0.05
        clearance, when, _ = find_least_clearance(a, b)
        assert clearance == pytest.approx(apart.min(), abs=0.1)
        assert abs(when - times[np.argmin(apart)]) <= 0.15


@pytest.mark.parametrize("seed", range(3))
def test_headway_is_the_time_between_rear_and_front_at_one_place(seed):
    clause = Headway(first=CAR_1, second=CAR_2, low=1.0, high=2.0)
    for schedule in stagings([clause], {CAR_1: BEHIND, CAR_2: EASTWARDS}, seed=seed):
        a, b = schedule.actors[CAR_1], schedule.actors[CAR_2]
        assert 0.9 <= a.enters - (b.enters + CAR.length / 10.0) <= 2.1
        times, apart = clearances(a, b)
        assert apart.min() > 0.5
        assert (a.get_poses(times)[:, 0] < b.get_poses(times)[:, 0]).all()
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
    for schedule in stagings([clause], dict(zip(names, (first, second), strict=True)), seed=seed):
        a, b = (schedule.actors[name] for name in names)
        zone = shapely.intersection(swept(a), swept(b))
        times = np.arange(max(a.enters, b.enters), min(a.leaves, b.leaves), 0.05)
        in_zone = [
            shapely.distance(footprints(each.get_poses(times), each.candidate.shape), zone)
            <= (0.3 if each.candidate.shape.type == "pedestrian" else 0.0)
            for each in (a, b)
        ]
        assert in_zone[0].any()
        assert in_zone[1].any()
        left = times[in_zone[1]].max()
        assert times[in_zone[0]].min() > left
        [stop] = a.stops
        s = a.motion.compute_positions(times - a.enters)
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
    for schedule in stagings([clause], {CAR_1: NORTHWARDS, CAR_2: EASTWARDS}, seed=seed):
        unheld = actor(NORTHWARDS, enters=schedule.actors[CAR_1].enters)
        assert np.abs(brute_offsets(unheld, schedule.actors[CAR_2])).min() <= 2.0


def test_later_clauses_keep_the_agents_already_placed():
    clauses = [
        TimeGap(first=CAR_1, second=CAR_2, low=2.0, high=2.4),
        TimeGap(first=CAR_1, second=CAR_3, low=1.0, high=1.4),
    ]
    candidates = {CAR_1: EASTWARDS, CAR_2: NORTHWARDS, CAR_3: FURTHER}
    for schedule in stagings(clauses, candidates):
        placed = schedule.actors
        assert 1.85 <= brute_pet(placed[CAR_1], placed[CAR_2]) <= 2.55
        assert 0.85 <= brute_pet(placed[CAR_1], placed[CAR_3]) <= 1.55
        first, second = schedule.events
        assert second.time > first.time


def test_everybody_obeys_but_who_runs_the_light():
    car = actor(EASTWARDS, enters=2.0, landmarks=AT_LIGHT)
    crosses = 2.0 + 4.5
    [green] = list_signal_demands(car, violates=False, until=30.0)
    assert green.colours == ("green",)
    assert green.start <= crosses <= green.end
    [red] = list_signal_demands(car, violates=True, until=30.0)
    assert red.colours == ("red",)
    assert red.start <= crosses <= red.end
    assert list_signal_demands(car, violates=False, until=5.0) == ()
    assert list_signal_demands(actor(EASTWARDS), violates=False, until=30.0) == ()


@given(st.integers(-100, 100))
@settings(max_examples=10)
def test_shifting_a_staging_shifts_everything(steps):
    clause = GivesWay(first=CAR_1, second=CAR_2)
    [schedule] = stagings([clause], {CAR_1: NORTHWARDS, CAR_2: EASTWARDS}, most=1)
    later = schedule.shift(steps * STEP)
    for name, before in schedule.actors.items():
        after = later.actors[name]
        assert after.enters == pytest.approx(before.enters + steps * STEP)
        times = np.arange(before.enters, before.leaves, 0.5)
        assert after.get_poses(times + steps * STEP) == pytest.approx(
            before.get_poses(times), abs=1e-6
        )
        for one, other in zip(before.stops, after.stops, strict=True):
            assert other.until - one.until == pytest.approx(steps * STEP)
    assert later.events[0].time - schedule.events[0].time == pytest.approx(steps * STEP)
