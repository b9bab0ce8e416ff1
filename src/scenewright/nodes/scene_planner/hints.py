"""Hints of a language model on words of the request, found in the text."""

from __future__ import annotations

from collections.abc import Iterator

from scenewright.backends.offline import find_named
from scenewright.scene.account import NAME, SaidSpan
from scenewright.scene.phrasing import PRONOUNS
from scenewright.scene.social import SocialGraph

HINTS = ("relation", "cause", "constraint", "behavior", "nothing")
"""What a model may say that words became: what a later stage does with them, or nothing."""


def locate_hints(plan: SocialGraph, text: str) -> Iterator[SaidSpan]:
    """The plan's entries of `said` that are hints, with their places in the text, in its order.

    Of words that the text does not hold, and of relations that the plan lacks, there is none. A
    value is the plan's or that of a later stage, never the model's.
    """
    low, after = text.lower(), 0
    for entry in plan.said:
        start = low.find(entry.words.lower(), after)
        start = low.find(entry.words.lower()) if start < 0 else start
        if start < 0 or entry.became not in HINTS:
            continue
        after = start
        hint = {"start": start, "end": start + len(entry.words), "value": None}
        if entry.became != "relation":
            yield entry.model_copy(update=hint)
            continue
        for edge in plan.relations:
            pair = (edge.from_, edge.to)
            if set(entry.agents) <= set(pair):
                yield entry.model_copy(update={**hint, "agents": pair, "value": edge.type})


def mark_names(plan: SocialGraph) -> SocialGraph:
    """The plan in which a word such as "Anna", that is no noun, is the name of its agent."""
    said = tuple(
        each.model_copy(update={"value": None, "note": NAME})
        if each.became == "agent"
        and each.words.istitle()
        and each.words.isalpha()
        and not find_named(each.words.lower())
        and each.words.lower() not in PRONOUNS.split()
        else each
        for each in plan.said
    )
    return plan if said == plan.said else plan.model_copy(update={"said": said})
