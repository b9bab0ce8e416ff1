"""A plan as one flat row, the exchange format of `scenewright plan`."""

from __future__ import annotations

from typing import Any

from scenewright.scene.events import EVENT_OF_RELATION
from scenewright.scene.social import AgentNode, Plan, Refusal, SceneContext


def plan_to_row(row_id: str, plan: Plan) -> dict[str, Any]:
    """The plan as {"id", "agents", "relations", "context", "refused", "reason"}.

    Relation types are collision | yielding | near_miss | follow | normal; a scene without a
    relation has one row `normal` with from and to null; a refusal has no agents and no relations.
    """
    if isinstance(plan, Refusal):
        return _row(row_id, [], [], SceneContext(), reason=plan.reason)
    agents = [_agent(agent) for agent in plan.agents]
    relations: list[dict[str, Any]] = [
        {"type": EVENT_OF_RELATION[edge.type], "from": edge.from_, "to": edge.to}
        for edge in plan.relations
    ]
    normal = [{"type": "normal", "from": None, "to": None}]
    return _row(row_id, agents, relations or normal, plan.context, reason=None)


def _row(
    row_id: str,
    agents: list[dict[str, Any]],
    relations: list[dict[str, Any]],
    context: SceneContext,
    *,
    reason: str | None,
) -> dict[str, Any]:
    return {
        "id": row_id,
        "agents": agents,
        "relations": relations,
        "context": context.model_dump(mode="json"),
        "refused": reason is not None,
        "reason": reason,
    }


def _agent(agent: AgentNode) -> dict[str, Any]:
    return agent.model_dump(
        mode="json", include={"id", "type", "entry", "exit", "movement", "crosswalk"}
    )
