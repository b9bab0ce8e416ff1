"""Words that rules read where the encoder marks none of them: clock figures, standing people."""

from __future__ import annotations

import re
from dataclasses import replace

from scenewright.backends.builtin.reader.reading import Reading, ReadSpan
from scenewright.backends.builtin.reader.words import compile_words

_KNOWN = 0.9
"""How sure a span is whose words leave no doubt."""

CLOCK = re.compile(r"(?<![\w.,:#/-])(?:[01]\d|2[0-3])[0-5]\d(?: ?h(?:rs|ours)?)?(?![\w:/-]|[.,]\d)")
_NOT_A_CLOCK = compile_words("unmarked.not_a_clock")
_YEAR = re.compile(r"(?:19|20)\d\d")
_STANDING = re.compile(r"^[^.,;:]{0,12}\b(?:stand(?:s|ing)?|stood)\b", re.IGNORECASE)


def read_unmarked(reading: Reading) -> Reading:
    """The reading with spans for clock figures and standing bystanders that it passes over."""
    spans = (*reading.spans, *_find_clocks(reading), *_find_standing(reading))
    return replace(reading, spans=spans)


def _find_clocks(reading: Reading) -> list[ReadSpan]:
    """Four figures that are a clause of their own, as in "1625. A van hits a car"."""
    if any(span.tag == "time" for span in reading.spans):
        return []
    return [
        _build_span(match.start(), match.end(), match[0], "time")
        for match in CLOCK.finditer(reading.text)
        if _is_free(reading, match.start(), match.end())
        and not is_no_clock(reading.text, match.start(), match[0])
        and _stands_alone(reading.text, match)
    ]


def _stands_alone(text: str, match: re.Match[str]) -> bool:
    """Whether a clause is nothing but the figures, or they have a unit or "at" with them."""
    before, after = text[: match.start()].rstrip(), text[match.end() :].lstrip()
    alone = (not before or before[-1] in ".,;:") and (not after or after[0] in ".,;:")
    said = not match[0].isdecimal() or before.lower().split(" ")[-1] == "at"
    return alone or said


def is_no_clock(text: str, start: int, words: str) -> bool:
    """Whether four figures are a year or the number of a thing: "June 2024", "unit 1412"."""
    counted = _NOT_A_CLOCK.search(text[:start])
    if counted is None or CLOCK.fullmatch(words) is None:
        return False
    return not counted[1] or _YEAR.fullmatch(words) is not None


def _find_standing(reading: Reading) -> list[ReadSpan]:
    """ "Stands" right after people that are no party: others walk in a scene, they do not stand."""
    found = []
    for span in reading.spans:
        match = _STANDING.search(reading.text[span.end : span.end + 30])
        if span.tag == "bgped" and match is not None:
            start, end = span.end + match.end() - len(match[0].split()[-1]), span.end + match.end()
            if _is_free(reading, start, end):
                found.append(_build_span(start, end, reading.text[start:end], "act"))
    return found


def _is_free(reading: Reading, start: int, end: int) -> bool:
    return not any(span.start < end and start < span.end for span in reading.spans)


def _build_span(start: int, end: int, words: str, tag: str) -> ReadSpan:
    return ReadSpan(start, end, words, tag, None, False, None, (), (), _KNOWN)
