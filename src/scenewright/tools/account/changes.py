"""What a change did beside what its words say, found by comparing the scene before and after."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.tools.account.facts import fits_noun
from scenewright.tools.account.mentions import Mention, find_mentions
from scenewright.tools.account.vocabulary import Token, read_tokens

_CROWD = ("density", "background", "time")
_EVENTS = ("event", "order", "red", "stop", "brake", "avoid", "priority", "normal", "meets",
           "manoeuvre", "reaction", "sight", "object")  # fmt: skip
_WAYS = ("side", "bound", "left", "right", "straight", "uturn", "turn", "jaywalking", "crosswalk",
         "cross", "opposite", "lateral", "same", "from_left", "from_right", "motion")  # fmt: skip
MOST_BACKGROUND = 6, 0.3
"""Background agents that may go or come where others must make room: a number, and a share."""


def find_unasked_changes(before: SceneRecord, after: SceneRecord, words: str) -> tuple[str, ...]:
    """What differs between two versions although the words of the change do not ask for it.

    A removal that takes none of those that it names is one, too.
    """
    tokens = read_tokens(words)
    return tuple(_compare(before, after, tokens, find_mentions(tokens)))


def _compare(
    before: SceneRecord, after: SceneRecord, tokens: Sequence[Token], mentions: Sequence[Mention]
) -> Iterator[str]:
    removes, adds = (any(token.is_in(name) for token in tokens) for name in ("removes", "adds"))
    crowd = any(e.is_in("crowd") or e.has(*_CROWD) or e.kind == "clock" for e in tokens)
    deeds = any(token.is_in("swaps") or token.has(*_EVENTS) for token in tokens)
    old, new = _list_foreground(before), _list_foreground(after)
    gone, come = old.keys() - new.keys(), new.keys() - old.keys()
    named = any(not m.pronoun and m.classes for m in mentions)
    if gone and not (removes or named or deeds):
        yield f"{', '.join(sorted(gone))} would be gone"
    if come and not (adds or named or deeds):
        yield f"{', '.join(sorted(come))} would be new"
    one_each = all(m.count == 1 for m in mentions)
    if len(new) > len(old) and named and one_each and not (adds or deeds):
        yield f"{', '.join(sorted(come))} would be there beside the others"
    moves = any(token.has(*_WAYS) for token in tokens)
    come_in = come or len(after.objects) > len(before.objects)
    if adds and moves and any(m.new and m.count == 1 for m in mentions) and not come_in:
        yield "who is new would only be one of those around"
    if removes and not crowd:
        yield from _check_removal(old, new, mentions)
    exchanged = any(token.is_in("exchanges") for token in tokens) and not any(
        m.new for m in mentions
    )
    if not (exchanged or any(token.has(*_WAYS, *_EVENTS) for token in tokens)):
        yield from _compare_ways(old, new)
    if any(token.is_in("crowd") for token in tokens):
        yield from _compare_crowd(before, after, tokens)
    yield from _compare_background(
        before, after, crowd or any(m.background or m.absent for m in mentions)
    )
    if before.meta.time_of_day != after.meta.time_of_day and not (
        crowd or any(token.kind == "clock" or token.number is not None for token in tokens)
    ):
        yield f"the time would be {after.meta.time_of_day}"
    if not (deeds or removes or adds or named) and _list_relations(before) != _list_relations(
        after
    ):
        yield "other events would be asked for"


def _check_removal(
    old: dict[str, AgentRecord], new: dict[str, AgentRecord], mentions: Sequence[Mention]
) -> Iterator[str]:
    """Whether those that are to go are gone: "one of the kids", "the cyclist"."""
    for mention in mentions:
        if mention.label or mention.other:  # one that a number names, or others
            continue
        there = {name for name, agent in old.items() if fits_noun(agent, mention.classes)}
        left = {name for name, agent in new.items() if fits_noun(agent, mention.classes)}
        if not mention.pronoun and there and there <= left and not new.keys() - old.keys():
            yield f"{', '.join(sorted(there))} would all stay"


def _compare_ways(old: dict[str, AgentRecord], new: dict[str, AgentRecord]) -> Iterator[str]:
    """Who would come from elsewhere, or go elsewhere, and is what it was."""
    for name in sorted(old.keys() & new.keys()):
        was, now = old[name], new[name]
        if was.type == now.type and (was.entry, was.exit) != (now.entry, now.exit):
            ways = (f"from {each.entry} to {each.exit}" for each in (now, was))
            yield f"{name} would go {' and not '.join(ways)}"


def _compare_crowd(
    before: SceneRecord, after: SceneRecord, tokens: Sequence[Token]
) -> Iterator[str]:
    """Whether more, or fewer, are around where that is what the words ask for."""
    old, new = (sum(a.role == "background" for a in scene.agents) for scene in (before, after))
    more = any(token.is_in("more_around") for token in tokens) and new <= old
    fewer = any(token.is_in("fewer_around") for token in tokens) and new >= old
    if more or fewer:
        yield f"there would be {new} around and not {old}"


def _compare_background(before: SceneRecord, after: SceneRecord, crowd: bool) -> Iterator[str]:
    old, new = (
        Counter(a.type for a in scene.agents if a.role == "background" and not a.group)
        for scene in (before, after)
    )
    for kind in sorted(old.keys() | new.keys()):
        number = abs(new[kind] - old[kind])
        if number > max(MOST_BACKGROUND[0], MOST_BACKGROUND[1] * old[kind]) and not crowd:
            yield f"there would be {new[kind]} background {kind}s and not {old[kind]}"


def _list_foreground(scene: SceneRecord) -> dict[str, AgentRecord]:
    return {agent.name: agent for agent in scene.agents if agent.role == "foreground"}


def _list_relations(scene: SceneRecord) -> set[tuple[str, str, str]]:
    names = {agent.id: agent.name for agent in scene.agents}
    return {
        (relation.type, names[relation.from_], names[relation.to]) for relation in scene.relations
    }
