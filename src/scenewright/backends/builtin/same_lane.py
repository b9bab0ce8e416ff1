"""Collisions in a chain: who is struck from behind and strikes a third is pushed into that."""

from __future__ import annotations

from scenewright.scene.kinds import find_marked
from scenewright.scene.social import SocialGraph


def link_collisions(graph: SocialGraph) -> SocialGraph:
    """The graph in which who is struck from behind and strikes a third is pushed into that.

    "A van hits a taxi and the taxi hits a bus": the taxi's motion ends with its first collision,
    unless that leads to the second.
    """
    kinds = {agent.id: agent.type for agent in graph.agents}
    hits = [  # collisions of two vehicles that may be ones from behind
        edge
        for edge in graph.relations
        if edge.type == "collide_at"
        and {kinds[edge.from_], kinds[edge.to]} == {"vehicle"}
        and edge.kind in (None, "rear_end")
        and {edge.manoeuvre, edge.pattern, edge.cause} == {None}
    ]
    struck = {edge.to: edge.from_ for edge in hits}
    second = [e for e in hits if e.from_ in struck and struck[e.from_] != e.to]
    linked = {each.from_ for each in second} | {struck[each.from_] for each in second}
    pushed = find_marked("manoeuvre", "chain")
    edges = sorted(
        (
            edge.model_copy(
                update={"kind": "rear_end", "manoeuvre": pushed if edge in second else None}
            )
            if edge in hits and edge.from_ in linked
            else edge
            for edge in graph.relations
        ),
        key=lambda edge: edge.is_pushed,
    )
    return graph.model_copy(update={"relations": tuple(edges)}) if second else graph
