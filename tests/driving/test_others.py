"""Others that react to the ego, and others that are re-timed for it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from exported_scenes import make_agent, make_line, make_record
from scenewright.driving.passing_order import find_passing_order
from scenewright.driving.policies import (
    LANE_FOLLOWER,
    ConstantSpeedPolicy,
    ReplayPolicy,
    RuleBasedPolicy,
)
from scenewright.driving.reactive import AHEAD, _find_speed
from scenewright.driving.report import report_drive
from scenewright.driving.run_drive import find_obstacles, run_drive
from scenewright.driving.scenario import COLOURS, Scenario, build_scenario
from scenewright.driving.single_drive import drive_once
from scenewright.driving.traffic import make_traffic
from scenewright.errors import InputError
from scenewright.intersections import load_map

NORTH, WEST = math.pi / 2, math.pi


def make_scenario(*agents: dict[str, Any], relations: tuple[Any, ...] = ()) -> Scenario:
    plain = make_record().to_json() | {"agents": list(agents), "events": [], "relations": relations}
    light = {"stop_line": "south:stop", "start": 0.0, "end": 10.0, "colour": "green"}
    record = type(make_record()).model_validate(plain | {"signals": [light]})
    return build_scenario(record, load_map("amsterdam_120"), ego="vehicle-1")


def drive_north(number: int, y: float, speed: float, seconds: float = 9.9) -> dict[str, Any]:
    line = make_line((4.95, y), (0.0, speed), seconds)
    return make_agent(number, f"vehicle-{number}", 0.0, line, NORTH)


class Standing:
    mode = "route"

    def reset(self, scenario: Scenario, seed: int) -> None:
        pass

    def act(self, observation: dict[str, Any]) -> np.ndarray:  # noqa: ARG002
        return np.array([-6.0])


def test_nothing_changes_where_the_ego_does_what_it_did() -> None:
    scenario = make_scenario(drive_north(1, -20.0, 6.0), drive_north(2, -35.0, 6.0))
    drives = [run_drive(scenario, ReplayPolicy(), others=o) for o in ("replay", "reactive")]
    states = [np.array([now.xy[1] for now in each.world.record]) for each in drives]
    assert np.abs(states[0] - states[1]).max() < 0.01


def test_who_follows_stops_behind_an_ego_that_brakes() -> None:
    scenario = make_scenario(
        drive_north(1, -20.0, 8.0), drive_north(2, -33.0, 8.0), drive_north(3, -46.0, 8.0)
    )
    hit = run_drive(scenario, Standing(), others="replay")
    drive = run_drive(scenario, Standing(), others="reactive")
    assert hit.world.end == "collision"
    assert drive.world.end == "over"
    ego, (_, second, third) = drive.world.ego, drive.world.others.xy[:, 1]
    assert 0.5 < ego.y - second - 4.6 < 4.0
    assert 0.5 < second - third - 4.6 < 4.0
    assert report_drive(drive).to_json()["background_collisions"] == 0
    speeds = np.array([now.speed[1:] for now in drive.world.record])
    assert np.diff(speeds, axis=0).min() >= -8.0 * 0.1 - 1e-6


def test_a_pedestrian_waits_for_an_ego_that_does_not() -> None:
    walker = make_agent(
        2, "pedestrian-1", 0.0, make_line((11.0, -6.5), (-1.2, 0.0), 9.0), WEST
    )  # fmt: skip
    scenario = make_scenario(drive_north(1, -48.0, 8.0), walker)
    assert run_drive(scenario, ConstantSpeedPolicy(), others="replay").world.hit == 1
    drive = run_drive(scenario, ConstantSpeedPolicy(), others="reactive")
    assert drive.world.hit is None
    assert drive.world.others.xy[1, 0] < 11.0 - 1.2 * 4


@pytest.mark.parametrize("speed", [6.0, 8.0, 10.0])
def test_a_retimed_pedestrian_meets_an_ego_of_any_speed(speed: float) -> None:
    walker = make_agent(2, "pedestrian-1", 0.0, make_line((13.0, -6.5), (-1.2, 0.0), 9.9), WEST)
    asked = {"type": "near_miss", "from": 1, "to": 2}
    scenario = make_scenario(drive_north(1, -49.0, speed), walker, relations=(asked,))
    told = report_drive(drive_once(scenario, ConstantSpeedPolicy(), others="resolve")).to_json()
    assert told["resolved"] == [{"with": "pedestrian-1", "came_about": True}]


def test_what_can_no_longer_come_about_is_said() -> None:
    walker = make_agent(2, "pedestrian-1", 0.0, make_line((30.0, -6.5), (-1.2, 0.0), 9.9), WEST)
    asked = {"type": "collision", "from": 1, "to": 2}
    far = make_line((30.0, -6.5), (-3.0, 0.0), 9.9)
    walker["trajectory"] = far.tolist()
    scenario = make_scenario(drive_north(1, -10.0, 9.0, 6.0), walker, relations=(asked,))
    told = report_drive(drive_once(scenario, ConstantSpeedPolicy(), others="resolve")).to_json()
    (row,) = told["resolved"]
    assert not row["came_about"]
    assert "m short of it" in row["reason"]


def make_crossing(walk: tuple[float, float], walk_speed: float, ego_speed: float) -> Scenario:
    walker = make_agent(2, "pedestrian-1", 0.0, make_line(walk, (-walk_speed, 0.0), 9.9), WEST)
    asked = {"type": "collision", "from": 1, "to": 2}
    return make_scenario(drive_north(1, -49.0, ego_speed), walker, relations=(asked,))


class Crossing:
    """Keeps its speed, but stops 15 m before its place for whoever is within 20 m and moves."""

    mode = "route"

    def reset(self, scenario: Scenario, seed: int) -> None:
        pass

    def act(self, observation: dict[str, Any]) -> np.ndarray:
        agents, ego = observation["agents"], observation["ego"]
        seen = agents[agents[:, 10] > 0]
        ahead = (seen[:, 0] > 0) & (np.hypot(seen[:, 0], seen[:, 1]) < 20.0)
        moving = np.hypot(seen[:, 4], seen[:, 5]) > 0.3
        return np.array([-5.0 if (ahead & moving).any() else (8.0 - ego[0]) / 0.5])


def test_a_rehearsal_brings_about_what_the_first_drive_missed() -> None:
    near = make_crossing((13.0, -6.5), 1.2, 8.0)
    first = drive_once(near, Crossing(), others="resolve", seed=2)
    drive = run_drive(near, Crossing(), others="resolve", seed=2)
    told = report_drive(drive).to_json()
    assert not report_drive(first).to_json()["resolved"][0]["came_about"]
    assert told["resolved"][0]["came_about"]
    assert told["tries"] > 1
    assert told["background_collisions"] == 0
    again = run_drive(near, Crossing(), others="resolve", seed=2)
    assert again.digest == drive.digest


def test_tracks_without_a_scene_have_nobody_to_retime() -> None:
    scenario = replace(make_crossing((13.0, -6.5), 1.2, 8.0), record=None)
    assert run_drive(scenario, ConstantSpeedPolicy(), others="resolve").tries is None


def test_who_waits_to_the_end_holds_nobody_up() -> None:
    waiting = make_agent(2, "pedestrian-1", 0.0, make_line((11.0, -6.5), (0.0, 0.0), 9.9), WEST)
    waiting["waypoints"] = [[11.0 - 1.5 * k, -6.5] for k in range(10)]
    ego = drive_north(1, 20.0, 1.0)
    scenario = make_scenario(ego, waiting, drive_north(3, -40.0, 5.0))
    drive = run_drive(scenario, ReplayPolicy(), others="reactive")
    assert np.abs(drive.world.record[80].xy[2] - scenario.xy[2, 80]).max() < 0.01


def test_physics_is_judged_by_a_drive_without_the_other() -> None:
    near = make_crossing((13.0, -6.5), 1.2, 8.0)
    drive = drive_once(near, ConstantSpeedPolicy(), others="resolve")
    assert find_obstacles(drive, ConstantSpeedPolicy()) == {"pedestrian-1": None}
    # Whoever brakes to a stop 40 m before the crosswalk cannot be met there.
    stopped = drive_once(near, Standing(), others="resolve")
    (why,) = find_obstacles(stopped, Standing()).values()
    assert why is not None
    assert "short of the place" in why
    # 32 m at 1.2 m/s^2 up to 2.4 m/s take 14.3 s; the ego is there after 5.3 s.
    far = make_crossing((37.0, -6.5), 3.4, 8.0)
    (why,) = find_obstacles(
        drive_once(far, ConstantSpeedPolicy(), others="resolve"), ConstantSpeedPolicy()
    ).values()
    assert why is not None
    assert "at the earliest" in why or "past the place" in why


def test_an_ego_kept_by_a_red_light_ends_the_attempt_with_the_reason() -> None:
    scenario = make_crossing((13.0, -6.5), 1.2, 8.0)
    red = np.full_like(scenario.colours, COLOURS.index("red"))
    held = replace(scenario, colours=red)
    told = report_drive(drive_once(held, RuleBasedPolicy(), others="resolve")).to_json()
    (row,) = told["resolved"]
    assert "red until the scene ends" in row["reason"]
    assert row["time"] < 9.9


def test_the_order_holds_for_who_comes_second() -> None:
    scenario = make_scenario(
        drive_north(1, -49.0, 1.0), drive_north(2, 0.0, 5.0, 5.0), drive_north(3, -20.0, 5.0, 9.0)
    )
    order = find_passing_order(scenario)
    # The second is 20 m ahead of the third: 4.6 m of length and the added gap lie between them.
    assert order.limits[1, 0, 2] == pytest.approx(20.0 - 4.6 - 0.4 - 0.5, abs=0.6)
    assert np.isinf(order.limits[2, 0, 1])


def test_the_allowed_speed_keeps_within_the_room() -> None:
    braking, step = np.array([3.0]), 0.1
    for room in (0.0, 1.0, 10.0, 40.0):
        speed = _find_speed(np.full((1, len(AHEAD)), room), braking, step)[0]
        assert speed * step + speed**2 / (2 * 3.0) <= room + 1e-6
    assert np.isinf(_find_speed(np.full((1, len(AHEAD)), np.inf), braking, step)[0])


def test_fewer_wait_for_the_ego_the_worse_their_temperament() -> None:
    walker = make_agent(2, "pedestrian-1", 0.0, make_line((11.0, -6.5), (-1.2, 0.0), 9.0), WEST)
    scenario = make_scenario(drive_north(1, -48.0, 8.0), walker)
    waited = [
        sum(
            drive_once(
                scenario, ConstantSpeedPolicy(), others="reactive", temperament=temper, seed=seed
            ).world.hit is None
            for seed in range(12)
        )
        for temper in ("obedient", "hasty", "careless")
    ]  # fmt: skip
    assert waited[0] == 12 > waited[1] > waited[2] > 0


@pytest.mark.parametrize(
    ("others", "temperament", "said"),
    [("reactive", "gruff", "gruff"), ("replay", "hasty", "replay"), ("herd", "hasty", "herd")],
)
def test_a_temperament_that_nobody_can_have_is_refused(
    others: Any, temperament: Any, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        make_traffic(others, temperament)


def test_a_lane_follower_brakes_for_its_lane_and_yields_to_nobody() -> None:
    ahead = make_scenario(drive_north(1, -48.0, 8.0), drive_north(2, -20.0, 0.3))
    assert run_drive(ahead, RuleBasedPolicy(LANE_FOLLOWER)).world.hit is None
    crossing = make_crossing((15.0, -6.5), 2.0, 8.0)
    assert run_drive(crossing, RuleBasedPolicy()).world.hit is None
    assert run_drive(crossing, RuleBasedPolicy(LANE_FOLLOWER)).world.hit == 1
