"""Stage 1, scene planner: instruction -> social graph, grounded on the map (paper 3.1)."""

from __future__ import annotations

from typing import TypedDict

from langgraph.runtime import Runtime
from pydantic import RootModel

from scenewright.backends import Question
from scenewright.errors import Rejected
from scenewright.nodes.ask import ask, earlier
from scenewright.nodes.context import RunContext
from scenewright.scene.grounding import Grounding
from scenewright.scene.rejection import Rejection, RejectionCode
from scenewright.scene.social import Plan, Refusal, SocialGraph
from scenewright.tools.map_grounding import ground


class PlannerReads(TypedDict):
    """Channels read."""

    instruction: str
    previous: str | None
    rejections: list[Rejection]


class PlannerWrites(TypedDict):
    """Channels written."""

    social_graph: SocialGraph
    grounding: Grounding


class PlanReply(RootModel[Plan]):
    """A social graph, or the reason why there can be none."""


_CODES: dict[str, RejectionCode] = {
    "out_of_scope": "out_of_scope",
    "contradictory": "contradictory",
    "impossible": "ungroundable",
}


def plan_scene(state: PlannerReads, *, runtime: Runtime[RunContext]) -> PlannerWrites:
    """Asks for the social graph and binds it to the map."""
    context = runtime.context
    question = Question(
        task="plan",
        facts={
            "instruction": state["instruction"],
            "previous": state.get("previous"),
            "legs": [leg.name for leg in context.intersection.legs],
        },
        rejections=earlier(state.get("rejections", []), "scene_planner"),
    )
    plan = ask(context.backend, question, PlanReply, stage="scene_planner").root
    if isinstance(plan, Refusal):
        raise Rejected(Rejection(stage="scene_planner", code=_CODES[plan.code], detail=plan.reason))
    context.tell("scene_planner", _summary(plan))
    return {"social_graph": plan, "grounding": ground(plan, on=context.intersection)}


def _summary(graph: SocialGraph) -> str:
    edges = [f"{edge.from_} {edge.type} {edge.to}" for edge in graph.relations]
    return f"{len(graph.agents)} agents; {', '.join(edges) or 'normal traffic'}"
