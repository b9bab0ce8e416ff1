"""The state of one run: one channel per product, written by one stage, replaced whole.

Nodes declare the channels they read as their parameter type and those they write as their return
type, so that LangGraph hands them no others.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping
from typing import Annotated, TypedDict

from scenewright.scene.base import FloatArray
from scenewright.scene.behavior import BehaviorProgram, EventSummary
from scenewright.scene.candidates import CandidateSet, Grounding
from scenewright.scene.constraints import ConstraintProgram
from scenewright.scene.events import Proof
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.record import SceneRecord
from scenewright.scene.refinement import Refinement
from scenewright.scene.rejection import Rejection
from scenewright.scene.remaining import AddedClauses, AddedStops
from scenewright.scene.selection import Selection
from scenewright.scene.social import SocialGraph
from scenewright.scene.track import Track

Tracks = Mapping[str, Track]
"""One track per agent name."""


class SceneState(TypedDict, total=False):
    """Every channel of a run (docs/architecture.md, data flow).

    Attributes:
        planned: a social graph that is fixed, so that the planner is not asked for one.
        pinned: agents of an earlier version that stay.
        added_clauses, added_stops: what words that no field of the plan holds became; they outlast
            a failed sample.
        rolled: what the network proposed for each agent, as [T] deviations from its edited prior
            in arc length [m].
    """

    instruction: str
    previous: str | None
    planned: SocialGraph | None
    pinned: FrozenAgents | None
    social_graph: SocialGraph
    grounding: Grounding
    candidates: CandidateSet
    added_clauses: AddedClauses
    constraints: ConstraintProgram
    selection: Selection
    summary: EventSummary
    added_stops: AddedStops
    behavior: BehaviorProgram
    edited: Tracks
    refined: Tracks
    rolled: Mapping[str, FloatArray]
    refinement: Refinement
    scene: SceneRecord
    proof: Proof
    refused: Rejection | None
    rejections: Annotated[list[Rejection], operator.add]
