"""Closed lists of words that rules read better than a network: vehicles and times of day."""

from __future__ import annotations

import re
import tomllib
from importlib.resources import files
from typing import Any

from scenewright.scene.base import AgentClass
from scenewright.scene.kinds import list_shipped

VOCABULARY: dict[str, Any] = tomllib.loads(
    files("scenewright.backends.builtin").joinpath("vocabulary.toml").read_text("utf-8")
)
WORDS: dict[str, Any] = VOCABULARY["words"]
"""What single rules look for: module -> name -> a pattern or a list."""


def compile_words(name: str, flags: re.RegexFlag = re.IGNORECASE) -> re.Pattern[str]:
    """The pattern of the vocabulary by this name, such as `merging.driver`."""
    module, _, key = name.partition(".")
    return re.compile(WORDS[module][key], flags)


_SUBTYPES = [(name, re.compile(pattern, re.IGNORECASE)) for name, pattern in VOCABULARY["subtypes"]]
_PICKUP = re.compile(r"\bpick-?up(?: truck)?s?\b", re.IGNORECASE)


def find_subtype(words: str) -> str | None:
    """The subtype of vehicle that some words name; None where they leave it open."""
    if _PICKUP.search(words):
        return "car"
    return next((name for name, pattern in _SUBTYPES if pattern.search(words)), None)


def find_class(words: str) -> AgentClass | None:
    """The class of road user that some words name; None where they leave it open."""
    if _RIDER.search(words):
        return "cyclist"
    if re.search(r"\be-?scooter|\bkick scooter", words, re.IGNORECASE):
        return "scooter"
    if find_subtype(words) is not None:
        return "vehicle"
    return "pedestrian" if _WALKER.search(words) else None


_RIDER = compile_words("words.rider")
_WALKER = compile_words("words.walker")


COARSE = {kind.id: kind.wider for kind in list_shipped("subtype") if kind.wider}
"""Subtypes as kinds of a wider one."""


def narrow_subtype(subtype: str | None, head: str) -> str | None:
    """The subtype that a noun says where only the wider one is known."""
    found = find_subtype(head)
    return found if subtype in (None, "car", "truck") and found in COARSE else subtype


def time_words_in(low: str) -> list[str]:
    """Names of times of day in lower-case words, the most specific first."""
    found: list[str] = []
    for name, time in VOCABULARY["times_of_day"].items():
        if re.search(time["pattern"], low):
            found.append(name)
            low = re.sub(time["pattern"], " ", low)
    return found


_USER = compile_words("words.user")


def has_user_noun(words: str) -> bool:
    """Whether some words name a road user by a noun."""
    return find_subtype(words) is not None or _USER.search(words) is not None
