"""When the bounding boxes of two entities first meet, by scenario-gym (its `CollisionMetric`).

Knows rectangles only, and looks every `timestep` seconds. Needs numpy < 2. All entities are called
obstacles: for what it calls vehicles, version 0.4.5 wants the kind of collision as well and stops
at an attribute that entities do not have.
"""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from typing import Any

import numpy as np
from scenario_gym.catalog_entry import BoundingBox, Catalog, CatalogEntry
from scenario_gym.entity import Entity
from scenario_gym.metrics.collision import CollisionMetric
from scenario_gym.scenario import Scenario
from scenario_gym.scenario_gym import ScenarioGym
from scenario_gym.trajectory import Trajectory


def entity(agent: dict[str, Any]) -> Entity:
    time = agent["start"] + agent["step"] * np.arange(len(agent["x"]))
    path = np.column_stack((time, agent["x"], agent["y"], agent["heading"]))
    box = BoundingBox(agent["width"], agent["length"], 0.0, 0.0)
    entry = CatalogEntry(Catalog("scenes", "Vehicle"), "box", "box", "MiscObject", box, {}, [])
    return Entity(entry, Trajectory(path, fields=("t", "x", "y", "h")), ref=str(agent["id"]))


def first_contact(agents: list[dict[str, Any]], timestep: float) -> float | None:
    """Time of the first contact of two agents while both are there [s]."""
    entities = [entity(agent) for agent in agents]
    metric = CollisionMetric()
    gym = ScenarioGym(timestep=timestep, metrics=[metric])
    gym.set_scenario(Scenario(entities, name="pair"))
    gym.rollout()
    found = metric.get_state()
    return float(found[0][0]) if found else None


def main() -> None:
    request = json.load(sys.stdin)
    answers = [first_contact(agents, request["timestep"]) for agents in request["pairs"]]
    json.dump({"version": version("scenario-gym"), "pairs": answers}, sys.stdout)


if __name__ == "__main__":
    main()
