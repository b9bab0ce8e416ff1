"""Words that may not be passed over: sides, turns, measures and negations outside of all spans."""

from __future__ import annotations

import re

from scenewright.backends.builtin.reader.reading import Reading
from scenewright.backends.builtin.reader.words import COARSE, compile_words, find_subtype

_SIDES = compile_words("coverage.sides")
_MEASURES = compile_words("coverage.measures")
_NEGATIONS = compile_words("coverage.negations")
_EXCEPTED = re.compile(r"\b(?:all|every\w*|each) (?:but|except)\b", re.IGNORECASE)
_DENYING = ("normal", "bgveh", "bgped", "bgall", "del", "density", "manner", "jay", "red", "pace")
_SURELY_A_REFERENCE = 0.6
"""A later mention that is less sure may be another agent: "a car ... the taxi ahead of it"."""

_NEAR = 30
"""Characters between a negation and the span that takes account of it."""


def find_passed_over(reading: Reading) -> list[str]:
    """Sides, turns, measures and negations that no span takes account of."""
    covered = [(span.start, span.end) for span in reading.spans]
    excepted = _EXCEPTED.search(reading.text)  # "all but one", and nothing is read as denied
    found = [excepted[0]] if excepted and not any(s.negated for s in reading.spans) else []
    denying = [s.start for s in reading.spans if s.negated or s.tag in _DENYING]
    for pattern in (_SIDES, _MEASURES, _NEGATIONS):
        for match in pattern.finditer(reading.text):
            inside = any(a < match.end() and match.start() < b for a, b in covered)
            near = any(-_NEAR < start - match.end() < _NEAR for start in denying)
            if not inside and not (pattern is _NEGATIONS and near):  # "No [!hit crash]"
                found.append(match[0])
    return found + _find_other_nouns(reading)


def _find_other_nouns(reading: Reading) -> list[str]:
    """Later mentions that call a vehicle something else: "the motorbike" is not "a car"."""
    introduced = {user: reading.spans[at] for user, at in reading.users.items()}
    found = []
    for span in reading.spans:
        first = introduced.get(span.subjects[0]) if len(span.subjects) == 1 else None
        if span.tag == "ref" and first is not None and first.tag == "veh":
            kinds = [find_subtype(each.words) for each in (first, span)]
            if span.label_confidence >= _SURELY_A_REFERENCE:
                kinds = [COARSE.get(kind or "", kind) for kind in kinds]
            if None not in kinds and kinds[0] != kinds[1] and not _PICKUP.search(first.words):
                found.append(span.words)
    return found


_PICKUP = re.compile(r"\bpick-?up|\bpolice\b|\bpatrol\b", re.IGNORECASE)
