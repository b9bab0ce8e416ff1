"""Words that say which of two agents strikes the other."""

from __future__ import annotations

import re

from scenewright.scene.account import SaidSpan
from scenewright.scene.relations import load_patterns
from scenewright.scene.social import RelationEdge, SocialGraph
from scenewright.tools.account.vocabulary import read_tokens
from scenewright.tools.map_grounding.orders import keeps_striker

_STRIKES = re.compile(
    r"\b(?:hit(?:s|ting)?|str(?:ikes?|uck|iking)|ram(?:s|med|ming)?|clip(?:s|ped|ping)?|"
    r"t[- ]?bon(?:es?|ed|ing)|broadsid(?:es?|ed|ing)|side[- ]?swip(?:es?|ed|ing)|mow(?:s|ed)? down|"
    r"knock(?:s|ed|ing)?|r[au]n(?:s|ning)? (?:over|into|down)|sweeps away|\w+(?:s|ing) into)\b",
    re.IGNORECASE,
)

_MUTUAL = re.compile(
    r".*\b(?:each other|one another)\b|(?:an? )?\S+ (?:between|of|involving)\b", re.IGNORECASE
)
"""Words that leave open which of the two it is."""


def name_strikers(plan: SocialGraph, text: str) -> SocialGraph:
    """The plan in which the agent strikes that the words of a collision say.

    With a pedestrian it is always the vehicle; with its side or rear no agent strikes.
    """
    said = [(edge, _find_words(edge, plan, text)) for edge in plan.relations]
    edges = [edge if words is None else _let_strike(edge, plan) for edge, words in said]
    added = [
        words.model_copy(
            update={"became": "striker", "agents": (edge.from_, edge.to), "value": None}
        )
        for edge, words in said
        if words is not None
    ]
    if not added:
        return plan
    account = sorted((*plan.said, *added), key=lambda each: each.start)
    return plan.model_copy(update={"relations": tuple(edges), "said": tuple(account)})


def _let_strike(edge: RelationEdge, plan: SocialGraph) -> RelationEdge:
    """The edge whose `from` strikes; without its pattern where in that the other one does."""
    strikes = edge.model_copy(update={"strikes": edge.from_})
    pattern = next((each for each in load_patterns() if each.id == edge.pattern), None)
    if pattern is None:
        return strikes
    kinds = {name: plan.agent(name).type for name in (edge.from_, edge.to)}
    orders = ((edge.from_, edge.to), (edge.to, edge.from_))
    played = (
        o for o in orders if pattern.from_.admits(kinds[o[0]]) and pattern.to.admits(kinds[o[1]])
    )
    if any(keeps_striker(strikes, pattern, order) for order in played):
        return strikes
    return strikes.model_copy(update={"pattern": None, "kind": None})


def _find_words(edge: RelationEdge, plan: SocialGraph, text: str) -> SaidSpan | None:
    """The words that say who strikes in the collision; None where none do."""
    pair = {edge.from_, edge.to}
    walks = any(plan.agent(name).type == "pedestrian" for name in pair)
    with_front = edge.point_from is None or edge.point_from.startswith("front")
    if edge.type != "collide_at" or edge.strikes is not None or walks or not with_front:
        return None
    words = (each for each in plan.said if each.became == "relation" and set(each.agents) == pair)
    for each in words:
        mutual = _MUTUAL.match(text[each.start : each.end + len(" involving")])
        mended = " ".join(token.text for token in read_tokens(each.words))
        if (_STRIKES.search(each.words) or _STRIKES.search(mended)) and not mutual:
            return each
    return None
