"""Order of passing, compared with what else is said of the two."""

from __future__ import annotations

from collections.abc import Iterable

from scenewright.backends.builtin.draft import AgentDraft, Refused, RelationDraft

_UNORDERED = ("sideswipe", "head_on")
"""Collisions along one road, where no agent comes first to a place that both pass."""


def pass_order_on(gone: RelationDraft, relations: Iterable[RelationDraft]) -> None:
    """The order of a relation that another one overrules becomes that of the other."""
    for relation in relations:
        if gone.first is not None and relation.pair() == gone.pair():
            relation.first = relation.first or gone.first


def settle_orders(relations: Iterable[RelationDraft]) -> None:
    """Orders that the relation has by itself are left to it.

    Raises:
        Refused: the agent to pass first yields, follows, drives into the other or brakes for it.
    """
    for relation in relations:
        if relation.first is None:
            continue
        if relation.ahead not in (None, relation.first):
            raise Refused(
                "contradictory",
                "One of the two passes first and gives way, follows or runs into the other from "
                "behind; keep one, or say that the two nearly collide.",
            )
        if relation.type == "near_miss" and relation.first is relation.braker:
            raise Refused(
                "contradictory",
                "An agent that brakes hard for another lets it pass first; say that the other "
                "one brakes, or that it passes first.",
            )
        if relation.ahead is not None or _is_along_one_road(relation):
            relation.first = None


def _is_along_one_road(relation: RelationDraft) -> bool:
    from_one_side = relation.from_.entry is not None and relation.from_.entry == relation.to.entry
    vehicles = _are_vehicles(relation.from_, relation.to)
    return relation.type == "collide_at" and (
        relation.kind in _UNORDERED or (vehicles and from_one_side)
    )


def _are_vehicles(*agents: AgentDraft) -> bool:
    return all(agent.type == "vehicle" for agent in agents)
