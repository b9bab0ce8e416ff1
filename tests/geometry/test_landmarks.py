"""Areas and landmarks of the shipped map on paths whose places are known by hand."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright.geometry.landmarks import find_landmarks
from scenewright.geometry.map_areas import MapAreas, Visit
from scenewright.intersections import load_map
from scenewright.scene.constraints import (
    MinLength,
    OnRoad,
    OnWalkable,
    PassesThrough,
    RunsRed,
    SpeedBetween,
)
from scenewright.tools.dsl_validator.check import check
from solver_agents import CAR, EAST, SOUTH, SOUTHBOUND, candidate, straight, walker

GROUND = MapAreas(load_map("amsterdam_120"))
SOUTHWARDS = candidate(straight((-4.95, 49.5), SOUTH, 99.0))
ACROSS = walker(straight((-14.0, 8.6), EAST, 28.0))


def refusal(of, clause):
    found = check(of, clause, landmarks=find_landmarks(of, map_areas=GROUND), map_areas=GROUND)
    assert len(found) <= 1
    return found[0].detail if found else None


def test_points_on_road_and_sidewalk():
    lane, sidewalk = np.array([[-4.95, 30.0]]), np.array([[-14.0, 8.6]])
    assert (GROUND.compute_road_share(lane), GROUND.compute_walkable_share(lane)) == (1.0, 0.0)
    assert (GROUND.compute_road_share(sidewalk), GROUND.compute_walkable_share(sidewalk)) == (
        0.0,
        1.0,
    )
    assert GROUND.compute_road_share(np.concatenate([lane, lane, sidewalk])) == pytest.approx(2 / 3)
    crosswalk = np.array([[0.0, 8.6], [0.0, 0.0]])
    assert GROUND.find_crosswalk_visits(crosswalk) == [Visit("north:crosswalk", 0, 0, 0)]
    again = np.concatenate([crosswalk[::-1], crosswalk[::-1]])
    assert GROUND.find_crosswalk_visits(again) == [Visit("north:crosswalk", 1, 3, 2)]


def test_a_vehicles_line_is_where_its_bumper_meets_the_stop_line():
    landmarks = find_landmarks(SOUTHWARDS, map_areas=GROUND)
    assert landmarks.group == "avenue"
    assert landmarks.line == pytest.approx(49.5 - 11.8 - CAR.length / 2, abs=1e-6)


def test_a_vehicle_touches_the_crosswalks_with_its_front_and_leaves_them_with_its_rear():
    landmarks = find_landmarks(SOUTHWARDS, map_areas=GROUND)
    assert [name for name, _, _ in landmarks.crosswalks] == ["north:crosswalk", "south:crosswalk"]
    _, touches, leaves = landmarks.crosswalks[0]
    assert touches == pytest.approx(49.5 - 10.6 - CAR.length / 2, abs=0.5)
    assert leaves == pytest.approx(49.5 - 6.6 + CAR.length / 2, abs=0.5)


def test_a_pedestrians_line_is_its_kerb():
    landmarks = find_landmarks(ACROSS, map_areas=GROUND)
    assert (landmarks.group, landmarks.own_crosswalk) == ("walk_across_avenue", "north:crosswalk")
    assert landmarks.steps_on == 1
    assert ACROSS.path.xy[round(landmarks.line / 0.5), 0] == pytest.approx(-9.09 - 0.3, abs=0.6)


def test_a_jaywalkers_line_is_the_kerb_and_no_light_rules_it():
    route = next(
        r for r in GROUND.intersection_map.routes if r.id == "pedestrian:north:west>east:jaywalk"
    )
    landmarks = find_landmarks(
        walker(straight((-14.0, 30.0), EAST, 28.0), route=route), map_areas=GROUND
    )
    assert landmarks.group is None
    assert landmarks.line == pytest.approx(14.0 - 9.09 - 0.3, abs=0.5)


@pytest.mark.parametrize(
    ("of", "clause", "problem"),
    [
        (SOUTHWARDS, OnRoad(agent="vehicle-1"), None),
        (candidate(straight((-14.0, 50.0), SOUTH, 40.0)), OnRoad(agent="vehicle-1"), "on the road"),
        (SOUTHWARDS, MinLength(agent="vehicle-1", metres=98.0), None),
        (SOUTHWARDS, MinLength(agent="vehicle-1", metres=101.0), "m of path"),
        (SOUTHWARDS, SpeedBetween(agent="vehicle-1", low=9, high=11), None),
        (SOUTHWARDS, SpeedBetween(agent="vehicle-1", low=11, high=12), "free speed 10.0 m/s"),
        (SOUTHWARDS, PassesThrough(agent="vehicle-1", region="junction"), None),
        (SOUTHWARDS, PassesThrough(agent="vehicle-1", region="leg", leg="south"), None),
        (SOUTHWARDS, PassesThrough(agent="vehicle-1", region="leg", leg="east"), "not pass"),
        (SOUTHWARDS, PassesThrough(agent="vehicle-1", region="crosswalk", leg="north"), None),
        (SOUTHWARDS, PassesThrough(agent="vehicle-1", region="crosswalk", leg="west"), "not pass"),
        (SOUTHWARDS, RunsRed(agent="vehicle-1"), None),
        (ACROSS, OnWalkable(agent="pedestrian-1"), None),
        (
            walker(straight((-14.0, 11.2), EAST, 28.0)),
            OnWalkable(agent="pedestrian-1"),
            "on walkable area",
        ),
        (
            walker(straight((-11.8, 20.0), SOUTH, 28.0)),
            OnWalkable(agent="pedestrian-1"),
            "strays onto the west:crosswalk",
        ),
    ],
)
def test_unary_clauses_hold_or_say_why_not(of, clause, problem):
    found = refusal(of, clause)
    assert (found is None) if problem is None else problem in found


def test_a_jaywalker_has_no_red_light_to_run():
    route = next(r for r in GROUND.intersection_map.routes if r.movement == "jaywalking")
    of = walker(straight((-14.0, 30.0), EAST, 28.0), route=route)
    assert "no red light" in refusal(of, RunsRed(agent="pedestrian-1"))


def test_the_route_names_movement_and_stop_line():
    assert SOUTHBOUND.movement_id in {movement.id for movement in GROUND.intersection_map.movements}


@pytest.mark.parametrize("wished", [20.0, 38.0, 50.0, 62.0, 90.0])
def test_a_place_to_stand_blocks_no_crosswalk_but_ones_own(wished):
    landmarks = find_landmarks(SOUTHWARDS, map_areas=GROUND)
    s = landmarks.move_off_crosswalks(wished)
    assert s <= wished
    assert not any(begins < s < ends for _, begins, ends in landmarks.crosswalks)
    on_one = [name for name, begins, ends in landmarks.crosswalks if begins < wished < ends]
    assert (s == wished) is (not on_one)
    for name in on_one:
        assert landmarks.move_off_crosswalks(wished, own=name) == wished
