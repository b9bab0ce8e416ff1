"""`brakes_for` and the path TTC it aims at, against a slow scan with shapely."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from scenewright.scene.constraints import BrakesFor, TimeGap
from scenewright.scene.track import STEP
from scenewright.tools.solver.context import NearestMisses, SolverContext, find_contact_nodes
from scenewright.tools.solver.foreground import ForegroundSolver
from scenewright.tools.solver.path_ttc import compute_path_ttc
from scenewright.tools.solver.scheduled_agent import PartialSchedule
from solver_agents import (
    BARE,
    CAR,
    EAST,
    NORTH,
    SOUTH,
    WESTBOUND,
    actor,
    brute_pet,
    candidate,
    clearances,
    distances,
    law,
    straight,
    walker,
)

CAR_1, CAR_2, WALKER = "vehicle-1", "vehicle-2", "pedestrian-1"
EASTWARDS = candidate(straight((-60.0, 0.0), EAST, 120.0))
NORTHWARDS = candidate(straight((0.0, -60.0), NORTH, 120.0), route=WESTBOUND, time_law=law(8.0))
ON_FOOT = walker(straight((5.0, 12.0), SOUTH, 24.0))
OTHERS = {CAR_2: NORTHWARDS, WALKER: ON_FOOT}


def brute_ttc(a, b, times):
    """[T] path TTC [s] up to 3 s: both driven on at their present speed, tried every 0.02 s."""
    ahead = np.arange(0.0, 3.0, 0.02)
    found = []
    for time in times:
        poses = []
        for each in (a, b):
            s, before, after = each.motion.compute_positions(
                np.array([time, time - STEP, time + STEP]) - each.enters
            )
            path, reached = each.candidate.path, s + (after - before) / (2 * STEP) * ahead
            columns = (path.xy[:, 0], path.xy[:, 1], path.heading)
            poses.append(np.column_stack([np.interp(reached, path.s, c) for c in columns]))
        touch = distances(*poses, (a.candidate.shape, b.candidate.shape)) <= 0
        found.append(ahead[np.argmax(touch)] if touch.any() else np.inf)
    return np.array(found)


def staged(second, low, high, *, seed, first=EASTWARDS, more=(), most=3):
    misses = NearestMisses()
    clause = BrakesFor(first=CAR_1, second=second, low=low, high=high)
    candidates = {CAR_1: first, second: OTHERS[second]}
    stage = ForegroundSolver(
        SolverContext(
            candidates, dict.fromkeys(candidates, BARE), np.random.default_rng(seed), misses=misses
        )
    )
    return (
        list(islice(stage.schedule_all((clause, *more), PartialSchedule()), most)),
        misses,
        clause,
    )


def test_at_constant_speeds_the_path_ttc_counts_down_to_the_contact():
    """Fronts meet the other's side after 5.24 s: 52.4 m at 10 m/s, the other long under way."""
    a = actor(EASTWARDS)
    b = actor(
        NORTHWARDS, enters=round(a.motion.find_time_at(60.0) - NORTHWARDS.path.length / 16, 1)
    )
    near = compute_path_ttc(find_contact_nodes(EASTWARDS, NORTHWARDS), a, b, horizon=3.0)
    times, apart = clearances(a, b, step=0.01)
    contact = times[np.argmax(apart <= 0)]
    before = (near.times > contact - 2.9) & (near.times < contact - 0.2)
    assert near.ttc[before] == pytest.approx(contact - near.times[before], abs=0.08)
    assert np.isinf(near.ttc[near.times < contact - 3.1]).all()


def test_who_passes_in_time_never_closes_in():
    a = actor(EASTWARDS)
    b = actor(NORTHWARDS, enters=20.0)
    near = compute_path_ttc(find_contact_nodes(EASTWARDS, NORTHWARDS), a, b, horizon=3.0)
    assert near.least == np.inf


@pytest.mark.parametrize("target", [0.6, 1.0, 1.4])
@pytest.mark.parametrize("second", [CAR_2, WALKER])
@pytest.mark.parametrize("seed", range(2))
def test_the_least_path_ttc_is_as_asked_and_the_braking_hard(second, target, seed):
    found, _, _ = staged(second, target - 0.08, target + 0.08, seed=seed)
    assert found
    for schedule in found:
        a, b = schedule.actors[CAR_1], schedule.actors[second]
        [event] = schedule.events
        times = np.arange(event.begins, event.time + 3.0, 0.1)
        assert brute_ttc(a, b, times).min() == pytest.approx(target, abs=0.2)
        change = np.diff(a.motion.speed) / STEP
        assert 5.0 < -change.min() <= 8.0
        times, apart = clearances(a, b)
        assert apart.min() >= 0.25
        assert event.time == pytest.approx(times[np.argmin(apart)], abs=0.15)
        assert brute_pet(a, b) <= 7.1


@pytest.mark.parametrize("seed", range(3))
def test_driven_and_walked_on_the_two_would_have_collided(seed):
    found, _, _ = staged(WALKER, 0.8, 1.2, seed=seed)
    for schedule in found:
        unbraked = actor(EASTWARDS, enters=schedule.actors[CAR_1].enters)
        walks_on = actor(ON_FOOT, enters=schedule.actors[WALKER].enters)
        assert clearances(unbraked, walks_on)[1].min() <= 0.1


def test_a_pedestrian_for_whom_a_car_brakes_runs():
    found, _, _ = staged(WALKER, 0.8, 1.2, seed=0)
    usual = float(actor(ON_FOOT).motion.speed.max())
    assert any(float(each.actors[WALKER].motion.speed.max()) > usual + 0.5 for each in found)


def test_both_a_stop_and_a_slowing_are_found():
    kinds = set()
    for seed in range(6):
        for schedule in staged(WALKER, 0.8, 1.2, seed=seed, most=6)[0]:
            kinds.add(bool(schedule.actors[CAR_1].stops))
    assert kinds == {True, False}


@pytest.mark.parametrize("seed", range(4))
def test_strictly_staged_the_braking_is_sudden_and_just_before(seed):
    clause = BrakesFor(first=CAR_1, second=WALKER, low=0.7, high=1.3)
    candidates = {CAR_1: EASTWARDS, WALKER: ON_FOOT}
    landmarks = dict.fromkeys(candidates, BARE)
    stage = ForegroundSolver(
        SolverContext(candidates, landmarks, np.random.default_rng(seed), lenient=False)
    )
    for schedule in islice(stage.schedule_all((clause,), PartialSchedule()), 3):
        a, [event] = schedule.actors[CAR_1], schedule.events
        change = np.gradient(a.motion.speed, STEP)
        hard = np.nonzero(change < -3.4)[0]
        assert (change[hard[0] - 15 : hard[0] - 5] > -2.5).all()
        assert 0.0 <= event.time - (a.enters + STEP * hard[0]) <= 4.5


def test_a_pet_asked_for_besides_is_met():
    gap = TimeGap(first=CAR_1, second=WALKER, low=1.95, high=2.05)
    found, _, _ = staged(WALKER, 0.8, 1.2, seed=0, more=(gap,))
    assert found
    for schedule in found:
        pet = brute_pet(schedule.actors[CAR_1], schedule.actors[WALKER])
        assert pet == pytest.approx(2.0, abs=0.15)
        assert len(schedule.events) == 1


def test_who_drives_slowly_cannot_brake_hard_and_the_refusal_says_so():
    slow = candidate(straight((-60.0, 0.0), EAST, 120.0), time_law=law(3.0), shape=CAR)
    found, misses, clause = staged(WALKER, 0.8, 1.2, seed=0, first=slow)
    assert found == []
    assert "is too slow on this movement" in misses.find_culprit((clause,)).words


def test_a_ttc_that_is_no_near_miss_is_refused_with_what_one_needs():
    gap = TimeGap(first=CAR_1, second=CAR_2, low=2.0, high=5.0)
    found, misses, clause = staged(CAR_2, 1.9, 2.1, seed=0, more=(gap,))
    assert found == []
    words = misses.find_culprit((clause,)).words
    assert words.startswith("a near miss needs a PET of at most 1.5 s, or a path TTC of at most")


def test_a_ttc_longer_than_the_way_is_refused():
    found, misses, clause = staged(CAR_2, 6.9, 7.1, seed=0)
    assert found == []
    words = "a path TTC of 7 s: the way of vehicle-1 begins too late for it"
    assert misses.find_culprit((clause,)).words == words
