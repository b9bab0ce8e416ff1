"""A noun of a road user means the same class to the reader and to the account, each by its own
list."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from scenewright.backends.builtin.reader.words import find_class, find_subtype, load_nouns
from scenewright.tools.account.facts import fits_noun
from scenewright.tools.account.mentions import find_mentions
from scenewright.tools.account.vocabulary import WORDS, read_tokens

LEFT_OPEN = {*WORDS["nouns"]["any"], *WORDS["nouns"]["rider"], "family", "group", "crowd", "class"}
"""Those of several classes, and of groups, which have a rule of their own."""
NOUNS = {n: k for k, nouns in WORDS["nouns"].items() for n in nouns if n not in LEFT_OPEN}


def make_agent(noun: str) -> Any:
    """The agent that the reader makes of a noun."""
    kind = find_class(noun)
    return SimpleNamespace(type=kind, subtype=find_subtype(noun) if kind == "vehicle" else None)


def test_the_reader_takes_a_noun_of_the_account_for_the_same_class() -> None:
    other = {n: k for n, k in NOUNS.items() if not fits_noun(make_agent(n), frozenset({k}))}
    assert other == {}


def test_the_account_takes_a_noun_of_the_reader_for_the_same_class() -> None:
    other = []
    for noun in (n for n, each in load_nouns().items() if each.kind != "none"):
        (mention,) = find_mentions(read_tokens(f"a {noun}"))
        if not (mention.classes and fits_noun(make_agent(noun), mention.classes)):
            other.append(noun)
    assert other == []
