"""Words for what no scene can show and that the readings may pass over."""

from __future__ import annotations

import re

from scenewright.scene.account import SaidSpan
from scenewright.scene.social import SocialGraph

_BEYOND = (
    (
        r"\b(?:push(?:es|ed|ing)?|shov(?:es|ed|ing)|shunt(?:s|ed|ing)?) (?:it |her |him )?into\b|"
        r"\bpile-?up\b|\bchain reaction\b",
        "who is in a collision stays there; ask for one collision of each",
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


def _overlap(one: SaidSpan, other: SaidSpan) -> bool:
    return one.start < other.end and other.start < one.end
