"""Pedestrians that walk together ("a couple", "a class"), and plurals without a number."""

from __future__ import annotations

import re
from dataclasses import replace

from scenewright.backends.builtin.reader.annotation import EVENTS
from scenewright.backends.builtin.reader.numbers import count_in
from scenewright.backends.builtin.reader.reading import RULE_CONFIDENCE, Reading, ReadSpan
from scenewright.backends.builtin.reader.words import WORDS, Patterns

_PATTERNS = Patterns("groups")

GROUP = "group of "
"""How the value of a mention begins that introduces a group."""

MOST_MEMBERS = 8
_PERSON: str = WORDS["groups"]["person"]
_TWO = re.compile(
    rf"\bcouples?\b(?! of)|\bpair\b|\bduo\b|\b{_PERSON} (?:with|and) "
    r"(?:a|an|her|his|their) (?:\w+ )?"
    r"(?:child|kid|son|daughter|toddler|baby|pupil|friend|boy|girl)\b",
    re.IGNORECASE,
)
_UNCOUNTED = {"class": 6, "family": 4, "group": 4}
"""How many they are where no number is said."""


def join_groups(reading: Reading) -> Reading:
    """The reading with pedestrians that walk together as one road user."""
    for span in reading.spans:
        count = _count_members(span, reading.text) if span.tag == "ped" else None
        if count is not None and 2 <= count <= MOST_MEMBERS and not span.negated:
            reading = _join(reading, span, count)
    return reading


def _count_members(span: ReadSpan, text: str) -> int | None:
    """How many walk together; None for one alone, or several each on its own."""
    if _TWO.search(span.words):
        return 2
    kind = _PATTERNS.kinds.search(span.words)
    if kind or _PATTERNS.group.search(span.words):
        return count_in(span.words) or (_UNCOUNTED[kind[1].lower()] if kind else None)
    if len(span.subjects) > 1 and _PATTERNS.together.search(text):
        return len(span.subjects)
    return None


def _join(reading: Reading, group: ReadSpan, count: int) -> Reading:
    """The reading in which the first of a group represents all of it."""
    first, *others = group.subjects
    spans = tuple(
        replace(
            span,
            subjects=_drop_users(span.subjects, first, others),
            objects=_drop_users(span.objects, first, others),
            value=f"{GROUP}{count}" if span is group else span.value,
            confidence=max(span.confidence, RULE_CONFIDENCE) if span is group else span.confidence,
        )
        for span in reading.spans
    )
    users = {user: at for user, at in reading.users.items() if user not in others}
    return replace(reading, spans=spans, users=users)


def _drop_users(users: tuple[int, ...], first: int, others: list[int]) -> tuple[int, ...]:
    return tuple(dict.fromkeys(first if user in others else user for user in users))


_TAKES_PART = (*EVENTS, "lane", "meet", "cross", "jay", "cw", "red")


def count_plurals(reading: Reading) -> Reading:
    """The reading with two road users for a plural without a number, three for "several".

    Plurals that take no part in anything say what traffic there is, and stay as they are, as do
    those of a text that says their number elsewhere.
    """
    if _PATTERNS.counted_elsewhere.search(reading.text):
        return reading
    for user, at in list(reading.users.items()):
        span = reading.spans[at]
        if span.value == "many" and not span.negated and takes_part(user, reading):
            first = max(reading.users) + 1
            others = range(first, first + (2 if _PATTERNS.few.search(span.words) else 1))
            reading = _split(reading, user, tuple(others))
    return reading


def takes_part(user: int, reading: Reading) -> bool:
    """Whether the text says what a road user does."""
    return any(
        span.tag in _TAKES_PART and not span.negated and user in span.users
        for span in reading.spans
    )


def _split(reading: Reading, user: int, others: tuple[int, ...]) -> Reading:
    """The reading in which the others do all that one road user does."""
    spans = tuple(
        replace(
            span,
            subjects=span.subjects + others * (user in span.subjects),
            objects=span.objects + others * (user in span.objects),
        )
        for span in reading.spans
    )
    return replace(
        reading, spans=spans, users=reading.users | dict.fromkeys(others, reading.users[user])
    )
