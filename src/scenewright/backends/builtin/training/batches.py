"""Annotated instructions as tensors."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from scenewright.backends.builtin.reader.annotation import (
    KINDS,
    SEPARATOR,
    SIDES,
    AnnotatedText,
    Span,
)
from scenewright.backends.builtin.reader.labels import (
    COMPASS,
    LABEL_INDEX,
    MOST_MEMBERS,
    is_mention,
    label_of,
)
from scenewright.backends.builtin.reader.tokens import bucket_distance

MOST_TOKENS = 200
_COMPASS_WORD = re.compile(r"(?<![a-z])(north|east|south|west)(?!-?(?:east|west))", re.IGNORECASE)


@dataclass(frozen=True)
class LabelSpan:
    """A span in tokens: first and last token, its label, and the annotation it comes from."""

    first: int
    last: int
    label: int
    span: Span


@dataclass(frozen=True)
class EncodedRow:
    """One instruction as token ids, parts (1 in the change of an edit) and labelled spans."""

    ids: tuple[int, ...]
    parts: tuple[int, ...]
    spans: tuple[LabelSpan, ...]
    kind: int


def encode_row(row: AnnotatedText, tokenizer: Any) -> EncodedRow:
    """Tokens of the text, and its spans as ranges of tokens; spans without a token fall away."""
    encoding = tokenizer.encode(row.text)
    cut = row.text.find(SEPARATOR) if row.kind == "edit" else -1
    offsets = encoding.offsets[:MOST_TOKENS]
    parts = tuple(int(cut >= 0 and start > cut) for start, _ in offsets)
    spans = [_locate(span, offsets) for span in row.spans]
    return EncodedRow(
        tuple(encoding.ids[:MOST_TOKENS]),
        parts,
        tuple(span for span in spans if span is not None),
        KINDS.index(row.kind),
    )


def _locate(span: Span, offsets: Sequence[tuple[int, int]]) -> LabelSpan | None:
    inside = [
        at for at, (start, end) in enumerate(offsets)
        if end > start and min(end, span.end) - max(start, span.start) > (end - start) / 2
    ]  # fmt: skip
    if not inside:
        return None
    return LabelSpan(inside[0], inside[-1], LABEL_INDEX[label_of(span)], span)


@dataclass(frozen=True)
class TokenBatch:
    """Tensors of several rows; spans and road users are listed across rows.

    Attributes:
        ids, parts, mask, tags: [rows, tokens]; tags: 0, or 1 + 2 label (+ 1 inside); -1: no token.
        kinds: [rows].
        spans: [n, 3] row, first, last token; span_labels: [n]; negated: [n].
        sided: indices of spans that name a leg, and which; counted: of mentions, and how many.
        pairs: [m, 3] span, mention of the road user, member of the mention's group (0: alone).
        links: [m]; distances: [m] buckets.
    """

    ids: Tensor
    parts: Tensor
    mask: Tensor
    tags: Tensor
    kinds: Tensor
    spans: Tensor
    span_labels: Tensor
    negated: Tensor
    sided: Tensor
    sides: Tensor
    counted: Tensor
    counts: Tensor
    pairs: Tensor
    links: Tensor
    distances: Tensor


def make_batch(rows: Sequence[EncodedRow], texts: Sequence[str]) -> TokenBatch:
    """The tensors of some rows; `texts` are theirs, in order."""
    width = max(len(row.ids) for row in rows)
    ids = torch.zeros(len(rows), width, dtype=torch.long)
    parts, tags = torch.zeros_like(ids), torch.full_like(ids, -1)
    mask = torch.zeros(len(rows), width, dtype=torch.bool)
    spans: list[tuple[int, int, int]] = []
    labels: list[int] = []
    negated: list[int] = []
    sided: list[tuple[int, int]] = []
    counted: list[tuple[int, int]] = []
    pairs: list[tuple[int, int, int, int, int]] = []
    for at, row in enumerate(rows):
        length = len(row.ids)
        ids[at, :length] = torch.tensor(row.ids)
        parts[at, :length] = torch.tensor(row.parts)
        mask[at, :length] = True
        tags[at, :length] = 0
        base = len(spans)
        for token_span in row.spans:
            tags[at, token_span.first] = 1 + 2 * token_span.label
            tags[at, token_span.first + 1 : token_span.last + 1] = 2 + 2 * token_span.label
            side = _get_side(token_span.span, texts[at])
            if side is not None:
                sided.append((len(spans), side))
            if token_span.span.subjects and is_mention(label_of(token_span.span)):
                counted.append((len(spans), min(len(token_span.span.subjects), MOST_MEMBERS) - 1))
            spans.append((at, token_span.first, token_span.last))
            labels.append(token_span.label)
            negated.append(int(token_span.span.negated))
        pairs += _pair(row, base)
    return TokenBatch(
        ids, parts, mask, tags, torch.tensor([row.kind for row in rows]),
        torch.tensor(spans).view(-1, 3), torch.tensor(labels, dtype=torch.long),
        torch.tensor(negated, dtype=torch.long),
        *_build_columns(sided), *_build_columns(counted),
        torch.tensor([p[:3] for p in pairs]).view(-1, 3),
        torch.tensor([p[3] for p in pairs], dtype=torch.long),
        torch.tensor([p[4] for p in pairs], dtype=torch.long),
    )  # fmt: skip


def _build_columns(rows: Sequence[tuple[int, int]]) -> tuple[Tensor, Tensor]:
    table = torch.tensor(rows, dtype=torch.long).view(-1, 2)
    return table[:, 0], table[:, 1]


def _get_side(span: Span, text: str) -> int | None:
    """Index into COMPASS of the leg or direction that the words of a span name."""
    if span.tag not in SIDES or span.value in ("opp", "left", "right", "same", "lateral", "other"):
        return None
    if span.value in COMPASS:
        return COMPASS.index(span.value)
    words = text[span.start : span.end]
    named = {match[1][0].upper() for match in _COMPASS_WORD.finditer(words)}
    named |= {c.upper() for c in re.findall(r"(?<![A-Za-z])([NESWnesw])/?[Bb]?(?![A-Za-z])", words)}
    return COMPASS.index(named.pop()) if len(named) == 1 else None


def _pair(row: EncodedRow, base: int) -> list[tuple[int, int, int, int, int]]:
    """Span, mention, member, link and distance bucket for every span and road user of a row."""
    users: list[tuple[int, LabelSpan, int, int]] = []
    for at, each in enumerate(row.spans):
        if is_mention(label_of(each.span)):
            many = len(each.span.subjects) > 1
            users += [
                (base + at, each, min(k, MOST_MEMBERS) if many else 0, user)
                for k, user in enumerate(each.span.subjects, start=1)
            ]
    found = []
    for at, each in enumerate(row.spans):
        if is_mention(label_of(each.span)):
            continue
        for mention, token_span, member, user in users:
            link = 1 if user in each.span.subjects else 2 if user in each.span.objects else 0
            found.append(
                (base + at, mention, member, link, bucket_distance(each.first - token_span.first))
            )
    return found
