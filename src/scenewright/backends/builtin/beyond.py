"""Words for what no scene can show and that the readings may pass over."""

from __future__ import annotations

import re

from scenewright.scene.account import SaidSpan
from scenewright.scene.social import Refusal, SocialGraph

_BEYOND = (
    (
        r"\b(?:push(?:es|ed|ing)?|shov(?:es|ed|ing)|shunt(?:s|ed|ing)?) (?:it |her |him )?into\b|"
        r"\bpile-?up\b|\bchain reaction\b",
        "say which vehicle is pushed into which, as in 'pushes it into the car ahead'",
    ),
)  # fmt: skip
_COMPILED = tuple((re.compile(words, re.IGNORECASE), note) for words, note in _BEYOND)


def note_beyond(graph: SocialGraph, text: str) -> SocialGraph:
    """The graph with such words in its account as what became nothing, with what would work."""
    found = [
        SaidSpan(start=m.start(), end=m.end(), words=m[0], became="nothing", note=note)
        for pattern, note in _COMPILED
        for m in pattern.finditer(text)
    ]
    if not found:
        return graph
    kept = [
        each
        for each in graph.said
        if each.became != "nothing" or not any(_overlap(each, other) for other in found)
    ]
    said = sorted((*kept, *found), key=lambda each: each.start)
    return graph.model_copy(update={"said": tuple(said)})


_CHAIN = re.compile(
    r"\b(?:push(?:es|ed|ing)?|shov(?:es|ed|ing)|shunt(?:s|ed|ing)?)\b.{0,40}?\b(?:into|onto)\b|"
    r"\bpile-?up\b|\bchain reaction\b",
    re.IGNORECASE,
)
_NO_CHAIN = (
    "It is not clear which vehicle is pushed into which; say who rear-ends it, and into which "
    "vehicle it is pushed."
)
_A_CHAIN = "A truck rear-ends a car and pushes it into the car ahead."


def refuse_beyond(refusal: Refusal, text: str) -> Refusal:
    """The refusal with what would work, where the words ask for a chain of collisions."""
    if not _CHAIN.search(text):
        return refusal
    return refusal.model_copy(update={"reason": _NO_CHAIN, "did_you_mean": (_A_CHAIN,)})


_NEVER_LOST = re.compile(
    r"^(?:he|she)\b|"
    r"\b(?:sprint(?:s|ing|ed)?|dart(?:s|ed|ing)?(?:[- ]out)?|(?:does|did)(?: not|n't) happen|"
    r"hid(?:es?|den|ing)?|conceal(?:s|ed|ing)?|obscur(?:es?|ed|ing)|occlud(?:es?|ed|ing)|"
    r"shield(?:s|ed|ing)?|block(?:s|ed|ing)? (?:the|his|her|its|their) (?:view|sight)|"
    r"opposite (?:directions?|ways|kerbs?|curbs?)|freez(?:es?|ing)|froze|"
    r"stands? (?:still )?in the (?:middle|road|crosswalk))\b",
    re.IGNORECASE,
)
_SELDOM_LOST = re.compile(
    r"\b(?:nearly|almost|yellow|brak(?:es?|ed|ing)|yield(?:s|ed|ing)?|steps? (?:off|back)|"
    r"near[- ]miss(?:es)?)\b",
    re.IGNORECASE,
)
"""Words of what happens; those of a relation file's phrase are in no account."""


_AVOIDED = re.compile(
    r"\b(?:stop|halt|brak)\w*\b[^.;]{0,30}\bbefore (?:hitting|colliding|touching|crashing)\b",
    re.IGNORECASE,
)
"""Words of a collision that does not come about."""


def find_lost_words(graph: SocialGraph, text: str) -> str | None:
    """Words of what happens of which the plan knows nothing; None if there are none."""
    avoided = _AVOIDED.search(text)
    if avoided and any(edge.type == "collide_at" for edge in graph.relations):
        return avoided[0]
    by_phrase = any(edge.pattern for edge in graph.relations)
    for pattern in (_NEVER_LOST,) if by_phrase else (_NEVER_LOST, _SELDOM_LOST):
        for match in pattern.finditer(text):
            if not any(e.start < match.end() and match.start() < e.end for e in graph.said):
                return match[0]
    return None


def _overlap(one: SaidSpan, other: SaidSpan) -> bool:
    return one.start < other.end and other.start < one.end
