"""Slips of the finger in words of traffic: "lihgt", "bycicle", "wset"."""

from __future__ import annotations

import os
import re
from functools import cache, lru_cache
from importlib.resources import files
from itertools import chain

from scenewright.backends.builtin.reader.words import WORDS
from scenewright.backends.builtin.rewritten import RewrittenText, replace_pieces
from scenewright.scene.english import load_english_words
from scenewright.scene.relations import load_patterns

_WORD = re.compile(r"(?<![\w'’])[A-Za-z]{3,}(?![\w'’])")
_TYPOLOGIES: list[tuple[re.Pattern[str], str]] = [
    (re.compile(each, re.I), said) for each, said in WORDS["spelling"]["typologies"]
]
_CONFLICT = "|".join(each.pattern for each, _ in _TYPOLOGIES)
_PIECE = re.compile(rf"\b(?P<conflict>{_CONFLICT})\b|{_WORD.pattern}", re.IGNORECASE)


def mend_spelling(text: str) -> RewrittenText:
    """The text with conflicts of crash typologies in plain words, and slips put right.

    A slip is a word that is no English one, where one slip of the finger explains it.
    """
    slips = [
        (m.start(), m.end(), _write_out(m[0]) if m["conflict"] else _mend_word(m[0].lower()))
        for m in _PIECE.finditer(text)
    ]
    worded, pieces = replace_pieces(text, ((a, b, word) for a, b, word in slips if word))
    return RewrittenText(worded, text, pieces)


def _write_out(words: str) -> str:
    return next(said for each, said in _TYPOLOGIES if each.fullmatch(words))


@lru_cache(maxsize=4096)
def _mend_word(word: str) -> str | None:
    """The word of traffic that has the same letters in another order, or one more or less."""
    targets = load_words("traffic_words.txt")
    own = _list_phrase_words(os.environ.get("SCENEWRIGHT_RELATIONS"))
    known = (targets, own, load_english_words(), load_words("instruction_words.txt"))
    if any(word in words for words in known):
        return None
    near = (w for w in targets if w[0] == word[0] and abs(len(w) - len(word)) <= 1)
    slips = [each for each in near if _is_slip(word, each)]
    return min(slips, key=lambda each: (abs(len(each) - len(word)), each), default=None)


def _is_slip(word: str, meant: str) -> bool:
    if len(word) == len(meant):
        other = sum(a != b for a, b in zip(word, meant, strict=True))
        return sorted(word) == sorted(meant) or (len(word) >= 8 and other == 1)  # "ambulence"
    short, long = sorted((word, meant), key=len)
    if long[-1] == long[-2] and long[:-1] == short:
        return True  # "buss"
    return len(short) >= 5 and any(long[:n] + long[n + 1 :] == short for n in range(len(long)))


@cache
def _list_phrase_words(_own: str | None) -> frozenset[str]:
    """The words of the phrases of all relations."""
    phrases = chain.from_iterable(pattern.phrases for pattern in load_patterns())
    return frozenset(word.lower() for each in phrases for word in _WORD.findall(each))


@cache
def load_words(name: str) -> frozenset[str]:
    """The words of a file of this room."""
    return frozenset(files(__package__).joinpath(name).read_text("utf-8").split())
