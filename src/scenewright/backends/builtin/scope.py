"""What cannot be planned at all: no traffic, another language, agents and places we do not have."""

from __future__ import annotations

import re
from functools import cache

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.normalise import clean
from scenewright.backends.builtin.spelling import load_words
from scenewright.scene.english import load_english_words
from scenewright.scene.stems import stem_word

MOST_CHARACTERS = 2_000
_CONTROL = re.compile(
    r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)


def check_text(text: str) -> None:
    """Refused for blank, oversized or unprintable text."""
    if not text.strip():
        raise Refused(
            "out_of_scope",
            "The instruction is blank; describe a traffic scene at the intersection.",
        )
    if len(text) > MOST_CHARACTERS:
        raise Refused(
            "out_of_scope",
            f"The instruction has {len(text)} characters; describe the scene in at most "
            f"{MOST_CHARACTERS}.",
        )
    if _CONTROL.search(text):
        raise Refused("out_of_scope", "The instruction holds control characters; write plain text.")


def check_language(text: str, mended: str | None = None) -> None:
    """Refused unless most words, with slips mended, are English and one is a word at all."""
    letters = [char for char in text if char.isalpha()]
    latin = sum(char.isascii() for char in letters)
    if not letters or latin < 0.8 * len(letters):
        raise build_not_english()
    words = re.findall(r"[a-z]+", clean(mended or text))
    english = _load_english()
    known = sum(not english.isdisjoint((word, stem_word(word))) for word in words)
    foreign = sum(word in load_words("foreign.txt") for word in words)
    if not words or known < 0.6 * len(words) or (foreign >= 2 and foreign >= 0.2 * len(words)):
        raise build_not_english()


@cache
def _load_english() -> frozenset[str]:
    """English words and their stems."""
    lists = ("instruction_words.txt", "traffic_words.txt")
    words = load_english_words().union(*map(load_words, lists))
    return words | {stem_word(word) for word in words}


def build_nothing_planned() -> Refused:
    """The verdict on a text that names no agent and no event."""
    return Refused(
        "out_of_scope",
        "The text describes no traffic scene; say which vehicles or pedestrians do "
        "what at the intersection.",
    )


def build_not_english() -> Refused:
    """The verdict on a text in another language."""
    return Refused(
        "out_of_scope",
        "The text does not seem to be English; describe the scene in English.",
    )
