"""A plan as one flat row, the exchange format of `scenewright plan`."""

from __future__ import annotations

from typing import Any

from scenewright.scene.account import list_unrealised
from scenewright.scene.events import EVENT_OF_RELATION
from scenewright.scene.social import AgentNode, Plan, Refusal, SocialGraph


def plan_to_row(row_id: str, plan: Plan) -> dict[str, Any]:
    """The plan as {"id", "agents", "relations", "context", "refused", "reason", ...}.

    `objects` are there where the plan has any.

    Relation types are collision | yielding | near_miss | follow | normal; a scene without a
    relation has one row `normal` with from and to null; a refusal has no agents and no relations,
    but, under `did_you_mean`, sentences that would be understood. `said` is the account of words,
    `unrealised` lists those of them that no scene can show. A range of time is [from, to].
    `first` is there where the text says which of the two passes first.
    """
    if isinstance(plan, Refusal):
        row = _build_row(row_id, SocialGraph(agents=()), relations=[], reason=plan.reason)
        return {**row, "did_you_mean": list(plan.did_you_mean)}
    relations: list[dict[str, Any]] = [
        {"type": EVENT_OF_RELATION[edge.type], "from": edge.from_, "to": edge.to}
        | ({} if edge.first is None else {"first": edge.first})
        for edge in plan.relations
    ]
    normal = [{"type": "normal", "from": None, "to": None}]
    return {
        **_build_row(row_id, plan, relations=relations or normal, reason=None),
        "did_you_mean": [],
    }


def _build_row(
    row_id: str, plan: SocialGraph, *, relations: list[dict[str, Any]], reason: str | None
) -> dict[str, Any]:
    # The context; numbers of the background also under the plural keys that rows once had.
    time, counts = plan.context.time_of_day, plan.context.background
    span = time.split("-") if time is not None and "-" in time else time
    numbers = None
    if counts is not None:
        cars, people = counts.vehicles, counts.pedestrians
        numbers = {"vehicle": cars, "pedestrian": people, "vehicles": cars, "pedestrians": people}
    return {
        "id": row_id,
        "agents": [_build_agent(agent) for agent in plan.agents],
        "relations": relations,
        "context": {"density": plan.context.density, "time_of_day": span, "background": numbers},
        "refused": reason is not None,
        "reason": reason,
        "said": [each.model_dump(mode="json") for each in plan.said],
        "unrealised": list(list_unrealised(plan.said)),
        **(
            {"objects": [each.model_dump(mode="json") for each in plan.objects]}
            if plan.objects
            else {}
        ),
    }


def _build_agent(agent: AgentNode) -> dict[str, Any]:
    return agent.model_dump(
        mode="json", include={"id", "type", "subtype", "entry", "exit", "movement", "crosswalk"}
    )
