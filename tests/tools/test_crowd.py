"""Seating everybody else against the least of all arrangements, by brute force."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from solver_actors import (
    EAST,
    NORTH,
    SOUTH,
    WESTBOUND,
    actor,
    brute_offsets,
    candidate,
    law,
    straight,
    walker,
)

from scenewright.scene.selection import Stop
from scenewright.scene.track import STEP
from scenewright.tools.dsl_validator.crowd import (
    Guest,
    Option,
    Seating,
    Table,
    seat_in_turn,
)
from scenewright.tools.dsl_validator.seating import seat
from scenewright.tools.dsl_validator.separation import forbidden_offsets

EASTWARDS = actor(candidate(straight((-40.0, 0.0), EAST, 80.0)))
SLOWLY = actor(candidate(straight((-40.0, 0.4), EAST, 80.0), time_law=law(6.0)))
NORTHWARDS = actor(candidate(straight((0.0, -40.0), NORTH, 80.0), route=WESTBOUND))
ON_FOOT = actor(walker(straight((6.0, 10.0), SOUTH, 20.0)))
AWAY = actor(candidate(straight((-40.0, 30.0), EAST, 80.0)))
ROADS = (EASTWARDS, SLOWLY, NORTHWARDS, ON_FOOT)
SPARE_COST = 5.0


def option(of, index, starts, cost, wish=0) -> Option:
    return Option(lambda: of, index, np.array(sorted(starts), dtype=np.int64), float(cost), wish)


def guest(name, options, *, foreground=False, spare=False) -> Guest:
    kind = options[0].actor.candidate.route.type
    return Guest(name, kind, foreground, lambda _standing: tuple(options), spare=spare)


def keeps_apart(one, other, strict) -> bool:
    (a, start_a), (b, start_b) = one, other
    return not any(low < start_b - start_a < high for low, high in _forbidden(a, b, strict))


@cache
def _forbidden(a, b, strict):
    return forbidden_offsets(a, b, strict=strict)


def least_cost(guests, fixed, wanted):
    """Of all arrangements that keep everybody apart; None if there is none."""
    best = None
    ways = []
    for each in guests:
        least = min(o.cost for o in each.options)
        own = [
            (each, o.actor, int(start), o.cost - least + SPARE_COST * each.spare)
            for o in each.options
            for start in o.starts
        ]
        ways.append(own if each.foreground else [None, *own])
    for choice in product(*ways):
        taken = [each for each in choice if each]
        counts = dict.fromkeys(wanted, 0)
        for each, *_ in taken:
            if not each.foreground:
                counts[each.type] += 1
        cost = sum(each[3] for each in taken)
        if counts != wanted or (best is not None and cost >= best):
            continue
        placed = [(a, start, g.foreground) for g, a, start, _ in taken]
        apart = all(
            keeps_apart((f, round(f.enters / STEP)), (a, start), strict=True)
            for f in fixed.values()
            for a, start, _ in placed
        ) and all(
            keeps_apart(placed[m][:2], placed[n][:2], placed[n][2] or placed[m][2])
            for n in range(len(placed))
            for m in range(n)
        )
        best = cost if apart else best
    return best


OPTION = st.tuples(
    st.integers(0, len(ROADS) - 1),
    st.sets(st.integers(-60, 60), min_size=2, max_size=4),
    st.integers(0, 5),
)
GUEST = st.tuples(st.lists(OPTION, min_size=1, max_size=3), st.booleans(), st.booleans())


@st.composite
def parties(draw):
    guests = []
    for n, (options, foreground, spare) in enumerate(draw(st.lists(GUEST, min_size=2, max_size=4))):
        road = options[0][0]
        of_one_kind = [o for o in options if (o[0] == 3) == (road == 3)]
        built = [option(ROADS[r], k, s, c) for k, (r, s, c) in enumerate(of_one_kind)]
        guests.append(guest(f"guest-{n}", built, foreground=foreground and n == 0, spare=spare))
    free = [each for each in guests if not each.foreground]
    wanted = {}
    for kind in ("vehicle", "pedestrian"):
        most = sum(each.type == kind for each in free)
        wanted[kind] = draw(st.integers((most + 1) // 2, most))
    fixed = {"fixed": NORTHWARDS} if draw(st.booleans()) else {}
    return guests, fixed, wanted


@given(parties())
@settings(max_examples=40)
def test_seating_costs_the_least_of_all_arrangements(party):
    guests, fixed, wanted = party
    expected = least_cost(guests, fixed, wanted)
    seating = seat(guests, Table(fixed.values()), wanted)
    if expected is None:
        assert isinstance(seating, str)
        return
    assert isinstance(seating, Seating)
    assert seating.optimal
    cost = is_a_seating(seating, guests, fixed, wanted)
    assert cost == pytest.approx(expected)


@given(parties())
@settings(max_examples=40)
def test_seating_in_turn_keeps_everybody_apart_too(party):
    guests, fixed, wanted = party
    seating = seat_in_turn(guests, Table(fixed.values()), wanted)
    if isinstance(seating, str):
        return
    assert is_a_seating(seating, guests, fixed, wanted) >= least_cost(guests, fixed, wanted)
    assert not seating.optimal


def is_a_seating(seating, guests, fixed, wanted) -> float:
    """Asserts that it is one, and returns its cost."""
    by_name = {each.name: each for each in guests}
    cost = sum(
        o.cost - min(x.cost for x in by_name[name].options) + SPARE_COST * by_name[name].spare
        for name, (o, _) in seating.chosen.items()
    )
    for kind, count in wanted.items():
        crowd = [n for n in seating.chosen if not by_name[n].foreground and by_name[n].type == kind]
        assert len(crowd) == count
    assert all(start in o.starts for o, start in seating.chosen.values())
    placed = list(seating.chosen.items())
    for n, (name, (o, start)) in enumerate(placed):
        for f in fixed.values():
            assert keeps_apart((f, round(f.enters / STEP)), (o.actor, start), strict=True)
        for other, (p, begins) in placed[:n]:
            strict = by_name[name].foreground or by_name[other].foreground
            assert keeps_apart((p.actor, begins), (o.actor, start), strict)
    return cost


def crowded():
    """Five cars that come along one road, whenever they like; the last two are spares."""
    return [
        guest(
            f"vehicle-{n}",
            [option(EASTWARDS, 0, range(0, 120, 2), 1.0), option(SLOWLY, 1, range(0, 120, 2), 0.5)],
            spare=n >= 3,
        )
        for n in range(5)
    ]


@pytest.mark.parametrize("way", [seat, seat_in_turn])
def test_the_same_party_is_seated_the_same_way_again(way):
    one, other = (way(crowded(), Table([]), {"vehicle": 3, "pedestrian": 0}) for _ in range(2))
    assert {n: (o.index, s) for n, (o, s) in one.chosen.items()} == {
        n: (o.index, s) for n, (o, s) in other.chosen.items()
    }


@pytest.mark.parametrize("way", [seat, seat_in_turn])
def test_spares_stay_out_unless_somebody_finds_no_room(way):
    wanted = {"vehicle": 3, "pedestrian": 0}
    seated = way(crowded(), Table([]), wanted)
    assert set(seated.chosen) == {"vehicle-0", "vehicle-1", "vehicle-2"}
    blocked = [guest("vehicle-0", [option(NORTHWARDS, 0, [0], 0.0)]), *crowded()[1:]]
    seated = way(blocked, Table([NORTHWARDS]), wanted)
    assert len(seated.chosen) == 3
    assert "vehicle-0" not in seated.chosen
    assert {"vehicle-1", "vehicle-2"} < set(seated.chosen)


@pytest.mark.parametrize("way", [seat, seat_in_turn])
def test_a_foreground_guest_without_room_is_told(way):
    stuck = guest("vehicle-1", [option(EASTWARDS, 0, [0], 0.0)], foreground=True)
    assert isinstance(way([stuck], Table([NORTHWARDS]), {}), str)


@pytest.mark.parametrize("way", [seat, seat_in_turn])
def test_nobody_wanted_nobody_seated(way):
    assert way([], Table([]), {"vehicle": 0, "pedestrian": 0}).chosen == {}


def test_in_turn_each_comes_as_near_to_its_wish_as_there_is_room():
    early = guest("vehicle-1", [option(EASTWARDS, 0, range(0, 200), 1.0, wish=50)])
    later = guest("vehicle-2", [option(EASTWARDS, 0, range(0, 200), 1.0, wish=52)])
    seated = seat_in_turn([early, later], Table([]), {"vehicle": 2})
    [(low, high)] = forbidden_offsets(EASTWARDS, EASTWARDS, strict=False)
    assert seated.chosen["vehicle-1"][1] == 50
    assert seated.chosen["vehicle-2"][1] == 50 + high
    assert low == -high


def test_in_turn_the_first_way_with_room_is_taken():
    options = [option(SLOWLY, 1, range(100), 1.0), option(EASTWARDS, 0, range(100), 3.0)]
    seated = seat_in_turn([guest("vehicle-1", options)], Table([]), {"vehicle": 1})
    assert seated.chosen["vehicle-1"][0].index == 1


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
    forbidden = forbidden_offsets(a, b, strict=strict)

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


def test_nobody_gives_a_second_cause_to_who_gives_way():
    """Where an unheld driver would have been, nobody else is within 2 s."""
    stop = Stop("yield_point", 30.0, 5.0, 15.0, "gives_way")
    held = EASTWARDS.edited(stops=(stop,))
    as_held = forbidden_offsets(held, NORTHWARDS, strict=True)
    [(low, high)] = [
        (low, high)
        for low, high in as_held
        if low * STEP <= 0.0 <= high * STEP  # unheld, both are in the middle at once
    ]
    assert low * STEP <= -2.4
    assert high * STEP >= 2.4


def test_two_walkers_need_little_room():
    beside = actor(walker(straight((6.9, -10.0), NORTH, 20.0)))
    assert forbidden_offsets(ON_FOOT, beside, strict=True) == []
