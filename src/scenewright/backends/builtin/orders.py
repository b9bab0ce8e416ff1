"""Order of passing, compared with what else is said of the two."""

from __future__ import annotations

from collections.abc import Iterable

from scenewright.backends.builtin.draft import Refused, RelationDraft

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
        one, two = relation.from_, relation.to
        vehicles = one.type == two.type == "vehicle"
        one_way = vehicles and one.entry is not None and one.entry == two.entry
        along_one_road = relation.kind in _UNORDERED or one_way
        if relation.ahead is not None or (relation.type == "collide_at" and along_one_road):
            relation.first = None
