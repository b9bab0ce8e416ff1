"""TTC at constant velocity by FCL, the collision library of robotics (python-fcl).

Vehicles are boxes and pedestrians cylinders, all of one height, so that the plane decides. TTC is
FCL's continuous collision of two translations, by conservative advancement. FCL's distances are
not asked for: between boxes that lie parallel they are up to a metre too long.
"""

from __future__ import annotations

import json
import math
import sys
from importlib.metadata import version
from typing import Any

import fcl
import numpy as np

HEIGHT = 100.0
STEPS = {"toc_err": 1e-5, "num_max_iterations": 10_000}


def shape(agent: dict[str, Any]) -> Any:
    if agent["class"] == "pedestrian":
        return fcl.Cylinder(agent["width"] / 2, HEIGHT)
    return fcl.Box(agent["length"], agent["width"], HEIGHT)


def place(x: float, y: float, heading: float) -> Any:
    c, s = math.cos(heading), math.sin(heading)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return fcl.Transform(turn, np.array([x, y, 0.0]))


def time_to_collision(states: list[list[float]], shapes: list[Any], horizon: float) -> float | None:
    bodies = [
        fcl.CollisionObject(g, place(*state[:3])) for g, state in zip(shapes, states, strict=True)
    ]
    ends = [place(x + horizon * vx, y + horizon * vy, h) for x, y, h, vx, vy in states]
    request = fcl.ContinuousCollisionRequest(
        ccd_motion_type=fcl.CCDMotionType.CCDM_TRANS,
        ccd_solver_type=fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT,
        gjk_solver_type=fcl.GJKSolverType.GST_INDEP,
        **STEPS,
    )
    result = fcl.ContinuousCollisionResult()
    fcl.continuousCollide(bodies[0], ends[0], bodies[1], ends[1], request, result)
    return result.time_of_contact * horizon if result.is_collide else None


def main() -> None:
    request = json.load(sys.stdin)
    answers = []
    for pair in request["pairs"]:
        shapes = [shape(agent) for agent in pair["agents"]]
        answers.append([time_to_collision(s, shapes, request["horizon"]) for s in pair["states"]])
    json.dump({"version": version("python-fcl"), "pairs": answers}, sys.stdout)


if __name__ == "__main__":
    main()
