"""Other readings of a doubtful text: its least certain spans read otherwise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from scenewright.backends.builtin.reader.annotation import EVENTS
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan

_DOUBTFUL_SPANS = 2
_NO_MATTER = ("manner", "ref", "pace")


def find_doubtful(reading: Reading) -> list[ReadSpan]:
    """The least certain spans that matter for a plan, the least certain first."""
    spans = [span for span in reading.spans if span.tag not in _NO_MATTER]
    return sorted(spans, key=lambda span: span.confidence)[:_DOUBTFUL_SPANS]


def read_otherwise(reading: Reading) -> Iterator[Reading]:
    """Readings in which one doubtful span is left out, turned round or said of another agent."""
    introducing = set(reading.users.values())
    for span in find_doubtful(reading):
        at = reading.spans.index(span)
        if at in introducing:
            continue
        if span.tag in EVENTS and span.objects and span.subjects:
            yield _replace_span(
                reading, at, replace(span, subjects=span.objects, objects=span.subjects)
            )
        elif len(span.subjects) == 1:
            for user in reading.users:
                if user not in span.subjects:
                    yield _replace_span(reading, at, replace(span, subjects=(user,)))
        if span.negated:
            yield _replace_span(reading, at, replace(span, negated=False))
        yield _replace_span(reading, at, replace(span, tag="manner", subjects=(), objects=()))


def _replace_span(reading: Reading, at: int, span: ReadSpan) -> Reading:
    spans = (*reading.spans[:at], replace(span, confidence=1.0), *reading.spans[at + 1 :])
    return replace(reading, spans=spans)
