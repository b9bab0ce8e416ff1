"""Numbers in words and figures."""

from __future__ import annotations

import re

from scenewright.backends.builtin.reader.words import WORDS, Patterns

_PATTERNS = Patterns("numbers")

TO_TWENTY: list[str] = WORDS["numbers"]["to_twenty"]
_WORDS: dict[str, int] = {word: number for number, word in enumerate(TO_TWENTY)}
_WORDS |= WORDS["numbers"]["others"]
TENS = ("twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety")
_COMPOUND = re.compile(rf"\b({'|'.join(TENS)})[- ]({'|'.join(TO_TWENTY[1:10])})\b", re.IGNORECASE)
_NUMBER = re.compile(
    r"(?<![\w.])(?:(\d{1,3})(?![\w.,:]*\d)|("
    + "|".join(sorted(map(re.escape, _WORDS), key=len, reverse=True))
    + r")(?![a-z]))",
    re.IGNORECASE,
)


def number_in(words: str) -> int | None:
    """The first number in some words; None if there is none."""
    match = _NUMBER.search(words)
    compound = _COMPOUND.search(words)
    if compound is not None and match is not None and compound.start() == match.start():
        return _WORDS[compound[1].lower()] + _WORDS[compound[2].lower()]
    if match is None:
        return None
    return int(match[1]) if match[1] else _WORDS[match[2].lower()]


def count_in(words: str) -> int | None:
    """How many road users the words of a mention count; None where they count none.

    The number of "vehicle 2" is a name, and that of "a two-door car" says what it is.
    """
    if times := _PATTERNS.times.search(words):
        return int(times[1])
    plain = _PATTERNS.of_one.sub(" ", words)
    if plain != words and _PATTERNS.singular.match(words):
        return 1
    found = number_in(_PATTERNS.label.sub(" ", plain))
    return found if found else None
