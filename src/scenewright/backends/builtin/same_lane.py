"""What it entails that two vehicles drive in one lane: cut-ins, who is ahead, and chains.

Who "cuts in" changes lanes ahead of another vehicle. "A van hits the car in front of it" is a
rear-end collision, and "nearly hits the car ahead" a near miss behind one that brakes. Who is
struck from behind and strikes a third is pushed into that.
"""

from __future__ import annotations

import re

from scenewright.backends.builtin.reader.words import compile_words
from scenewright.scene.account import SaidSpan
from scenewright.scene.kinds import find_marked
from scenewright.scene.social import RelationEdge, SocialGraph

_SAYS_CUT_IN = re.compile(r"\bcut(?:s|ting)?[- ]in\b(?! front)", re.IGNORECASE)
_AHEAD = compile_words("same_lane.ahead")


def settle_lanes(graph: SocialGraph, text: str) -> SocialGraph:
    """The graph with what driving in one lane entails."""
    return link_collisions(read_leaders(read_cut_ins(graph), text))


def read_cut_ins(graph: SocialGraph) -> SocialGraph:
    """The graph in which who "cuts in" on a vehicle does so by a lane change ahead of it."""
    edges, said = list(graph.relations), list(graph.said)
    cuts_in = find_marked("manoeuvre", "near_miss lane")
    for number, edge in enumerate(edges):
        pair = {edge.from_, edge.to}
        here = [
            k
            for k, each in enumerate(said)
            if _SAYS_CUT_IN.search(each.words) and pair.issuperset(each.agents)
        ]
        one, two = graph.agent(edge.from_), graph.agent(edge.to)
        tied = any({tie.agent, tie.of} == pair for tie in graph.ties)
        turns = {one.movement, two.movement} - {None, "straight"}
        settled = edge.manoeuvre not in (None, cuts_in) or edge.pattern or edge.cause
        drives = edge.type == "near_miss" and {one.type, two.type} == {"vehicle"}
        if not here or not drives or _are_apart(edge, graph) or tied or turns or settled:
            continue
        edges[number] = edge.model_copy(update={"manoeuvre": cuts_in, "first": None})
        change = {"became": "manoeuvre", "agents": (edge.from_, edge.to), "value": cuts_in}
        for k in here:
            if said[k].became in ("manner", "order"):
                said[k] = said[k].model_copy(update=change)
    return graph.model_copy(update={"relations": tuple(edges), "said": tuple(said)})


def _are_apart(edge: RelationEdge, graph: SocialGraph) -> bool:
    """Whether the two of a relation come from different legs."""
    entries = {graph.agent(name).entry for name in (edge.from_, edge.to)}
    return None not in entries and len(entries) == 2


def read_leaders(graph: SocialGraph, text: str) -> SocialGraph:
    """The graph in which who is said to be ahead is hit from behind, and the account of that."""
    by_braking = find_marked("manoeuvre", "brakes")
    for number, edge in enumerate(graph.relations):
        types = {graph.agent(name).type for name in (edge.from_, edge.to)}
        settled = edge.kind or edge.manoeuvre or edge.pattern or edge.cause
        event = edge.type in ("collide_at", "near_miss") and types == {"vehicle"}
        place = _find_place(edge, graph, text)
        if place is None or not event or settled or _are_apart(edge, graph):
            continue
        brakes = edge.type == "near_miss"
        change = {"manoeuvre": by_braking} if brakes else {"kind": "rear_end"}
        edges = [*graph.relations]
        edges[number] = edge.model_copy(update={"first": None, **change})
        words = {
            "start": place[0], "end": place[1], "words": text[place[0] : place[1]],
            "became": "manoeuvre" if brakes else "relation", "agents": (edge.from_, edge.to),
            "value": by_braking if brakes else edge.type,
        }  # fmt: skip
        kept = [e for e in graph.said if not place[0] <= e.start < place[1]]
        said = sorted((*kept, SaidSpan.model_validate(words)), key=lambda each: each.start)
        graph = graph.model_copy(update={"relations": tuple(edges), "said": tuple(said)})
    return graph


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
