"""Words that push the struck vehicle on into another: taken out of a text before the readings.

"A truck rear-ends a car and pushes it into the van ahead" is read as "A truck rear-ends a car"; the
van and the second collision are added to that.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.reader.words import find_subtype
from scenewright.backends.builtin.standing import VEHICLE, join_any
from scenewright.scene.account import SaidSpan
from scenewright.scene.social import AgentNode, RelationEdge, SocialGraph

_ACTIVE = (
    r"(?:push|shunt|propel|knock|ram|bump)(?:s|es|l?ing)|shov(?:es|ing)|forc(?:es|ing)|"
    r"driv(?:es|ing)|throw(?:s|ing)|send(?:s|ing)"
)
_PASSIVE = r"(?:push|shunt|propell|knock|ramm|bump|shov|forc)ed|driven|thrown"
_WHICH = join_any("first", "struck", "stopped", "stationary", "standing", "waiting", then=" ")
_ONE = f"(?:(?:the|that) )?(?:{_WHICH})?{VEHICLE}"
_AHEAD = (
    r"(?: (?:(?:that|which) (?:is|was) )?(?:stopped |waiting |standing )?(?:(?:ahead|in front)"
    r"(?: of (?:it|them|him|her|that))?|at the (?:front|head)(?: of the (?:line|queue))?))?"
)
_SAID = re.compile(
    r",?(?: (?:and|then|which|thereby|so|that)\b)*"
    rf"(?: (?:{_ACTIVE}) (?:it|this|that|{_ONE})|"
    rf"(?: {_ONE})?(?: (?:is|was|gets|got|being))?(?: then)? (?:{_PASSIVE}))"
    r"(?: (?:on|along|forwards?|straight|right))? (?:into|onto|against)"
    r" (?P<third>(?:(?:an?|the|another|a third|a second|the next) )?"
    rf"(?:(?:stopped|waiting|standing|stationary|next|third|second|parked) )?(?:{VEHICLE}|one)"
    rf"{_AHEAD})(?!\w)",
    re.IGNORECASE,
)


_STANDS = re.compile(
    rf"\b(?:stopped|stationary|standing|halted|queue?ing)\b(?= {VEHICLE}\b)", re.IGNORECASE
)
"""Of the struck vehicle, which stands in any case."""


@dataclass(frozen=True)
class PushPhrase:
    """Words that say it.

    Attributes:
        start, end: characters of the text, end exclusive.
        stands: [start, end) of words that say that the struck vehicle stands.
        third: start, end and words of the vehicle that the other is pushed into.
    """

    start: int
    end: int
    words: str
    stands: tuple[tuple[int, int], ...]
    third: tuple[int, int, str]

    @property
    def says_where(self) -> bool:
        """Whether the third vehicle is said to be ahead."""
        return re.search(r"ahead|front|head", self.third[2]) is not None


def take_out_push(text: str) -> tuple[str, PushPhrase | None]:
    """A text without such words, as long as before, and those words; None if there are none.

    Raises:
        Refused: they are said twice.
    """
    found = list(_SAID.finditer(text))
    if not found:
        return text, None
    if len(found) > 1:
        raise Refused("out_of_scope", "Only one vehicle can be pushed on into another.")
    match = found[0]
    start = match.start() + len(match[0]) - len(match[0].lstrip(", "))
    rest = text[: match.start()] + " " * len(match[0]) + text[match.end() :]
    stands = tuple(each.span() for each in _STANDS.finditer(rest))
    rest = _STANDS.sub(lambda each: " " * len(each[0]), rest)
    third = (match.start("third"), match.end("third"), match["third"])
    return rest, PushPhrase(start, match.end(), text[start : match.end()], stands, third)


def add_push(graph: SocialGraph, phrase: PushPhrase, text: str) -> SocialGraph:
    """The graph with the third vehicle, the second collision, and the account of their words.

    Raises:
        Refused: the rest of the text is no collision from behind of two vehicles.
    """
    kinds = {agent.id: agent.type for agent in graph.agents}
    hits = [edge for edge in graph.relations if edge.type == "collide_at"]
    wheels = len(hits) == 1 and {kinds[hits[0].from_], kinds[hits[0].to]} == {"vehicle"}
    if not wheels or hits[0].kind not in (None, "rear_end"):
        raise Refused(
            "out_of_scope",
            f"'{phrase.words}': only a vehicle that another one rear-ends is pushed on, as in "
            "'A truck rear-ends a car and pushes it into the car ahead'.",
        )
    if not phrase.says_where and _is_named(phrase.third[2], graph, hits[0]):
        raise Refused(
            "out_of_scope",
            f"'{phrase.words}': it is not clear whether that is one more; say 'the car ahead'.",
        )
    name = f"vehicle-{sum(kind == 'vehicle' for kind in kinds.values()) + 1}"
    subtype = find_subtype(phrase.third[2])
    third = AgentNode.model_validate({"id": name, "type": "vehicle", "subtype": subtype})
    second = RelationEdge.model_validate(
        {
            "type": "collide_at", "from": hits[0].to, "to": name, "kind": "rear_end",
            "manoeuvre": "pushed",
        }
    )  # fmt: skip
    edges = [
        edge.model_copy(update={"kind": "rear_end"}) if edge is hits[0] else edge
        for edge in graph.relations
    ]
    said = [_restore(each, text) for each in graph.said]
    said += _account_for(phrase, text, (hits[0].to, name), subtype or "vehicle")
    return SocialGraph.model_validate(
        graph.model_dump(by_alias=True)
        | {
            "agents": (*graph.agents, third), "relations": (*edges, second),
            "said": tuple(sorted(said, key=lambda each: each.start)),
        }
    )  # fmt: skip


def _account_for(
    phrase: PushPhrase, text: str, pair: tuple[str, str], subtype: str
) -> list[SaidSpan]:
    """The words of the push, and those of the third vehicle."""
    start, end, _ = phrase.third
    pushes = [*phrase.stands, (phrase.start, start - 1)]
    said: list[tuple[tuple[int, int], str, tuple[str, ...], str]]
    said = [((start, end), "agent", pair[1:], subtype)]
    said += [(span, "manoeuvre", pair, "pushed") for span in pushes]
    return [
        SaidSpan.model_validate(
            {
                "start": a, "end": b, "words": text[a:b], "became": became, "agents": agents,
                "value": value,
            }
        )
        for (a, b), became, agents, value in said
    ]  # fmt: skip


def _is_named(words: str, graph: SocialGraph, hit: RelationEdge) -> bool:
    """Whether "the bus" may be one that the rest of the text names."""
    kind = find_subtype(words)
    others = [each for each in graph.agents if each.id not in (hit.from_, hit.to)]
    return words.lower().startswith("the ") and any(each.subtype == kind for each in others)


def link_collisions(graph: SocialGraph) -> SocialGraph:
    """The graph in which who is struck from behind and strikes a third is pushed into that.

    "A van hits a taxi and the taxi hits a bus": the taxi's motion ends with its first collision,
    unless that leads to the second.
    """
    kinds = {agent.id: agent.type for agent in graph.agents}
    hits = [edge for edge in graph.relations if _may_be_linked(edge, kinds)]
    struck = {edge.to: edge.from_ for edge in hits}
    second = [e for e in hits if e.from_ in struck and struck[e.from_] != e.to]
    linked = {each.from_ for each in second} | {struck[each.from_] for each in second}
    edges = sorted(
        (
            edge.model_copy(
                update={"kind": "rear_end", "manoeuvre": "pushed" if edge in second else None}
            )
            if edge in hits and edge.from_ in linked
            else edge
            for edge in graph.relations
        ),
        key=lambda edge: edge.manoeuvre == "pushed",
    )
    return graph.model_copy(update={"relations": tuple(edges)}) if second else graph


def _may_be_linked(edge: RelationEdge, kinds: Mapping[str, str]) -> bool:
    """Whether it is a collision of two vehicles that may be one from behind."""
    return (
        edge.type == "collide_at"
        and {kinds[edge.from_], kinds[edge.to]} == {"vehicle"}
        and edge.kind in (None, "rear_end")
        and edge.manoeuvre is None
        and edge.pattern is None
        and edge.cause is None
    )


def _restore(span: SaidSpan, text: str) -> SaidSpan:
    """Words of the account as the text has them."""
    return span.model_copy(update={"words": text[span.start : span.end]})
