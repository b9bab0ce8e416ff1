"""Who is to run a red light: passes its line in the scene, and before what it does to others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenewright.scene.constraints import Contact, GivesWay, Headway
from scenewright.scene.selection import Stop
from scenewright.tools.solver.red_lights import (
    add_red_light_runners,
    compute_line_time,
    list_signal_demands,
    runs_in_time,
)
from scenewright.tools.solver.scheduled_agent import PartialSchedule, ScheduledEvent
from solver_agents import BARE, EAST, SOUTH, WESTBOUND, actor, candidate, straight

LIT = replace(BARE, line=30.0, group="avenue")
CAR = candidate(straight((0.0, 60.0), SOUTH, 100.0))
OTHER = candidate(straight((-60.0, 0.0), EAST, 100.0), route=WESTBOUND)
ONE, TWO = "vehicle-1", "vehicle-2"


def happens(clause, time, *, freed=None) -> ScheduledEvent:
    return ScheduledEvent(
        clause, time, time - 3.0, time, time if freed is None else freed, (0.0, 0.0)
    )


def staged(*events, enters=2.0) -> PartialSchedule:
    return PartialSchedule(
        {ONE: actor(CAR, enters=enters, landmarks=LIT), TWO: actor(OTHER)}, events
    )


def test_the_line_is_passed_when_the_motion_gets_there():
    assert compute_line_time(actor(CAR, enters=2.0, landmarks=LIT)) == pytest.approx(5.0, abs=0.1)
    assert compute_line_time(actor(CAR, landmarks=BARE)) == np.inf
    assert compute_line_time(actor(CAR, landmarks=replace(LIT, line=None))) == np.inf
    assert compute_line_time(actor(CAR, landmarks=LIT).end_at(2.0)) == np.inf


@pytest.mark.parametrize(
    ("schedule", "runs"),
    [
        (staged(), True),
        (staged(enters=-2.6), False),
        (staged(enters=18.0), False),
        (staged(happens(Contact(first=ONE, second=TWO), 7.0)), True),
        (staged(happens(Contact(first=ONE, second=TWO), 4.0)), False),
        (staged(happens(GivesWay(first=TWO, second=ONE), 3.0, freed=7.0)), True),
        (staged(happens(GivesWay(first=TWO, second=ONE), 3.0, freed=4.0)), False),
        (staged(happens(Headway(first=TWO, second=ONE, low=1.0, high=2.0), 3.0)), True),
    ],
)
def test_a_red_light_is_run_in_the_scene_and_before_the_event(schedule, runs):
    assert runs_in_time(ONE, schedule, until=20.0) is runs


def test_who_runs_red_on_its_own_passes_its_line_well_inside_the_scene():
    rng = np.random.default_rng(1)
    known = {ONE: (CAR, LIT)}
    times = [
        compute_line_time(add_red_light_runners(PartialSchedule(), known, rng).actors[ONE])
        for _ in range(30)
    ]
    assert 6.0 <= min(times) < 9.0
    assert 16.0 < max(times) <= 19.1


def test_who_is_on_stage_stays_where_it_is():
    before = staged()
    after = add_red_light_runners(before, {ONE: (CAR, LIT)}, np.random.default_rng(1))
    assert after.actors[ONE] is before.actors[ONE]


def test_who_gives_way_before_its_line_does_so_at_green_even_if_it_runs_red_then():
    stop = Stop("stop_line", 29.0, 6.0, 9.0, "gives_way")
    held = replace(actor(CAR, enters=2.0, landmarks=LIT), stops=(stop,))
    asked = {each.colours: each for each in list_signal_demands(held, violates=True, until=30.0)}
    assert set(asked) == {("green",), ("red",)}
    assert asked[("green",)].start < stop.start < asked[("green",)].end
