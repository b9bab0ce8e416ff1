"""Variations of an annotated instruction that keep its labels true."""

from __future__ import annotations

import random
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from scenewright.backends.builtin.reader.annotation import (
    MENTIONS,
    SIDES,
    AnnotatedText,
    Span,
)
from scenewright.backends.builtin.reader.words import Patterns

_PATTERNS = Patterns("augmentation")

_NAMES = ("north", "east", "south", "west")
_LETTERS = "NESW"
_SWAPPED = (*MENTIONS, "time", "bgveh", "bgped", "bgall", "density", "weather", "place", "pace")
_OPENERS = (
    "Show me {}", "Please make {}", "I need a scene where {}", "scene: {}", "Generate: {}",
    "{} please", "Scenario - {}", "ok so {}", "Create a scenario in which {}", "We want {}",
    "{} thanks", "Simulate this: {}", "can you do {}?", "test case: {}", "{} (for my dataset)",
)  # fmt: skip


def augment(
    row: AnnotatedText, rng: random.Random, bank: dict[tuple[str, ...], list[tuple[str, Span]]]
) -> AnnotatedText:
    """A variation drawn at random: other sides and turns, other words for spans, slips.

    Args:
        bank: spans of other rows by what makes them interchangeable (`collect_spans`).
    """
    if row.kind in ("off", "foreign"):
        return _add_slips(row, rng) if rng.random() < 0.3 else row
    row = turn(row, rng.randrange(4), mirrored=rng.random() < 0.5)
    if rng.random() < 0.5:
        row = _exchange(row, rng, bank)
    if row.kind == "scene" and rng.random() < 0.08:
        row = _open(row, rng.choice(_OPENERS))
    if rng.random() < 0.2:
        row = _strip_punctuation(row, rng)
    return _add_slips(row, rng) if rng.random() < 0.12 else row


def collect_spans(rows: Iterable[AnnotatedText]) -> dict[tuple[str, ...], list[tuple[str, Span]]]:
    """Spans whose words can be exchanged, by tag, value and size of the group."""
    bank: dict[tuple[str, ...], list[tuple[str, Span]]] = defaultdict(list)
    for row in rows:
        for span in row.spans:
            if _is_exchangeable(span):
                bank[_exchange_key(span)].append((row.text[span.start : span.end], span))
    return dict(bank)


def _is_exchangeable(span: Span) -> bool:
    return span.tag in _SWAPPED and not span.negated


def _exchange_key(span: Span) -> tuple[str, ...]:
    if span.tag in MENTIONS:
        return (span.tag, str(span.value), str(len(span.subjects)))
    return (span.tag,)


def _exchange(
    row: AnnotatedText, rng: random.Random, bank: dict[tuple[str, ...], list[tuple[str, Span]]]
) -> AnnotatedText:
    """Other rows' words for times, densities, counts and, mostly, road users."""

    def choose_words(span: Span, words: str) -> tuple[str, Span]:
        likely = 0.25 if span.tag in MENTIONS else 0.4
        if not _is_exchangeable(span) or rng.random() > likely:
            return words, span
        found, other = rng.choice(bank.get(_exchange_key(span)) or [(words, span)])
        if span.tag in MENTIONS and (len(found) < 4 or len(words) < 4):
            return words, span  # labels such as V1 come again later in the text
        return found, replace(span, value=other.value)

    return _rewrite(row, choose_words)


def _rewrite(
    row: AnnotatedText,
    change: Callable[[Span, str], tuple[str, Span]],
    plain: Callable[[str], str] = lambda words: words,
) -> AnnotatedText:
    """The row with `change` applied to every span and `plain` to the words between."""
    pieces: list[str] = []
    spans: list[Span] = []
    at = length = 0
    for span in sorted(row.spans, key=lambda each: each.start):
        between = plain(row.text[at : span.start])
        words, changed = change(span, row.text[span.start : span.end])
        start = length + len(between)
        length = start + len(words)
        spans.append(replace(changed, start=start, end=length))
        pieces += [between, words]
        at = span.end
    return replace(row, text="".join([*pieces, plain(row.text[at:])]), spans=tuple(spans))


def turn(row: AnnotatedText, quarters: int, *, mirrored: bool) -> AnnotatedText:
    """The scene turned by so many quarters clockwise, and seen in a mirror before that.

    A text with words that do not turn along, such as "top of the map", stays as it is.
    """
    if (not quarters and not mirrored) or _PATTERNS.unturned.search(row.text):
        return row
    flipped = {"left": "right", "right": "left"} if mirrored else {}

    def change(span: Span, words: str) -> tuple[str, Span]:
        words = _turn_words(words, quarters, mirrored, letters=span.tag in SIDES)
        value = span.value
        if span.tag in SIDES and value in tuple(_LETTERS):
            value = _turn_letter(value, quarters, mirrored)
        value = flipped.get(value or "", value)
        tag = flipped.get(span.tag, span.tag)
        if mirrored and (tag != span.tag or value != span.value):
            words = _PATTERNS.turn_short.sub(
                lambda m: _match_case(m[1], "r" if m[1] in "lL" else "l"), words
            )
        return words, replace(span, tag=tag, value=value)

    return _rewrite(row, change, lambda words: _turn_words(words, quarters, mirrored))


def _turn_letter(letter: str, quarters: int, mirrored: bool) -> str:
    index = _LETTERS.index(letter)
    return _LETTERS[((-index if mirrored else index) + quarters) % 4]


def _turn_words(words: str, quarters: int, mirrored: bool, *, letters: bool = False) -> str:
    def replace_name(match: re.Match[str]) -> str:
        letter = _LETTERS[_NAMES.index(match[1].lower())]
        return _match_case(
            match[1], _NAMES[_LETTERS.index(_turn_letter(letter, quarters, mirrored))]
        )

    def replace_letter(match: re.Match[str]) -> str:
        found = _turn_letter(match[1].upper(), quarters, mirrored)
        tail = match[2] if match.re.groups > 1 else ""
        return (found if match[1].isupper() else found.lower()) + tail

    words = _PATTERNS.bound.sub(replace_letter, _PATTERNS.word.sub(replace_name, words))
    if letters:
        words = _PATTERNS.letter.sub(replace_letter, words)
    return _swap_turns(words) if mirrored else words


def _swap_turns(words: str) -> str:
    kept = [match.span() for match in _PATTERNS.kept.finditer(words)]

    def swap_word(match: re.Match[str]) -> str:
        if any(start <= match.start() < end for start, end in kept):
            return match[0]
        return _match_case(match[1], "left" if match[1].lower() == "right" else "right")

    return _PATTERNS.turn.sub(swap_word, words)


def _match_case(model: str, word: str) -> str:
    if model.isupper():
        return word.upper()
    return word.capitalize() if model[:1].isupper() else word


def _open(row: AnnotatedText, opener: str) -> AnnotatedText:
    before = opener.index("{")
    spans = tuple(replace(s, start=s.start + before, end=s.end + before) for s in row.spans)
    return replace(row, text=opener.replace("{}", row.text), spans=spans)


def _strip_punctuation(row: AnnotatedText, rng: random.Random) -> AnnotatedText:
    marks = rng.choice([",", ".", ",.", ",.;:", "'", ",;"])

    def strip_marks(words: str) -> str:
        return (
            words if ">" in words or "=" in words else words.translate({ord(m): "" for m in marks})
        )

    return _rewrite(row, lambda span, words: (words, span), strip_marks)


def _add_slips(row: AnnotatedText, rng: random.Random) -> AnnotatedText:
    """One or two slips of the typing finger in words of five letters and more."""
    words = list(re.finditer(r"[A-Za-z]{5,}", row.text))
    for match in rng.sample(words, min(len(words), rng.choice([1, 1, 2]))):
        row = _add_slip(row, match.start() + rng.randrange(1, len(match[0]) - 1), rng.randrange(3))
    return row


def _add_slip(row: AnnotatedText, at: int, slip: int) -> AnnotatedText:
    """A letter left out (0), two exchanged (1) or one doubled (2) at a character of the text."""
    if at + 1 >= len(row.text):
        return row
    text, here = row.text, row.text[at]
    if slip == 1:
        return replace(row, text=text[:at] + text[at + 1] + here + text[at + 2 :])
    added = 1 if slip == 2 else -1
    kept = here * 2 if slip == 2 else ""
    spans = tuple(
        replace(
            s,
            start=s.start + added * (s.start > at),
            end=s.end + added * (s.end > at),
        )
        for s in row.spans
    )
    return replace(row, text=text[:at] + kept + text[at + 1 :], spans=spans)


def drop_duplicates(rows: Sequence[AnnotatedText]) -> list[AnnotatedText]:
    """The rows without those whose text came before."""
    return list({row.text.lower(): row for row in reversed(rows)}.values())[::-1]
