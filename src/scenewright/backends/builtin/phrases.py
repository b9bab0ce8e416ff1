"""Phrases of relation files: each asks for its relation, played as that file says."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from scenewright.backends.builtin.clock import read_clock
from scenewright.backends.builtin.draft import AgentDraft, Refused, RelationDraft, Site
from scenewright.backends.builtin.impacts import read_impacts
from scenewright.backends.builtin.normalise import clean
from scenewright.backends.builtin.shorthand import expand
from scenewright.scene.cache import RecentCache
from scenewright.scene.relations import Pattern, Role, load_patterns
from scenewright.scene.social import RelationType

_TAGS: dict[RelationType, str] = {
    "collide_at": "COLLIDE", "near_miss": "NEAR", "yield_to": "YIELD", "follow": "FOLLOW",
}  # fmt: skip
_CARRIER = re.compile(r"^ *a car (.+) a truck *$")
_REVERSED = "<"


@dataclass(frozen=True)
class Phrase:
    """Words that ask for a pattern.

    Attributes:
        spellings: the words as written, and as they are once the text has been made plain.
        tags: what they mean to the reader: the relation, and the pattern.
    """

    spellings: tuple[str, ...]
    tags: tuple[tuple[str, str], ...]


def load_phrases() -> tuple[Phrase, ...]:
    """Every phrase of every relation file; the same tuple as long as the files are the same."""
    found = load_patterns()
    return _SPOKEN.get(
        None, found, make=lambda: tuple(itertools.chain.from_iterable(map(_list_phrases, found)))
    )


def has_phrase(text: str) -> bool:
    """Whether a text holds the phrase of a relation file."""
    plain = f" {' '.join(expand(clean(text)).split())} "
    return any(
        f" {spelling} " in plain for phrase in load_phrases() for spelling in phrase.spellings
    )


def is_of_phrase(words: str, pattern: str) -> bool:
    """Whether words are part of a phrase that asks for a pattern."""
    part = f" {' '.join(expand(clean(words)).split())} "
    return any(
        part in f" {spelling} "
        for phrase in load_phrases()
        if read_pattern(dict(phrase.tags)["PATTERN"])[0] == pattern
        for spelling in phrase.spellings
    )


_SPOKEN: RecentCache[None, tuple[Phrase, ...]] = RecentCache(most=1)


def _list_phrases(pattern: Pattern) -> Iterator[Phrase]:
    for words, turned in pattern.list_phrase_words():
        yield _build_phrase(pattern.relation, pattern.kind or "any", pattern.id, words, turned)


@lru_cache(maxsize=4096)
def _build_phrase(relation: RelationType, kind: str, name: str, words: str, turned: bool) -> Phrase:
    meaning = kind if relation == "collide_at" else "any"
    pattern = f"{name}{_REVERSED if turned else ''}"
    return Phrase(
        tuple(dict.fromkeys((words, _normalise_words(words)))),
        ((_TAGS[relation], meaning), ("PATTERN", pattern)),
    )


def _normalise_words(words: str) -> str:
    """The words after all that is done to a text before it is read; unchanged if they dissolve."""
    said, _ = read_impacts(expand(clean(f"a car {words} a truck")))
    found = _CARRIER.match(read_clock(said)[0])
    return found[1] if found else words


def read_pattern(value: str | None) -> tuple[str | None, bool]:
    """Of a PATTERN tag: the id, and whether `to` is named first."""
    if value is None:
        return None, False
    return value.removesuffix(_REVERSED), value.endswith(_REVERSED)


def assign_agents(relation: RelationDraft, site: Site) -> None:
    """Gives both agents what the pattern of the phrase leaves no choice about.

    A phrase that names a turn means that turn. In left-hand traffic the files' patterns are played
    in a mirror, so there it fixes the turn only, and no pattern.

    Raises:
        Refused: the phrase cannot be said of these two.
    """
    pattern = next((each for each in load_patterns() if each.id == relation.pattern), None)
    if pattern is None:
        return
    if site.left_hand and pattern.names_a_turn:
        relation.pattern = None
        relation.kind = None if relation.kind == "left_turn" else relation.kind
    for agent, role in _list_roles(relation, pattern):
        if agent.movement is None and len(role.movements) == 1:
            agent.movement = role.movements[0]
        if agent.movement is not None and agent.movement not in role.movements:
            raise Refused(
                "contradictory",
                f"'{_describe_pattern(pattern)}' is for {' or '.join(role.movements)}, "
                f"not {agent.movement}; change the one or the other.",
            )


def _list_roles(relation: RelationDraft, pattern: Pattern) -> list[tuple[AgentDraft, Role]]:
    given, wanted = (relation.from_, relation.to), (pattern.from_, pattern.to)
    for pair in (given, given[::-1]):
        if all(role.admits(agent.type) for agent, role in zip(pair, wanted, strict=True)):
            return list(zip(pair, wanted, strict=True))
    raise Refused(
        "contradictory",
        f"'{_describe_pattern(pattern)}' is said of {_describe_pair(pattern)}; "
        "name these, or use other words.",
    )


def _describe_pattern(pattern: Pattern) -> str:
    return pattern.list_phrase_words()[0][0]


def _describe_pair(pattern: Pattern) -> str:
    first, second = pattern.from_.type, pattern.to.type
    return f"two {first}s" if first == second else f"a {first} and a {second}"
