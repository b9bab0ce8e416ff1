"""Street names in a text, put as the compass names of their legs before the text is read.

Both readers know "from the north" and no street of any town. What they are given is the text with
"from Marshalsea Road" as "from the west"; what comes back is put in the words of the text again.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice, product
from typing import NamedTuple

from rapidfuzz import fuzz

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.reader.words import Patterns
from scenewright.backends.builtin.rewritten import RewrittenText, replace_pieces
from scenewright.scene.account import SaidSpan
from scenewright.scene.edits import Choice, Clarification
from scenewright.scene.streets import TYPES, expand_name

_PATTERNS = Patterns("street_names")

_MOST_READINGS = 24
_BOTH = " and one from the "
_PLACES = ("entry", "exit", "crosswalk")
_ALIKE = 88.0
_COMPASS = r"(?:north|south)(?:east|west)?|east|west"
_FROM = frozenset(("from", "off", "along", "down", "up", "via", "on", "in", "leaving", "exiting"))
_TO = frozenset(("into", "onto", "to", "toward", "towards", "for"))
_BEFORE = re.compile(
    rf"(?:\bthe\s+)?(?:\b(?P<side>{_COMPASS})(?:ern)?(?:\s+(?:end|part|side) of)?\s+)?"
    r"(?:\bthe\s+)?$",
    re.IGNORECASE,
)
_AFTER = re.compile(
    rf"\s*(?:\(\s*)?\b(?P<side>{_COMPASS})\b(?!\s*(?:bound|leg|crosswalk))\s*\)?", re.IGNORECASE
)


@dataclass(frozen=True)
class StreetMention:
    """Words that name a street, and the legs that bear the name."""

    start: int
    end: int
    legs: tuple[str, ...]


@dataclass(frozen=True)
class CompassText(RewrittenText):
    """A text with compass names for street names.

    Attributes:
        left_open: mentions of streets with several legs, of which the text does not say which.
    """

    left_open: tuple[StreetMention, ...] = ()

    def restore_span(self, entry: SaidSpan) -> SaidSpan:
        """An entry of the account in the words of the original; which leg is left open, noted."""
        own = super().restore_span(entry)
        spans = (each for each in self.left_open if each.start < own.end and own.start < each.end)
        if own.became not in _PLACES or (street := next(spans, None)) is None:
            return own
        name = self.original[street.start : street.end]
        note = f"{name} has the legs {' and '.join(street.legs)}; the words leave open which"
        return own.model_copy(update={"note": note})


def list_compass_texts(
    text: str, roads: Sequence[tuple[str, str]], chosen: Mapping[str, str] | None = None
) -> list[CompassText]:
    """The text with a leg for every street it names, one for each choice of legs; [] if none.

    Args:
        roads: leg and the name of its street.
        chosen: the leg of a street that has several: the words that name it -> leg.

    Raises:
        Refused: a street is named that no leg bears.
    """
    found = find_mentions(text, roads)
    _refuse_unknown(text, found, roads)
    if not found:
        return []
    answers = [(chosen or {}).get(text[each.start : each.end]) for each in found]
    found = [
        replace(mention, legs=(leg,)) if leg in mention.legs else mention
        for mention, leg in zip(found, answers, strict=True)
    ]
    # Of two road users on a street of two legs there may also be one on each.
    legs = (
        (*m.legs, _BOTH.join(m.legs))
        if len(m.legs) == 2 and _PATTERNS.two_on.search(text[: m.start])
        else m.legs
        for m in found
    )
    choices = product(*legs)
    tried = sorted(islice(choices, _MOST_READINGS), key=lambda legs: _BOTH in "".join(legs))
    return [_replace(text, found, legs) for legs in tried]


def ask_which_leg(text: str, mention: StreetMention) -> Clarification:
    """The question which leg of a street is meant."""
    street = text[mention.start : mention.end]
    return Clarification(
        question=f"Which leg of {street}: {' or '.join(mention.legs)}?",
        choices=tuple(
            Choice(answer=leg, means=f"{street}={leg}: the {leg} leg") for leg in mention.legs
        ),
    )


def find_mentions(text: str, roads: Sequence[tuple[str, str]]) -> list[StreetMention]:
    """Where a text names streets of the map, in order; of names within names the longest."""
    streets = _name_streets(tuple(roads))
    words = [(m.start(), m.end(), m[0]) for m in _PATTERNS.word.finditer(text)]
    found: list[StreetMention] = list(_find_unspaced(text, streets.named))
    at = 0
    while at < len(words):
        mention = _match_at(text, words, at, streets)
        if mention is None or any(m.start < mention.end and mention.start < m.end for m in found):
            at += 1
            continue
        found.append(mention)
        at = next((n for n, word in enumerate(words) if word[0] >= mention.end), len(words))
    found.sort(key=lambda each: each.start)
    return [_narrow(text, mention) for mention in found]


def _narrow(text: str, mention: StreetMention) -> StreetMention:
    """The mention with the one leg that a compass word beside it names: "northern High Street"."""
    before = _BEFORE.search(text, 0, mention.start)
    if before and before["side"]:
        side = before["side"].lower()
        if side not in mention.legs:
            words = text[mention.start : mention.end]
            there = " and the ".join(mention.legs)
            raise Refused("impossible", f"'{words}' is the {there} leg here, not the {side}.")
        return replace(mention, start=before.start(), legs=(side,))
    after = _AFTER.match(text, mention.end)
    if after and after["side"].lower() in mention.legs:
        return replace(mention, end=after.end(), legs=(after["side"].lower(),))
    return mention


class _Streets(NamedTuple):
    """The streets of a map.

    Attributes:
        named: leg and name, one row for each name of a leg; wordings: names by what else they are
            called; longest: words of a mention at most.
    """

    named: tuple[tuple[str, str], ...]
    wordings: Mapping[str, set[str]]
    longest: int


@lru_cache(maxsize=16)
def _name_streets(roads: tuple[tuple[str, str], ...]) -> _Streets:
    named = tuple(  # of a leg with several names each is one
        (leg, name)
        for leg, road in roads
        for part in re.split(r"[/;,]", road)
        if (name := expand_name(part.strip()))
    )
    named = tuple(dict.fromkeys(named))
    wordings: dict[str, set[str]] = {}
    for _, name in named:
        for words in _list_wordings(name):
            wordings.setdefault(words, set()).add(name)
    return _Streets(named, wordings, max((len(name.split()) for _, name in named), default=0) + 1)


def _find_unspaced(text: str, named: Sequence[tuple[str, str]]) -> Iterator[StreetMention]:
    """Names in scripts without spaces, anywhere in the text."""
    taken: list[tuple[int, int]] = []
    for name in sorted({name for _, name in named if not name.isascii()}, key=len, reverse=True):
        for match in re.finditer(re.escape(name), text.casefold()):
            if not any(a < match.end() and match.start() < b for a, b in taken):
                taken.append(match.span())
                legs = dict.fromkeys(leg for leg, own in named if own == name)
                yield StreetMention(*match.span(), tuple(legs))


def _match_at(
    text: str, words: Sequence[tuple[int, int, str]], at: int, streets: _Streets
) -> StreetMention | None:
    """The street that is named from a word on, longest wording first."""
    for many in range(min(streets.longest, len(words) - at), 0, -1):
        start, end = words[at][0], words[at + many - 1][1]
        if re.search(r"[.,;:!?]\s", text[start:end].replace("St. ", "St  ")):
            continue
        said = expand_name(re.sub(r"['’]s$", "", text[start:end]))
        if said in TYPES or not said:
            continue
        found = _find_meant(said, streets)
        if found:
            stop = end - (2 if re.search(r"['’]s$", text[start:end]) else 0)
            legs = dict.fromkeys(leg for leg, name in streets.named if name in found)
            return StreetMention(start, stop, tuple(legs))
    return None


def _find_meant(said: str, streets: _Streets) -> Collection[str]:
    """The one name that words mean, exact names first: "10th Street" is like "11th Street"."""
    names = {name for _, name in streets.named}
    meant = streets.wordings.get(said, set())
    if said in names:
        return (said,)
    if len(meant) != 1:
        meant = {name for name in names if _is_alike(said, name)}
    return meant if len(meant) == 1 else ()


def _list_wordings(name: str) -> list[str]:
    """A street's name without its type or side: "Marshalsea" for Marshalsea Road."""
    core = [word for word in name.split() if word not in TYPES]
    short = [word for word in core if not re.fullmatch(_COMPASS, word)]
    typed = [word for word in name.split() if not re.fullmatch(_COMPASS, word)]
    if not any(len(word) > 3 or word[0].isdigit() for word in short):
        return []
    wordings = (" ".join(each) for each in (core, short, typed))
    return [wording for wording in wordings if not re.fullmatch(_COMPASS, wording)]


def _is_alike(said: str, name: str) -> bool:
    """Whether words are a name with a slip in its letters; figures must be the same."""
    if len(said) <= 6 or len(said.split()) != len(name.split()):
        return False
    figures = [re.findall(r"\d+", each) for each in (said, name)]
    return figures[0] == figures[1] and fuzz.ratio(said, name) >= _ALIKE


def _refuse_unknown(
    text: str, found: Sequence[StreetMention], roads: Sequence[tuple[str, str]]
) -> None:
    if not roads:
        return
    for match in _PATTERNS.named.finditer(text):
        start, end = match.span("name")
        if any(mention.start < end and start < mention.end for mention in found):
            continue
        if re.match(
            rf"(?:The\s+)?(?:{_COMPASS}|Main|Side|Cross|Minor|Major)\b",
            match["name"],
            re.IGNORECASE,
        ):
            continue
        known = "; ".join(f"{road} ({leg})" for leg, road in roads)
        raise Refused(
            "impossible", f"No leg here is called '{match['name']}'; the streets are {known}."
        )


def _replace(text: str, found: Sequence[StreetMention], legs: Sequence[str]) -> CompassText:
    replacements, at = [], 0
    for number, (mention, leg) in enumerate(zip(found, legs, strict=True)):
        replacements.append(_rewrite_leg(text, at, mention, leg, found[number + 1 :]))
        at = replacements[-1][1]
    left_open = tuple(mention for mention in found if len(mention.legs) > 1)
    worded, pieces = replace_pieces(text, replacements)
    return CompassText(worded, text, pieces, left_open)


def _rewrite_leg(
    text: str, at: int, mention: StreetMention, leg: str, later: Sequence[StreetMention]
) -> tuple[int, int, str]:
    """Which characters are replaced, and by which words."""
    before = _BEFORE.search(text, at, mention.start)
    start, end = (before.start() if before else mention.start), mention.end
    beside = (
        re.match(r"\s*(?:and|&|/)\s*(?:the\s+)?$", text[end : later[0].start]) if later else None
    )
    place = _PATTERNS.place.search(text[at:start])
    joined = re.search(r"(?:and|&|/)\s*(?:the\s+)?$", text[at : mention.start])
    if place and beside:
        return at + place.start(), end, ""
    if joined and at > 0 and not text[at : joined.start()].strip():
        return at, end, ""
    if part := _PATTERNS.part.match(text, end):
        owned = re.match(r"(?:'s|’s)", part[0])
        return start, end + (owned.end() if owned else 0), f"the {leg}"
    lead = _PATTERNS.preposition.search(text[at:start])
    word = lead["word"].lower() if lead else ""
    if lead and word == "of" and lead[1]:
        return at + lead.start(), end, f"from the {leg}"
    if lead and word in _TO:
        return at + lead.start(), end, f"to the {leg}"
    on_foot = _PATTERNS.crosses_on_foot.search(text[:start].rsplit(" by ", 1)[-1]) and word in (
        "on",
        "at",
    )
    if lead and on_foot and _stands_last(text[:start]):
        return at + lead.start(), end, f"on the {leg} crosswalk"
    if lead and _BOTH in leg:
        return at + lead.start(), end, f", one from the {leg},"
    if lead and word in _FROM:
        return at + lead.start(), end, f"from the {leg}"
    return start, end, f"the {leg} leg"


def _stands_last(text: str) -> bool:
    """Whether the last road user mentioned is on foot."""
    drives = re.compile(
        r"\b(?:car|van|truck|bus|taxi|vehicle|motorcycle|cyclist|scooter)\b", re.IGNORECASE
    )
    last = max((m.start() for m in drives.finditer(text)), default=-1)
    found = _PATTERNS.crosses_on_foot.search(text)
    return found is not None and found.start() > last
