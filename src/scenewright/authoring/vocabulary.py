"""Patterns of the vocabulary that conversations look for, with their common parts put in."""

from __future__ import annotations

import re

from scenewright.backends.offline import WORDS

_PARTS = WORDS["turn_parts"] | {
    "number_words": "|".join(WORDS["turn_kind"]["numbers"]),
}


def fill_in(pattern: str) -> str:
    """The pattern with what its parts, such as `{who}`, stand for."""
    whole = re.sub(r"\{([a-z_]+)\}", lambda part: _PARTS[part[1]], pattern)
    return whole if whole == pattern else fill_in(whole)


def compile_words(name: str) -> re.Pattern[str]:
    """The pattern of the vocabulary by this name, such as `turn_kind.polite`."""
    module, _, key = name.partition(".")
    return re.compile(fill_in(WORDS[module][key]))
