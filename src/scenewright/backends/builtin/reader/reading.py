"""What the encoder reads in a text: spans with labels, their agents, and their certainty."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.reader.annotation import (
    KINDS,
    MENTIONS,
    PAIRS,
    SEPARATOR,
)
from scenewright.backends.builtin.reader.encoder import Encoder, Floats, load_encoder
from scenewright.backends.builtin.reader.labels import (
    COMPASS,
    LABELS,
    MOST_MEMBERS,
    is_mention,
    is_side_label,
    split_label,
)
from scenewright.backends.builtin.reader.numbers import count_in
from scenewright.backends.builtin.reader.single_thread import SINGLE_THREAD
from scenewright.backends.builtin.reader.tokens import bucket_distance, load_tokenizer

_RELATIVE = {"opp", "left", "right", "same", "lateral", "other", "exit", "entry"}
_UNOWNED = frozenset(
    (
        *("density", "time", "bgveh", "bgped", "bgall", "normal", "weather", "place", "broken"),
        *("cond", "thing", "manner", "del", "when", "act", "pace", "sight", "wait", "dist"),
        *("speed", "impact", "pet", "ttc", "gap", "headway", "light", "point", "decel", "accel"),
        "seen",
    )
)
"""Tags that need no agent."""

_VEHICLE_ONLY = frozenset({"left", "right", "straight", "uturn"})


@dataclass(frozen=True)
class ReadSpan:
    """Words and what the encoder takes them to say.

    Attributes:
        start, end: characters; words: the text between them.
        tag, value, negated: as in `annotation.Span`.
        side: the compass direction that the encoder sees in the words, where the tag has one.
        subjects, objects: road users by number, from 1.
        confidence: the least probability of the choices made for this span; label_confidence: that
            of its tag alone.
    """

    start: int
    end: int
    words: str
    tag: str
    value: str | None
    negated: bool
    side: str | None
    subjects: tuple[int, ...]
    objects: tuple[int, ...]
    confidence: float
    label_confidence: float = 1.0

    @property
    def users(self) -> tuple[int, ...]:
        """The road users that it is said of, and those that it happens to."""
        return (*self.subjects, *self.objects)

    @property
    def names_user(self) -> bool:
        """Whether the words name a road user or an object, for the first time or again."""
        return self.tag in (*MENTIONS, "ref")

    def overlaps(self, match: re.Match[str]) -> bool:
        """Whether the words of a match are among these, in part at least."""
        return self.start < match.end() and match.start() < self.end


RULE_CONFIDENCE = 0.9
"""How sure a span is that a rule finds, whose words leave no doubt."""


def build_span(
    match: re.Match[str],
    tag: str,
    value: str | None,
    subjects: tuple[int, ...],
    group: str | int = 0,
) -> ReadSpan:
    """The span of words that a rule finds, or of a group of them."""
    return ReadSpan(
        *match.span(group), match[group], tag, value, False, None, subjects, (), RULE_CONFIDENCE
    )


@dataclass(frozen=True)
class Reading:
    """The spans of a text; `kind` is one of KINDS, `kind_confidence` its probability.

    Attributes:
        users: number -> class tag, with the number of the span that introduces it.
        gaps: words outside of all spans, with the probability that they say nothing.
    """

    text: str
    kind: str
    kind_confidence: float
    spans: tuple[ReadSpan, ...]
    users: dict[int, int]

    def select_spans(self, kept: Sequence[int]) -> Reading:
        """The reading of the spans with these numbers, and of the users that they introduce."""
        users = {user: kept.index(at) for user, at in self.users.items() if at in kept}
        return replace(self, spans=tuple(self.spans[at] for at in kept), users=users)


@dataclass(frozen=True)
class _TokenSpan:
    first: int
    last: int
    label: int
    confidence: float


def read_text(text: str, *, previous: str | None = None, encoder: Encoder | None = None) -> Reading:
    """Read an instruction, or a change to a previous one.

    Raises:
        Refused: more tokens than the encoder has positions.
    """
    return _read_known(text, previous, encoder or load_encoder())


@lru_cache(maxsize=64)
def _read_known(text: str, previous: str | None, encoder: Encoder) -> Reading:
    """The reading of a text, which a planner in doubt asks for several times."""
    whole = text if previous is None else f"{previous}{SEPARATOR}{text}"
    encoding = load_tokenizer().encode(whole)
    if len(encoding.ids) > 510:
        raise Refused(
            "out_of_scope", "The instruction is too long to be read; describe it in fewer words."
        )
    cut = len(previous) if previous is not None else len(whole)
    parts = np.array([int(start > cut) for start, _ in encoding.offsets], dtype=np.int64)
    with SINGLE_THREAD:
        x = encoder.encode(np.array(encoding.ids, dtype=np.int64), parts)
        kinds = np.exp(encoder.compute_head("kind", x[:1])[0])
        found = _find_spans(np.asarray(encoder.compute_head("tags", x)), encoding)
        spans, users = _describe(encoder, x, found, encoding, whole)
    kind = int(kinds.argmax())
    return Reading(whole, KINDS[kind], float(kinds[kind]), spans, users)


def _find_spans(scores: Floats, encoding: Any) -> list[_TokenSpan]:
    """The likeliest labels of all tokens in which no span goes on that has not begun (Viterbi)."""
    inside = np.arange(2, scores.shape[1], 2)
    best, back = np.full_like(scores, -np.inf), np.zeros(scores.shape, dtype=np.int64)
    best[0] = scores[0]
    best[0, inside] = -np.inf
    for at in range(1, len(scores)):
        last = int(best[at - 1].argmax())
        best[at], back[at] = best[at - 1, last] + scores[at], last
        begun, going = best[at - 1, inside - 1], best[at - 1, inside]
        best[at, inside] = np.maximum(begun, going) + scores[at, inside]
        back[at, inside] = np.where(begun >= going, inside - 1, inside)
    path = [int(best[-1].argmax())]
    for at in range(len(scores) - 1, 0, -1):
        path.append(int(back[at, path[-1]]))
    return _gather(path[::-1], np.exp(scores), encoding)


def _gather(path: list[int], chances: Floats, encoding: Any) -> list[_TokenSpan]:
    spans: list[_TokenSpan] = []
    for at, tag in enumerate(path):
        start, end = encoding.offsets[at]
        if tag == 0 or end == start:
            continue
        label = (tag - 1) // 2
        sure = float(chances[at, 1 + 2 * label] + chances[at, 2 + 2 * label])
        if tag % 2 == 0 and spans and spans[-1].last == at - 1 and spans[-1].label == label:
            before = spans.pop()
            spans.append(_TokenSpan(before.first, at, label, min(sure, before.confidence)))
        else:
            spans.append(_TokenSpan(at, at, label, sure))
    return [
        span
        for span in spans
        if any(map(str.isalnum, "".join(encoding.tokens[span.first : span.last + 1])))
    ]


def _describe(
    encoder: Encoder, x: Floats, found: list[_TokenSpan], encoding: Any, text: str
) -> tuple[tuple[ReadSpan, ...], dict[int, int]]:
    if not found:
        return (), {}
    places = np.array([(each.first, each.last) for each in found])
    spans = encoder.represent(x, places, np.array([each.label for each in found]))
    negated = np.exp(encoder.compute_head("negated", spans))[:, 1]
    sides, counts = (
        np.exp(encoder.compute_head("side", spans)),
        np.exp(encoder.compute_head("count", spans)),
    )
    words = [_widen_to_words(each, encoding, text) for each in found]
    members: list[tuple[int, int]] = []  # span, member (0: alone)
    users: dict[int, int] = {}
    for at, each in enumerate(found):
        label = LABELS[each.label]
        if is_mention(label):
            counted = 1 if label.endswith("=many") else count_in(words[at][2])
            likeliest = int(counts[at].argmax()) + 1
            size = counted if counted is not None and counted <= MOST_MEMBERS else likeliest
            for member in range(1, size + 1):
                users[len(members) + 1] = at
                members.append((at, member if size > 1 else 0))
    links = _score_links(encoder, spans, found, members)
    result = []
    for at, each in enumerate(found):
        label = LABELS[each.label]
        tag, value = split_label(label)
        start, end, said = words[at]
        if is_mention(label):
            subjects = tuple(user for user, span in users.items() if span == at)
            objects: tuple[int, ...] = ()
            sure = 1.0
        else:
            subjects, objects, sure = _choose(links[at], tag, value, members, found)
        side = COMPASS[int(sides[at].argmax())] if is_side_label(label) else None
        denied = bool(negated[at] > 0.5)
        sure = min(sure, each.confidence, float(max(negated[at], 1 - negated[at])))
        sures = round(sure, 4), round(each.confidence, 4)
        result.append(
            ReadSpan(start, end, said, tag, value, denied, side, subjects, objects, *sures)
        )
    return tuple(result), users


def _widen_to_words(span: _TokenSpan, encoding: Any, text: str) -> tuple[int, int, str]:
    """Characters of a span, widened to whole words."""
    start, end = encoding.offsets[span.first][0], encoding.offsets[span.last][1]
    tokens = encoding.tokens
    first, last = span.first, span.last
    while tokens[first].startswith("##"):
        first -= 1
        start = encoding.offsets[first][0]
    while last + 1 < len(tokens) and tokens[last + 1].startswith("##"):
        last += 1
        end = encoding.offsets[last][1]
    return start, end, text[start:end]


def _score_links(
    encoder: Encoder, spans: Floats, found: list[_TokenSpan], members: list[tuple[int, int]]
) -> Floats:
    """Probabilities [spans, road users, LINKS]."""
    if not members:
        return np.zeros((len(found), 0, 3), np.float32)
    mentions = np.array([span for span, _ in members])
    users = spans[mentions] + encoder.compute_members(np.array([member for _, member in members]))
    n, m = len(found), len(members)
    left, right = np.repeat(np.arange(n), m), np.tile(np.arange(m), n)
    distances = [
        bucket_distance(found[a].first - found[members[b][0]].first)
        for a, b in zip(left, right, strict=True)
    ]
    scores = encoder.score_links(spans[left], users[right], np.array(distances))
    return np.exp(scores).reshape(n, m, 3)


def _choose(
    chances: Floats,
    tag: str,
    value: str | None,
    members: list[tuple[int, int]],
    found: list[_TokenSpan],
) -> tuple[tuple[int, ...], tuple[int, ...], float]:
    """Subjects and objects of a span, at least one where its tag needs one."""
    if not members:
        return (), (), 1.0
    chances = chances.copy()
    if tag in _VEHICLE_ONLY:
        for user, (span, _) in enumerate(members):
            if LABELS[found[span].label].startswith("ped"):
                chances[user] = (1.0, 0.0, 0.0)
    picked = chances.argmax(1)
    sure = float(chances.max(1).min())
    if tag not in _UNOWNED and not (picked == 1).any():
        free = int(chances[:, 1].argmax())
        sure = min(sure, float(chances[free, 1]))
        picked[free] = 1
    if (tag in PAIRS or value in _RELATIVE) and not (picked == 2).any() and len(members) > 1:
        # The road user that costs least as object, while at least one subject is left.
        cost = chances.max(1) / np.maximum(chances[:, 2], 1e-9)
        if (picked == 1).sum() == 1:
            cost = np.where(picked == 1, np.inf, cost)
        free = int(cost.argmin())
        sure = min(sure, float(chances[free, 2]))
        picked[free] = 2
    subjects = tuple(int(user) + 1 for user in np.flatnonzero(picked == 1))
    objects = tuple(int(user) + 1 for user in np.flatnonzero(picked == 2))
    return subjects, objects, sure
