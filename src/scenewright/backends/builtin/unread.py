"""What a reading leaves out: a deed or a road user that came to nothing is asked back, not dropped.

A word of no meaning here is passed over, as colours and adverbs are. Where it means what one
road user does to another, or an agent that is hit or waited for, the graph would lack a part of the
text, so the text is refused with that word.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import dropwhile, takewhile

from scenewright.backends.builtin.clauses import ClauseReader
from scenewright.backends.builtin.cursor import NOUNS, PARTS, Group, get_words, is_pronoun
from scenewright.backends.builtin.draft import AgentDraft, Draft, Refused
from scenewright.backends.builtin.grammar import Modifier
from scenewright.backends.builtin.lexicon import Chunk
from scenewright.backends.builtin.mentions import Item, Mention

_EVENTS = ("COLLIDE", "NEAR", "YIELD", "WAIT")
_ARTICLES = frozenset({"a", "an", "the", "another"})
_LINKS = frozenset({"to", "for", "into"})
_PARTS = PARTS | frozenset(
    [
        "path",
        "way",
        "lane",
        "road",
        "route",
        "middle",
        "place",
        "centre",
        "center",
        "curb",
        "kerb",
        "kerbside",
        "box",
        "spot",
        "moment",
        "brakes",
        "line",
    ]
)
"""Nouns that are a place or a part of an agent."""

_TALK = frozenset(
    [
        "scene",
        "scenario",
        "clip",
        "video",
        "test",
        "case",
        "simulation",
        "event",
        "incident",
        "situation",
    ]
)

_FILLERS = frozenset(
    [
        "there",
        "then",
        "also",
        "just",
        "please",
        "scene",
        "scenario",
        "video",
        "with",
        "where",
        "both",
        "same",
        "time",
        "meanwhile",
        "later",
        "first",
        "only",
        "along",
        "around",
        "over",
        "past",
        "while",
        "still",
        "this",
        "that",
        "these",
        "those",
        "arrive",
        "arrives",
    ]
)
_CROWD = frozenset({"everyone", "everybody", "all", "others", "the others", "everything", "rest"})
_NO_DEEDS = frozenset(
    [
        "sees",
        "notices",
        "noticed",
        "watches",
        "watched",
        "spots",
        "observes",
        "observed",
        "greets",
        "recognises",
        "recognizes",
        "this",
        "does",
        "needs",
        "needed",
        "wants",
        "wanted",
        "admires",
        "less",
        "affects",
        "reports",
        "forces",
        "wins",
    ]
)
"""Words between two agents after which nothing has happened yet, and some that are no verbs."""


def check_read(draft: Draft, reader: ClauseReader) -> None:
    """Refused where an event of the text is in no relation of the draft."""
    for word in (*_find_unknown_objects(reader.items), *_find_unknown_actors(reader.items)):
        raise Refused(
            "out_of_scope",
            f"Nothing is known here of '{word}'; name a vehicle or a pedestrian in its place.",
        )
    if (pronoun := _find_unresolved_pronoun(reader)) is not None:
        raise Refused(
            "out_of_scope",
            f"It is not clear which agent '{pronoun}' means; name the vehicle or the pedestrian.",
        )
    if (crowd := _find_unresolved_plural(draft, reader)) is not None:
        raise Refused(
            "out_of_scope",
            f"How many '{crowd}' are is not said; say who gives way to whom, such as 'a car from "
            "the north and a bus yield to the ambulance'.",
        )
    for word in (*_list_deeds(draft, reader), *_list_unread_words(draft, reader)):
        raise Refused(
            "out_of_scope",
            f"What '{word}' asks for is not known here; say that they collide, nearly collide, "
            "give way or follow.",
        )
    for word in _list_unread_events(draft, reader):
        raise Refused(
            "out_of_scope",
            f"The text says '{word}', but not between which agents; say which road user collides "
            "with, nearly hits, gives way to or follows which other.",
        )
    for agent in _list_unrelated(draft, reader):
        raise Refused(
            "out_of_scope",
            f"What the {agent.head or agent.type} does is not clear; say it, or leave the "
            f"{agent.head or agent.type} out.",
        )


def _find_unknown_objects(items: Sequence[Item]) -> Iterator[str]:
    """ "hits a wombat", "stops for a parade": an agent of unknown kind."""
    for at, item in enumerate(items):
        if not (isinstance(item, Chunk) and (item.has(*_EVENTS) or _is_driving_after(item))):
            continue
        start = at + 1
        link = items[start] if start < len(items) else None
        linked = isinstance(link, Chunk) and link.text in _LINKS
        if item.words[-1] in {"at", "near"}:
            continue
        if linked or (item.has("COLLIDE") and get_words(link) in {"with", "against"}):
            start += 1
        elif item.has("WAIT"):
            continue
        noun = _find_unknown_noun(items[start : start + 5])
        if noun is not None:
            yield noun


def _is_driving_after(chunk: Chunk) -> bool:
    """ "follows", "chases"; not "behind", which may be a place only."""
    return chunk.has("FOLLOW") and chunk.words[0].startswith(("follow", "chas", "tail", "trail"))


def _find_unknown_actors(items: Sequence[Item]) -> Iterator[str]:
    """ "a wombat from the east hits": an agent of unknown kind acts."""
    for at, item in enumerate(items):
        if not (isinstance(item, Chunk) and item.text in _ARTICLES):
            continue
        words = [get_words(each) for each in takewhile(_is_plain_word, items[at + 1 : at + 4])]
        rest = dropwhile(_can_stand_between, items[at + 1 + len(words) :])
        verb = next(rest, None)
        acts = isinstance(verb, Chunk) and verb.has(*_EVENTS) and verb.words[-1] not in NOUNS
        finite = acts and isinstance(verb, Chunk) and not verb.words[0].endswith("ing")
        if finite and 0 < len(words) < 3 and not (_PARTS | _TALK) & set(words):
            yield " ".join(words)


def _is_plain_word(item: Item) -> bool:
    return isinstance(item, Chunk) and not item.tags and item.text.isalpha()


def _can_stand_between(item: Item) -> bool:
    """What may stand between a noun and its verb."""
    return isinstance(item, Modifier) or (
        isinstance(item, Chunk) and (item.mark == "," or item.has("WHO", "ALMOST", "NEGATION"))
    )


def _find_unknown_noun(items: Sequence[Item]) -> str | None:
    """ "a wombat", where no known noun follows."""
    if get_words(items[0] if items else None) not in _ARTICLES:
        return None
    words = [get_words(item) for item in takewhile(_is_plain_word, items[1:])]
    rest = items[1 + len(words) :]
    known = bool(rest) and (isinstance(rest[0], Mention) or get_words(rest[0]) == "of")
    if known or _PARTS & set(words) or all(word.endswith("ly") for word in words):
        return None
    return " ".join(words)


def _find_unresolved_pronoun(reader: ClauseReader) -> str | None:
    """ "a swan walks by, drivers stop for it": a pronoun for an agent that was not understood."""
    items = reader.items
    for at, item in enumerate(items):
        if not (isinstance(item, Chunk) and item.has(*_EVENTS)):
            continue
        then = at + 1
        if then < len(items) and get_words(items[then]) in _LINKS:
            then += 1
        following = items[then] if then < len(items) else None
        if is_pronoun(following) and then not in reader.named:
            return get_words(following)
    return None


def _find_unresolved_plural(draft: Draft, reader: ClauseReader) -> str | None:
    """ "an ambulance passes, everyone yields": no agent in particular gives way."""
    known = {id(agent) for group in reader.named.values() for agent in group}
    yields = [edge for edge in draft.relations if edge.type == "yield_to"]
    if yields and all({id(edge.from_), id(edge.to)} <= known for edge in yields):
        return None
    for first, second in zip(reader.items, reader.items[1:], strict=False):
        verb = isinstance(second, Chunk) and second.has("YIELD", "WAIT", "LET")
        if isinstance(first, Chunk) and first.text in _CROWD and verb:
            return first.text
    return None


def _list_deeds(draft: Draft, reader: ClauseReader) -> Iterator[str]:
    items = reader.items
    for at, item in enumerate(items):
        if not isinstance(item, Chunk) or item.mark or item.tags.keys() - {"EDIT"}:
            continue
        word = item.words[0]
        if len(word) < 4 or not word.endswith(("s", "ed")) or word in _NO_DEEDS:
            continue
        before, after = (items[at - 1] if at else None), reader.named.get(at + 1)
        subject = reader.named.get(at - 1)
        if after and (subject or (isinstance(before, Chunk) and before.has("AND", "WHO"))):
            itself = {id(agent) for agent in after} <= {id(agent) for agent in subject or []}
            if not itself and not (subject and _is_related(draft, reader, subject, after)):
                yield item.text


def _is_related(draft: Draft, reader: ClauseReader, first: Group, second: Group) -> bool:
    pairs = {edge.pair() for edge in (*draft.relations, *reader.failed)}
    return any(frozenset((id(a), id(b))) in pairs for a in first for b in second)


def _list_unread_events(draft: Draft, reader: ClauseReader) -> Iterator[str]:
    """Words for an event, in a text that has come to none."""
    if _is_eventless(draft, reader):
        for item in reader.items:
            if isinstance(item, Chunk) and item.has(*_EVENTS, "FOLLOW", "ALMOST", "LET"):
                yield item.text


def _list_unread_words(draft: Draft, reader: ClauseReader) -> list[str]:
    """Words of no meaning here between agents without events, verbs first."""
    if not _is_eventless(draft, reader) or len(draft.agents) < 2:
        return []
    chunks = [item for item in reader.items if isinstance(item, Chunk)]
    words = [chunk.text for chunk in chunks if not chunk.tags.keys() - {"EDIT"}]
    given = [word for word in words if len(word) > 3 and word.isalpha() and word[-2:] != "ly"]
    deeds = [word for word in given if word not in _FILLERS | _NO_DEEDS]
    return sorted(deeds, key=lambda word: not word.endswith(("s", "ed")))


def _is_eventless(draft: Draft, reader: ClauseReader) -> bool:
    """Agents, but no relation, and nothing is said to be normal or denied."""
    given = draft.relations or reader.failed or draft.normal or draft.denied
    lights = any(isinstance(item, Chunk) and item.has("SIGNAL") for item in reader.items)
    return bool(draft.agents) and not given and not lights


def _list_unrelated(draft: Draft, reader: ClauseReader) -> Iterator[AgentDraft]:
    if not draft.relations:
        return
    bound = {id(a) for edge in (*draft.relations, *reader.failed) for a in (edge.from_, edge.to)}
    groups = {id(a) for group in reader.named.values() if len(group) > 1 for a in group}
    around = {id(a) for at, group in reader.named.items() if _is_nearby(reader, at) for a in group}
    for agent in draft.agents:
        placed = agent.entry and not agent.relatives
        bare = not (placed or agent.exit or agent.movement or agent.crosswalk)
        if id(agent) not in bound | groups | around and bare:
            yield agent


def _is_nearby(reader: ClauseReader, at: int) -> bool:
    """ "with a truck nearby": it is there, and that is all."""
    after = reader.items[at + 1] if at + 1 < len(reader.items) else None
    return isinstance(after, Chunk) and after.has("BACKGROUND", "NEARBY")
