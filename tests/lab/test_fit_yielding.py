"""Stops and yields as they are measured for `manners.json`, on motion whose answers are known."""

from dataclasses import replace

import numpy as np
import pytest

from lab.yielding.fit_yielding import find_yield_cases, fit_acceleration_profiles
from lab.yielding.stops import find_standstills, measure_line_gap, measure_stop
from scenewright.evals.realism.sources import convert_scene
from scenewright.graph.run import synthesize
from scenewright.intersections import load_map
from scenewright.scene.track import PEDESTRIAN, Track, get_vehicle_shape
from scenewright.tools.relation_checker import RoadUser, build_trajectory


@pytest.fixture(scope="module")
def intersection_map():
    return load_map("amsterdam_120")


@pytest.fixture(scope="module")
def yielding():
    """A car that comes to stand; with some seeds it only slows, which is a yield as well."""
    return synthesize("A car turning right yields to a pedestrian at 09:00", seed=7)


def ride(*, speed=8.0, braking=2.0, wait=3.0, starting=1.0, cruise=3.0):
    """Arc length at 0.1 s: cruises, brakes, stands, starts, cruises."""
    down, up = speed / braking, speed / starting
    ends = np.cumsum([cruise, down, wait, up, cruise])
    t = np.arange(0, ends[-1], 0.001)
    v = np.select(
        [t < ends[0], t < ends[1], t < ends[2], t < ends[3]],
        [speed, speed - braking * (t - ends[0]), 0.0, starting * (t - ends[2])],
        speed,
    )
    return (np.cumsum(v) * 0.001)[::100]


def mover(s, *, shape=None, origin=(0.0, 0.0), heading=0.0):
    way = np.array([np.cos(heading), np.sin(heading)])
    track = Track(np.array(origin) + s[:, None] * way, np.full(len(s), heading), 0.0)
    return build_trajectory(RoadUser(1, track, shape or get_vehicle_shape()))


def test_a_stop_is_measured_as_it_was_driven(intersection_map):
    driver = mover(ride())
    (stand,) = find_standstills(driver)
    stop = measure_stop(driver, stand, intersection_map)
    # At 0.3 m/s or less it stands: 0.15 s of the braking and 0.3 s of the starting.
    assert stop.duration == pytest.approx(3.45, abs=0.2)
    assert stop.braking == pytest.approx(2.0, abs=0.02)
    assert stop.starting == pytest.approx(1.0, abs=0.02)
    assert stop.mean_braking == pytest.approx(2.0, abs=0.1)
    assert stop.mean_starting == pytest.approx(1.0, abs=0.1)
    assert (stop.gap, stop.line_gap) == (None, None)


def test_what_the_scene_cuts_off_is_not_measured(intersection_map):
    whole = ride()
    standing = find_standstills(mover(whole))[0]
    cut_off = mover(whole[: standing.start + 15])
    late = measure_stop(cut_off, find_standstills(cut_off)[0], intersection_map)
    assert (late.duration, late.starting) == (None, None)
    assert late.braking == pytest.approx(2.0, abs=0.02)
    begun = mover(whole[standing.start + 5 :])
    early = measure_stop(begun, find_standstills(begun)[0], intersection_map)
    assert (early.duration, early.braking) == (None, None)


@pytest.mark.parametrize("leg", ["north", "south", "east", "west"])
def test_the_gap_to_the_stop_line_is_from_the_front_bumper(intersection_map, leg):
    line = next(each for each in intersection_map.stop_lines if each.leg == leg)
    middle = np.array(line.line).mean(axis=0)
    bearing = next(each.bearing for each in intersection_map.legs if each.name == leg)
    inwards = -np.array([np.cos(bearing), np.sin(bearing)])
    length = get_vehicle_shape().length
    for gap in (0.5, 3.0):
        place = middle - inwards * (gap + length / 2)
        here = mover(np.zeros(9), origin=place, heading=bearing + np.pi)
        assert measure_line_gap(here, 4, intersection_map) == pytest.approx(gap, abs=1e-6)
    away = mover(np.zeros(9), origin=middle + inwards * 5.0, heading=bearing)
    assert (
        measure_line_gap(away, 4, intersection_map) is None
        or measure_line_gap(away, 4, intersection_map) < 1.0
    )
    assert (
        measure_line_gap(mover(np.zeros(9), shape=PEDESTRIAN, origin=middle), 4, intersection_map)
        is None
    )


def with_another(scene):
    """The same scene with a second person who walks just as the one that is let pass."""
    walker = next(user for user in scene.users if user.id == scene.asked[0][1])
    track = replace(walker.track, xy=walker.track.xy + np.array([0.3, 0.3]))
    return replace(scene, users=(*scene.users, RoadUser(99, track, walker.shape)))


def find_cases(scene, intersection_map):
    return [
        each
        for each in find_yield_cases([scene], intersection_map=intersection_map)
        if each.pair == ("vehicle", "pedestrian")
    ]


def test_who_lets_one_pass_is_distinguished_from_who_lets_several(intersection_map, yielding):
    scene = convert_scene(yielding.record)
    (alone,) = find_cases(scene, intersection_map)
    (several,) = find_cases(with_another(scene), intersection_map)
    assert (alone.alone, several.alone) == (True, False)
    assert 0.0 <= alone.gap < 10.0


def test_who_stands_once_for_several_counts_once(intersection_map, yielding):
    scene = convert_scene(yielding.record)
    asked = find_cases(scene, intersection_map)
    twice = find_cases(with_another(scene), intersection_map)
    assert len(asked) == len(twice)
    assert all(each.stood_at is not None for each in twice)
    found = fit_acceleration_profiles(asked * 20)["vehicle"]
    assert 1.0 < found.starts[0] < 2.6
    assert 1.5 < found.brakes[0] < 3.1
    assert "pedestrian" not in fit_acceleration_profiles(asked * 20)
