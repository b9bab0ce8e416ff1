"""Seating everybody else in turn, and what two agents forbid of one another's entry times."""

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
    SLOWLY,
    agent,
    assert_is_seating,
    crowded,
    parties,
)
from scenewright.scene.selection import Stop
from scenewright.scene.track import STEP
from scenewright.tools.solver.background_assignment import assign_in_turn
from scenewright.tools.solver.reservation import ReservationTable, find_blocked_offsets
from solver_agents import NORTH, actor, brute_offsets, straight, walker


@given(parties())
@settings(max_examples=40)
def test_seating_in_turn_keeps_everybody_apart_too(party):
    agents, fixed, wanted = party
    assignment = assign_in_turn(agents, fixed.values(), wanted)
    if not isinstance(assignment, str):
        assert_is_seating(assignment, agents, fixed, wanted)


def test_the_same_party_is_seated_the_same_way_again():
    one, other = (assign_in_turn(crowded(), [], {"vehicle": 3, "pedestrian": 0}) for _ in range(2))
    assert {n: (each.index, each.actor.enters) for n, each in one.items()} == {
        n: (each.index, each.actor.enters) for n, each in other.items()
    }


def test_spares_stay_out_unless_somebody_finds_no_room():
    wanted = {"vehicle": 3, "pedestrian": 0}
    seated = assign_in_turn(crowded(), [], wanted)
    assert set(seated) == {"vehicle-0", "vehicle-1", "vehicle-2"}
    blocked = [agent("vehicle-0", [(NORTHWARDS, 0, [0])]), *crowded()[1:]]
    seated = assign_in_turn(blocked, [NORTHWARDS], wanted)
    assert len(seated) == 3
    assert "vehicle-0" not in seated
    assert {"vehicle-1", "vehicle-2"} < set(seated)


def test_a_foreground_guest_without_room_is_told():
    stuck = agent("vehicle-1", [(EASTWARDS, 0, [0])], foreground=True)
    assert isinstance(assign_in_turn([stuck], [NORTHWARDS], {}), str)


def test_nobody_wanted_nobody_seated():
    assert assign_in_turn([], [], {"vehicle": 0, "pedestrian": 0}) == {}


def test_in_turn_the_first_time_with_room_is_taken():
    early = agent("vehicle-1", [(EASTWARDS, 0, [50])])
    later = agent("vehicle-2", [(EASTWARDS, 0, range(52, 200))])
    seated = assign_in_turn([early, later], [], {"vehicle": 2})
    [(low, high)] = find_blocked_offsets(EASTWARDS, EASTWARDS, strict=False)
    assert seated["vehicle-1"].actor.enters == pytest.approx(5.0)
    # an end of an interval that falls between two steps is rounded outwards
    assert seated["vehicle-2"].actor.enters == pytest.approx((50 + high) * STEP, abs=STEP + 1e-9)
    assert low == -high


def test_in_turn_the_first_way_with_room_is_taken():
    options = [(SLOWLY, 1, range(100)), (EASTWARDS, 0, range(100))]
    seated = assign_in_turn([agent("vehicle-1", options)], [], {"vehicle": 1})
    assert seated["vehicle-1"].index == 1


@pytest.mark.parametrize("strict", [True, False])
@pytest.mark.parametrize(
    ("a", "b"),
    [(EASTWARDS, NORTHWARDS), (EASTWARDS, ON_FOOT), (EASTWARDS, SLOWLY), (EASTWARDS, AWAY)],
    ids=["crossing", "on foot", "one lane", "apart"],
)
def test_what_is_forbidden_is_what_would_break_the_certificate(a, b, strict):
    """SEMANTICS 4: half a metre, and a PET of 1.5 s (two of the background: 1.0 s)."""
    gap = 1.5 if strict else 1.0
    touching = brute_offsets(a, b, step=0.1)
    close = brute_offsets(a, b, within=0.5, step=0.1)
    forbidden = find_blocked_offsets(a, b, strict=strict)

    def free(delta: float) -> bool:
        return not any(low * STEP < delta < high * STEP for low, high in forbidden)

    for delta in np.arange(-20.0, 20.0, 0.1):
        if not free(delta):
            continue
        assert not len(touching) or np.abs(touching - delta).min() >= gap
        assert not len(close) or np.abs(close - delta).min() > 0.0
    if not len(touching):
        assert forbidden == []
        return
    # and not much more than that is forbidden
    for delta in (touching.min() - gap - 0.8, touching.max() + gap + 0.8):
        assert free(delta)


def test_nobody_gives_a_second_cause_to_who_gives_seat_in_turn():
    """Where an unheld driver would have been, nobody else is within 2 s."""
    stop = Stop("yield_point", 30.0, 5.0, 15.0, "gives_way")
    held = EASTWARDS.edit(stops=(stop,))
    as_held = find_blocked_offsets(held, NORTHWARDS, strict=True)
    [(low, high)] = [
        (low, high)
        for low, high in as_held
        if low * STEP <= 0.0 <= high * STEP  # unheld, both are in the middle at once
    ]
    assert low * STEP <= -2.4
    assert high * STEP >= 2.4


GIVES_WAY = EASTWARDS.edit(stops=(Stop("yield_point", 30.0, 5.0, 15.0, "gives_way"),))
ACTORS = (EASTWARDS, NORTHWARDS, ON_FOOT, SLOWLY, AWAY, GIVES_WAY, EASTWARDS.end_at(6.0))


@given(
    st.lists(st.tuples(st.sampled_from(ACTORS), st.integers(-80, 80)), min_size=1, max_size=4),
    st.sampled_from(ACTORS),
    st.booleans(),
)
@settings(max_examples=60)
def test_one_time_is_looked_at_as_all_of_them_are(there, newcomer, strict):
    present = ReservationTable(
        [each.shift(STEP * steps) for each, steps in there], foreground=strict
    )
    local = newcomer.shift(-newcomer.enters)
    low, high = present.find_blocked_intervals(local, foreground=strict)
    for start in range(-150, 150):
        blocked = np.any((np.floor(low / STEP) <= start) & (start <= np.ceil(high / STEP)))
        assert present.is_free(local.shift(STEP * start), foreground=strict) == (not blocked)


def test_a_table_grows_with_its_agents():
    present = ReservationTable()
    for n in range(200):
        present.add(EASTWARDS.shift(20.0 * n), foreground=False)
    assert len(present.get_reservations().keeping) == 200
    assert not present.is_free(NORTHWARDS.shift(20.0 * 150), foreground=False)
    assert present.is_free(NORTHWARDS.shift(20.0 * 150 + 10.0), foreground=False)


def test_two_walkers_need_little_room():
    beside = actor(walker(straight((6.9, -10.0), NORTH, 20.0)))
    assert find_blocked_offsets(ON_FOOT, beside, strict=True) == []
