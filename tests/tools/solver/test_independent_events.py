"""Events that share no agent keep apart, on roads and lights worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from scenewright.scene.constraints import Headway, TimeGap
from scenewright.tools.solver.foreground import (
    join_names,
    list_separations,
    split_by_agents,
    split_clauses,
)
from scenewright.tools.solver.scheduled_agent import PartialSchedule, ScheduledEvent
from solver_agents import EAST, NORTH, actor, candidate, clearances, straight

A, B, C, D, E = (f"vehicle-{k}" for k in range(1, 6))


def gap(first: str, second: str) -> TimeGap:
    return TimeGap(first=first, second=second, low=0.5, high=1.0)


def two_pairs() -> PartialSchedule:
    """Two eastward cars behind one another, and two northward ones, all over the origin at once."""
    names = (A, B), (C, D)
    starts = {A: (-40, 0), B: (-60, 0), C: (0, -40), D: (0, -60)}
    actors = {
        name: actor(candidate(straight(start, EAST if name in (A, B) else NORTH, 100.0)))
        for name, start in starts.items()
    }
    events = tuple(ScheduledEvent(gap(*pair), 4.0, 2.0, 5.0, 5.0, (0.0, 0.0)) for pair in names)
    return PartialSchedule(actors, events)


def find_least_clearance(schedule: PartialSchedule) -> float:
    """Least distance of an eastward car from a northward one [m], looked for every 0.05 s."""
    pairs = product((A, B), (C, D))
    found = (clearances(schedule.actors[one], schedule.actors[two])[1] for one, two in pairs)
    return min(float(each.min(initial=np.inf)) for each in found)


@pytest.mark.parametrize("seed", range(3))
def test_unrelated_pairs_are_moved_until_they_keep_apart(seed: int) -> None:
    schedule = two_pairs()
    assert find_least_clearance(schedule) == 0.0
    first, *moved = list_separations(
        schedule, np.random.default_rng(seed), lambda _: np.ones(180, dtype=np.bool_)
    )
    assert first is schedule
    assert moved
    for each in moved:
        assert find_least_clearance(each) >= 0.5
        for one, two in ((A, B), (C, D)):
            before = schedule.actors[two].enters - schedule.actors[one].enters
            after = each.actors[two].enters - each.actors[one].enters
            assert after == pytest.approx(before)


def test_one_programme_of_the_lights_serves_all_that_are_moved() -> None:
    """The eastward pair needs offset 10 s, the northward one, unmoved, offset 16 s: it comes 6 s
    later, or as much earlier as a cycle of 90 s has it."""
    schedule = two_pairs()

    def find_offsets(part: PartialSchedule) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        lawful = np.zeros(180, dtype=np.bool_)
        lawful[20 if A in part.actors else 32] = True
        return lawful

    _, *moved = list_separations(schedule, np.random.default_rng(0), find_offsets)
    shifts = {round(each.actors[C].enters - each.actors[A].enters, 1) for each in moved}
    assert shifts == {6.0}


def test_what_shares_an_agent_is_not_moved() -> None:
    schedule = two_pairs()
    bound = replace(schedule.events[1], clause=gap(B, D))
    third = replace(schedule.events[1], clause=gap(C, D))
    joined = replace(schedule, events=(schedule.events[0], bound, third))
    rng = np.random.default_rng(0)
    assert list(list_separations(joined, rng, lambda _: np.ones(1, dtype=np.bool_))) == [joined]
    assert len(split_by_agents(replace(schedule, events=schedule.events[:1]))) == 3


def test_clauses_are_split_where_they_share_no_agent() -> None:
    follow = Headway(first=E, second=B, low=1.0, high=2.0)
    clauses = (gap(A, B), gap(C, D), follow)
    assert split_clauses(clauses) == [(clauses[1],), (clauses[0], follow)]
    assert join_names("a", [("b", "c"), ("d", "e"), ("c", "f")]) == [
        {"a"}, {"d", "e"}, {"b", "c", "f"},
    ]  # fmt: skip
