"""Annotated instructions: `[tag=value:who>whom words]` in plain text, read into spans.

The format is described in docs/instructions.md. The same spans are what the encoder predicts.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

MENTIONS = ("veh", "ped", "cyc", "scoot", "obj", "other")
"""Tags that introduce a road user or an object; the tag names its class."""

EVENTS = ("hit", "near", "yield", "follow")
PAIRS = (*EVENTS, "lane", "push", "meet", "door")
"""Tags that say what one road user does to another, or about an object."""

SIDES = ("from", "to", "heading", "cw")
"""Tags whose words name a leg or a direction of the compass."""

_FACTS = (
    *("left", "right", "straight", "uturn", "turn", "cross", "jay", "red", "road"),
    *("brake", "first", "light", "speed", "impact", "pet", "ttc", "headway", "gap", "dist"),
    *("wait", "when", "decel", "accel", "point", "density", "time", "bgveh", "bgped", "bgall"),
    *("normal", "weather", "place", "act", "sight", "broken", "cond", "thing", "pace", "manner"),
    *("del", "drop", "swap", "becomes", "ref"),
    *("seen", "meet", "door", "motion", "lane", "push", "react"),
)
TAGS = frozenset((*MENTIONS, *EVENTS, *SIDES, *_FACTS))
SEPARATOR = " >>> "
"""Between an earlier instruction and the change to it, in rows of the kind `edit`."""

KINDS = ("scene", "edit", "off", "foreign")
_TAG = re.compile(
    r"\[(!?)([a-z]+)(?:=([^\s:\]]+(?::\d\d(?:-\d\d:\d\d)?)?))?(?::([\d,]+)(?:>([\d,]+))?)?"
    r" ([^\[\]]+)\]"
)


class AnnotationError(ValueError):
    """An annotated line that cannot be read; the message says what is wrong with it."""


@dataclass(frozen=True)
class Span:
    """Words of an instruction and what they say.

    Attributes:
        start, end: characters of the text, end exclusive.
        tag: one of TAGS; value: what the tag alone does not say, such as `opp` or `high`.
        negated: the words deny it.
        subjects, objects: numbers of the road users that it is said of, from 1.
    """

    start: int
    end: int
    tag: str
    value: str | None = None
    negated: bool = False
    subjects: tuple[int, ...] = ()
    objects: tuple[int, ...] = ()


@dataclass(frozen=True)
class AnnotatedText:
    """An instruction with its spans; `kind` is one of KINDS."""

    text: str
    spans: tuple[Span, ...]
    kind: str = "scene"


def parse_annotation(line: str) -> AnnotatedText:
    """Read one annotated line.

    Raises:
        AnnotationError: an unknown tag, or brackets that make no tag.
    """
    kind = "scene"
    for name in KINDS[1:]:
        if line.startswith(f"%{name} "):
            kind, line = name, line[len(name) + 2 :]
    pieces: list[str] = []
    spans: list[Span] = []
    length = at = 0
    for match in _TAG.finditer(line):
        before, words = line[at : match.start()], match[6]
        if match[2] not in TAGS:
            raise AnnotationError(f"unknown tag [{match[2]} ...]")
        start = length + len(before)
        length = start + len(words)
        spans.append(
            Span(
                start,
                length,
                match[2],
                match[3],
                bool(match[1]),
                _parse_ids(match[4]),
                _parse_ids(match[5]),
            )
        )
        pieces += [before, words]
        at = match.end()
    text = "".join([*pieces, line[at:]])
    if "[" in text or "]" in text:
        raise AnnotationError("a bracket that belongs to no tag")
    return AnnotatedText(text.replace("\\n", " \n"), tuple(spans), kind)  # as long as before


def _parse_ids(text: str | None) -> tuple[int, ...]:
    return tuple(int(each) for each in text.split(",") if each) if text else ()
