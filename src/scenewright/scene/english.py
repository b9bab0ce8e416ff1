"""Common English words, which are no slips of the finger for another word."""

from __future__ import annotations

from functools import cache
from importlib.resources import files


@cache
def load_english_words() -> frozenset[str]:
    """The words in lower case, whether anything here can say them or not."""
    return frozenset(files(__package__).joinpath("english.txt").read_text("utf-8").split())
