"""Closed lists of words that rules read better than a network: vehicles and times of day."""

from __future__ import annotations

import re
import tomllib
from functools import cache, lru_cache
from importlib.resources import files
from typing import Any, Literal, NamedTuple

from scenewright.scene.base import AgentClass
from scenewright.scene.kinds import list_shipped

VOCABULARY: dict[str, Any] = tomllib.loads(
    files("scenewright.backends.builtin").joinpath("vocabulary.toml").read_text("utf-8")
)
WORDS: dict[str, Any] = VOCABULARY["words"]
"""What single rules look for: module -> name -> a pattern or a list."""


class Patterns:
    """The patterns of a part of the vocabulary, by name; each is compiled when first asked for.

    Capitals do not matter, where a pattern does not say so itself.
    """

    def __init__(self, part: str) -> None:
        self._part = part

    def __getattr__(self, name: str) -> re.Pattern[str]:
        """The pattern of that name."""
        if name not in WORDS[self._part]:
            raise AttributeError(f"the vocabulary has no {self._part}.{name}")
        pattern = re.compile(fill_in(WORDS[self._part][name]), re.IGNORECASE)
        setattr(self, name, pattern)
        return pattern


def fill_in(pattern: str) -> str:
    """The pattern with what its parts, such as `{less}`, stand for."""
    parts = WORDS["turn_parts"] | {"number_words": "|".join(WORDS["turn_kind"]["numbers"])}
    whole = re.sub(r"\{([a-z_]+)\}", lambda part: parts[part[1]], pattern)
    return whole if whole == pattern else fill_in(whole)


class Noun(NamedTuple):
    """What a noun of a road user names: a class, or "none" of those that there are not."""

    kind: AgentClass | Literal["none"]
    subtype: str | None
    plural: bool


@cache
def load_nouns() -> dict[str, Noun]:
    """The nouns of road users, with blanks for hyphens."""
    nouns: dict[str, Noun] = {}
    for key, given in VOCABULARY["nouns"].items():
        kind, _, subtype = key.partition(".")
        for each in given:
            noun, exact = each.removeprefix("=").replace("-", " "), each.startswith("=")
            nouns[noun] = Noun(kind, subtype or None, exact and bool(_PLURAL.search(noun)))
            if not exact:
                ends = noun.endswith("y") and noun[-2] not in "aeiou"
                many = f"{noun[:-1]}ies" if ends else f"{noun}s"
                nouns[many] = Noun(kind, subtype or None, True)
    return nouns


_PLURAL = re.compile(r"(?<!s)s$|men$|people$|children$|persons$|ladies$")


@lru_cache(maxsize=1024)
def find_nouns(words: str) -> tuple[Noun, ...]:
    """What the nouns in some words name, in order."""
    low = words.lower().replace("’", "'").replace("-", " ")
    return tuple(load_nouns()[each[0]] for each in _load_pattern().finditer(low))


@cache
def _load_pattern() -> re.Pattern[str]:
    return re.compile(rf"\b(?:{'|'.join(sorted(load_nouns(), key=len, reverse=True))})\b")


def find_subtype(words: str) -> str | None:
    """The subtype of vehicle that some words name first; None where they leave it open."""
    return next((noun.subtype for noun in find_nouns(words) if noun.subtype), None)


def find_class(words: str) -> AgentClass | None:
    """The class of road user that some words name first; None where they leave it open."""
    return next((noun.kind for noun in find_nouns(words) if noun.kind != "none"), None)


COARSE = {kind.id: kind.wider for kind in list_shipped("subtype") if kind.wider}
"""Subtypes as kinds of a wider one."""


def time_words_in(low: str) -> list[str]:
    """Names of times of day in lower-case words, the most specific first."""
    found: list[str] = []
    for name, time in VOCABULARY["times_of_day"].items():
        if re.search(time["pattern"], low):
            found.append(name)
            low = re.sub(time["pattern"], " ", low)
    return found


def has_user_noun(words: str) -> bool:
    """Whether some words name a road user by a noun."""
    return bool(find_nouns(words))
