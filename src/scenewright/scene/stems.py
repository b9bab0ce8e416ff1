"""Stems of English words, for threads (the Snowball stemmer keeps its state in itself), and a list
of words that are no slips of the finger."""

from __future__ import annotations

import threading
from functools import cache, lru_cache
from importlib.resources import files
from typing import Any

_LOCK = threading.Lock()


@lru_cache(maxsize=8192)
def stem_word(word: str) -> str:
    """The Snowball stem of a lower-case English word."""
    with _LOCK:
        return str(_load_stemmer().stemWord(word))


@cache
def load_english_words() -> frozenset[str]:
    """Common English words, in lower case, whether anything here can say them or not."""
    return frozenset(files(__package__).joinpath("english.txt").read_text("utf-8").split())


@cache
def _load_stemmer() -> Any:
    import Stemmer

    return Stemmer.Stemmer("english")
