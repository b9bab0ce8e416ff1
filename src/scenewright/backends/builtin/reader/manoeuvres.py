"""Manoeuvres in one lane: which words name one, and what they make of the relations of two."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

from scenewright.backends.builtin.draft import AgentDraft, RelationDraft
from scenewright.backends.builtin.reader.annotation import MENTIONS
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan
from scenewright.backends.builtin.reader.words import compile_words
from scenewright.scene.kinds import find_marked, list_readings
from scenewright.scene.social import RelationType

if TYPE_CHECKING:
    from scenewright.backends.builtin.reader.interpret import Interpretation

_KNOWN = 0.9
"""How sure a span is whose words leave no doubt."""

_AHEAD = re.compile(r"\b(?:lead(?:ing|er)?|ahead|in front|front|preced\w+)\b", re.IGNORECASE)
_BEHIND = re.compile(r"\b(?:behind|follow\w*|trail\w*|tail\w*|second)\b", re.IGNORECASE)
_INTO_THE_BACK = compile_words("manoeuvres.into_the_back")
_IN_TIME = compile_words("manoeuvres.in_time")
_NARROWLY = compile_words("manoeuvres.narrowly")
_STOPS = re.compile(r"\b(?:stop|brake|halt)\w*\b", re.IGNORECASE)


_CLOSE_UP = compile_words("manoeuvres.close_up")
_LANE_CHANGE = compile_words("manoeuvres.lane_change")
_NEAR = 45
"""Characters behind the words of a follow in which it may be said that it is a close one."""

_SHORT_OF = re.compile(r"^(?:right|just)$", re.IGNORECASE)
_CALLED_YELLOW = re.compile(r"^(?!.*\bred\b).*\b(?:yellow|amber)\b", re.IGNORECASE)
_TURNS_GREEN = compile_words("manoeuvres.turns_green")
_RIGHT_ON_RED = compile_words("manoeuvres.right_on_red")
_PASSIVE_REAR = compile_words("manoeuvres.passive_rear")
_FOR = re.compile(r"^ (?:for|to let) $", re.IGNORECASE)
_CANNOT = compile_words("manoeuvres.cannot")
_CORNER = re.compile(r"\b(?:at|on) (?:the|a) (?:street )?corner\b", re.IGNORECASE)
_HERE = compile_words("manoeuvres.here")
"""Words of a place that are the junction itself, or say where people are on their way to."""

_TURNS = re.compile(r"(?:turn\w*|veer\w*|going|heading|bear\w*|swing\w*) $", re.IGNORECASE)
_ADVERB = re.compile(r"(?:\w+ly|just|almost)\b", re.IGNORECASE)
"""Words for a near miss that stand on their own: the word before them is no part of them."""


def correct_manoeuvres(reading: Reading) -> Reading:
    """The reading with spans made sure, or read otherwise, whose words leave no doubt."""
    # An agent that stops for a pedestrian gives way; only behind another vehicle is it a manoeuvre.
    driving = all(span.tag != "ped" for span in reading.spans)
    spans = [_correct_span(span, driving=driving) for span in reading.spans]
    for n, span in enumerate(spans[:-1]):
        close = spans[n + 1].tag in ("follow", "near") and spans[n + 1].start - span.end <= 1
        turns = _TURNS.search(reading.text[: span.start]) or _ADVERB.match(spans[n + 1].words)
        if not close or turns:
            continue
        if span.tag in ("right", "place") and _SHORT_OF.search(span.words):
            spans[n] = replace(span, tag="manner", confidence=_KNOWN)
    _read_passive_rear_end(reading, spans)
    _read_motion(reading, spans)
    _separate_red(reading.text, spans)
    _read_right_on_red(reading, spans)
    if not any(span.tag in ("veh", "cyc", "scoot") for span in spans):
        _read_corner(reading, spans)
    return reading if spans == list(reading.spans) else replace(reading, spans=tuple(spans))


def _separate_red(text: str, spans: list[ReadSpan]) -> None:
    """An agent that runs a yellow light, or drives when it is green, runs no red one."""
    yellow = {(s.start, s.subjects) for s in spans if s.value == "yellow"}
    for n, span in enumerate(spans):
        called = _CALLED_YELLOW.search(span.words) or (span.end + 1, span.subjects) in yellow
        if span.tag == "red" and called and not span.negated:
            spans[n] = replace(span, tag="motion", value="yellow")
        elif span.tag == "red" and _TURNS_GREEN.search(text[span.start : span.end + 15]):
            spans[n] = replace(span, tag="light", confidence=_KNOWN)


def _read_right_on_red(reading: Reading, spans: list[ReadSpan]) -> None:
    """ "Turns right on red" is a turn, and a red light that is run."""
    for match in _RIGHT_ON_RED.finditer(reading.text):
        owner = _find_owner(spans, match, drives=True)
        marked = any(s.tag == "red" and _is_overlapping(s, match) for s in spans)
        if owner is not None and not marked:
            place = (*match.span("red"), match["red"], "red", None)
            spans.append(ReadSpan(*place, False, None, (owner,), (), _KNOWN))


def _read_passive_rear_end(reading: Reading, spans: list[ReadSpan]) -> None:
    """ "Is hit from behind": by a vehicle without other relations; the agent that braked gave
    way."""
    passive = _PASSIVE_REAR.search(reading.text)
    if passive is None:
        return
    hits = [n for n, s in enumerate(spans) if s.tag == "hit" and _is_overlapping(s, passive)]
    struck = [s.subjects or s.objects for s in (spans[n] for n in hits)]
    if len(hits) != 1 or not struck[0]:
        return
    hit = replace(spans[hits[0]], subjects=(), objects=struck[0][:1], value="rear")
    spans[hits[0]] = replace(hit, confidence=max(hit.confidence, _KNOWN))
    for n, span in enumerate(spans[:-1]):
        other = spans[n + 1]
        between = reading.text[span.end : other.start]
        if span.tag == "brake" and other.tag in ("ped", "veh") and _FOR.search(between):
            spans[n] = replace(span, tag="yield", objects=other.subjects)


def _read_motion(reading: Reading, spans: list[ReadSpan]) -> None:
    """How a pedestrian crosses, where words of an event say it: "darts out in front of"."""
    for pattern, motion in list_readings("motion"):
        if find_marked("motion", motion, of="vehicle") is not None:
            continue
        for match in pattern.finditer(reading.text):
            touching = [span for span in spans if _is_overlapping(span, match)]
            owner = _find_owner(spans, match)
            if owner is None or all(span.tag not in ("near", "jay", "cross") for span in touching):
                continue
            if all(span.tag != "motion" for span in touching):
                place = (*match.span(), match[0], "motion", motion)
                spans.append(ReadSpan(*place, False, None, (owner,), (), _KNOWN))


def _find_owner(spans: list[ReadSpan], match: re.Match[str], *, drives: bool = False) -> int | None:
    """The road user that the words describe: that of the span there, else the last one named."""
    walkers = {user for span in spans if span.tag == "ped" for user in span.subjects}
    vehicles = {user for span in spans if span.tag == "veh" for user in span.subjects}
    if drives:
        walkers, vehicles = vehicles, walkers
    inside = [s for s in spans if _is_overlapping(s, match) and s.tag not in ("ped", "veh", "ref")]
    for span in inside:
        if span.subjects:
            return span.subjects[0] if span.subjects[0] in walkers else None
    named = [s for s in spans if s.tag in ("ped", "veh", "ref") and s.end <= match.start()]
    last = max(named, key=lambda each: each.end, default=None)
    if last is None or not last.subjects or last.subjects[0] in vehicles:
        return None
    return last.subjects[0] if last.subjects[0] in walkers else None


def _is_overlapping(span: ReadSpan, match: re.Match[str]) -> bool:
    return span.start < match.end() and match.start() < span.end


def _correct_span(span: ReadSpan, *, driving: bool) -> ReadSpan:
    sure = max(span.confidence, _KNOWN)
    if span.tag in ("place", "act") and _HERE.search(span.words):
        return replace(span, tag="manner")
    other_lane = span.tag == "place" or span.value == "wrongway"
    if other_lane and _LANE_CHANGE.search(span.words):
        return replace(span, tag="act", subjects=span.subjects or (1,), confidence=_KNOWN)
    if span.tag not in ("hit", "near", "yield", "follow") or not driving:
        return span
    if _IN_TIME.search(span.words) and not _NARROWLY.search(span.words):
        known = replace(span, negated=False, confidence=sure)
        if _CANNOT.search(span.words):
            return replace(known, tag="hit", value="rear")
        return replace(known, tag="follow", value=None)
    if not span.negated and _NARROWLY.search(span.words) and _STOPS.search(span.words):
        return replace(span, tag="near", value=None, confidence=sure)
    return span


def _read_corner(reading: Reading, spans: list[ReadSpan]) -> None:
    """A corner is a place of scenes in which all are on foot."""
    match = _CORNER.search(reading.text)
    if match is None:
        return
    touching = [n for n, span in enumerate(spans) if _is_overlapping(span, match)]
    inside = [n for n in touching if spans[n].tag not in (*MENTIONS, "ref")]
    for n in inside:
        spans[n] = replace(spans[n], tag="place", confidence=_KNOWN)
    if not inside:
        start, end = match.span()
        spans.append(ReadSpan(start, end, match[0], "place", None, False, None, (), (), _KNOWN))


def settle_lanes(result: Interpretation) -> None:
    """Following close up, and lane changes, are manoeuvres of the relations that they belong to."""
    for n, entry in enumerate(result.entries):
        agents = result.list_agents(entry.users)
        words = entry.span.words
        near = words + result.text[entry.span.end : entry.span.end + _NEAR]
        if entry.became == "relation" and entry.value == "follow" and _CLOSE_UP.search(near):
            for edge in result.draft.relations:
                if edge.type == "follow" and [edge.from_, edge.to] == agents:
                    edge.manoeuvre = find_marked("manoeuvre", "close")
                    result.entries[n] = replace(entry, became="manoeuvre", value=edge.manoeuvre)
        elif entry.span.tag in ("act", "near", "place") and _LANE_CHANGE.search(words):
            edge_ = _find_changed(result, agents)
            if edge_ is not None and entry.became == "nothing":
                known = replace(entry, became="manoeuvre", value=edge_.manoeuvre)
                result.entries[n] = replace(known, note=None)


def _find_change(edge: RelationDraft) -> str | None:
    """What a lane change is to a relation."""
    return find_marked("manoeuvre", f"{edge.type} lane")


def _find_changed(result: Interpretation, agents: list[AgentDraft]) -> RelationDraft | None:
    """The relation of two vehicles that a lane change of the first brings about."""
    for edge in result.draft.relations:
        if not agents or agents[0] not in (edge.from_, edge.to):
            continue
        if {edge.from_.type, edge.to.type} != {"vehicle"} or _find_change(edge) is None:
            continue
        if edge.type == "collide_at" and edge.kind not in (None, "sideswipe"):
            continue
        if edge.from_ is not agents[0]:
            edge.from_, edge.to = edge.to, edge.from_
        edge.manoeuvre = _find_change(edge)
        if edge.type == "collide_at":
            edge.kind = "sideswipe"
        return edge
    return None


def read_lanes(result: Interpretation, note: str) -> None:
    """Lane changes and following close up, once it is known what else the two do.

    Args:
        note: why such words become nothing where they are not said of two agents.
    """
    for span in result.lanes:
        users = (*span.subjects[:1], *span.objects[:1])
        agents = result.list_agents(users)
        if len(agents) != 2 or span.negated:
            result.enter(span, "nothing", span.subjects, note=note)
            continue
        edge = _find_lane_relation(result, agents, span.value or "")
        result.enter(span, "manoeuvre", users, edge.manoeuvre)
    result.lanes = []


def _find_lane_relation(
    result: Interpretation, agents: list[AgentDraft], value: str
) -> RelationDraft:
    """The relation of the two as a manoeuvre; a new one where nothing else is said of them."""
    follows = value == "tailgate"
    kinds: tuple[RelationType, ...] = ("follow",) if follows else ("near_miss", "collide_at")
    pair = frozenset(map(id, agents))
    found = [e for e in result.draft.relations if e.type in kinds and e.pair() == pair]
    if not found:
        found = [RelationDraft(kinds[0], agents[0], agents[1])]
        result.draft.relations += found
    edge = found[0]
    edge.from_, edge.to = agents
    edge.manoeuvre = find_marked("manoeuvre", "close") if follows else _find_change(edge)
    if edge.type == "collide_at":
        edge.kind = "sideswipe"
    return edge


def settle_lead_braking(result: Interpretation) -> None:
    """Hard braking ahead of another agent in its lane is a manoeuvre of their relation."""
    for user in sorted(result.braking):
        agent = result.users.get(user)
        if agent is None or agent.type != "vehicle":
            continue
        for edge in result.draft.relations:
            if not _is_braking_ahead(result, edge, agent):
                continue
            edge.manoeuvre = find_marked("manoeuvre", "brakes")
            if edge.type == "collide_at":
                edge.kind = "rear_end"
            if edge.from_ is agent:  # `from` is the agent that drives behind
                edge.from_, edge.to = edge.to, agent
            for n, entry in enumerate(result.entries):
                if entry.became == "cause" and entry.users == (user,):
                    result.entries[n] = replace(entry, became="manoeuvre", value=edge.manoeuvre)
    _drop_follows(result)


def _is_braking_ahead(result: Interpretation, edge: RelationDraft, agent: AgentDraft) -> bool:
    """Whether the agent drives ahead of the other of the edge, in its lane, and brakes."""
    other = edge.to if agent is edge.from_ else edge.from_
    if agent not in (edge.from_, edge.to) or other.type != "vehicle":
        return False
    if edge.type == "follow":
        return agent is edge.to
    if edge.type == "collide_at":
        return agent is edge.to and (edge.kind == "rear_end" or _is_in_line(result, agent, other))
    return edge.type == "near_miss" and _is_in_line(result, agent, other)


def _is_in_line(result: Interpretation, agent: AgentDraft, other: AgentDraft) -> bool:
    """Whether words have the agent ahead of the other: its name, the other's, or a follow."""
    follows = any(
        edge.type == "follow" and edge.from_ is other and edge.to is agent
        for edge in result.draft.relations
    )
    named = _AHEAD.search(agent.head) or _BEHIND.search(other.head)
    into_the_back = any(
        _INTO_THE_BACK.search(entry.span.words)
        for entry in result.entries
        if entry.became == "relation" and result.list_agents(entry.users) == [other, agent]
    )
    return follows or named is not None or into_the_back


def _drop_follows(result: Interpretation) -> None:
    """An agent that hits or nearly hits a braking leader follows it: one relation says both."""
    relations, by_braking = result.draft.relations, find_marked("manoeuvre", "brakes")
    others = {e.pair() for e in relations if e.manoeuvre == by_braking and e.type != "follow"}
    dropped = [e for e in relations if e.type == "follow" and e.pair() in others]
    relations[:] = [each for each in relations if each not in dropped]
    for n, entry in enumerate(result.entries):
        pair = frozenset(map(id, result.list_agents(entry.users)))
        if entry.became == "relation" and entry.value == "follow" and pair in others:
            result.entries[n] = replace(entry, became="manoeuvre", value=by_braking)
