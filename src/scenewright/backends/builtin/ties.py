"""Entries that the text fixes by one another alone: oncoming, from its left, cross street."""

from __future__ import annotations

from collections.abc import Iterator

from scenewright.backends.builtin.draft import (
    LEFT_OF_HEADING,
    AgentDraft,
    Draft,
)
from scenewright.backends.builtin.entail import find_partner
from scenewright.scene.base import OPPOSITE
from scenewright.scene.social import EntrySide

_SIDES: dict[str, EntrySide] = {
    "opposite": "opposite", "mutual": "opposite", "same": "same", "lateral": "lateral",
    "of_left": "left", "of_right": "right", "other": "other",
}  # fmt: skip

Tie = tuple[AgentDraft, AgentDraft, EntrySide]
"""Agent, the other one, and where the agent comes from as seen by the other one."""


def list_ties(draft: Draft) -> list[Tie]:
    """What the text says of entries, once for every pair, without what an edit has overruled."""
    found: dict[frozenset[int], Tie] = {}
    stated = (
        (agent, other, _SIDES[word])
        for agent in draft.agents
        for word, named in agent.relatives
        if word in _SIDES and (other := named or find_partner(agent, draft)) is not None
    )
    for agent, other, side in (*stated, *_list_implied_ties(draft)):
        vehicles = agent.drives and other.drives and agent is not other
        if vehicles and other in draft.agents and not _is_overruled(agent, other, side):
            found.setdefault(frozenset((id(agent), id(other))), (agent, other, side))
    return list(found.values())


def name_turns_across(draft: Draft) -> None:
    """An agent that turns across an oncoming vehicle and hits it has a left-turn collision.

    In left-hand traffic it turns right; the kind has one name.
    """
    opposite = {frozenset((id(a), id(b))) for a, b, side in list_ties(draft) if side == "opposite"}
    for relation in draft.relations:
        moves = {relation.from_.movement, relation.to.movement}
        across = draft.site.across
        turns = across in moves and moves <= {across, None, "straight"} and len(moves) == 2
        entry = relation.from_.entry
        facing = entry is not None and relation.to.entry == OPPOSITE[entry]
        oncoming = facing or relation.pair() in opposite
        if relation.type == "collide_at" and relation.kind is None and turns and oncoming:
            relation.kind = "left_turn"


def _list_implied_ties(draft: Draft) -> Iterator[Tie]:
    """ "nearly collide head-on": towards one another; "nearly rear-ends": in one lane."""
    for relation in draft.relations:
        if relation.type == "near_miss" and relation.kind == "rear_end":
            yield relation.to, relation.from_, "same"
        if relation.type == "near_miss" and relation.kind == "head_on":
            yield relation.to, relation.from_, "opposite"


def _is_overruled(agent: AgentDraft, other: AgentDraft, side: EntrySide) -> bool:
    """Whether both entries are known and lie otherwise."""
    if agent.entry is None or other.entry is None:
        return False
    left = LEFT_OF_HEADING.get(OPPOSITE[other.entry])
    lies: dict[EntrySide, bool] = {
        "same": agent.entry == other.entry,
        "other": agent.entry != other.entry,
        "opposite": agent.entry == OPPOSITE[other.entry],
        "lateral": agent.entry not in (other.entry, OPPOSITE[other.entry]),
        "left": agent.entry == left,
        "right": agent.entry == OPPOSITE.get(left or ""),
    }
    return not lies[side]
