"""Manoeuvres in one lane: which words name one, and what they make of the relations of two."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from scenewright.backends.builtin.draft import AgentDraft, RelationDraft
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan

if TYPE_CHECKING:
    from scenewright.backends.builtin.reader.interpret import Interpretation

_KNOWN = 0.9
"""How sure a span is whose words leave no doubt."""

_AHEAD = re.compile(r"\b(?:lead(?:ing|er)?|ahead|in front|front|preced\w+)\b", re.IGNORECASE)
_BEHIND = re.compile(r"\b(?:behind|follow\w*|trail\w*|tail\w*|second)\b", re.IGNORECASE)
_INTO_THE_BACK = re.compile(
    r"\brear\b|\bback of|\bup the back|\bbehind\b|\b(?:runs?|running|ran|drives?|drove) into\b",
    re.IGNORECASE,
)
_IN_TIME = re.compile(
    r"\b(?:stop|brake|halt|react|pull)\w*\b.*\bin (?:good )?time\b", re.IGNORECASE
)
_NARROWLY = re.compile(
    r"\b(?:just|barely|only|narrowly|hardly|last moment|manages?)\b", re.IGNORECASE
)
_STOPS = re.compile(r"\b(?:stop|brake|halt)\w*\b", re.IGNORECASE)


def sharpen_manoeuvres(reading: Reading) -> Reading:
    """The reading with spans made sure, or read otherwise, whose words leave no doubt."""
    spans = tuple(_sharpened(span) for span in reading.spans)
    return reading if spans == reading.spans else replace(reading, spans=spans)


def _sharpened(span: ReadSpan) -> ReadSpan:
    if span.tag not in ("hit", "near", "yield", "follow"):
        return span
    if stops_in_time(span):
        sure = max(span.confidence, _KNOWN)
        return replace(span, tag="follow", value=None, negated=False, confidence=sure)
    if span.negated:
        return span
    if _NARROWLY.search(span.words) and _STOPS.search(span.words):
        return replace(span, tag="near", value=None, confidence=max(span.confidence, _KNOWN))
    return span


def stops_in_time(span: ReadSpan) -> bool:
    """Whether the words say that somebody stops in time, with nothing that makes it narrow."""
    return bool(_IN_TIME.search(span.words)) and not _NARROWLY.search(span.words)


def settle_lead_braking(result: Interpretation) -> None:
    """Who brakes hard ahead of another in its lane does so as a manoeuvre of their relation."""
    for user in sorted(result.braking):
        agent = result.users.get(user)
        for edge in list(result.draft.relations):
            if agent is None or agent.type != "vehicle" or not _brakes_ahead(result, edge, agent):
                continue
            edge.manoeuvre = "lead_brakes"
            if edge.type == "collide_at":
                edge.kind = "rear_end"
            _turn_round(edge, agent)
            _take_in(result, edge, user)
    _drop_follows(result)


def _brakes_ahead(result: Interpretation, edge: RelationDraft, agent: AgentDraft) -> bool:
    """Whether the agent drives ahead of the other of the edge, in its lane, and brakes."""
    other = edge.to if agent is edge.from_ else edge.from_
    if agent not in (edge.from_, edge.to) or other.type != "vehicle":
        return False
    if edge.type == "follow":
        return agent is edge.to
    if edge.type == "collide_at":
        return agent is edge.to and (edge.kind == "rear_end" or _in_line(result, agent, other))
    return edge.type == "near_miss" and _in_line(result, agent, other)


def _in_line(result: Interpretation, agent: AgentDraft, other: AgentDraft) -> bool:
    """Whether words have the agent ahead of the other: its name, the other's, or a follow."""
    follows = any(
        edge.type == "follow" and edge.from_ is other and edge.to is agent
        for edge in result.draft.relations
    )
    named = bool(_AHEAD.search(agent.head) or _BEHIND.search(other.head))
    return follows or named or any(map(_INTO_THE_BACK.search, _words_between(result, agent, other)))


def _words_between(result: Interpretation, agent: AgentDraft, other: AgentDraft) -> Iterator[str]:
    """The words of relations in which the other does something to the agent."""
    for entry in result.entries:
        users = result.agents_of(entry.users)
        if entry.became == "relation" and users == [other, agent]:
            yield entry.span.words


def _turn_round(edge: RelationDraft, leader: AgentDraft) -> None:
    """`from` is who drives behind."""
    if edge.from_ is leader:
        edge.from_, edge.to = edge.to, leader


def _take_in(result: Interpretation, edge: RelationDraft, user: int) -> None:
    """The words for the braking became the manoeuvre."""
    for n, entry in enumerate(result.entries):
        if entry.became == "cause" and entry.users == (user,):
            result.entries[n] = replace(entry, became="manoeuvre", value=edge.manoeuvre)


def _drop_follows(result: Interpretation) -> None:
    """Who hits or nearly hits a braking leader follows it: one relation says both."""
    relations = result.draft.relations
    others = {e.pair() for e in relations if e.manoeuvre == "lead_brakes" and e.type != "follow"}
    dropped = [e for e in relations if e.type == "follow" and e.pair() in others]
    relations[:] = [each for each in relations if each not in dropped]
    for n, entry in enumerate(result.entries):
        pair = frozenset(map(id, result.agents_of(entry.users)))
        if entry.became == "relation" and entry.value == "follow" and pair in others:
            result.entries[n] = replace(entry, became="manoeuvre", value="lead_brakes")
