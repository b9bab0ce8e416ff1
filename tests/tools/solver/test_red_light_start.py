"""Foreground vehicles that wait at red first: who, how often, and what their lights show."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from scenewright.geometry.landmarks import Landmarks
from scenewright.intersections import load_map
from scenewright.scene.constraints import Contact, GivesWay
from scenewright.scene.map_elements import SignalGroup, SignalPhase, SignalProgram
from scenewright.scene.track import STEP
from scenewright.tools.map_grounding.signal_plan import SignalClock, find_feasible_offsets
from scenewright.tools.solver.context import SolverContext
from scenewright.tools.solver.foreground import ForegroundSolver
from scenewright.tools.solver.red_lights import draw_red_light_starts, list_signal_demands
from scenewright.tools.solver.scheduled_agent import PartialSchedule
from solver_agents import BARE, CAR, EAST, SOUTH, WESTBOUND, candidate, straight, walker

GIVER, WALKER = "vehicle-1", "pedestrian-1"
CYCLE = SignalProgram(
    groups=(SignalGroup(id="avenue"),),
    phases=(
        SignalPhase(duration=27, colours={"avenue": "green"}),
        SignalPhase(duration=3, colours={"avenue": "yellow"}),
        SignalPhase(duration=30, colours={"avenue": "red"}),
    ),
)
MAP = load_map("amsterdam_120")
ON = MAP.model_copy(update={"signals": CYCLE})
YIELD = (GivesWay(first=GIVER, second=WALKER),)
CANDIDATES = {
    GIVER: candidate(straight((-60.0, 0.0), EAST, 120.0)),
    WALKER: walker(straight((0.0, 12.0), SOUTH, 24.0)),
}
MARKS = {GIVER: Landmarks(line=40.0, crosswalks=(), group="avenue"), WALKER: BARE}


def opened(clauses=YIELD, *, landmarks=MARKS, chance=1.0, seed=0):
    chances = {} if chance is None else {GIVER: chance}
    rng = np.random.default_rng(seed)
    return draw_red_light_starts(
        CANDIDATES, landmarks, clauses, intersection_map=ON, chances=chances, rng=rng
    )


@pytest.mark.parametrize("seed", range(5))
def test_who_waits_stands_first_at_its_line_for_up_to_a_whole_red(seed):
    [(name, waiting)] = opened(seed=seed).items()
    [stop] = waiting.stops
    assert (name, stop.at_red, waiting.enters) == (GIVER, True, 0.0)
    assert 0.3 <= 40.0 - stop.s <= 1.5  # from its front to the line
    assert 2.0 + 0.8 <= stop.until - stop.start <= 30.0 + 1.5
    standing = np.diff(waiting.motion.s) / STEP < 0.05
    assert standing.sum() * STEP == pytest.approx(stop.until - stop.start, abs=1.0)
    assert waiting.free is waiting.motion


def test_others_start_as_they_are():
    strikes = Contact(first=GIVER, second=WALKER)
    assert opened((strikes,)) == opened((*YIELD, strikes)) == opened(()) == {}
    assert opened(chance=0.0) == {}
    no_light = replace(MARKS[GIVER], group=None)
    no_room = replace(MARKS[GIVER], line=3.0)
    assert opened(landmarks={**MARKS, GIVER: no_light}) == {}
    assert opened(landmarks={**MARKS, GIVER: no_room}) == {}


def test_who_has_no_green_while_the_other_has_comes_as_it_is():
    """It would still stand at red while the other passes."""
    cars = {GIVER: CANDIDATES[GIVER], "vehicle-2": candidate(CANDIDATES[GIVER].path)}
    across = {**cars, "vehicle-2": replace(cars["vehicle-2"], route=WESTBOUND)}
    clauses = (GivesWay(first=GIVER, second="vehicle-2"),)
    landmarks, rng = dict.fromkeys(cars, MARKS[GIVER]), np.random.default_rng(0)
    always = dict.fromkeys(cars, 1.0)
    # One of two is enough, as the light would settle when both start.
    assert draw_red_light_starts(
        cars, landmarks, clauses, intersection_map=MAP, chances=always, rng=rng
    ).keys() == {GIVER}
    assert (
        draw_red_light_starts(
            across, landmarks, clauses, intersection_map=MAP, chances=always, rng=rng
        )
        == {}
    )


def test_red_is_met_as_often_as_it_is_shown():
    found = sum(bool(opened(chance=None, seed=seed)) for seed in range(600))
    assert found / 600 == pytest.approx(0.5, abs=0.1)  # 30 of 60 s; 5 standard errors


def staged(seed):
    rng = np.random.default_rng(seed)
    stage = ForegroundSolver(
        SolverContext(CANDIDATES, MARKS, rng, red_light_starts=opened(seed=seed))
    )
    return list(islice(stage.schedule_all(YIELD, PartialSchedule()), 2))


@pytest.mark.parametrize("seed", range(4))
def test_it_gives_way_on_its_way_from_the_light(seed):
    found = staged(seed)
    assert found
    for schedule in found:
        giver = schedule.actors[GIVER]
        light, stop = giver.stops
        assert (light.reason, stop.reason) == ("red_light", "gives_way")
        assert stop.s - light.s > 4.0
        between = giver.motion.speed[
            round((light.until - giver.enters) / STEP) : round((stop.start - giver.enters) / STEP)
        ]
        assert between.max() > 2.0  # it has been moving (SEMANTICS 4)
        assert stop.s < 60.0 - CAR.length / 2  # short of where the other walks


def test_who_is_hit_later_has_a_light_that_allows_it():
    for schedule in staged(0):
        giver = schedule.actors[GIVER]
        hit = giver.end_at(giver.stops[1].start + 1.0)
        assert len(
            find_feasible_offsets(CYCLE, list_signal_demands(hit, violates=False, until=60.0))
        )


@pytest.mark.parametrize("shift", [0.0, 12.0])
@pytest.mark.parametrize("seed", range(4))
def test_its_light_is_red_until_shortly_before_it_starts(seed, shift):
    """Also where it has started before the scene begins."""
    for schedule in staged(seed):
        light = schedule.actors[GIVER].stops[0]
        giver = schedule.actors[GIVER].shift(round(shift - light.until, 1))
        light = giver.stops[0]
        crosses = giver.enters + giver.motion.find_time_at(40.0)
        offsets = find_feasible_offsets(
            CYCLE, list_signal_demands(giver, violates=False, until=30.0)
        )
        assert len(offsets)
        for offset in offsets.tolist():
            clock = SignalClock(CYCLE, offset)
            turns = [
                t for t in np.arange(light.until - 3.0, light.until, 0.05)
                if clock.get_colour("avenue", t) == "green"
            ]  # fmt: skip
            assert 0.7 <= light.until - turns[0] <= 1.55
            assert clock.get_colour("avenue", crosses) == "green"
            assert (
                clock.get_colour("avenue", max(light.start, min(0.0, light.until - 1.6))) == "red"
            )
