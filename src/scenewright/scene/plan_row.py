"""A plan as one flat row, the exchange format of `scenewright plan`."""

from __future__ import annotations

from typing import Any

from scenewright.scene.account import list_unrealised
from scenewright.scene.events import EVENT_OF_RELATION
from scenewright.scene.social import Plan, Refusal, SocialGraph

_OF_AGENTS = {"id", "type", "subtype", "entry", "exit", "movement", "crosswalk"}
"""Fields of an agent that rows have."""


def plan_to_row(row_id: str, plan: Plan) -> dict[str, Any]:
    """The plan as {"id", "agents", "relations", "context", "refused", "reason", ...}.

    `objects` are there where the plan has any.

    Relation types are collision | yielding | near_miss | follow | normal; a scene without a
    relation has one row `normal` with from and to null; a refusal has no agents and no relations,
    but, under `did_you_mean`, sentences that would be understood. `said` is the account of words,
    `unrealised` lists those of them that no scene can show. A range of time is [from, to].
    `first` is there where the text says which of the two passes first.
    """
    refusal = plan if isinstance(plan, Refusal) else None
    graph = SocialGraph(agents=()) if isinstance(plan, Refusal) else plan
    relations: list[dict[str, Any]] = [
        {"type": EVENT_OF_RELATION[edge.type], "from": edge.from_, "to": edge.to}
        | ({} if edge.first is None else {"first": edge.first})
        for edge in graph.relations
    ]
    if not relations and refusal is None:
        relations = [{"type": "normal", "from": None, "to": None}]
    # The context; numbers of the background also under the plural keys that rows once had.
    time, counts = graph.context.time_of_day, graph.context.background
    span = time.split("-") if time is not None and "-" in time else time
    numbers = None
    if counts is not None:
        cars, people = counts.vehicles, counts.pedestrians
        numbers = {"vehicle": cars, "pedestrian": people, "vehicles": cars, "pedestrians": people}
    objects = [scene_object.model_dump(mode="json") for scene_object in graph.objects]
    return {
        "id": row_id,
        "agents": [agent.model_dump(mode="json", include=_OF_AGENTS) for agent in graph.agents],
        "relations": relations,
        "context": {"density": graph.context.density, "time_of_day": span, "background": numbers},
        "refused": refusal is not None,
        "reason": None if refusal is None else refusal.reason,
        "said": [each.model_dump(mode="json") for each in graph.said],
        "unrealised": list(list_unrealised(graph.said)),
        **({"objects": objects} if objects else {}),
        "did_you_mean": [] if refusal is None else list(refusal.did_you_mean),
    }
