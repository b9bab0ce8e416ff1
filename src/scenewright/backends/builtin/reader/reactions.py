"""Words by which a road user does not react: "without braking", "distracted", "does not react"."""

from __future__ import annotations

import re
from dataclasses import replace

from scenewright.backends.builtin.reader.annotation import MENTIONS
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan

_KNOWN = 0.9
"""How sure a span is whose words leave no doubt."""

_ANSWER = r"(?:react|respond|brak|slow|notic)\w*(?: down)?(?: (?:at all|to it|in any way))?"
_UNREACTING = re.compile(
    rf"\bwithout (?:even |ever )?(?:reacting|responding|braking|slowing(?: down)?|noticing)\b|"
    rf"\b(?:does|do|did)(?: not|n['’]t) (?:even )?{_ANSWER}|\bnever {_ANSWER}|"
    r"\bfail(?:s|ed|ing)? to (?:react|respond|brake|notice)\b"
    r"(?! in time| to (?:the|its) |[^.]* braking of)|"
    r"\b(?:is |was )?(?:distracted|inattentive|asleep|absent-minded|daydreaming|texting)\b|"
    r"\b(?:is |was )?not paying attention\b|"
    r"\b(?:is |was )?(?:looking|staring) (?:down )?at (?:a|the|his|her|their|its) phone\b|"
    r"\b(?:is |was )?on (?:his|her|their|its|the) phone\b",
    re.IGNORECASE,
)
_IN_TIME = re.compile(r"\s*(?:in time|(?:hard|early|quickly|soon|fast) enough)", re.IGNORECASE)
_OF_REACTING = ("brake", "decel", "manner", "act", "sight", "thing", "pace", "yield")
"""Tags of spans whose words say no more than that an agent does not react."""


def read_reactions(reading: Reading) -> Reading:
    """The reading with spans of their own for words that say that an agent does not react."""
    spans = list(reading.spans)
    for match in _UNREACTING.finditer(reading.text):
        owner = _find_owner(spans, match)
        if owner is None or _IN_TIME.match(reading.text, match.end()):
            continue
        spans = [span for span in spans if not _is_same_statement(span, match)]
        start, end = match.span()
        spans.append(
            ReadSpan(start, end, match[0], "reaction", "none", False, None, (owner,), (), _KNOWN)
        )
    return reading if spans == list(reading.spans) else _replace_spans(reading, spans)


def _replace_spans(reading: Reading, spans: list[ReadSpan]) -> Reading:
    """The reading with other spans, its road users introduced where they were."""
    users = {user: spans.index(reading.spans[at]) for user, at in reading.users.items()}
    return replace(reading, spans=tuple(spans), users=users)


def _is_same_statement(span: ReadSpan, match: re.Match[str]) -> bool:
    return span.tag in _OF_REACTING and _is_overlapping(span, match)


def _is_overlapping(span: ReadSpan, match: re.Match[str]) -> bool:
    return span.start < match.end() and match.start() < span.end


def _find_owner(spans: list[ReadSpan], match: re.Match[str]) -> int | None:
    """The agent described: the one that the words name or belong to, else the last one named."""
    for span in spans:
        if (
            _is_overlapping(span, match)
            and span.subjects
            and span.tag in (*MENTIONS, *_OF_REACTING)
        ):
            return span.subjects[0]
    named = [s for s in spans if s.tag in (*MENTIONS, "ref") and s.end <= match.start()]
    named.sort(key=lambda each: each.end)
    if not named or not named[-1].subjects:
        return None
    # "A car hits a cyclist without braking" is said of the one that the sentence is about.
    about = named[0] if match[0].lower().startswith("without") else named[-1]
    return about.subjects[0] if about.subjects else None
