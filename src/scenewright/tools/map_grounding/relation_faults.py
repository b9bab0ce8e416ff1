"""Relations that no map can show, and why: wrong orders of passing, collisions, reactions."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

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


Fault = tuple[tuple[str, ...], str]
"""Agents that cannot do what is asked on any map, and why."""


def find_collision_faults(graph: SocialGraph) -> Iterator[Fault]:
    """Second collisions of one agent that nothing pushes there, hit groups, late braking alone."""
    hits: dict[str, list[RelationEdge]] = {}
    for edge in graph.relations:
        if edge.type == "collide_at":
            hits.setdefault(edge.from_, []).append(edge)
            hits.setdefault(edge.to, []).append(edge)
    for name, edges in hits.items():
        pushed = any(edge.is_pushed and edge.from_ == name for edge in edges)
        if len(edges) > 1 + pushed:
            yield (
                (edges[1].from_, edges[1].to),
                f"{name} would be in {len(edges)} collisions, but its track ends at the first; "
                "ask for one collision of each agent, or for one that pushes it into the next",
            )
    for edge in graph.relations:
        pair = (edge.from_, edge.to)
        for name in pair if edge.type == "collide_at" else ():
            if graph.agent(name).members is not None:
                yield (
                    pair,
                    f"{name} is a group, and the member that is hit cannot be chosen; ask for "
                    "a near miss or a yield, or have one pedestrian hit",
                )
    for edge in graph.relations:
        if has_trait("cause", edge.cause, "late") and edge.type not in ("collide_at", "near_miss"):
            yield (
                (edge.from_, edge.to),
                f"{edge.cause} goes with collide_at or near_miss alone, as a yielding or following "
                "agent brakes in time; ask for a near miss, or leave the braking out",
            )


def find_reaction_faults(graph: SocialGraph) -> Iterator[Fault]:
    """Braking pedestrians, waiting for a vehicle that never passes, and reactions to no threat."""
    for edge in graph.relations:
        if edge.braker is not None and graph.agent(edge.braker).type != "vehicle":
            yield (
                (edge.from_, edge.to),
                f"{edge.braker} has no brakes; as braker write the vehicle of the two, or leave "
                "the key out",
            )
    for wait, hit in find_waits_and_hits(graph):
        walker, struck = graph.agent(wait.from_), graph.agent(hit.get_other(wait.to))
        if walker.crosswalk is not None and walker.crosswalk == struck.crosswalk:
            yield (
                (wait.from_, wait.to),
                f"{wait.to} is to hit {struck.id} on the {walker.crosswalk} crosswalk and stays "
                f"there, so it never passes {walker.id}, which waits for it at that crosswalk; "
                "give the two pedestrians different crosswalks",
            )
    threats = (e for e in graph.relations if e.type in ("collide_at", "near_miss"))
    threatened = {name for edge in threats for name in edge.pair}
    for agent in graph.agents:
        if agent.reaction not in (None, "none") and agent.id not in threatened:
            how = str(agent.reaction).replace("_", " ")
            yield (agent.id,), f"{agent.id} {how}, which goes with a collision or a near miss alone"


def find_waits_and_hits(graph: SocialGraph) -> Iterator[tuple[RelationEdge, RelationEdge]]:
    """Find pairs of edges: a pedestrian waits for a vehicle that hits another pedestrian."""
    walks = {
        agent.id
        for agent in graph.agents
        if agent.type == "pedestrian" and agent.movement != "jaywalking"
    }
    for wait, hit in product(graph.relations, repeat=2):
        if (wait.type, hit.type) != ("yield_to", "collide_at") or wait.from_ not in walks:
            continue
        if wait.to in hit.pair and hit.get_other(wait.to) in walks - {wait.from_}:
            yield wait, hit
