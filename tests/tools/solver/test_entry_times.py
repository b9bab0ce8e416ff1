"""Who may come when, by the lights: answers known by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenewright.geometry.landmarks import Landmarks
from scenewright.intersections import load_map
from scenewright.scene.map_elements import SignalGroup, SignalPhase, SignalProgram
from scenewright.scene.track import STEP
from scenewright.tools.map_grounding.signal_plan import SignalClock
from scenewright.tools.solver.entry_times import (
    SceneTiming,
    compute_arrival_entry,
    compute_queue_growth,
    count_visible_agents,
    pass_or_wait,
    passes_on_green,
)
from scenewright.tools.solver.reservation import ReservationTable
from solver_agents import BARE, EAST, actor, candidate, law, straight, walker

ON = load_map("amsterdam_120")
GREEN_10_RED_20 = SignalProgram(
    groups=(SignalGroup(id="g"),),
    phases=(
        SignalPhase(duration=10, colours={"g": "green"}),
        SignalPhase(duration=20, colours={"g": "red"}),
    ),
)
MOMENT = SceneTiming(SignalClock(GREEN_10_RED_20, 0.0), duration=30.0)
AT_20_M = Landmarks(line=20.0, crosswalks=(), group="g")
TEN_M_PER_S = candidate(straight((0.0, 0.0), EAST, 80.0), time_law=law(10.0))


@pytest.mark.parametrize(
    ("enters", "allowed"), [(0.0, True), (7.5, True), (8.5, False), (27.5, False), (28.5, True)]
)
def test_a_line_is_passed_on_green_alone(enters, allowed):
    arriving = actor(TEN_M_PER_S, landmarks=AT_20_M)
    assert arriving.motion.find_time_at(20.0) == pytest.approx(2.0, abs=0.05)
    assert passes_on_green(arriving, MOMENT, enters) is allowed


def enter(of, times, *, moment=MOMENT, others=(), foreground=False):
    present = ReservationTable(others)
    rng = np.random.default_rng(0)
    return pass_or_wait(of, np.array(times), present, moment, rng, foreground=foreground)


@pytest.mark.parametrize(
    ("place", "allowed"),
    [
        ((0.0, 21.0), [-20, 0, 10, 20, 60, 180, 260]),  # beside its beginning
        ((80.0, 21.0), [-20, 60, 70, 90, 100, 180, 260]),  # beside its end, 8 s after it came
        ((40.0, 21.0), [-20, 0, 10, 20, 60, 70, 90, 100, 180, 260]),  # out of view of both
    ],
)
def test_nobody_comes_or_goes_in_view_of_a_conflict(place, allowed):
    """A conflict at 10 s; the last to come, at 26 s, are still there when the scene ends."""
    steps = [-20, 0, 10, 20, 60, 70, 90, 100, 180, 260]
    moment = replace(MOMENT, conflicts=((10.0, place),))
    on_foot = actor(walker(TEN_M_PER_S.path, speed=10.0))
    assert STEP * (len(on_foot.motion.s) - 1) == pytest.approx(8.0, abs=0.2)
    found = [step for step in steps if enter(on_foot, [step * STEP], moment=moment) is not None]
    assert found == allowed


def test_at_red_it_waits_and_sets_off_on_green():
    """Green 0 to 10 s, red to 30 s: who would pass the line at 22 s waits until 30 s."""
    long = SceneTiming(SignalClock(GREEN_10_RED_20, 0.0), duration=60.0)
    waiting = enter(actor(TEN_M_PER_S, landmarks=AT_20_M), [20.0], moment=long)
    [stop] = waiting.stops
    assert 20.0 - 1.5 <= stop.s <= 20.0 - 0.3
    assert 30.8 <= stop.until <= 31.5
    crosses = waiting.enters + waiting.motion.find_time_at(20.0)
    assert 30.8 < crosses < 34.0
    assert enter(actor(TEN_M_PER_S, landmarks=AT_20_M), [3.0], moment=long).stops == ()


def test_the_first_of_the_times_with_room_is_taken():
    own = actor(TEN_M_PER_S, landmarks=BARE)
    placed = enter(own, [5.0, 5.5, 12.0], others=[own.shift(5.0)])
    assert placed.enters == pytest.approx(12.0)
    assert enter(own, [5.0, 5.5], others=[own.shift(5.0)]) is None


def test_those_who_wait_at_the_kerb_stand_in_rows():
    long = SceneTiming(SignalClock(GREEN_10_RED_20, 0.0), duration=60.0)
    own = walker(straight((0.0, 0.0), EAST, 40.0))
    first = enter(actor(own, landmarks=AT_20_M), [8.0], moment=long)
    second = enter(actor(own, landmarks=AT_20_M), [10.0], moment=long, others=[first])
    assert first.stops[0].s == pytest.approx(20.0 - 0.45)
    assert 0.7 <= first.stops[0].s - second.stops[0].s <= 2.0


def test_who_never_gets_to_the_line_and_who_has_none_may_come_at_any_time():
    stops_short = actor(TEN_M_PER_S, landmarks=AT_20_M).cut_after(1.5)
    assert passes_on_green(stops_short, MOMENT, 15.0)
    assert passes_on_green(actor(TEN_M_PER_S, landmarks=BARE), MOMENT, 15.0)


def test_chance_arrivals_wait_as_long_as_the_light_is_red():
    """Green 0 to 10 s, red to 30 s: those who came on red before the scene still stand in it."""
    arriving = actor(TEN_M_PER_S, landmarks=AT_20_M)
    late = SceneTiming(SignalClock(GREEN_10_RED_20, 15.0), duration=30.0)
    enters = np.array([compute_arrival_entry(arriving, late, (n + 0.5) / 400) for n in range(400)])
    # Time 15 of the programme at 0: red since -5 s, until 15 s. Who came at -7 s stands there now.
    assert enters.min() == pytest.approx(-7.0, abs=0.6)
    assert enters.max() < 26.0
    spread = np.diff(np.quantile(enters, [0.0, 0.25, 0.5, 0.75, 1.0]))
    assert spread == pytest.approx([spread.mean()] * 4, abs=1.5)


def test_who_would_have_gone_on_green_long_ago_is_not_there():
    arriving = actor(TEN_M_PER_S, landmarks=AT_20_M)
    enters = [compute_arrival_entry(arriving, MOMENT, n / 50) for n in range(50)]
    seen = [e for e in enters if e < -4.5]
    # Only those held by the red light that ends at 0.
    assert all(not passes_on_green(arriving, MOMENT, e) for e in seen)


def test_a_scene_that_begins_late_in_a_red_light_has_more_to_show():
    """Green 0 to 10 s, red to 30 s: near its end people have come for 20 s who still stand."""
    ahead = next(r for r in ON.routes if r.type == "vehicle")
    rules = ON.find_signal_group(ahead)
    lights = SignalProgram(
        groups=(SignalGroup(id=rules),),
        phases=tuple(
            SignalPhase(duration=phase.duration, colours={rules: phase.colours["g"]})
            for phase in GREEN_10_RED_20.phases
        ),
    )
    offsets = np.array([5.0, 12.0, 29.5])
    seen = count_visible_agents(lights, offsets, [ahead, ahead], duration=20.0, intersection_map=ON)
    assert seen.tolist() == [40.0, 40.0 + 2 * 2.5, 40.0 + 2 * 20.0]
    assert (
        count_visible_agents(lights, offsets, [], duration=20.0, intersection_map=ON).tolist()
        == [20.0] * 3
    )


def test_queues_set_off_or_form_as_the_lights_turn_while_the_scene_lasts():
    ahead, walker = (
        next(route for route in ON.routes if route.type == kind)
        for kind in ("vehicle", "pedestrian")
    )
    lights = SignalProgram(
        groups=GREEN_10_RED_20.groups,
        phases=tuple(
            SignalPhase(
                duration=phase.duration,
                colours={str(ON.find_signal_group(ahead)): phase.colours["g"]},
            )
            for phase in GREEN_10_RED_20.phases
        ),
    )
    # Waited 10 s and gone; nobody waits, then 5 s; waited 19.5 s, then 4.5 s.
    offsets = np.array([20.0, 5.0, 29.5])
    left = compute_queue_growth(
        lights, offsets, [ahead, ahead, walker], duration=15.0, intersection_map=ON
    )
    assert left == pytest.approx([-10.0, 10.0, 4.5 - 19.5], abs=0.5)
    assert (
        compute_queue_growth(lights, offsets, [walker], duration=15.0, intersection_map=ON).tolist()
        == [0.0] * 3
    )


def test_over_all_moments_as_many_set_off_as_come_to_stand():
    program = ON.signals
    assert program is not None
    crowd = [route for route in ON.routes if route.type == "vehicle"]
    offsets = np.arange(0.0, program.cycle, 0.5)
    left = compute_queue_growth(program, offsets, crowd, duration=30.0, intersection_map=ON)
    assert left.mean() == pytest.approx(0.0, abs=1e-6)
    assert left.min() < -5.0
    assert left.max() > 5.0
