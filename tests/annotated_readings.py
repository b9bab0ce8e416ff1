"""Annotated instructions written back as lines."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.backends.builtin.reader.annotation import AnnotatedText, Span


def format_annotation(annotated: AnnotatedText) -> str:
    """The line that `parse_annotation` reads back."""
    pieces: list[str] = [] if annotated.kind == "scene" else [f"%{annotated.kind} "]
    at = 0
    for span in sorted(annotated.spans, key=lambda each: each.start):
        pieces += [annotated.text[at : span.start], _format_span(annotated.text, span)]
        at = span.end
    return "".join([*pieces, annotated.text[at:]]).replace(" \n", "\\n")


def _format_span(text: str, span: Span) -> str:
    value = "" if span.value is None else f"={span.value}"
    subjects = f":{_join(span.subjects)}" if span.subjects else ""
    objects = f">{_join(span.objects)}" if span.objects else ""
    words = text[span.start : span.end]
    return f"[{'!' if span.negated else ''}{span.tag}{value}{subjects}{objects} {words}]"


def _join(ids: Sequence[int]) -> str:
    return ",".join(map(str, ids))
