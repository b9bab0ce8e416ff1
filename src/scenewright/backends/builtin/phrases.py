"""Phrases of relation files: each asks for its relation, played as that file says.

The reader knows no phrase of a file: a plain verb stands for it while the text is read, and the
event that is read there gets the file's pattern.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

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
    patterns = load_patterns()
    spoken, known = _COMPILED.get(None, patterns, make=lambda: _compile_phrases(patterns))
    found = [(m, *known[int(str(m.lastgroup)[1:])]) for m in spoken.finditer(text)]
    worded, pieces = replace_pieces(
        text,
        ((m.start(), m.end(), verbs[_PASSIVE.match(m[0]) is not None]) for m, verbs, _ in found),
    )
    phrases = tuple(
        Phrase(start, end, names)
        for (start, end, *_), (_, _, names) in zip(pieces, found, strict=True)
    )
    return PhrasedText(worded, text, pieces, phrases)


_PASSIVE = re.compile(r"(?:is|was|were|are|gets|got|being) .* by$", re.IGNORECASE | re.DOTALL)
_Spoken = tuple[re.Pattern[str], list[tuple[tuple[str, str], tuple[str, ...]]]]
_COMPILED: RecentCache[None, _Spoken] = RecentCache(most=1)


def _compile_phrases(patterns: Sequence[Pattern]) -> _Spoken:
    """Any phrase; by the number of its group, its verbs (active, passive) and its patterns."""
    known: dict[str, tuple[tuple[str, str], tuple[str, ...]]] = {}
    for pattern in patterns:
        active, passive = pattern.find_kind("stand_ins").stand_ins
        verbs = (active, passive)
        for words, turned in pattern.list_phrase_words():
            both, others = known.get(words, (verbs[::-1] if turned else verbs, ()))
            known[words] = both, (*others, pattern.id)
    longest = sorted(known, key=len, reverse=True)
    spoken = "|".join(f"(?P<p{n}>{_spell(words)})" for n, words in enumerate(longest))
    whole = rf"(?<!\w)(?:{spoken})(?!\w)" if longest else r"(?!)"
    return re.compile(whole, re.IGNORECASE), [known[words] for words in longest]


def _spell(words: str) -> str:
    """The words of a phrase, its verb in any form: "noses out", "nosing out", "nosed out"."""
    verb, *rest = words.split()
    if not verb.endswith("s"):
        return r"\s+".join(map(re.escape, words.split()))
    base = re.escape(verb.removesuffix("s").removesuffix("e"))
    active = rf"(?:(?:is|was|are|were) )?{base}(?:e?s|e?d|ing|e)?"
    passive = rf"(?:is|was|were|are|gets|got|being) {base}e?d"
    after = "".join(rf"\s+{re.escape(each)}" for each in rest)
    return rf"{passive}{after}\s+by|{active}{after}"


def play_phrase(relation: RelationDraft, phrase: Phrase, site: Site) -> None:
    """Give a relation the first pattern of a phrase that fits its two agents.

    The pattern of a collision that nearly happens is that of the near miss.

    Raises:
        Refused: no pattern fits them.
    """
    known = {each.id: each for each in load_patterns() if each.relation == relation.type}
    names = list(phrase.patterns)
    if relation.type == "near_miss":
        names = [re.sub("_(?:collision|strike)", "_near_miss", each) for each in names]
    names = [each for each in names if each in known]
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
