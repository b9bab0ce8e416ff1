"""Mentions that the encoder takes for two road users and that are one."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from scenewright.backends.builtin.reader.annotation import EVENTS, MENTIONS
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan
from scenewright.backends.builtin.reader.words import (
    WORDS,
    compile_words,
    find_nouns,
)

_FUNCTION_WORDS = frozenset(WORDS["merging"]["function_words"])
_ARTICLE = re.compile(r"an?|the", re.IGNORECASE)
_ON_THE = compile_words("merging.on_the")
"""Between a rider and the crosswalk that it rides on."""

_SURELY = 0.95


def merge_mentions(reading: Reading) -> Reading:
    """The reading with mentions of one road user made one: "the oncoming", "truck"."""
    reading = _drop_function_words(reading)
    reading = replace(reading, spans=tuple(map(_correct_class, reading.spans)))
    reading = replace(reading, spans=tuple(_let_ride(span, reading) for span in reading.spans))
    for kept, dropped in list(_find_same(reading)):
        if kept in reading.users and dropped in reading.users:
            reading = _merge(reading, kept, dropped)
    return reading


def refer_back(reading: Reading, end: int) -> Reading:
    """The reading of a change in which "the car" or "car 2" is the one that is there.

    Args:
        end: where the sentences of what is there end.
    """
    known = {
        re.sub(r"^(?:an?|the) ", "", reading.spans[at].words.lower()): user
        for user, at in reading.users.items()
        if reading.spans[at].start < end
    }
    for user, at in list(reading.users.items()):
        span = reading.spans[reading.users.get(user, at)]
        noun = span.words.lower().removeprefix("the ")
        definite = span.words.lower() != noun or noun[-1].isdecimal()
        if span.start >= end and definite and noun in known and len(span.subjects) == 1:
            reading = _merge(reading, known[noun], user)
    return reading


def _correct_class(span: ReadSpan) -> ReadSpan:
    """The mention as one of a rider where its noun can be nothing else."""
    kinds = {noun.kind for noun in find_nouns(span.words)} if span.tag == "veh" else set()
    tag = {"cyclist": "cyc", "scooter": "scoot"}.get("".join(kinds))
    return replace(span, tag=tag, confidence=max(span.confidence, _SURELY)) if tag else span


def _let_ride(span: ReadSpan, reading: Reading) -> ReadSpan:
    """A crosswalk said right after the rider who opens the text, or who alone could be on it, is
    where that one rides."""
    riders = [each for each in reading.spans if each.tag in ("cyc", "scoot")]
    before = [
        each
        for each in riders
        if each.end <= span.start and _ON_THE.fullmatch(reading.text[each.end : span.start])
    ]
    if span.tag not in ("cw", "cross") or len(before) != 1 or len(before[0].subjects) != 1:
        return span
    walkers = [each for each in reading.spans if each.tag == "ped" and each.start < span.start]
    if any(n in span.subjects for each in walkers for n in each.subjects):
        return span
    sure = max(span.confidence, _SURELY)
    return replace(span, subjects=before[0].subjects, objects=(), confidence=sure)


def _drop_function_words(reading: Reading) -> Reading:
    """The reading without spans of "at", "of the" and the like, which say nothing alone."""
    kept = [
        at
        for at, span in enumerate(reading.spans)
        if span.tag in (*MENTIONS, "ref") or set(span.words.lower().split()) - _FUNCTION_WORDS
    ]
    spans = tuple(reading.spans[at] for at in kept)
    users = {user: kept.index(at) for user, at in reading.users.items()}
    return replace(reading, spans=spans, users=users)


def _find_same(reading: Reading) -> Iterator[tuple[int, int]]:
    """Pairs of road users that are one, the one that is kept first."""
    single = {
        user: reading.spans[at]
        for user, at in reading.users.items()
        if len(reading.spans[at].subjects) == 1
    }
    text, spans = reading.text, reading.spans
    for user, span in single.items():
        # A mention without a noun, and the one of its class right behind it: "through", "vehicle".
        for other, later in single.items():
            beside = span.end < later.start and not text[span.end : later.start].strip(" -")
            if beside and span.tag == later.tag and not find_nouns(span.words):
                yield other, user
        # An article alone, and the next mention: "a jaywalking pedestrian".
        later_users = [
            u
            for u in (single if _ARTICLE.fullmatch(span.words) else ())
            if 0 <= single[u].start - span.end <= _MOST_BETWEEN
            and re.fullmatch(r"[\w' -]*", text[span.end : single[u].start])
            and not any(e.tag in EVENTS and span.end <= e.start < single[u].start for e in spans)
        ]
        if later_users:
            yield min(later_users, key=lambda u: single[u].start), user


_MOST_BETWEEN = 40
"""Characters between an article and the noun that it belongs to."""


def _merge(reading: Reading, kept: int, dropped: int) -> Reading:
    """The reading without one road user, whose spans now belong to another."""
    first, second = reading.spans[reading.users[kept]], reading.spans[reading.users[dropped]]
    spans = tuple(_renumber_span(span, kept, dropped) for span in reading.spans)
    at_kept, at_dropped = reading.users[kept], reading.users[dropped]
    gone = replace(second, tag="ref", value=None, subjects=(kept,))
    if second.end <= first.start and not reading.text[second.end : first.start].strip(" -"):
        whole = reading.text[second.start : first.end]
        first = replace(first, words=whole, start=second.start)
    spans = tuple(
        gone if at == at_dropped else first if at == at_kept else span
        for at, span in enumerate(spans)
    )
    users = {user: at for user, at in reading.users.items() if user != dropped}
    return replace(reading, spans=spans, users=users)


def _renumber_span(span: ReadSpan, kept: int, dropped: int) -> ReadSpan:
    if span.tag in MENTIONS:
        return span

    def renumber_users(users: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(dict.fromkeys(kept if user == dropped else user for user in users))

    subjects = renumber_users(span.subjects)
    objects = tuple(user for user in renumber_users(span.objects) if user not in subjects)
    return replace(span, subjects=subjects, objects=objects)
