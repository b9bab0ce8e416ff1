"""Mentions that the encoder takes for two road users and that are one."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from scenewright.backends.builtin.reader.annotation import MENTIONS
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan
from scenewright.backends.builtin.reader.words import subtype_in

_SPEAKER = re.compile(r"^(?:i|me|we|us|myself)$", re.IGNORECASE)
_OWN = re.compile(r"^(?:my|our) [\w -]+$", re.IGNORECASE)
_OWN_VEHICLE = re.compile(
    r"\b(?:car|van|taxi|cab|bus|truck|lorry|moped|motorbike|motorcycle|bike|scooter|vehicle|suv|"
    r"pick-?up|sedan|hatchback|rig|coach|ride|wheels|vespa|minivan|jeep)$",
    re.IGNORECASE,
)

_NOUN = re.compile(
    r"\b(?:vehicles?|drivers?|autos?|ego|units?|ped(?:estrian)?s?|(?:wo)?m[ae]n|girls?|boys?|kids?|"
    r"child(?:ren)?|lad(?:y|ies)|walkers?|joggers?|persons?|people|guys?|dudes?)\b",
    re.IGNORECASE,
)


def merge_mentions(reading: Reading) -> Reading:
    """The reading with mentions of one road user made one: "I ... my moped", "oncoming truck"."""
    for kept, dropped in list(_same(reading)):
        if kept in reading.users and dropped in reading.users:
            reading = _merge(reading, kept, dropped)
    return reading


def _same(reading: Reading) -> Iterator[tuple[int, int]]:
    """Pairs of road users that are one, the one that is kept first."""
    single = {
        user: reading.spans[at]
        for user, at in reading.users.items()
        if len(reading.spans[at].subjects) == 1
    }
    yield from _touching(reading, single)
    speaker = next((u for u, span in single.items() if _SPEAKER.match(span.words)), None)
    for user, span in single.items():
        own = _OWN.match(span.words) and _OWN_VEHICLE.search(span.words)
        if speaker is not None and user != speaker and own and single[speaker].tag == span.tag:
            yield speaker, user


def _touching(reading: Reading, single: dict[int, ReadSpan]) -> Iterator[tuple[int, int]]:
    """Mentions of one class side by side, the first without a noun: "through", "vehicle"."""
    for user, span in single.items():
        for other, later in single.items():
            between = reading.text[span.end : later.start]
            beside = span.end < later.start and not between.strip(" -")
            if span.tag == later.tag and beside and not _has_noun(span.words):
                yield other, user


def _has_noun(words: str) -> bool:
    found = (_NOUN.search(words), _OWN_VEHICLE.search(words), subtype_in(words))
    return any(each is not None for each in found)


def _merge(reading: Reading, kept: int, dropped: int) -> Reading:
    """The reading without one road user, of whom all is said that was said of another."""
    first, second = reading.spans[reading.users[kept]], reading.spans[reading.users[dropped]]
    spans = tuple(_renumber(span, kept, dropped) for span in reading.spans)
    at_kept, at_dropped = reading.users[kept], reading.users[dropped]
    gone = replace(second, tag="ref", value=None, subjects=(kept,))
    words = first.words
    if _SPEAKER.match(first.words):
        words = second.words
    elif not reading.text[second.end : first.start].strip(" -"):
        words = reading.text[second.start : first.end]
    spans = tuple(
        gone if at == at_dropped else replace(first, words=words) if at == at_kept else span
        for at, span in enumerate(spans)
    )
    users = {user: at for user, at in reading.users.items() if user != dropped}
    return replace(reading, spans=spans, users=users)


def _renumber(span: ReadSpan, kept: int, dropped: int) -> ReadSpan:
    if span.tag in MENTIONS:
        return span

    def renumbered(users: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(dict.fromkeys(kept if user == dropped else user for user in users))

    subjects = renumbered(span.subjects)
    objects = tuple(user for user in renumbered(span.objects) if user not in subjects)
    return replace(span, subjects=subjects, objects=objects)
