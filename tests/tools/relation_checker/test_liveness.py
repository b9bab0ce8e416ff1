"""Who stands without a reason: every answer follows from the plan of lights and the tracks."""

from __future__ import annotations

import numpy as np
import pytest

from checker_tracks import EAST, NORTH, distance, light, line, list_rules, plus_map, scene, walk
from scenewright.tools.relation_checker import check, observe
from scenewright.tools.relation_checker.liveness import check_liveness

GREEN = [light("green", 0.0, 30.0), light("green", 0.0, 30.0, crosswalk=True)]
RED = [light("red", 0.0, 30.0), light("red", 0.0, 30.0, crosswalk=True)]


def waiting_car(seconds, *, n=1, x=-47.7):
    """East at 10 m/s, braking at 2.5 m/s^2 from 1.5 s on: its front, 2.3 m ahead of its centre,
    stands 0.4 m before the line from 5.5 s on."""
    s = distance(10.0, (0.0, 1.5), (-2.5, 4.0), (0.0, seconds), (2.0, 3.0))
    return line(n, (x - 2.0, -1.75), EAST, s)


def waiting_walker(seconds):
    """North at 1.4 m/s to the kerb at y = -3.5, where it stands from 3 s on."""
    s = distance(1.4, (0.0, 2.0), (-1.4, 1.0), (0.0, seconds), (1.4, 1.0), (0.0, 6.0))
    return walk(2, (-8.0, -7.5), NORTH, s)


def find(users, signals=GREEN, background=(1, 2)):
    observed = observe(
        users, intersection_map=plus_map(), signals=signals, asked=(), detailed=frozenset(),
        until=30.0,
    )  # fmt: skip
    return [(each.rule, each.agents, each.time) for each in check_liveness(
        observed, background=background)]  # fmt: skip


@pytest.mark.parametrize(("seconds", "found"), [(3.5, []), (6.0, ["stands_on_green"])])
def test_a_vehicle_that_stands_at_its_line_on_green_is_named_after_four_seconds(seconds, found):
    assert [rule for rule, _, _ in find([waiting_car(seconds)])] == found


def test_it_is_named_with_the_time_from_which_it_could_have_gone():
    lights = [light("red", 0.0, 8.0), light("green", 8.0, 30.0)]
    [(rule, agents, time)] = find([waiting_car(10.0)], lights)
    assert (rule, agents, time) == ("stands_on_green", (1,), 8.0)


def test_a_red_light_is_a_reason_to_stand():
    assert find([waiting_car(10.0), waiting_walker(10.0)], RED) == []


def test_so_is_a_vehicle_or_a_pedestrian_before_it():
    stopped = line(3, (-5.0, -1.75), EAST, np.zeros(160))
    assert find([waiting_car(8.0), stopped]) == []
    walker = walk(3, (-8.0, -14.0), NORTH, distance(1.4, (0.0, 15.0)))
    assert find([waiting_car(8.0), walker]) == []


@pytest.mark.parametrize(("front", "found"), [(3.9, ["stands_on_green"]), (4.1, [])])
def test_a_vehicle_stands_at_the_line_where_its_front_is_within_four_metres_of_it(front, found):
    car = waiting_car(8.0, x=-47.7 + 0.4 - front)
    assert [rule for rule, _, _ in find([car])] == found


@pytest.mark.parametrize(("seconds", "found"), [(3.0, []), (9.0, ["misses_walk_phase"])])
def test_a_pedestrian_that_stands_through_a_walk_phase_is_named(seconds, found):
    assert [rule for rule, _, _ in find([waiting_walker(seconds)])] == found


def test_who_never_moves_is_named_unless_it_is_a_wreck_or_of_the_foreground():
    stands = walk(1, (-20.0, 5.0), NORTH, np.zeros(200))
    assert find([stands], RED) == [("never_moves", (1,), 0.0)]
    assert find([stands], RED, background=()) == []
    parked = line(1, (0.0, -1.75), EAST, np.zeros(200))
    runs_into_it = line(3, (-60.0, -1.75), EAST, distance(8.0, (0.0, 7.0)))
    assert find([parked, runs_into_it], RED) == []


def test_a_scene_made_here_is_not_verified_with_one():
    record = scene([waiting_car(8.0)], background=(1,), signals=GREEN)
    assert "stands_on_green" not in list_rules(check(record, plus_map()))
    made = record.model_copy(update={"meta": record.meta.model_copy(update={"rules": 3})})
    proof = check(made, plus_map())
    assert "stands_on_green" in list_rules(proof)
    assert not proof.verified
