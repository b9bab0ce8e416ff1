"""Order of passing, by the words themselves: "after", "second to" and "behind" turn an order round.

The encoder sees that words speak of an order; which of the two it puts first is read from where the
two are named: the complement of "after" goes first, the subject of "second" goes second.
"""

from __future__ import annotations

import re
from dataclasses import replace

from scenewright.backends.builtin.reader.reading import Reading, ReadSpan
from scenewright.backends.builtin.reader.words import Patterns, has_user_noun

_PATTERNS = Patterns("orders")


Parties = tuple[tuple[int, ...], tuple[int, ...]]
"""Road users that go first, and those that go second."""


def orient_orders(reading: Reading) -> Reading:
    """The reading with every order as its words have it, whatever the encoder makes of them.

    Where the words settle it, no doubt is left but whether they speak of an order at all.
    """
    settled = {
        at: found
        for at, span in enumerate(reading.spans)
        if span.tag == "first" and (found := find_direction(reading, span)) is not None
    }
    pairs = [
        *settled.values(),
        *(
            (span.subjects, span.objects)
            for at, span in enumerate(reading.spans)
            if span.tag == "first" and at not in settled and has_order_words(span.words)
        ),
    ]
    for at, span in enumerate(reading.spans):
        if span.tag == "first" and at not in settled and not has_order_words(span.words):
            same = [pair for pair in pairs if set(pair) == {span.subjects, span.objects}]
            settled |= {at: same[0]} if same else {}
    spans = tuple(
        _turn(span, settled[at]) if at in settled else span for at, span in enumerate(reading.spans)
    )
    return replace(reading, spans=spans)


def has_order_words(words: str) -> bool:
    """Whether the words themselves speak of an order; "goes" and "crosses" do not."""
    return any(each.search(words) for each in (_PATTERNS.early, _PATTERNS.late, _PATTERNS.then))


def _turn(span: ReadSpan, parties: Parties) -> ReadSpan:
    sure = max(span.confidence, span.label_confidence)
    return replace(span, subjects=parties[0], objects=parties[1], confidence=sure)


def find_direction(reading: Reading, span: ReadSpan) -> Parties | None:
    """The first and the second agent by the words of a span; None where they leave it open."""
    early, late = _PATTERNS.early.search(span.words), _PATTERNS.late.search(span.words)
    parties = (span.subjects, span.objects)
    unclear = bool(early) == bool(late) or not all(parties) or has_user_noun(span.words)
    chain = len(reading.users) > 2 and not _PATTERNS.governs.search(span.words)  # "second" of three
    if unclear or chain or _PATTERNS.elsewhere.search(span.words):
        return None
    complement = _find_complement(reading, span, parties)
    if complement is not None:
        other = parties[1 - parties.index(complement)]
        return (complement, other) if late else (other, complement)
    subject = _find_subject(reading, span, parties) or _find_late_subject(reading, span, parties)
    if subject is None:
        return None
    other = parties[1 - parties.index(subject)]
    return (subject, other) if early else (other, subject)


def _find_complement(reading: Reading, span: ReadSpan, parties: Parties) -> tuple[int, ...] | None:
    """The agent named right after "before", "after", "second to" and their like."""
    governed = _PATTERNS.governs.search(span.words)
    to = re.match(r"\s+to\b", reading.text[span.end :])
    if not governed and not (to and span.words.lower().endswith("second")):
        return None
    found = _find_next_party(reading, span, parties)
    if found is None:
        return None
    between = reading.text[span.end : found[0].start]
    return found[1] if not _PATTERNS.clause_break.search(between) else None


def _find_subject(reading: Reading, span: ReadSpan, parties: Parties) -> tuple[int, ...] | None:
    """The agent named last before the words, in one clause with them and as its subject."""
    after = reading.text[span.end :]
    if _PATTERNS.governs.search(span.words) and _PATTERNS.points_back.match(after):
        return None
    before = [
        (mention, party)
        for mention, party in _list_parties(reading, parties)
        if mention.end <= span.start
    ]
    if before:
        mention, party = max(before, key=lambda each: each[0].end)
        between = reading.text[mention.end : span.start]
        if not _PATTERNS.clause_break.search(between):
            return party
    return None


def _find_late_subject(
    reading: Reading, span: ReadSpan, parties: Parties
) -> tuple[int, ...] | None:
    """The agent named right after "first through is"."""
    found = (
        _find_next_party(reading, span, parties) if _PATTERNS.copula.search(span.words) else None
    )
    if found is None or _PATTERNS.clause_break.search(reading.text[span.end : found[0].start]):
        return None
    return found[1]


def _find_next_party(
    reading: Reading, span: ReadSpan, parties: Parties
) -> tuple[ReadSpan, tuple[int, ...]] | None:
    later = [party for party in _list_parties(reading, parties) if party[0].start >= span.end]
    return min(later, key=lambda each: each[0].start, default=None)


def _list_parties(reading: Reading, parties: Parties) -> list[tuple[ReadSpan, tuple[int, ...]]]:
    """Every mention of one of the two parties alone."""
    found = []
    for span in reading.spans:
        if span.names_user:
            named = [party for party in parties if set(span.subjects) & set(party)]
            if len(named) == 1:
                found.append((span, named[0]))
    return found
