"""Distance and time of closest encounter, TTC in a lane and PET of a junction by CommonRoad-CriMe.

CriMe wants a lanelet map. Pairs get one wide lanelet from west to east, which DCE, TTCE and TTC
need to be there; pairs that are told to be `crossing` get two roads of the given width, one from
west to east and one from south to north, and PET over the square where they overlap. HW and TTC of
version 0.4.5 are only right for lanes that run to the east, so no other lane is asked for.
"""

from __future__ import annotations

import json
import logging
import math
import sys
from importlib.metadata import version
from typing import Any

import numpy as np
from commonroad.geometry.shape import Circle, Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.intersection import Intersection, IntersectionIncomingElement
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, LaneletType
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario, Tag
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory
from commonroad_crime.data_structure.configuration import CriMeConfiguration
from commonroad_crime.measure import DCE, PET, TTC, TTCE

FAR = 300.0


def lanelet(number: int, begin: Any, end: Any, width: float, **links: Any) -> Lanelet:
    """A straight lanelet between two points."""
    line = np.linspace(begin, end, 61)
    along = (line[-1] - line[0]) / np.hypot(*(line[-1] - line[0]))
    left = np.array([-along[1], along[0]]) * width / 2
    return Lanelet(line + left, line, line - left, number, **links)


def one_lane() -> list[Lanelet]:
    return [lanelet(1001, (-FAR, 0.0), (FAR, 0.0), 2 * FAR)]


def crossroads(width: float) -> tuple[list[Lanelet], Intersection]:
    """Two one-way roads, each in three pieces; the middle ones overlap."""
    pieces, ways = [], ((1000, np.array([1.0, 0.0])), (2000, np.array([0.0, 1.0])))
    for base, way in ways:
        inner = {"predecessor": [base + 1], "successor": [base + 3],
                 "lanelet_type": {LaneletType.INTERSECTION}}  # fmt: skip
        pieces += [
            lanelet(base + 1, -FAR * way, -10 * way, width, successor=[base + 2]),
            lanelet(base + 2, -10 * way, 10 * way, width, **inner),
            lanelet(base + 3, 10 * way, FAR * way, width, predecessor=[base + 2]),
        ]
    incomings = [
        IntersectionIncomingElement(base + 9, {base + 1}, successors_straight={base + 2})
        for base, _ in ways
    ]
    return pieces, Intersection(5000, incomings)


def obstacle(agent: dict[str, Any], lanes: LaneletNetwork) -> DynamicObstacle:
    walker = agent["class"] == "pedestrian"
    # commonroad-io 2024.3 draws a circle with half the radius it is given
    shape = Circle(agent["width"]) if walker else Rectangle(agent["length"], agent["width"])
    xy = np.column_stack((agent["x"], agent["y"]))
    speed = np.hypot(*np.gradient(xy, agent["step"], axis=0).T)
    begin = round(agent["start"] / agent["step"])
    states = [
        {"time_step": begin + k, "position": p, "orientation": math.remainder(h, 2 * math.pi),
         "velocity": float(v)}
        for k, (p, h, v) in enumerate(zip(xy, agent["heading"], speed, strict=True))
    ]  # fmt: skip
    first = InitialState(**states[0], acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
    found = lanes.find_lanelet_by_position(list(xy))
    assigned = {begin + k: set(ids) for k, ids in enumerate(found)}
    track = Trajectory(begin + 1, [CustomState(**state) for state in states[1:]])
    prediction = TrajectoryPrediction(track, shape, assigned, assigned)
    kind = ObstacleType.PEDESTRIAN if walker else ObstacleType.CAR
    return DynamicObstacle(agent["id"], kind, shape, first, prediction)


def configuration(pair: dict[str, Any]) -> CriMeConfiguration:
    """The two agents of a pair on their map, the first as ego."""
    lanes, junction = crossroads(pair["crossing"]) if pair.get("crossing") else (one_lane(), None)
    network = LaneletNetwork.create_from_lanelet_list(lanes)
    scenario = Scenario(pair["agents"][0]["step"])
    scenario.add_objects(network)
    if junction is not None:
        scenario.add_objects(junction)
        scenario.tags = {Tag.INTERSECTION}
    for agent in pair["agents"]:
        scenario.add_objects(obstacle(agent, scenario.lanelet_network))
    config = CriMeConfiguration()
    config.update(ego_id=pair["agents"][0]["id"], sce=scenario)
    return config


def measures(pair: dict[str, Any]) -> dict[str, Any]:
    other = pair["agents"][1]["id"]
    begin = round(max(a["start"] / a["step"] for a in pair["agents"]))
    if pair.get("crossing"):
        return {"pet": _finite(PET(configuration(pair)).compute(other, begin, verbose=False))}
    config = configuration(pair)
    result = {
        "dce": _finite(DCE(config).compute(other, begin, verbose=False)),
        "ttce": _finite(TTCE(config).compute(other, begin, verbose=False)),
    }
    if pair.get("in_lane"):
        ttc = TTC(config)
        result["ttc"] = [
            [k, _finite(ttc.compute(other, k, verbose=False))] for k in pair["in_lane"]
        ]
    return result


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


def main() -> None:
    logging.disable(logging.CRITICAL)
    request = json.load(sys.stdin)
    answers = [measures(pair) for pair in request["pairs"]]
    json.dump({"version": version("commonroad-crime"), "pairs": answers}, sys.stdout)


if __name__ == "__main__":
    main()
