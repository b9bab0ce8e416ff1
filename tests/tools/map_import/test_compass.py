"""Compass names of legs: bearings, turns between names, and the names that a junction gets."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.tools.map_import.compass import (
    COMPASS_RING,
    compute_bearing,
    find_sides,
    name_bearing,
    name_turn,
    rotate_compass,
)
from scenewright.tools.map_import.legs import SurveyLeg, name_legs

names = st.sampled_from(COMPASS_RING)
MIRRORED = {"left": "right", "right": "left", "straight": "straight", "uturn": "uturn"}


def mirror(name):
    """The name on the other side of the line from south to north."""
    return COMPASS_RING[-COMPASS_RING.index(name) % 8]


@pytest.mark.parametrize(
    ("name", "east", "north"),
    [("north", 0, 1), ("east", 1, 0), ("south", 0, -1), ("west", -1, 0),
     ("northeast", 1, 1), ("southeast", 1, -1), ("southwest", -1, -1), ("northwest", -1, 1)],
)  # fmt: skip
def test_a_name_points_where_it_says(name, east, north):
    bearing = compute_bearing(name)
    assert (math.cos(bearing), math.sin(bearing)) == pytest.approx(
        np.array([east, north]) / math.hypot(east, north)
    )


@given(names, st.floats(-math.pi / 8 + 1e-6, math.pi / 8 - 1e-6), st.integers(-3, 3))
def test_every_direction_within_half_an_eighth_has_the_name(name, off, turns):
    assert name_bearing(compute_bearing(name) + off + turns * math.tau) == name


@given(st.floats(-20.0, 20.0))
def test_a_direction_is_named_within_an_eighth_of_half_a_turn(bearing):
    off = math.remainder(bearing - compute_bearing(name_bearing(bearing)), math.tau)
    assert abs(off) <= math.pi / 8 + 1e-9


@given(names, st.integers(-20, 20), st.integers(-20, 20))
def test_turns_of_names_add_up(name, first, second):
    assert rotate_compass(rotate_compass(name, first), second) == rotate_compass(
        name, first + second
    )
    assert rotate_compass(name, 8) == name
    turned = compute_bearing(name) - first * math.pi / 4
    assert name_bearing(turned) == rotate_compass(name, first)


@given(names)
def test_the_sides_of_a_leg_lie_at_right_angles_to_it(name):
    left, right = find_sides(name)
    ahead = compute_bearing(name)
    assert math.sin(compute_bearing(left) - ahead) == pytest.approx(1.0)
    assert math.sin(compute_bearing(right) - ahead) == pytest.approx(-1.0)


def test_the_sides_of_the_north_are_west_and_east():
    assert find_sides("north") == ("west", "east")


@pytest.mark.parametrize(("entry", "exit_"), [*product(COMPASS_RING, COMPASS_RING)])
def test_a_turn_between_names_is_the_turn_of_the_directions(entry, exit_):
    course = compute_bearing(entry) + math.pi  # of one who comes in
    turn = math.remainder(compute_bearing(exit_) - course, math.tau)
    if abs(turn) < 1e-9:
        expected = "straight"
    elif abs(abs(turn) - math.pi) < 1e-9:
        expected = "uturn"
    else:
        expected = "left" if turn > 0 else "right"
    assert name_turn(entry, exit_) == expected


@given(names, names, st.integers(0, 7))
def test_a_turn_stays_when_both_legs_are_turned_and_changes_side_in_a_mirror(a, b, eighths):
    turn = name_turn(a, b)
    assert name_turn(rotate_compass(a, eighths), rotate_compass(b, eighths)) == turn
    assert name_turn(mirror(a), mirror(b)) == MIRRORED[turn]
    assert name_turn(b, a) == MIRRORED[turn]


def build_legs(degrees):
    """Legs without lanes at bearings."""
    return [
        SurveyLeg(math.radians(a), (), (), np.zeros(2), np.array([math.cos(a), math.sin(a)]))
        for a in degrees
    ]


def list_turns(degrees):
    """The turn from each leg to each other one, as straight streets lead."""
    return [
        (i, j, math.remainder(math.radians(b - a - 180.0), math.tau))
        for i, a in enumerate(degrees)
        for j, b in enumerate(degrees)
        if i != j
    ]


@pytest.mark.parametrize("off", [-20.0, -5.0, 0.0, 5.0, 20.0])
def test_a_cross_that_is_a_little_turned_has_the_plain_names(off):
    degrees = [off + a for a in (-180, -90, 0, 90)]
    named = name_legs(build_legs(degrees), list_turns(degrees))
    assert named == ("west", "south", "east", "north")


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [
        ((-90, 0, 180), ("south", "east", "west")),
        ((0, 90, 180), ("east", "north", "west")),
        ((-90, 90, 180), ("south", "north", "west")),
    ],
)
def test_a_t_junction_lacks_the_name_of_the_leg_that_is_missing(degrees, expected):
    assert name_legs(build_legs(degrees), list_turns(degrees)) == expected


def test_eight_legs_have_all_names_in_their_order():
    degrees = [-180 + 45 * k for k in range(8)]
    assert name_legs(build_legs(degrees), list_turns(degrees)) == (
        "west", "southwest", "south", "southeast", "east", "northeast", "north", "northwest",
    )  # fmt: skip


@given(st.integers(3, 6), st.floats(-10.0, 10.0), st.integers(0, 5))
def test_names_are_different_and_in_the_order_of_the_legs(count, off, seed):
    gaps = np.random.default_rng(seed).uniform(0.7, 1.3, count)
    degrees = sorted(off - 180.0 + 360.0 * np.cumsum(gaps) / gaps.sum() - 1.0)
    named = name_legs(build_legs(degrees), [])
    assert len(set(named)) == count
    # Counter-clockwise, they go round the ring once.
    steps = [
        (COMPASS_RING.index(a) - COMPASS_RING.index(b)) % 8
        for a, b in zip(named, (*named[1:], named[0]), strict=True)
    ]
    assert sum(steps) == 8


def test_the_turn_that_is_driven_outweighs_the_nearest_name():
    # A street bends by 60 degrees at the side road; its traffic is said to go straight on.
    degrees = (-90.0, 30.0, 180.0)
    turns = [(2, 1, 0.1), (1, 2, -0.1), (0, 1, -1.2), (1, 0, 1.2), (2, 0, -1.5), (0, 2, 1.5)]
    named = name_legs(build_legs(degrees), turns)
    assert name_turn(named[2], named[1]) == "straight"
    assert name_turn(named[0], named[1]) == "right"
    assert name_turn(named[2], named[0]) == "right"
