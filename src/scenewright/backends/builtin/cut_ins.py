"""Who cuts in changes lanes ahead of another vehicle, and may leave it some headway or gap.

"A car cuts in ahead of a bus with a headway of 0.6 s" is read as "A car cuts in ahead of a bus", a
near miss; that the two share a lane then, and how closely the bus follows, is added to that.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from scenewright.backends.builtin.draft import Refused
from scenewright.scene.account import SaidSpan
from scenewright.scene.measures import UNITS, Measure, MeasureKind, format_measure
from scenewright.scene.social import RelationEdge, SocialGraph

_CUTS_IN = re.compile(r"\bcut(?:s|ting)?[- ]in\b|\bcuts? in front\b|\bchang\w+ lanes?\b", re.I)
_NUMBER = r"(?P<{}>\d+(?:\.\d+)?) ?(?P<{}>s|secs?|seconds?|m|met(?:re|er)s?)\b"
_LEAVES = (
    r",?(?: (?:and|with|at|leaves?|leaving|keeps?|keeping|only|just|about|barely|an?|the|small|"
    r"tiny|short))*"
)
_SPACE = r"(?:(?:time )?(?:headway|gap)|distance|space|room)"
_LEFT = re.compile(
    rf"{_LEAVES} (?:{_SPACE} of (?:only |just |about )?{_NUMBER.format('a', 'b')}"
    rf"|{_NUMBER.format('c', 'd')} (?:of )?{_SPACE})",
    re.IGNORECASE,
)


_SAYS_CUT_IN = re.compile(r"\bcut(?:s|ting)?[- ]in\b(?! front)", re.IGNORECASE)


@dataclass(frozen=True)
class CutInSpace:
    """Words that say how much room is left: start, end, words, and the figure [s or m]."""

    start: int
    end: int
    words: str
    kind: MeasureKind
    value: float


def take_out_space(text: str) -> tuple[str, CutInSpace | None]:
    """A text without such words, as long as before, and those words; None if there are none."""
    match = _LEFT.search(text) if _CUTS_IN.search(text) else None
    if match is None:
        return text, None
    value, unit = match["a"] or match["c"], match["b"] or match["d"]
    words = match[0].lstrip(", ")
    start = match.end() - len(words)
    kind: MeasureKind = "headway" if unit.lower().startswith("s") else "gap"
    rest = text[: match.start()] + " " * len(match[0]) + text[match.end() :]
    return rest, CutInSpace(start, match.end(), words, kind, float(value))


def read_cut_ins(graph: SocialGraph) -> SocialGraph:
    """The graph in which who "cuts in" on a vehicle does so by a lane change ahead of it."""
    edges, said = list(graph.relations), list(graph.said)
    for number, edge in enumerate(edges):
        pair = {edge.from_, edge.to}
        here = [
            k
            for k, each in enumerate(said)
            if _SAYS_CUT_IN.search(each.words) and pair.issuperset(each.agents)
        ]
        if not here or not _may_cut_in(edge, graph):
            continue
        edges[number] = edge.model_copy(update={"manoeuvre": "cuts_in", "first": None})
        change = {"became": "manoeuvre", "agents": (edge.from_, edge.to), "value": "cuts_in"}
        for k in here:
            if said[k].became in ("manner", "order"):
                said[k] = said[k].model_copy(update=change)
    return graph.model_copy(update={"relations": tuple(edges), "said": tuple(said)})


def _may_cut_in(edge: RelationEdge, graph: SocialGraph) -> bool:
    """Whether it is a near miss of two vehicles that may drive one way, come about in some way."""
    one, two = graph.agent(edge.from_), graph.agent(edge.to)
    apart = None not in (one.entry, two.entry) and one.entry != two.entry
    tied = any({tie.agent, tie.of} == {one.id, two.id} for tie in graph.ties)
    turns = {one.movement, two.movement} - {None, "straight"}
    settled = edge.manoeuvre not in (None, "cuts_in") or edge.pattern or edge.cause
    drives = edge.type == "near_miss" and {one.type, two.type} == {"vehicle"}
    return drives and not (apart or tied or turns or settled)


def add_space(graph: SocialGraph, space: CutInSpace) -> SocialGraph:
    """The graph in which one cuts in on the other and leaves that room.

    Raises:
        Refused: the rest of the text is no near miss of two vehicles, or more than fits is asked.
    """
    near = [each for each in graph.relations if _may_cut_in(each, graph)]
    if len(near) != 1:
        reason = f"'{space.words}': say who cuts in ahead of which vehicle."
        raise Refused("out_of_scope", reason)
    unit = UNITS[space.kind]
    if not unit.least <= space.value <= unit.most:
        bounds = f"{unit.least:g} to {unit.most:g} {unit.unit}"
        raise Refused("impossible", f"'{space.words}': a {space.kind} is {bounds}.")
    (edge,) = near
    measure = Measure(
        kind=space.kind, agent=edge.to, other=edge.from_,
        low=round(space.value - unit.tolerance, 3), high=round(space.value + unit.tolerance, 3),
    )  # fmt: skip
    cuts_in = edge.model_copy(update={"manoeuvre": "cuts_in", "first": None})
    said = SaidSpan(
        start=space.start, end=space.end, words=space.words, became="measure",
        agents=(edge.to, edge.from_), value=format_measure(measure),
    )  # fmt: skip
    return graph.model_copy(
        update={
            "relations": tuple(cuts_in if e is edge else e for e in graph.relations),
            "measures": (*graph.measures, measure),
            "said": tuple(sorted((*graph.said, said), key=lambda each: each.start)),
        }
    )
