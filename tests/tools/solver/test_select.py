"""Selection on the shipped map: the least of all tuples, and why there is none."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenewright.errors import Rejected
from scenewright.geometry.driving_profile import compute_motion
from scenewright.geometry.landmarks import find_landmarks
from scenewright.geometry.map_areas import MapAreas
from scenewright.intersections import load_map
from scenewright.scene.candidates import CandidateSet, RoleAssignment
from scenewright.tools.dsl_validator.parse import parse
from scenewright.tools.map_grounding.signal_plan import SignalClock
from scenewright.tools.segment_editor import get_motion_edits
from scenewright.tools.solver.scheduled_agent import ScheduledAgent
from scenewright.tools.solver.select import select
from solver_agents import (
    NORTH,
    SOUTH,
    SOUTHBOUND,
    WEST,
    WESTBOUND,
    brute_pet,
    candidate,
    clearances,
    draws,
    law,
    straight,
)

GROUND = MapAreas(load_map("amsterdam_120"))
NEAR_MISS = "time_gap(vehicle-1, vehicle-2) in [0.6, 1.2] s\nruns_red(vehicle-1)"


def southbound(shift=0.0, speed=10.0, length=99.0):
    path = straight((-4.95 + shift, 49.5), SOUTH, length)
    return candidate(path, time_law=law(speed), route=SOUTHBOUND)


def westbound(shift=0.0, speed=10.0, length=99.0):
    path = straight((49.5, 1.75 + shift), WEST, length)
    return candidate(path, time_law=law(speed), route=WESTBOUND)


def pool(*agents, background=None) -> CandidateSet:
    return CandidateSet(
        agents={each.name: each for each in agents},
        cast=RoleAssignment(routes={each.name: each.route for each in agents}, patterns=()),
        hour=12.0,
        background=background or {"vehicle": 0, "pedestrian": 0},
    )


def chosen(program, of, *, mode="map", seed=0):
    return select(parse(program), of, map_areas=GROUND, rng=np.random.default_rng(seed), mode=mode)


def placed(selection, name) -> ScheduledAgent:
    """A selected agent in scene time."""
    agent = selection.agents[name]
    editing = get_motion_edits(agent)
    motion = compute_motion(agent.candidate, holds=editing.holds, slowings=editing.slowings)
    landmarks = find_landmarks(agent.candidate, map_areas=GROUND)
    return ScheduledAgent(
        agent.candidate, landmarks, agent.enters, motion, compute_motion(agent.candidate)
    )


NLL = st.lists(st.floats(0.0, 20.0), min_size=4, max_size=4)


@given(NLL, NLL, NLL)
@settings(max_examples=12)
def test_map_mode_takes_the_least_sum_of_what_survives(first, second, times):
    """Of four each: one too slow for the clause, one that ends before the junction."""
    fast = [southbound(0.3), southbound(speed=5.0), southbound(-0.2, 9.0), southbound(length=25.0)]
    slow = [westbound(length=30.0), westbound(0.1), westbound(speed=8.0), westbound(speed=13.0)]
    program = f"{NEAR_MISS}\nspeed(vehicle-1) in [8, 12] m/s\nspeed(vehicle-2) in [8, 12] m/s"
    survivors = product((0, 2), (1, 2))
    least = min(first[i] + times[i] + second[j] for i, j in survivors)
    selection = chosen(
        program,
        pool(
            draws("vehicle-1", fast, nll=first, time_nll=times),
            draws("vehicle-2", slow, nll=second),
        ),
    )
    chosen_first = selection.agents["vehicle-1"].index
    assert selection.cost == pytest.approx(least)
    assert selection.nll == pytest.approx(least - times[chosen_first])
    assert selection.agents["vehicle-1"].index in (0, 2)
    assert selection.agents["vehicle-2"].index in (1, 2)


def two_roads():
    return pool(
        draws("vehicle-1", [southbound(), southbound(0.2, 9.0)]),
        draws("vehicle-2", [westbound(), westbound(speed=8.0)]),
    )


@pytest.mark.parametrize("mode", ["draw", "map"])
@pytest.mark.parametrize("seed", range(3))
def test_the_selection_brings_about_what_the_clause_says(mode, seed):
    selection = chosen(NEAR_MISS, two_roads(), mode=mode, seed=seed)
    a, b = (placed(selection, name) for name in ("vehicle-1", "vehicle-2"))
    assert 0.45 <= brute_pet(a, b) <= 1.35
    times, apart = clearances(a, b)
    [event] = selection.events
    assert event.time == pytest.approx(times[np.argmin(apart)], abs=0.15)
    assert 0.0 < event.time < selection.duration <= 30.0


@pytest.mark.parametrize("seed", range(3))
def test_lights_are_obeyed_by_all_but_who_is_to_run_them(seed):
    selection = chosen(NEAR_MISS, two_roads(), seed=seed)
    clock = SignalClock(GROUND.intersection_map.signals, selection.signal_offset)
    for name, colour in (("vehicle-1", "red"), ("vehicle-2", "green")):
        actor = placed(selection, name)
        crosses = actor.enters + actor.motion.find_time_at(actor.landmarks.line)
        assert clock.get_colour(actor.landmarks.group, crosses) == colour
        assert selection.agents[name].violates == (colour == "red")


def test_a_yielder_stands_at_its_planned_stop():
    program = "gives_way(vehicle-1, vehicle-2)\nruns_red(vehicle-2)"
    selection = chosen(program, two_roads())
    [stop] = selection.agents["vehicle-1"].stops
    a, b = (placed(selection, name) for name in ("vehicle-1", "vehicle-2"))
    times = np.arange(stop.start + 0.5, stop.until - 0.4, 0.1)
    assert np.ptp(a.get_poses(times)[:, 1]) < 1e-4
    assert 0.5 <= brute_pet(a, b) <= 7.2


def test_the_same_seed_selects_the_same():
    one, other = (chosen(NEAR_MISS, two_roads(), mode="draw", seed=5) for _ in range(2))
    assert one.events == other.events
    assert one.signal_offset == other.signal_offset
    for name, agent in one.agents.items():
        twin = other.agents[name]
        assert (agent.index, agent.enters, agent.stops) == (twin.index, twin.enters, twin.stops)


def test_draw_mode_does_not_always_take_the_likeliest():
    likely = pool(
        draws("vehicle-1", [southbound(0.1 * n) for n in range(4)], nll=[0.0, 1.0, 2.0, 3.0]),
        draws("vehicle-2", [westbound()]),
    )
    picked = {
        chosen(NEAR_MISS, likely, mode="draw", seed=seed).agents["vehicle-1"].index
        for seed in range(8)
    }
    assert len(picked) > 1


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        (f"{NEAR_MISS}\nspeed(vehicle-1) in [1, 3] m/s", "vehicle-1: free speed 10.0 m/s"),
        (f"{NEAR_MISS}\nmin_length(vehicle-2) >= 120 m", "at least 120"),
        (f"{NEAR_MISS}\nsame_lane(vehicle-1, vehicle-2) >= 50 m", "same_lane(vehicle-1, vehicle-2"),
        ("contact(vehicle-1, vehicle-2, rear_end)", "contact(vehicle-1, vehicle-2, rear_end)"),
        (
            "runs_red(vehicle-1)\ncontact(vehicle-1, vehicle-2, 18 m/s)",
            "18 m/s: the fastest car on this movement strikes at 10.0 m/s",
        ),
        ("time_gap(vehicle-1, vehicle-2) in [0.6, 1.2] s", "the signal programme allows no such"),
    ],
)
def test_a_refusal_names_the_clause_that_nobody_survives(program, reason):
    with pytest.raises(Rejected) as refused:
        chosen(program, two_roads())
    assert refused.value.rejection.code == "no_surviving_combination"
    assert refused.value.rejection.agents == ("vehicle-1", "vehicle-2")
    assert reason in refused.value.rejection.detail


def test_roads_that_never_meet_are_refused_by_their_clause():
    apart = pool(
        draws("vehicle-1", [southbound()]),
        draws("vehicle-2", [candidate(straight((4.95, -49.5), NORTH, 99.0), route=SOUTHBOUND)]),
    )
    with pytest.raises(Rejected, match=r"time_gap\(vehicle-1, vehicle-2\)"):
        chosen(NEAR_MISS, apart)


def test_background_keeps_its_distance_and_its_number():
    background = [
        draws(
            f"vehicle-{n}",
            [westbound(0.1 * n), westbound(speed=8.0 + 0.1 * n)],
            role="background",
            arrival=arrival,
            reserve=n > 5,
        )
        for n, arrival in zip(range(3, 8), (4.0, 11.0, 16.0, 22.0, 27.0), strict=True)
    ]
    agents = [*two_roads().agents.values(), *background]
    selection = chosen(NEAR_MISS, pool(*agents, background={"vehicle": 3, "pedestrian": 0}))
    crowd = [name for name, agent in selection.agents.items() if agent.role == "background"]
    assert len(crowd) == 3
    for n, name in enumerate(selection.agents):
        for other in list(selection.agents)[:n]:
            if {name, other} == {"vehicle-1", "vehicle-2"}:
                continue
            a, b = placed(selection, other), placed(selection, name)
            apart = clearances(a, b, step=0.1)[1]
            assert not len(apart) or apart.min() >= 0.5
            assert brute_pet(a, b, step=0.1) >= (1.0 if {name, other} <= set(crowd) else 1.5)


def test_without_relations_everybody_is_a_guest():
    agents = [draws("vehicle-1", [southbound()], arrival=10.0), draws("vehicle-2", [westbound()])]
    selection = chosen("on_road(vehicle-1)", pool(*agents))
    assert set(selection.agents) == {"vehicle-1", "vehicle-2"}
    assert selection.events == ()
