"""Turns of a conversation that say which agent passes first: "the van goes first instead"."""

from __future__ import annotations

import re
from collections.abc import Sequence

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.named import Named
from scenewright.backends.builtin.reader.words import WORDS
from scenewright.backends.builtin.references import People
from scenewright.scene.edits import AgentView, Edit, Relate, Situation
from scenewright.scene.social import RelationEdge

_PASSES: str = WORDS["order_edits"]["passes"]
_ORDER = re.compile(
    _PASSES
    + r"(?:(?P<early>first|before|ahead of|in front of)|(?P<late>second|last|after|behind))\b"
)


def read_order(
    plain: str, every: Sequence[Named], situation: Situation, people: People
) -> tuple[Edit, ...] | None:
    """The relation of the two with that order; None where the words speak of none.

    Raises:
        Unclear: the words may mean any of several.
        Refused: nothing happens between the two, or it is so already.
    """
    said = _ORDER.search(plain)
    if said is None:
        return None
    found = map(people.find_agent, every)
    named = list({each.id: each for each in found if each is not None}.values())
    if not named:
        return None
    edge = _find_edge(named, situation, people)
    subject = named[0].id
    other = edge.to if edge.from_ == subject else edge.from_
    first, second = (other, subject) if said["late"] else (subject, other)
    if edge.get_first() == first:
        raise Refused("no_change", f"{first} passes before {second} as it is.")
    return (Relate(edge=reorder(edge, first=first, second=second)),)


def reorder(edge: RelationEdge, *, first: str, second: str) -> RelationEdge:
    """The relation with the other order; the agent that yields, follows or strikes changes."""
    plain = edge.model_dump(by_alias=True)
    if edge.type in ("yield_to", "follow") or edge.kind == "rear_end":
        plain |= {"from": second, "to": first, "pattern": None}
    else:
        plain |= {"first": first}
    if edge.type == "near_miss" and edge.braker == first:
        plain |= {"braker": second if second.startswith("vehicle") else None}
    return RelationEdge.model_validate(plain)


def _find_edge(named: list[AgentView], situation: Situation, people: People) -> RelationEdge:
    """The relation that the words mean: of the two that are named, or the only one of the one."""
    ids = {each.id for each in named[:2]}
    edges = [each for each in situation.graph.relations if ids <= {each.from_, each.to}]
    if not edges:
        names = " and ".join(sorted(ids))
        raise Refused(
            "impossible",
            f"Nothing happens of which {names} could be first; say that one yields to the other, "
            "or that the two nearly collide.",
        )
    if len(edges) == 1:
        return edges[0]
    others = {name for each in edges for name in (each.from_, each.to)} - ids
    partner = people.pick(
        [e for e in people.list_foreground() if e.id in others], "other of the two"
    )
    return next(each for each in edges if partner.id in (each.from_, each.to))
