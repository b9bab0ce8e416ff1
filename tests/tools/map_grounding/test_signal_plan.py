"""The signal clock against the programme written out second by second."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scenewright.intersections import load_map
from scenewright.scene.map_elements import SignalGroup, SignalPhase, SignalProgram
from scenewright.tools.map_grounding.signal_plan import (
    SignalClock,
    SignalDemand,
    build_signal_records,
    find_feasible_offsets,
    find_green,
    get_red_duration,
    is_showing,
)

COLOURS = st.sampled_from(["green", "yellow", "red"])
PHASES = st.lists(st.tuples(st.integers(1, 20), COLOURS), min_size=1, max_size=5)
QUARTERS = st.integers(-200, 400).map(lambda n: n / 4)
HALVES = st.integers(0, 80).map(lambda n: n / 2)
ON = load_map("amsterdam_120")


def program(phases) -> SignalProgram:
    return SignalProgram(
        groups=(SignalGroup(id="g"),),
        phases=tuple(SignalPhase(duration=d, colours={"g": colour}) for d, colour in phases),
    )


def written_out(phases, time: float) -> str:
    """The colour at a time of the programme, from a list with one entry per quarter second."""
    quarters = [colour for duration, colour in phases for _ in range(4 * duration)]
    return quarters[int(time * 4) % len(quarters)]


@given(PHASES, HALVES, QUARTERS)
def test_colour_is_the_programme_shifted(phases, offset, time):
    assert SignalClock(program(phases), offset).get_colour("g", time) == written_out(
        phases, time + offset
    )


@given(PHASES, HALVES, QUARTERS)
def test_next_green_is_the_first_green_from_then_on(phases, offset, time):
    clock = SignalClock(program(phases), offset)
    later = time + np.arange(0, 120, 0.25)
    green = [t for t in later if written_out(phases, t + offset) == "green"]
    found = find_green(time, clock.get_greens("g"))
    assert found == (green[0] if green else float("inf"))


DEMANDS = st.lists(
    st.tuples(QUARTERS, st.integers(0, 40).map(lambda n: n / 4), st.sets(COLOURS, min_size=1)),
    max_size=3,
)


@given(PHASES, DEMANDS)
def test_feasible_offsets_are_those_that_meet_every_demand(phases, wanted):
    running = program(phases)
    demands = tuple(SignalDemand("g", at, at + lasts, tuple(c)) for at, lasts, c in wanted)
    expected = [
        offset
        for offset in np.arange(0, running.cycle, 0.5)
        if all(
            written_out(phases, t + offset) in demand.colours
            for demand in demands
            for t in np.arange(demand.start, demand.end + 1e-9, 0.25)
        )
    ]
    assert find_feasible_offsets(running, demands).tolist() == expected


@given(PHASES, st.integers(0, 400))
def test_how_long_it_has_been_red_is_since_the_last_green(phases, half_seconds):
    running, offset = program(phases), half_seconds / 2 % sum(each[0] for each in phases)
    back = np.arange(0.0, running.cycle, 0.5)
    greens = [k for k in back if written_out(phases, offset - k) == "green"]
    expected = greens[0] if greens else running.cycle
    [found] = get_red_duration(running, "g", np.array([offset]))
    assert found == expected


@given(PHASES, QUARTERS)
def test_shows_agrees_with_the_clock(phases, time):
    running = program(phases)
    colour = SignalClock(running, 0.0).get_colour("g", time)
    assert is_showing(running, "g", np.array([time]), (colour,)).all()


@given(st.integers(0, 147).map(lambda n: n / 2), st.integers(20, 30))
def test_the_plan_covers_the_scene_without_gaps_and_says_what_the_clock_says(offset, until):
    clock = SignalClock(ON.signals, offset)
    records = build_signal_records(clock, intersection_map=ON, until=float(until))
    heads = {line.id for line in ON.stop_lines} | {each.id for each in ON.crosswalks}
    assert {r.stop_line or r.crosswalk for r in records} == heads
    group_of = {c: g.id for g in ON.signals.groups for c in g.crosswalks}
    group_of |= {m.stop_line: m.signal_group for m in ON.movements}
    for head in heads:
        own = [r for r in records if head in (r.stop_line, r.crosswalk)]
        assert (own[0].start, own[-1].end) == (0.0, until)
        for before, after in pairwise(own):
            assert before.end == after.start
            assert before.colour != after.colour
        for record in own:
            for time in np.linspace(record.start + 0.01, record.end - 0.01, 9):
                assert clock.get_colour(group_of[head], time) == record.colour
