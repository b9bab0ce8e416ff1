"""Legs of a map by the names of their streets, however they are written."""

from __future__ import annotations

import re
from collections.abc import Sequence

from rapidfuzz import fuzz

from scenewright.backends.builtin.reader.words import compile_words
from scenewright.scene.streets import TYPES, expand_name

_NAMED = compile_words("streets.named")
_BARE_ROAD = compile_words("streets.bare_road")
_ALIKE = 90.0


def find_named_legs(words: str, roads: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """The legs whose street some words name.

    Args:
        roads: leg and the name of its street.
    """
    said = expand_name(words)
    return tuple(leg for leg, road in roads if road and _is_name_of(said, expand_name(road)))


def is_street_like(words: str) -> bool:
    """Whether some words are the name of a street: "Elm Road", not "the road"."""
    return _NAMED.search(words) is not None and _BARE_ROAD.match(words.strip()) is None


def _is_name_of(said: str, road: str) -> bool:
    core = " ".join(word for word in road.split() if word not in TYPES)
    if re.search(rf"\b{re.escape(road)}\b", said):
        return True
    if len(core) > 3 and re.search(rf"\b{re.escape(core)}\b", said):
        return True
    return len(said) > 4 and fuzz.ratio(said, road) >= _ALIKE
