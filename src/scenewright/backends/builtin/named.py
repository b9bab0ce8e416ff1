"""Noun phrases and directions in a turn of a conversation: "the red car", "two buses"."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

from scenewright.backends.builtin.reader.numbers import number_in
from scenewright.backends.builtin.reader.words import VOCABULARY, WORDS, load_nouns
from scenewright.scene.base import AgentClass

_DETERMINERS: dict[str, str] = WORDS["named"]["determiners"]
_NUMBER: str = WORDS["named"]["number"]
_NO_ADJECTIVE: str = WORDS["named"]["no_adjective"]
_SIDE = r"(?P<side>north|south|east|west|top|bottom)(?:ern|erly)?"
_MAP = {"top": "north", "bottom": "south", "n": "north", "s": "south", "e": "east", "w": "west"}
_BOUND = r"(?:(?P<side>north|south|east|west)[- ]?(?:bound|wards?)\b|\b(?P<letter>[nsew])[- ]?b\b)"
_WAYS = tuple(
    (means, re.compile(pattern))
    for means, pattern in (
        ("crosswalk", rf"(?:(?:on|at|in|to|from|of) )?(?:the )?\b{_SIDE} (?:leg |side |side's )?"
         r"(?:crosswalk|zebra|crossing)s?\b"),
        ("crosswalk", rf"\bcross\w* (?:on |at |in )(?:the )?{_SIDE}\b"),
        ("from", rf"\b(?:from|off|out of|entering(?: from)?) (?:the )?{_SIDE}\b"
         r"(?: (?:leg|arm|side|approach))?"),
        ("from", rf"(?:on |at )?(?:the )?\b{_SIDE} (?:approach|arm|entrance|branch)\b"),
        ("leg", rf"(?:on |at |in )?(?:the )?\b{_SIDE} (?:leg|side|end|edge)\b"),
        ("bound", rf"(?:(?:head|travel|go|driv)\w* )?(?:the )?\b{_BOUND}"),
        ("bound", rf"\b(?:head|travel|go|com|driv)(?:es?|ing|s)? {_SIDE}\b"),
        ("turn", r"\b(?:turn\w*|goe?s?|going|bear\w*) (?:to the )?(?P<side>left|right)\b"),
        ("turn", r"\b(?P<side>left|right)[- ](?:hand )?turn\w*"),
        ("to", rf"\b(?:to|towards?|onto|into|exit\w*|leav\w*) (?:the |on the |to the )?{_SIDE}\b"),
        ("straight", r"\bstraight(?: (?:on|ahead|through|across))?\b"),
        ("uturn", r"\bu[- ]?turn\w*"),
        ("corner", rf"\b(?:{_SIDE}|north ?(?:east|west)|south ?(?:east|west))\w* corner\b"),
        ("axis", r"\b(?:on|at|in|across) (?:the|a) (?:crosswalk|crossing)\b"),
    )
)  # fmt: skip


@dataclass(frozen=True)
class Way:
    """A direction, leg or turn: what it means, its side or turn, and where it stands."""

    means: str
    value: str | None
    start: int
    end: int


@dataclass(frozen=True)
class Named:
    """A noun phrase that means agents.

    Attributes:
        type: None for "one", "the other one"; "none" of a class that does not exist here.
        subtype: that of the noun; head: the noun.
        det: indefinite, definite, another, other, first, second, third, last, no, both, bare.
        count: as said; None where no number is.
        given: the ways said before the noun; after: the one that follows it.
        phrase: what the agent is called, without its determiner.
    """

    type: AgentClass | Literal["none"] | None
    subtype: str | None
    det: str
    count: int | None
    head: str
    phrase: str
    given: tuple[Way, ...] = ()
    after: Way | None = None
    label: str | None = None
    plural: bool = False
    start: int = 0


def find_ways(plain: str) -> list[Way]:
    """The directions in some words in lower case, in order; of two at a place the first kind."""
    found: list[Way] = []
    for means, pattern in _WAYS:
        for match in pattern.finditer(plain):
            if not any(e.start < match.end() and match.start() < e.end for e in found):
                groups = match.groupdict()
                value = groups.get("side") or groups.get("letter")
                way = Way(means, _MAP.get(value or "", value), match.start(), match.end())
                found.append(way)
    return sorted(found, key=lambda each: each.start)


def find_named(plain: str) -> list[Named]:
    """The noun phrases in some words in lower case, in order."""
    return list(_list_named(plain, find_ways(plain)))


def _list_named(plain: str, ways: Sequence[Way]) -> Iterator[Named]:
    last: tuple[int, str | None] = (-1, None)
    for match in _load_pattern().finditer(plain):
        noun = match["noun"] and match["noun"].replace("-", " ")
        kind, subtype, plural = load_nouns()[noun] if noun else (None, None, False)
        before, last = last, (match.end(), kind)
        if noun and before == (match.start() - 1, kind):
            continue  # "the kid jogger" is one agent
        det = next((name for name in _DETERMINERS if match[name]), "bare")
        if kind == "pedestrian" and re.match(r"(?:his|her|their)\b", match[0]):
            det = "another"  # "his mother"
        said = match["number"]
        count = (number_in(said) if said else None) or (2 if said or det == "both" else None)
        given = tuple(w for w in ways if match.start() <= w.start and w.end <= match.end())
        adjectives = " ".join(plain[w.start : w.end] for w in given).removeprefix("the ")
        head, label = match["noun"] or "one", (match["label"] or "").strip() or None
        yield Named(
            type=kind,
            subtype=subtype,
            det=det,
            count=count,
            head=head,
            phrase=" ".join(f"{adjectives} {head} {label or ''}".split()),
            given=given,
            after=next((w for w in ways if 0 <= w.start - match.end() <= 1), None),
            label=label,
            plural=plural,
            start=match.start(),
        )


@cache
def _load_pattern() -> re.Pattern[str]:
    """A noun phrase: its determiner by name, number, noun and label."""
    nouns = "|".join(sorted(load_nouns(), key=len, reverse=True)).replace(" ", "[ -]")
    determiner = "|".join(f"(?P<{name}>{words})" for name, words in _DETERMINERS.items())
    begins = rf"(?=(?:{'|'.join(_DETERMINERS.values())}|{_NUMBER}) )"
    adjective = rf"(?:{_NO_ADJECTIVE}[a-z'-]+,? )"
    number = rf"(?:(?P<number>{_NUMBER})(?: more| fewer)? )"
    label = (  # "car 2", but not "slow the car 2 m/s"
        r"(?P<label> (?:[1-8]|[bcdx])\b"
        r"(?! ?(?:m|s|km|mph|sec\w*|met\w*|%|per\w*)\b|[.:]\d))"
    )
    other = r"(?! (?:traffic|density|flow|volume|lanes?|doors?|signal|side|route)\b)"
    stands = r"(?<!parked )(?<!stalled )"
    stop = r"(?!(?<=bus) stop(?:$|[.,]))"
    return re.compile(
        rf"(?<![\w-])(?:{begins}(?:(?:{determiner}) )?{number}?{adjective}{{0,3}}?)?"
        rf"(?:{stands}(?P<noun>{nouns}){other}{stop}"
        rf"(?: (?:drivers?|riders?))?{label}?|ones?)(?![\w-])"
    )


CLASSES: dict[str, tuple[AgentClass, str | None]] = {
    noun: (kind, subtype)
    for noun in VOCABULARY["everyday"]
    for kind, subtype, _ in (load_nouns()[noun.replace("-", " ")],)
    if kind != "none"
}
"""Everyday noun -> class and subtype."""
