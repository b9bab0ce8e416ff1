"""A refusal that a retried stage can act on."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

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
    "impossible",
    "malformed_program",
    "no_surviving_combination",
    "unknown_anchor",
    "times_not_increasing",
    "segment_off_track",
    "relation_not_realised",
    "wrong_braker",
    "words_not_shown",
    "background_interferes",
    "implausible_motion",
    "unlawful",
    "work_spent",
]

SEARCHED: frozenset[RejectionCode] = frozenset((
    "no_surviving_combination", "relation_not_realised", "wrong_braker", "words_not_shown",
    "background_interferes", "implausible_motion", "unlawful", "work_spent",
))  # fmt: skip
"""What a search did not find; another seed may. The other codes hold for every seed."""
MISPLANNED: tuple[RejectionCode, ...] = ("wrong_braker", "words_not_shown")
"""What a later stage finds and only another plan can mend."""


class Rejection(Model):
    """Why a stage's product was refused.

    Attributes:
        stage: the stage that refused.
        code: for tables, tests and routes.
        agents: the agents concerned, if any.
        detail: one sentence for the repair.
        missed: how near the nearest attempt came to a clause that never held, for comparison with
            other attempts: what it failed on, negated, and by how much. Not written to files.
        repairable: whether another answer to the stage's question could mend it; where none can,
            only another layout does. Not written to files.
    """

    stage: Stage
    code: RejectionCode
    agents: tuple[str, ...] = ()
    detail: str
    missed: tuple[int, float] | None = Field(default=None, exclude=True)
    repairable: bool = Field(default=True, exclude=True)
