"""The order of passing: relations that can state it, and patterns that keep it (SEMANTICS 8)."""

from __future__ import annotations

from scenewright.scene.kinds import has_trait
from scenewright.scene.relations import Pattern
from scenewright.scene.social import RelationEdge, SocialGraph

ORDERED = ("crossing", "merging", "turn_across")
"""Geometries with a place that two pass one after the other."""

_LONGEST_PET = 1.4
"""A near miss with a longer PET needs a vehicle that brakes hard [s] (SEMANTICS 4)."""


def keeps_striker(edge: RelationEdge, pattern: Pattern, roles: tuple[str, str]) -> bool:
    """Return whether an assignment of the roles lets the agent strike that is said to."""
    if edge.strikes is None or pattern.striker is None:
        return True
    return edge.strikes == roles[("from", "to").index(pattern.striker)]


def find_wrong_order(edge: RelationEdge, graph: SocialGraph) -> str | None:
    """Why the relation cannot have its order, and what would work; None where it can."""
    second = edge.to if edge.first == edge.from_ else edge.from_
    in_line = has_trait("collision", edge.kind, "no_order")  # along one road
    if edge.type == "follow" or in_line or edge.manoeuvre is not None:
        return (
            f"{edge.manoeuvre or edge.kind or edge.type} has no order of passing, as the two share "
            f"one road, where {edge.to} is ahead or beside; leave first out, or ask for a "
            "near_miss, a yield_to or an angle collision of two that cross"
        )
    if edge.type == "yield_to" and edge.first == edge.from_:
        return (
            f"{edge.from_} gives way, so {edge.to} passes first; turn the two round, or ask for a "
            f"near_miss in which {edge.from_} passes first"
        )
    if edge.type != "near_miss":
        return None
    late = edge.target_pet is not None and edge.target_pet > _LONGEST_PET
    if edge.brakes and edge.braker == edge.first:
        return (
            f"{edge.first} brakes hard and so lets {second} pass; write {second} as first, or as "
            "braker, or leave one of the two out"
        )
    if (edge.brakes or late) and graph.agent(second).type != "vehicle":
        return (
            f"{second} passes second and has no brakes; ask for a PET of at most {_LONGEST_PET:g} s"
            f", without hard braking and without a TTC, or write {second} as first"
        )
    return None
