"""Words of how a road user reacts to a threat, or that it does not: "without braking",
"distracted", "does not react", "jumps back", "swerves within its lane"."""

from __future__ import annotations

import re
from dataclasses import replace

from scenewright.backends.builtin.reader.annotation import MENTIONS
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan, build_span
from scenewright.backends.builtin.reader.words import Patterns
from scenewright.scene.kinds import list_readings

_PATTERNS = Patterns("reactions")

_THREATS = ("hit", "near")
"""Tags of collisions and near misses, without which there is nothing to react to."""
_OF_REACTING = (
    "brake", "decel", "manner", "act", "sight", "thing", "pace", "yield", "react", "motion",
)  # fmt: skip
"""Tags of spans whose words may say no more than how an agent reacts."""


def read_reactions(reading: Reading) -> Reading:
    """The reading with spans of their own for words that say that an agent does not react."""
    spans = list(reading.spans)
    (unreacting,) = (pattern for pattern, way in list_readings("reaction") if way == "none")
    for match in unreacting.finditer(reading.text):
        owner = _find_owner(spans, match)
        if owner is None or _PATTERNS.in_time.match(reading.text, match.end()):
            continue
        spans = [span for span in spans if not _is_same_statement(span, match)]
        spans.append(build_span(match, "reaction", "none", (owner,)))
    spans = _add_ways(reading, spans)
    return reading if spans == list(reading.spans) else _replace_spans(reading, spans)


def _add_ways(reading: Reading, spans: list[ReadSpan]) -> list[ReadSpan]:
    """The spans with those that say how an agent reacts to a collision or a near miss."""
    if any(span.tag == "turn" for span in spans):
        return spans  # which way is open, and nothing else would hold an agent to turning at all
    ways = (each for each in reversed(list_readings("reaction")) if each[1] != "none")
    found = [(way, match) for words, way in ways for match in words.finditer(reading.text)]
    for way, match in found:
        owner = _find_owner(spans, match)
        threats = _find_threats(reading, spans, match)
        if owner not in reading.users or threats is None:
            continue
        spans = [s for s in threats if s.tag in _THREATS or not _is_same_statement(s, match)]
        spans.append(build_span(match, "reaction", way, (owner,)))
    return spans


def _find_threats(
    reading: Reading, spans: list[ReadSpan], match: re.Match[str]
) -> list[ReadSpan] | None:
    """The spans, where something threatens; a contact that is avoided so is a near miss."""
    if any(span.tag in _THREATS and not span.negated for span in spans):
        return spans
    avoids = _PATTERNS.to_avoid.match(reading.text, match.end())
    avoided = [s for s in spans if avoids and s.tag == "hit" and s.start >= match.end()]
    if not avoided:
        return None
    return [replace(s, tag="near", negated=False) if s is avoided[0] else s for s in spans]


def _replace_spans(reading: Reading, spans: list[ReadSpan]) -> Reading:
    """The reading with other spans, its road users introduced where they were."""
    users = {user: spans.index(reading.spans[at]) for user, at in reading.users.items()}
    return replace(reading, spans=tuple(spans), users=users)


def _is_same_statement(span: ReadSpan, match: re.Match[str]) -> bool:
    return span.tag in _OF_REACTING and span.overlaps(match)


def _find_owner(spans: list[ReadSpan], match: re.Match[str]) -> int | None:
    """The agent described: the one that the words name or belong to, else the last one named."""
    for span in spans:
        if span.overlaps(match) and span.subjects and span.tag in (*MENTIONS, *_OF_REACTING):
            return span.subjects[0]
    named = [span for span in spans if span.names_user and span.end <= match.start()]
    named.sort(key=lambda span: span.end)
    if not named or not named[-1].subjects:
        return None
    # "A car hits a cyclist without braking" is said of the one that the sentence is about.
    about = named[0] if match[0].lower().startswith("without") else named[-1]
    return about.subjects[0] if about.subjects else None
