"""Seating everybody else at once against the least of all arrangements, by brute force."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from assignment_cases import (
    AWAY,
    EASTWARDS,
    NORTHWARDS,
    ON_FOOT,
    ROADS,
    SLOWLY,
    agent,
    crowded,
    invited,
    is_a_seating,
    least_cost,
    option,
    parties,
)
from scenewright.tools.solver.assignment import assign_cheapest, assign_min_cost
from scenewright.tools.solver.background_assignment import Assignment, ConflictTable
from scenewright.tools.solver.offers import AgentOffers, CandidateOffer


def at_once(agents, fixed, wanted, **bounds):
    return assign_min_cost(
        [invited(each) for each in agents], ConflictTable(fixed), wanted, **bounds
    )


def is_the_least(agents, fixed, wanted) -> None:
    expected = least_cost(agents, fixed, wanted)
    assignment = at_once(agents, fixed.values(), wanted)
    if expected is None:
        assert isinstance(assignment, str)
        return
    assert isinstance(assignment, Assignment)
    assert assignment.optimal
    assert is_a_seating(assignment, agents, fixed, wanted) == pytest.approx(expected, abs=1e-4)


@given(parties())
@settings(max_examples=80)
def test_seating_costs_the_least_of_all_arrangements(party):
    is_the_least(*party)


@st.composite
def pinned(draw):
    """Guests who come within 0.4 s of a moment of their own, on whichever of their candidates."""
    agents = []
    for n in range(draw(st.integers(2, 4))):
        moment, walks = draw(st.integers(-40, 40)), draw(st.integers(0, 3)) == 0
        costs = draw(st.lists(st.floats(0.0, 9.0), min_size=1, max_size=3))
        built = [
            option(ROADS[3 if walks else draw(st.integers(0, 2))], k, moment + late, cost)
            for k, (cost, late) in enumerate(zip(costs, (MOMENTS,) * 3, strict=False))
        ]
        agents.append(agent(f"guest-{n}", built, foreground=draw(st.booleans()) and n == 0))
    free = [each for each in agents if not each.foreground]
    kinds = ("vehicle", "pedestrian")
    wanted = {kind: sum(each.type == kind for each in free) for kind in kinds}
    fewer = draw(st.sampled_from(kinds))
    wanted[fewer] = draw(st.integers(0, wanted[fewer]))
    return agents, {"fixed": NORTHWARDS} if draw(st.booleans()) else {}, wanted


MOMENTS = np.array([-4, 0, 4])


@given(pinned())
@settings(max_examples=80)
def test_with_arrivals_pinned_and_fewer_wanted_than_there_are_too(party):
    is_the_least(*party)


def test_the_same_party_is_seated_the_same_way_again():
    wanted = {"vehicle": 3, "pedestrian": 0}
    one, other = (at_once(crowded(), [], wanted) for _ in range(2))
    assert {n: (o.index, s) for n, (o, s) in one.chosen.items()} == {
        n: (o.index, s) for n, (o, s) in other.chosen.items()
    }


def test_spares_stay_out_unless_somebody_finds_no_room():
    wanted = {"vehicle": 3, "pedestrian": 0}
    assert set(at_once(crowded(), [], wanted).chosen) == {"vehicle-0", "vehicle-1", "vehicle-2"}
    blocked = [agent("vehicle-0", [option(NORTHWARDS, 0, [0], 0.0)]), *crowded()[1:]]
    seated = at_once(blocked, [NORTHWARDS], wanted)
    assert len(seated.chosen) == 3
    assert "vehicle-0" not in seated.chosen
    assert {"vehicle-1", "vehicle-2"} < set(seated.chosen)


def test_nobody_wanted_nobody_seated():
    assert at_once([], [], {"vehicle": 0, "pedestrian": 0}).chosen == {}


def lone(name, road, start, *, foreground=False):
    return agent(name, [option(road, 0, [start], 0.0)], foreground=foreground)


def test_who_cannot_come_beside_the_fixed_is_named():
    stuck = lone("vehicle-1", EASTWARDS, 0, foreground=True)
    reason = at_once([stuck, lone("vehicle-2", AWAY, 0)], [NORTHWARDS], {"vehicle": 1})
    assert reason == "vehicle-1 finds no moment at which it would not interact"


def test_who_cannot_come_beside_one_another_is_named_and_nobody_else():
    party = [
        lone("vehicle-1", AWAY, 0),
        agent("vehicle-2", [option(EASTWARDS, k, [k], 1.0 * k) for k in range(5)]),
        lone("pedestrian-1", ON_FOOT, 900),
        agent("vehicle-3", [option(SLOWLY, k, [2 - k], 0.5 * k) for k in range(5)]),
    ]
    reason = at_once(party, [], {"vehicle": 3, "pedestrian": 1})
    assert reason == "no arrangement keeps vehicle-2, vehicle-3 apart"


def test_a_class_of_which_too_few_find_room_is_named():
    party = [lone(f"vehicle-{n}", EASTWARDS, n) for n in range(1, 4)]
    reason = at_once([*party, lone("pedestrian-1", ON_FOOT, 900)], [], {"vehicle": 2})
    assert reason == "no arrangement keeps 2 of vehicle-1, vehicle-2, vehicle-3 apart"


def test_a_class_with_too_few_guests_is_counted():
    reason = at_once([lone("vehicle-1", AWAY, 0)], [], {"vehicle": 2})
    assert reason == "only 1 of 2 agents came"


def test_a_search_without_means_says_that_it_proved_nothing():
    party = [lone("vehicle-1", EASTWARDS, 0), lone("vehicle-2", SLOWLY, 0)]
    reason = at_once(party, [], {"vehicle": 2}, effort=0.0)
    assert reason.endswith("within the bounds of the search")


def test_candidates_far_from_the_cheapest_are_not_even_built():
    looked_at = []

    def offer(name, road, k):
        def make():
            looked_at.append((name, k))
            return (option(road, k, range(0, 60), 10.0 * k),)

        return CandidateOffer(10.0 * k, make)

    party = [
        AgentOffers(name, "vehicle", False, tuple(offer(name, road, k) for k in range(64)))
        for name, road in (("vehicle-1", EASTWARDS), ("vehicle-2", SLOWLY))
    ]
    assert assign_min_cost(party, ConflictTable([]), {"vehicle": 2}).optimal
    assert sorted(looked_at) == [("vehicle-1", 0), ("vehicle-2", 0)]


def test_everybody_on_the_cheapest_at_a_glance_or_not_at_all():
    free = [invited(agent("vehicle-1", [option(EASTWARDS, 0, range(99), 1.0, drawn_time=7)]))]
    assert assign_cheapest(free, ConflictTable([]), {"vehicle": 1}).chosen["vehicle-1"][1] == 7
    stuck = [invited(lone("vehicle-1", EASTWARDS, 0))]
    assert assign_cheapest(stuck, ConflictTable([NORTHWARDS]), {"vehicle": 1}) is None
