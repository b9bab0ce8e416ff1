"""Streets of the map that a text names, each cut into one token with the legs that it is."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from scenewright.scene.base import OPPOSITE
from scenewright.scene.map import IntersectionMap
from scenewright.scene.streets import TYPES, expand_name
from scenewright.tools.account.vocabulary import Token

_LONGEST = 7
"""Words of a name at most."""


def name_roads(
    tokens: Sequence[Token], text: str, intersection_map: IntersectionMap | None
) -> tuple[Token, ...]:
    """The tokens of a text with one for each name of a street, "5th Avenue NE", of sense `road`."""
    names = _list_names(intersection_map)
    starts = {"", *(name.partition(" ")[0] for name in names)}  # "" of an article or a stop
    starts |= {"street"} if "saint" in starts else set()  # "St" alone
    roads: list[Token] = []
    places: list[int] = []  # where each token went
    at = 0
    while at < len(tokens):
        token, many = tokens[at], 1
        begins = expand_name(token.text).partition(" ")[0] in starts
        for length in range(min(_LONGEST, len(tokens) - at), 0, -1) if begins else ():
            words = text[token.start : tokens[at + length - 1].end]
            name = expand_name(words)
            typed = token.capital or not TYPES.isdisjoint(name.split())
            if typed and (legs := names.get(name)):  # "high" is no "High Street"
                many = length
                end, low = tokens[at + length - 1].end, words.lower()
                token = replace(
                    token, end=end, text=low, stem=low, kind="word", number=None, unit=None,
                    senses={f"road.{'|'.join(legs)}": (at, at + length)}, phrase=None, mended=None,
                )  # fmt: skip
                break
        places += [len(roads)] * many
        roads.append(token)
        at += many
    places.append(len(roads))
    return tuple(
        replace(
            each,
            senses={name: (places[a], places[b]) for name, (a, b) in each.senses.items()},
            phrase=each.phrase and (each.phrase[0], places[each.phrase[1]], places[each.phrase[2]]),
        )
        for each in roads
    )


def _list_names(intersection_map: IntersectionMap | None) -> Mapping[str, list[str]]:
    """Legs by names in small letters: whole, without compass words and without "road"."""
    names: dict[str, list[str]] = {}
    for leg in intersection_map.legs if intersection_map else ():
        for part in re.split(r"[/;,]", leg.road or ""):
            words = expand_name(part).split()
            short = [word for word in words if word not in OPPOSITE]
            core = [each for each in short if each not in TYPES]
            wordings = {" ".join(each) for each in (words, short, core)}
            for name in wordings - TYPES - {""}:
                if len(name) > 3 and name not in OPPOSITE and leg.name not in names.get(name, ()):
                    names.setdefault(name, []).append(leg.name)
    return names
