"""First collisions in CommonRoad files: commonroad-io reads, the drivability checker collides."""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from itertools import combinations
from typing import Any

import numpy as np
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.scenario.obstacle import StaticObstacle
from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import (
    create_collision_object,
)


def play(question: dict[str, Any]) -> dict[str, Any]:
    """Pairs and times of first contact, and how far the positions are from the scene's [m]."""
    scenario, _ = CommonRoadFileReader(question["file"]).open()
    numbers = {agent["id"]: name for name, agent in question["agents"].items()}
    numbers |= {number: name for name, number in question["objects"].items()}
    obstacles = {numbers[each.obstacle_id]: each for each in scenario.obstacles}
    worst = 0.0
    for name, agent in question["agents"].items():
        first = round(agent["t"][0] / scenario.dt)
        for k, xy in enumerate(agent["xy"]):
            there = obstacles[name].state_at_time(first + k).position
            worst = max(worst, float(np.abs(there - np.array(xy)).max()))
    network = scenario.lanelet_network
    return {
        "agents": len(obstacles),
        "collisions": _collide(obstacles, scenario.dt, question["steps"]),
        "position_error": worst,
        "lanelets": len(network.lanelets),
        "lights": len(network.traffic_lights),
    }


def _collide(obstacles: dict[str, Any], step: float, steps: int) -> list[list[Any]]:
    shapes = {name: create_collision_object(each) for name, each in obstacles.items()}
    stands = {name for name, each in obstacles.items() if isinstance(each, StaticObstacle)}
    found = []
    for a, b in combinations(sorted(shapes), 2):
        if {a, b} <= stands:
            continue
        for k in range(steps):
            one, two = (shapes[n] if n in stands else shapes[n].obstacle_at_time(k) for n in (a, b))
            if one is not None and two is not None and one.collide(two):
                found.append([a, b, round(k * step, 3)])
                break
    return found


def main() -> None:
    request = json.load(sys.stdin)
    answers = [play(each) for each in request["scenes"]]
    json.dump({"version": version("commonroad-drivability-checker"), "scenes": answers}, sys.stdout)


if __name__ == "__main__":
    main()
