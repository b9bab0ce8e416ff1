"""How people give way: rolling, standing as long and as far off as was seen, and its file."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from lab.yielding.fit_yielding import format_yielding_model
from scenewright.errors import InputError
from scenewright.geometry.landmarks import Landmarks
from scenewright.intersections import find_bundle_folder
from scenewright.scene.constraints import GivesWay, Headway
from scenewright.scene.map_elements import Route
from scenewright.scene.reaction_behavior import LEVELS, YieldingBehavior, sample_quantiles
from scenewright.tools.gmm_sampler.observed_behavior import (
    OBSERVED_FILE,
    AccelerationProfile,
    load_acceleration_profiles,
    load_yielding_model,
    replace_accelerations,
)
from scenewright.tools.gmm_sampler.priors import DrivingProfilePrior
from scenewright.tools.solver.context import SolverContext
from scenewright.tools.solver.foreground import ForegroundSolver
from scenewright.tools.solver.scheduled_agent import PartialSchedule
from solver_agents import (
    BARE,
    CAR,
    EAST,
    NORTH,
    WEST,
    WESTBOUND,
    bend,
    candidate,
    law,
    straight,
)

CAR_1, CAR_2 = "vehicle-1", "vehicle-2"
EASTWARDS = candidate(straight((-60.0, 0.0), EAST, 120.0))
NORTHWARDS = candidate(straight((0.0, -60.0), NORTH, 120.0), route=WESTBOUND, time_law=law(8.0))
GIVES_WAY = GivesWay(first=CAR_1, second=CAR_2)
PAIR = ("vehicle", "vehicle")


def always(value: float) -> tuple[float, ...]:
    return (value,) * len(LEVELS)


def get_yielding(**told) -> YieldingBehavior:
    usual = {
        "rolls": 0.0,
        "pace": always(0.2),
        "place": always(4.0),
        "margin": always(1.5),
        "gap": always(1.5),
        "stands": always(2.5),
        "reacts": always(0.5),
    }
    return YieldingBehavior(**{**usual, **told})


def stagings(yielding_model, *, seed=0, clauses=(GIVES_WAY,), most=3):
    candidates = {CAR_1: EASTWARDS, CAR_2: NORTHWARDS}
    rng = np.random.default_rng(seed)
    stage = ForegroundSolver(
        SolverContext(
            candidates, dict.fromkeys(candidates, BARE), rng, yielding_model=yielding_model
        )
    )
    found = list(islice(stage.schedule_all(tuple(clauses), PartialSchedule()), most))
    assert found
    return found


@pytest.mark.parametrize("seed", range(4))
def test_who_rolls_slows_to_less_than_half_and_never_stands(seed):
    schedule = stagings({PAIR: get_yielding(rolls=1.0)}, seed=seed)[0]
    giver, other = schedule.actors[CAR_1], schedule.actors[CAR_2]
    [stop] = giver.stops
    assert stop.rolls
    assert stop.until == stop.start
    lowest = giver.motion.speed.min()
    assert 0.3 < lowest < 0.5 * giver.motion.speed.max()
    # It was slowest where it was seen to be, and came in after the other had left.
    [event] = schedule.events
    assert event.freed < event.ends
    assert event.ends - event.freed == pytest.approx(1.5, abs=0.4)
    assert other.motion is other.free or not other.stops


def test_on_whose_stop_others_depend_never_rolls():
    follow = Headway(first="vehicle-3", second=CAR_1, low=1.0, high=3.0)
    behind = candidate(straight((-60.0, 0.0), EAST, 120.0))
    candidates = {CAR_1: EASTWARDS, CAR_2: NORTHWARDS, "vehicle-3": behind}
    stage = ForegroundSolver(
        SolverContext(
            candidates,
            dict.fromkeys(candidates, BARE),
            np.random.default_rng(0),
            yielding_model={PAIR: get_yielding(rolls=1.0)},
        )
    )
    found = next(stage.schedule_all((GIVES_WAY, follow), PartialSchedule()))
    assert not any(stop.rolls for stop in found.actors[CAR_1].stops)


@pytest.mark.parametrize("gap", [1.5, 3.0, 6.0])
def test_it_stands_as_far_off_as_people_were_seen_to(gap):
    schedule = stagings({PAIR: get_yielding(gap=always(gap))})[0]
    [stop] = schedule.actors[CAR_1].stops
    assert not stop.rolls
    assert stop.ahead == pytest.approx(gap, abs=0.01)


@pytest.mark.parametrize("reacts", [0.2, 1.0, 2.0])
def test_it_starts_as_soon_as_people_were_seen_to(reacts):
    schedule = stagings({PAIR: get_yielding(reacts=always(reacts), stands=always(0.8))})[0]
    [stop], [event] = schedule.actors[CAR_1].stops, schedule.events
    assert stop.until - event.freed == pytest.approx(reacts, abs=0.15)


@pytest.mark.parametrize("stands", [0.8, 2.0, 3.5])
def test_it_stands_as_long_as_people_were_seen_to_and_starts_later_for_it(stands):
    schedule = stagings({PAIR: get_yielding(stands=always(stands), reacts=always(0.2))})[0]
    [stop], [event] = schedule.actors[CAR_1].stops, schedule.events
    assert stop.until - stop.start == pytest.approx(stands, abs=0.15)
    assert 0.05 < stop.until - event.freed < 3.6


def test_nobody_stands_on_for_longer_than_it_counts_as_giving_way():
    schedule = stagings({PAIR: get_yielding(stands=always(20.0), reacts=always(3.9))})[0]
    [stop], [event] = schedule.actors[CAR_1].stops, schedule.events
    # Moving at 1 m/s within 4 s, at 2 m/s^2.
    assert stop.until - event.freed < 3.3


def crossroads():
    """A left turn over a crosswalk, the line before it, and a car that comes towards it."""
    path = bend(60.0, 9.0, 50.0)
    turning = Route(
        id="vehicle:west>north:left", type="vehicle", entry="west", exit="north",
        movement="left", movement_id="west>north:left",
    )  # fmt: skip
    giver = candidate(path, route=turning)
    # The line at 52, the crosswalk from 53 to 57 m.
    half = CAR.length / 2
    walk = ("west:crosswalk", 53.0 - half, 57.0 + half)
    landmarks = Landmarks(line=52.0 - half, crosswalks=(walk,), group="west")
    x = 9.0 / np.sqrt(2.0) + 60.0
    other = candidate(straight((x + 80.0, 5.5), WEST, 140.0), route=WESTBOUND)
    return {CAR_1: giver, CAR_2: other}, {CAR_1: landmarks, CAR_2: BARE}


@pytest.mark.parametrize("group", ["west", None])
def test_who_turns_on_green_waits_past_the_crosswalk_it_came_by(group):
    candidates, landmarks = crossroads()
    landmarks[CAR_1] = replace(landmarks[CAR_1], group=group)
    yielding_model = {PAIR: get_yielding(gap=always(8.0), stands=always(1.5))}
    stage = ForegroundSolver(
        SolverContext(
            candidates, landmarks, np.random.default_rng(0), yielding_model=yielding_model
        )
    )
    [stop] = next(stage.schedule_all((GIVES_WAY,), PartialSchedule())).actors[CAR_1].stops
    front = stop.s + CAR.length / 2
    if group is None:
        # Somebody may be walking: its rear is off the crosswalk too, or it waits at its line.
        assert stop.anchor == "stop_line" or stop.s - CAR.length / 2 > 57.0
    else:
        assert stop.anchor == "yield_point"
        assert 57.0 < front < 57.0 + CAR.length


def test_paces_are_read_as_they_were_written_and_move_the_laws(tmp_path):
    told = {"pedestrian": AccelerationProfile((1.9, 0.1), (1.8, 0.2))}
    folder = _bundle(tmp_path, format_yielding_model({PAIR: get_yielding()}, told))
    assert load_acceleration_profiles(folder) == told
    assert load_yielding_model(folder) == {PAIR: get_yielding()}
    law = DrivingProfilePrior(*(np.array([1.2, 1.0, 1.0, 1.3]) * k for k in (1, 0.2, 0.5, 2)), 9)
    laws = replace_accelerations({"pedestrian:x": law, "vehicle:x": law}, told)
    assert laws["pedestrian:x"].median.tolist() == [1.2, 1.9, 1.8, 1.3]
    assert laws["vehicle:x"] is law


def test_a_bundle_without_a_file_keeps_its_own_laws(tmp_path):
    assert load_acceleration_profiles(tmp_path) == {}


@pytest.mark.parametrize("pace", [{"starts": [0.0, 0.1], "brakes": [1.0, 0.1]}, {"starts": [1.0]}])
def test_paces_that_are_none_are_refused(tmp_path, pace):
    folder = _bundle(tmp_path, json.dumps({"vehicle": pace}))
    with pytest.raises(InputError, match=r"manners\.json of"):
        load_acceleration_profiles(folder)


def test_draws_lie_between_the_outermost_quantiles():
    quantiles = tuple(float(k) for k in range(len(LEVELS)))
    rng = np.random.default_rng(0)
    values = [sample_quantiles(quantiles, rng) for _ in range(300)]
    assert 0.0 <= min(values) < 1.0
    assert len(LEVELS) - 2 < max(values) <= len(LEVELS) - 1


def test_the_shipped_habits_roll_now_and_then():
    yielding_model = load_yielding_model(find_bundle_folder("amsterdam_120"))
    assert 0.05 < yielding_model["vehicle", "pedestrian"].rolls < 0.3
    assert 0.05 < yielding_model["vehicle", "vehicle"].rolls < 0.4


def test_a_bundle_without_habits_borrows_the_shipped_ones(tmp_path):
    assert load_yielding_model(tmp_path) == load_yielding_model(find_bundle_folder("amsterdam_120"))


def _bundle(folder, text):
    import hashlib

    (folder / OBSERVED_FILE).write_text(text, encoding="utf-8")
    digest = hashlib.sha256(text.encode()).hexdigest()
    header = f'name = "here"\nformat = 1\n[sha256]\n"{OBSERVED_FILE}" = "{digest}"\n'
    (folder / "bundle.toml").write_text(header, encoding="utf-8")
    return folder


def test_habits_are_read_as_they_were_written(tmp_path):
    yielding_model = {PAIR: get_yielding(rolls=0.25)}
    assert (
        load_yielding_model(_bundle(tmp_path, format_yielding_model(yielding_model)))
        == yielding_model
    )


@pytest.mark.parametrize("gap", [[1.0, 2.0], list(range(11))[::-1]])
def test_quantiles_that_are_none_are_refused(tmp_path, gap):
    told = json.loads(format_yielding_model({PAIR: get_yielding()}))
    told["vehicle to vehicle"]["gap"] = gap
    with pytest.raises(InputError, match="gap needs 11 ascending quantiles"):
        load_yielding_model(_bundle(tmp_path, json.dumps(told)))
