"""Instruction text -> plain lower-case text."""

from __future__ import annotations

import re
import unicodedata

from scenewright.backends.builtin.reader.words import WORDS

_REPLACEMENTS = [(re.compile(pattern), new) for pattern, new in WORDS["normalise"]["replacements"]]


def clean(text: str) -> str:
    """The text in lower case with contractions, quotes, dashes and arrows made plain."""
    result = unicodedata.normalize("NFKC", text).lower().replace("\r", "\n")
    for pattern, new in _REPLACEMENTS:
        result = pattern.sub(new, result)
    return result
