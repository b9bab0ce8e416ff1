"""Radii of lines, Bezier curves between directions, and curves that replace kinks."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.geometry.polyline import (
    find_point,
    measure_distances,
    measure_length,
    resample_by_spacing,
)
from scenewright.tools.map_import.curves import (
    LEAST_RADIUS,
    draw_curve,
    measure_least_radius,
    round_curves,
)


def turn(points, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.asarray(points, float) @ np.array([[c, s], [-s, c]])


def draw_corner(degrees, far=25.0):
    """A line that turns at the origin, half a metre from point to point."""
    a = math.radians(degrees)
    line = np.array([(-far, 0.0), (0.0, 0.0), (far * math.cos(a), far * math.sin(a))])
    return resample_by_spacing(line, 0.5)


@given(st.floats(3.0, 60.0))
def test_the_least_radius_of_an_arc_is_its_own(radius):
    t = np.arange(0.0, 20.0, 0.5) / radius
    arc = radius * np.column_stack([np.sin(t), 1 - np.cos(t)])
    assert measure_least_radius(arc) == pytest.approx(radius, rel=1e-6)


def test_a_straight_line_and_one_too_short_to_measure_have_no_radius():
    assert measure_least_radius(np.column_stack([np.arange(20.0), np.zeros(20)])) == math.inf
    assert measure_least_radius(np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 0.5)])) == math.inf


def test_a_line_that_turns_back_has_no_radius_at_all():
    there = np.column_stack([np.arange(0.0, 10.0, 0.5), np.zeros(20)])
    back = there[::-1] + np.array([0.0, 0.2])
    assert measure_least_radius(np.concatenate([there, back])) == 0.0


def test_the_sharpest_of_two_arcs_counts():
    t = np.arange(0.0, 8.0, 0.5)
    wide = 20.0 * np.column_stack([np.sin(t / 20), 1 - np.cos(t / 20)])
    course = 7.5 / 20.0
    ahead = np.array([math.cos(course), math.sin(course)])
    left = np.array([-ahead[1], ahead[0]])
    sharp = wide[-1] + 6.0 * (
        np.outer(np.sin(t[1:] / 6), ahead) + np.outer(1 - np.cos(t[1:] / 6), left)
    )
    assert measure_least_radius(np.concatenate([wide, sharp])) == pytest.approx(6.0, rel=1e-3)


@given(st.floats(0.0, 360.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.booleans())
def test_a_radius_is_the_same_wherever_the_line_lies_and_however_it_is_seen(
    degrees, east, north, mirrored
):
    line = draw_corner(50.0)
    line = 0.9 * line + np.column_stack([np.zeros(len(line)), np.linspace(0, 1, len(line)) ** 2])
    seen = turn(line, degrees) * ([1, -1] if mirrored else [1, 1]) + [east, north]
    expected = measure_least_radius(line)
    assert measure_least_radius(seen) == pytest.approx(expected, rel=1e-6)
    assert measure_least_radius(seen[::-1]) == pytest.approx(expected, rel=1e-6)


def test_a_curve_leaves_and_meets_in_the_directions_given():
    curve = draw_curve(*map(np.array, ((0.0, 0.0), (3.0, 0.0), (10.0, 10.0), (0.0, 0.2))))
    assert curve.shape == (21, 2)
    assert curve[0] == pytest.approx((0.0, 0.0))
    assert curve[-1] == pytest.approx((10.0, 10.0))
    first, last = curve[1] - curve[0], curve[-1] - curve[-2]
    assert math.atan2(first[1], first[0]) == pytest.approx(0.0, abs=0.1)
    assert math.atan2(last[1], last[0]) == pytest.approx(math.pi / 2, abs=0.1)


@given(st.floats(5.0, 40.0), st.floats(0.0, 360.0))
def test_a_curve_round_a_quarter_is_about_a_circle(radius, degrees):
    points = [turn([each], degrees)[0] for each in ((0, 0), (1, 0), (radius, radius), (0, 1))]
    curve = draw_curve(*points)
    centre = turn([(0.0, radius)], degrees)[0]
    away = np.hypot(*(curve - centre).T)
    assert away == pytest.approx(radius, rel=0.01)


@given(st.floats(1.0, 50.0), st.floats(0.1, 9.0), st.floats(0.1, 9.0))
def test_a_curve_straight_on_is_a_line_however_long_the_directions(far, first, last):
    curve = draw_curve(*map(np.array, ((0.0, 0.0), (first, 0.0), (far, 0.0), (last, 0.0))))
    assert curve[:, 1] == pytest.approx(0.0, abs=1e-12)
    assert (np.diff(curve[:, 0]) > 0).all()


def test_a_curve_without_a_direction_or_a_length_is_still_numbers():
    zero = np.zeros(2)
    assert np.isfinite(draw_curve(zero, zero, np.array([5.0, 0.0]), zero)).all()
    assert draw_curve(zero, zero, zero, zero) == pytest.approx(0.0)


@given(st.floats(0.0, 360.0))
def test_a_curve_turns_with_its_ends(degrees):
    ends = np.array([(0.0, 0.0), (1.0, 0.2), (12.0, 7.0), (0.3, 1.0)])
    assert draw_curve(*turn(ends, degrees)) == pytest.approx(
        turn(draw_curve(*ends), degrees), abs=1e-9
    )


@given(st.floats(35.0, 110.0), st.booleans())
def test_a_corner_becomes_a_curve_that_keeps_both_streets(degrees, to_the_right):
    line = draw_corner(-degrees if to_the_right else degrees)
    rounded = round_curves(line)
    assert measure_least_radius(rounded) >= LEAST_RADIUS
    assert rounded[[0, -1]] == pytest.approx(line[[0, -1]])
    assert measure_distances(rounded, line).min(axis=1).max() <= 3.5
    assert measure_length(rounded) < measure_length(line)  # it cuts the corner
    assert np.hypot(*np.diff(rounded, axis=0).T).max() < 0.6
    for before, after in ((line, rounded), (line[::-1], rounded[::-1])):
        assert find_point(after, 4.0) == pytest.approx(find_point(before, 4.0), abs=0.05)


@pytest.mark.parametrize("degrees", [45.0, 75.0, 100.0])
def test_a_mirrored_corner_becomes_the_mirrored_curve(degrees):
    left, right = (round_curves(draw_corner(a)) for a in (degrees, -degrees))
    assert left == pytest.approx(right * [1, -1], abs=1e-6)


@given(st.floats(5.0, 40.0))
def test_what_a_car_can_drive_is_not_drawn_anew(radius):
    t = np.arange(0.0, min(30.0, 1.5 * radius), 0.5) / radius
    arc = radius * np.column_stack([np.sin(t), 1 - np.cos(t)])
    assert round_curves(arc) is arc


def test_both_of_two_corners_far_apart_are_rounded():
    points = np.array([(0, 0), (25, 0), (25, 40), (60, 40)], float)
    line = resample_by_spacing(points, 0.5)
    rounded = round_curves(line)
    assert measure_least_radius(rounded) >= LEAST_RADIUS
    # Between them the street is where it was.
    assert measure_distances(np.array([(25.0, 20.0)]), rounded).min() < 0.3
    for corner in points[1:3]:
        assert 0.5 < measure_distances(corner[None], rounded).min() < 3.5


def test_a_short_line_stays_as_it_is():
    line = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (1.0, 0.5)])
    assert round_curves(line) is line
