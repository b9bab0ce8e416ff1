"""A refusal that a retried stage can act on."""

from __future__ import annotations

from typing import Literal

from scenewright.scene.base import Model

Stage = Literal[
    "scene_planner",
    "agent_generator",
    "waypoint_filter",
    "event_reasoner",
    "trajectory_refiner",
    "scene_verifier",
]

RejectionCode = Literal[
    "malformed_reply",
    "unknown_direction",
    "role_mismatch",
    "ungroundable",
    "out_of_scope",
    "contradictory",
    "malformed_program",
    "no_surviving_combination",
    "unknown_anchor",
    "times_not_increasing",
    "relation_not_realised",
    "background_interferes",
    "implausible_motion",
]


class Rejection(Model):
    """Why a stage's product was refused.

    Attributes:
        stage: the stage that refused.
        code: for tables, tests and routes.
        agents: the agents concerned, if any.
        detail: one sentence for whoever must repair it.
    """

    stage: Stage
    code: RejectionCode
    agents: tuple[str, ...] = ()
    detail: str
