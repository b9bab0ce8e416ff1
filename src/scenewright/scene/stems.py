"""Stems of English words, for threads: the Snowball stemmer keeps its state in itself."""

from __future__ import annotations

import threading
from functools import cache, lru_cache
from typing import Any

_LOCK = threading.Lock()


@lru_cache(maxsize=8192)
def stem_word(word: str) -> str:
    """The Snowball stem of a lower-case English word."""
    with _LOCK:
        return str(_load_stemmer().stemWord(word))


@cache
def _load_stemmer() -> Any:
    import Stemmer

    return Stemmer.Stemmer("english")
