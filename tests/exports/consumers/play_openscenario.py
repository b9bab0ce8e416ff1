"""First collisions in OpenSCENARIO files, by scenario-gym: its reader, its clock, its test."""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from scenario_gym import ScenarioGym
from scenario_gym.xosc_interface import import_scenario


def play(file: Path, question: dict[str, Any]) -> dict[str, Any]:
    """Pairs and times of first contact, and how far the positions are from the scene's [m]."""
    scenario = import_scenario(str(file), relabel=False)
    gym = ScenarioGym(timestep=question["step"], terminal_conditions=["max_length"])
    gym.set_scenario(scenario)
    gym.reset_scenario()
    found: dict[tuple[str, str], float] = {}
    while True:
        for entity, others in gym.state.collisions().items():
            for other in others:
                pair = sorted((entity.ref, other.ref))
                found.setdefault((pair[0], pair[1]), round(gym.state.t, 3))
        if gym.state.is_done:  # the last state counts as well
            break
        gym.step()
    by_name = {entity.ref: entity for entity in scenario.entities}
    worst = 0.0
    for name, agent in question["agents"].items():
        for t, xy in zip(agent["t"], agent["xy"], strict=True):
            there = find_middle(by_name[name], t)
            worst = max(worst, float(np.abs(there - xy).max()))
    return {
        "agents": len(scenario.entities),
        "collisions": [[*pair, t] for pair, t in sorted(found.items())],
        "position_error": worst,
        "roads": len(scenario.road_network.roads) if scenario.road_network else 0,
    }


def find_middle(entity: Any, t: float) -> np.ndarray:
    """[2] middle of an entity's box at a time [m]; its place is that of its reference point."""
    x, y, _, heading, *_ = entity.trajectory.position_at_t(t)
    box = entity.catalog_entry.bounding_box
    ahead = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-ahead[1], ahead[0]])
    return np.array([x, y]) + box.center_x * ahead + box.center_y * left


def main() -> None:
    request = json.load(sys.stdin)
    answers = [play(Path(each["file"]), each) for each in request["scenes"]]
    json.dump({"version": version("scenario-gym"), "scenes": answers}, sys.stdout)


if __name__ == "__main__":
    main()
