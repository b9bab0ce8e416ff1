"""Rollouts as the Waymo Open Sim Agents Challenge takes them, without TensorFlow.

Field numbers are those of the challenge's sim_agents_submission.proto.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.tools.formats.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.formats.protobuf_schema import build_messages
from scenewright.tools.formats.womd import PACKAGE

CURRENT, STEPS, ROLLOUTS = 10, 80, 32
"""The last step that is given, how many follow it, and how many times they are simulated."""
NEAR = 0.01
"""Rollouts of one scenario have every agent at one place at the last given step [m]."""
_SCHEMA = """
SimulatedTrajectory: center_x 2 +float, center_y 3 +float, center_z 4 +float, heading 5 +float, object_id 6 int32
JointScene: simulated_trajectories 1 *SimulatedTrajectory
ScenarioRollouts: scenario_id 1 string, joint_scenes 2 *JointScene
SimAgentsChallengeSubmission: scenario_rollouts 1 *ScenarioRollouts, submission_type 2 int32, uses_lidar_data 9 bool, uses_camera_data 10 bool
"""  # noqa: E501
_SIM_AGENTS = 1


@cache
def load_messages() -> dict[str, Any]:
    """The message classes of a submission, by name."""
    return build_messages(PACKAGE, _SCHEMA)


def write(scene: ExportedScene) -> dict[str, bytes]:
    """The 8 s after the eleventh step of a scene, of every agent and object that is there then.

    An agent whose track ends before goes on along its route, and stands at the end of the map.
    """
    joint = load_messages()["JointScene"](simulated_trajectories=_list_trajectories(scene))
    return {f"{scene.name}.joint_scene.binproto": joint.SerializeToString(deterministic=True)}


def write_index(scenes: Sequence[ExportedScene]) -> dict[str, bytes]:
    """One submission of all scenes; those alike until the eleventh step are of one scenario.

    There is none where no two scenes are alike.

    Raises:
        InputError: a scenario has not 32 rollouts; says which and how many.
    """
    scenarios: list[list[ExportedScene]] = []
    for scene in scenes:
        alike = (own for own in scenarios if _begin_alike(own[0], scene))
        held = next(alike, None)
        if held is None:
            scenarios.append([scene])
        else:
            held.append(scene)
    for own in scenarios if len(scenarios) < len(scenes) else ():
        if len(own) != ROLLOUTS:
            raise InputError(
                f"{own[0].name} has {len(own)} rollouts, scenes that are as it is until "
                f"{CURRENT * own[0].step:g} s; the challenge takes {ROLLOUTS} of each scenario"
            )
    if len(scenarios) == len(scenes):
        return {}
    submission = load_messages()["SimAgentsChallengeSubmission"](
        submission_type=_SIM_AGENTS, uses_lidar_data=False, uses_camera_data=False,
        scenario_rollouts=[
            {
                "scenario_id": own[0].name,
                "joint_scenes": [{"simulated_trajectories": _list_trajectories(s)} for s in own],
            }
            for own in scenarios
        ],
    )  # fmt: skip
    return {"submission.binproto": submission.SerializeToString(deterministic=True)}


def _list_present(scene: ExportedScene) -> list[ExportedAgent]:
    """Agents and objects that are there at the last given step."""
    return [a for a in (*scene.agents, *scene.objects) if a.first <= CURRENT <= a.last]


def _begin_alike(one: ExportedScene, other: ExportedScene) -> bool:
    """Whether the same agents are at the same places at the last given step."""
    places = [
        {a.id: a.xy[CURRENT - a.first] for a in _list_present(scene)} for scene in (one, other)
    ]
    first, second = places
    return first.keys() == second.keys() and all(
        np.hypot(*(first[n] - second[n])) <= NEAR for n in first
    )


def _list_trajectories(scene: ExportedScene) -> list[dict[str, Any]]:
    trajectories = []
    for agent in _list_present(scene):
        went = agent.continue_until(CURRENT + STEPS)
        at = np.minimum(CURRENT + 1 + np.arange(STEPS), went.last) - went.first
        (x, y), heading = went.xy[at].T, went.heading[at]
        trajectories.append({
            "object_id": agent.id, "center_x": x.tolist(), "center_y": y.tolist(),
            "center_z": [agent.height / 2] * STEPS, "heading": heading.tolist(),
        })  # fmt: skip
    return trajectories
