"""Who may come when, by the lights: answers known by hand."""

from __future__ import annotations

import pytest
from solver_actors import BARE, EAST, actor, candidate, law, straight

from scenewright.scene.map import SignalGroup, SignalPhase, SignalProgram
from scenewright.tools.dsl_validator.waiting import Moment, passes_on_green
from scenewright.tools.landmarks import Landmarks
from scenewright.tools.signals import SignalClock

GREEN_10_RED_20 = SignalProgram(
    groups=(SignalGroup(id="g"),),
    phases=(
        SignalPhase(duration=10, colours={"g": "green"}),
        SignalPhase(duration=20, colours={"g": "red"}),
    ),
)
MOMENT = Moment(SignalClock(GREEN_10_RED_20, 0.0), duration=30.0, blocked=False)
AT_20_M = Landmarks(line=20.0, crosswalks=(), group="g")
TEN_M_PER_S = candidate(straight((0.0, 0.0), EAST, 80.0), time_law=law(10.0))


@pytest.mark.parametrize(
    ("enters", "allowed"), [(0.0, True), (7.5, True), (8.5, False), (27.5, False), (28.5, True)]
)
def test_a_line_is_passed_on_green_alone(enters, allowed):
    arriving = actor(TEN_M_PER_S, marks=AT_20_M)
    assert arriving.motion.time_at(20.0) == pytest.approx(2.0, abs=0.05)
    assert passes_on_green(arriving, MOMENT, enters) is allowed


def test_who_never_gets_to_the_line_and_who_has_none_may_come_at_any_time():
    stops_short = actor(TEN_M_PER_S, marks=AT_20_M).until(1.5)
    assert passes_on_green(stops_short, MOMENT, 15.0)
    assert passes_on_green(actor(TEN_M_PER_S, marks=BARE), MOMENT, 15.0)
