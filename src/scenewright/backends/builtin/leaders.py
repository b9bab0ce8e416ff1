"""Who is run into "ahead of it" or "in front" drives in the same lane, ahead of the other.

"A van hits the car in front of it" is a rear-end collision, and "nearly hits the car ahead" a near
miss behind one that brakes; the readings of sentences leave open how the two come together.
"""

from __future__ import annotations

import re

from scenewright.scene.account import SaidSpan
from scenewright.scene.social import RelationEdge, SocialGraph

_AHEAD = re.compile(
    r",?(?: (?:that|which) (?:is|was|drives))?(?: (?:just|right|directly|driving|immediately))?"
    r" (?:ahead|in front)(?: of (?:it|him|her|them|itself))?(?=[ .,;!?]|$)",
    re.IGNORECASE,
)


def read_leaders(graph: SocialGraph, text: str) -> SocialGraph:
    """The graph in which who is said to be ahead is hit from behind, and the account of that."""
    for number, edge in enumerate(graph.relations):
        place = _find_place(edge, graph, text) if _is_open(edge, graph) else None
        if place is None:
            continue
        brakes = edge.type == "near_miss"
        change = {"manoeuvre": "lead_brakes"} if brakes else {"kind": "rear_end"}
        edges = [*graph.relations]
        edges[number] = edge.model_copy(update={"first": None, **change})
        words = {
            "start": place[0], "end": place[1], "words": text[place[0] : place[1]],
            "became": "manoeuvre" if brakes else "relation", "agents": (edge.from_, edge.to),
            "value": "lead_brakes" if brakes else edge.type,
        }  # fmt: skip
        kept = [e for e in graph.said if not place[0] <= e.start < place[1]]
        said = sorted((*kept, SaidSpan.model_validate(words)), key=lambda each: each.start)
        graph = graph.model_copy(update={"relations": tuple(edges), "said": tuple(said)})
    return graph


def _is_open(edge: RelationEdge, graph: SocialGraph) -> bool:
    """Whether the text leaves open how two vehicles come together."""
    one, two = graph.agent(edge.from_), graph.agent(edge.to)
    apart = None not in (one.entry, two.entry) and one.entry != two.entry
    settled = edge.kind or edge.manoeuvre or edge.pattern or edge.cause
    event = edge.type in ("collide_at", "near_miss") and {one.type, two.type} == {"vehicle"}
    return event and not (apart or settled)


def _find_place(edge: RelationEdge, graph: SocialGraph, text: str) -> tuple[int, int] | None:
    """Where the text says that the second vehicle is ahead, [start, end)."""
    for each in graph.said:
        if each.became == "agent" and each.agents == (edge.to,):
            # The words may be read as part of the noun: "the car ahead".
            inside = _AHEAD.search(text, each.start, each.end)
            found = inside or _AHEAD.match(text, each.end)
            if found is not None:
                return found.end() - len(found[0].lstrip(", ")), found.end()
    return None
