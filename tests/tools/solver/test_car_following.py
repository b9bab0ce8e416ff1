"""Background vehicles among others: behind who drives ahead, behind who stands, and on green."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenewright.scene.candidates import PACE_STEP
from scenewright.scene.map_elements import SignalGroup, SignalPhase, SignalProgram
from scenewright.scene.selection import Stop
from scenewright.scene.track import STEP
from scenewright.tools.map_grounding.signal_plan import SignalClock
from scenewright.tools.solver.car_following import enter_traffic
from scenewright.tools.solver.entry_times import SceneTiming
from scenewright.tools.solver.reservation import ReservationTable
from scenewright.tools.solver.scheduled_agent import ScheduledAgent
from solver_agents import BARE, EAST, SOUTH, actor, candidate, law, straight

ROAD = straight((0.0, 100.0), SOUTH, 100.0)
FREE = SceneTiming(None, 30.0)


def driver(speed=10.0, **kw):
    return actor(candidate(ROAD, time_law=law(speed)), **kw)


def drive(own, enters, others, moment=FREE, seed=0):
    """The vehicle in scene time, entering then or as soon as there is room."""
    table = ReservationTable(others, foreground=False)
    rng = np.random.default_rng(seed)
    return enter_traffic(own, np.array([enters]), table, moment, rng)


def gaps(behind, ahead) -> np.ndarray:
    """From the front behind to the rear ahead [m] at every sample at which both are there."""
    ends = ahead.motion.find_time_at(95.0)
    times = np.arange(max(behind.enters, ahead.enters), min(20.0, ends), STEP)
    own = behind.motion.compute_positions(times - behind.enters)
    length = ahead.candidate.shape.length
    return ahead.motion.compute_positions(times - ahead.enters) - own - length


def test_who_is_alone_drives_as_it_likes():
    driven = drive(driver(), 0.0, [])
    assert driven.stops == ()
    assert np.ptp(driven.motion.speed[5:90]) < 0.05


@pytest.mark.parametrize("seed", range(4))
def test_the_faster_one_follows_the_slower_one(seed):
    ahead = driver(6.0)
    driven = drive(driver(11.0), 4.0, [ahead], seed=seed)
    apart = gaps(driven, ahead)
    speed = driven.motion.find_speed_at(14.0 - driven.enters)
    assert apart.min() > 1.0
    assert speed == pytest.approx(6.0, abs=0.7)  # it has come up, and drives as the one ahead
    assert 0.9 < apart[-1] / 6.0 < 4.0


def test_who_comes_upon_a_queue_stands_behind_it():
    stop = Stop("queue", 60.0, 6.0, 60.0, "red_light")
    ahead = driver(9.0).edit(stops=(stop,))
    driven = drive(driver(10.0), 3.0, [ahead])
    apart = gaps(driven, ahead)
    assert len(driven.stops) == 1
    assert 1.0 < apart[-1] < 4.0


def test_who_finds_the_entry_taken_waits_for_room_to_enter():
    slow = driver(3.0)
    driven = drive(driver(10.0), 0.3, [slow])
    assert driven is None or 1.5 < driven.enters < 6.0
    assert drive(driver(10.0), 20.0, [slow]).enters == pytest.approx(20.0)


def test_nobody_enters_where_the_entry_is_taken_for_long():
    parked = driver(3.0).edit(stops=(Stop("queue", 3.0, 1.0, 60.0, "red_light"),))
    assert drive(driver(10.0), 5.0, [parked]) is None


def test_a_straight_one_gives_way_to_nobody_who_crosses():
    crossing = actor(candidate(straight((-50.0, 50.0), EAST, 100.0), time_law=law(10.0)))
    assert drive(driver(10.0), 0.0, [crossing]) is None


def _red_until(time: float) -> SignalProgram:
    return SignalProgram(
        groups=(SignalGroup(id="ahead", movements=("north>south:straight",), crosswalks=()),),
        phases=(
            SignalPhase(duration=time, colours={"ahead": "red"}),
            SignalPhase(duration=60.0 - time, colours={"ahead": "green"}),
        ),
    )


def test_at_red_it_waits_before_its_line_and_sets_off_on_green():
    moment = SceneTiming(SignalClock(_red_until(15.0), 0.0), 30.0)
    own = driver(10.0, landmarks=replace(BARE, line=50.0, group="ahead"))
    driven = drive(own, 0.0, [], moment)
    [stop] = driven.stops
    assert 47.0 < stop.s < 50.0
    assert 15.5 < driven.motion.find_time_at(50.0) < 18.5


def test_a_queue_discharges_at_two_to_two_and_a_half_seconds():
    moment = SceneTiming(SignalClock(_red_until(15.0), 0.0), 30.0)
    queue: list[ScheduledAgent] = []
    for n in range(6):
        own = driver(12.0, landmarks=replace(BARE, line=60.0, group="ahead"))
        driven = drive(own, 2.0 * n, queue, moment, seed=n)
        assert driven is not None
        queue.append(driven)
    crosses = [each.enters + each.motion.find_time_at(60.0) for each in queue]
    assert crosses[0] > 15.0
    assert 1.6 < np.mean(np.diff(crosses)[2:]) < 2.6  # from the fourth on


def test_the_pace_says_the_motion_again():
    """What is kept of it, speeds along the way, drives as it was planned: within a metre."""
    ahead = driver(6.0)
    driven = drive(driver(11.0), 4.0, [ahead])
    again = actor(driven.candidate)
    assert len(driven.candidate.time_law.pace) * PACE_STEP >= 100.0
    assert np.array_equal(again.motion.s[:100], driven.motion.s[:100])
