"""Phrases of relation files: each asks for its relation, played as that file says.

The reader knows no phrase of a file: a plain verb stands for it while the text is read, and the
event that is read there gets the file's pattern.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from scenewright.backends.builtin.draft import AgentDraft, Refused, RelationDraft, Site
from scenewright.backends.builtin.rewritten import RewrittenText, replace_pieces
from scenewright.scene.cache import RecentCache
from scenewright.scene.relations import Pattern, Role, load_patterns


@dataclass(frozen=True)
class Phrase:
    """A plain verb in place of a phrase: where it stands, and the patterns that are asked for."""

    start: int
    end: int
    patterns: tuple[str, ...]


@dataclass(frozen=True)
class PhrasedText(RewrittenText):
    """A text with plain verbs in place of the phrases of relation files."""

    phrases: tuple[Phrase, ...] = ()


def replace_phrases(text: str) -> PhrasedText:
    """The text with a plain verb for every phrase of a relation file."""
    patterns, folded = load_patterns(), text.casefold()
    known = _KNOWN.get(None, patterns, make=lambda: _list_known(patterns))
    # All of them in one expression take longer to compile than the whole text to read.
    here = [each for each in known if all(part in folded for part in each.parts)]
    spoken = "|".join(f"(?P<p{n}>{each.spelling})" for n, each in enumerate(here))
    matches = re.finditer(rf"(?<!\w)(?:{spoken})(?!\w)", text, re.IGNORECASE) if here else ()
    found = [(m, here[int(str(m.lastgroup)[1:])]) for m in matches]
    worded, pieces = replace_pieces(
        text,
        ((m.start(), m.end(), one.verbs[_PASSIVE.match(m[0]) is not None]) for m, one in found),
    )
    phrases = tuple(
        Phrase(start, end, one.patterns)
        for (start, end, *_), (_, one) in zip(pieces, found, strict=True)
    )
    return PhrasedText(worded, text, pieces, phrases)


class _Known(NamedTuple):
    """A phrase as an expression, what any text with it holds, its verbs (active, passive)."""

    spelling: str
    parts: list[str]
    verbs: tuple[str, str]
    patterns: tuple[str, ...]


_PASSIVE = re.compile(r"(?:is|was|were|are|gets|got|being) .* by$", re.IGNORECASE | re.DOTALL)
_KNOWN: RecentCache[None, list[_Known]] = RecentCache(most=1)


def _list_known(patterns: Sequence[Pattern]) -> list[_Known]:
    """The phrases of all patterns, the longest first."""
    known: dict[str, tuple[tuple[str, str], tuple[str, ...]]] = {}
    for pattern in patterns:
        active, passive = pattern.find_kind("stand_ins").stand_ins
        verbs = (active, passive)
        for words, turned in pattern.list_phrase_words():
            both, others = known.get(words, (verbs[::-1] if turned else verbs, ()))
            known[words] = both, (*others, pattern.id)
    return [_Known(*_spell(words), *known[words]) for words in sorted(known, key=len, reverse=True)]


def _spell(words: str) -> tuple[str, list[str]]:
    """A phrase, its verb in any form ("noses out", "nosing out", "nosed out"), and its parts."""
    verb, *rest = words.split()
    folded = words.casefold().split()
    if not verb.endswith("s"):
        return r"\s+".join(map(re.escape, words.split())), folded
    stem = verb.removesuffix("s").removesuffix("e")
    base = re.escape(stem)
    active = rf"(?:(?:is|was|are|were) )?{base}(?:e?s|e?d|ing|e)?"
    passive = rf"(?:is|was|were|are|gets|got|being) {base}e?d"
    after = "".join(rf"\s+{re.escape(each)}" for each in rest)
    return rf"{passive}{after}\s+by|{active}{after}", [stem.casefold(), *folded[1:]]


def play_phrase(relation: RelationDraft, phrase: Phrase, site: Site) -> None:
    """Give a relation the first pattern of a phrase that fits its two agents.

    The pattern of a collision that nearly happens is that of the near miss.

    Raises:
        Refused: no pattern fits them.
    """
    known = {
        pattern.id: pattern for pattern in load_patterns() if pattern.relation == relation.type
    }
    names = list(phrase.patterns)
    if relation.type == "near_miss":
        names = [re.sub("_(?:collision|strike)", "_near_miss", name) for name in names]
    names = [name for name in names if name in known]
    for number, name in enumerate(names, start=1):
        relation.pattern, relation.kind = name, relation.kind or known[name].kind
        try:
            assign_agents(relation, site)
        except Refused:
            if number == len(names):
                raise
        else:
            return


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
    given, wanted = relation.ends, (pattern.from_, pattern.to)
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
