"""Manoeuvres in one lane: which words name one, and what they make of the relations of two."""

from __future__ import annotations

import re
from dataclasses import replace

from scenewright.backends.builtin.draft import AgentDraft, RelationDraft
from scenewright.backends.builtin.reader.interpretation import Interpretation
from scenewright.backends.builtin.reader.reading import (
    RULE_CONFIDENCE,
    Reading,
    ReadSpan,
    build_span,
)
from scenewright.backends.builtin.reader.words import Patterns
from scenewright.scene.kinds import find_marked, list_readings
from scenewright.scene.social import RelationType

_PATTERNS = Patterns("manoeuvres")

_NEAR = 45
"""Characters behind the words of a follow in which it may be said that it is a close one."""


def correct_manoeuvres(reading: Reading) -> Reading:
    """The reading with lights, places and ways of crossing as their words say."""
    spans = [_call_yellow(span) for span in reading.spans]
    for n, span in enumerate(spans):
        if span.tag in ("place", "act") and _PATTERNS.here.search(span.words):
            spans[n] = replace(span, tag="manner")
        elif (span.tag == "place" or span.value == "wrongway") and _PATTERNS.lane_change.search(
            span.words
        ):
            spans[n] = replace(span, tag="act", subjects=span.subjects or (1,))
            spans[n] = replace(spans[n], confidence=RULE_CONFIDENCE)
        elif span.tag == "red" and _PATTERNS.turns_green.search(
            reading.text[span.start : span.end + 15]
        ):
            spans[n] = replace(span, tag="light", confidence=RULE_CONFIDENCE)
    for pattern, motion in list_readings("motion"):  # "darts out in front of"
        if find_marked("motion", motion, of="vehicle") is None:
            for match in pattern.finditer(reading.text):
                tags = [span.tag for span in spans if span.overlaps(match)]
                owner = _find_owner(spans, match, "ped")
                if {"near", "jay", "cross"} & {*tags} and "motion" not in tags and owner:
                    spans.append(build_span(match, "motion", motion, owner))
    for match in _PATTERNS.right_on_red.finditer(reading.text):
        owner = _find_owner(spans, match, "veh")
        if owner and all(span.tag != "red" or not span.overlaps(match) for span in spans):
            spans.append(build_span(match, "red", None, owner, group="red"))
    return reading if spans == list(reading.spans) else replace(reading, spans=tuple(spans))


def _call_yellow(span: ReadSpan) -> ReadSpan:
    """A light that is called yellow is no red one that is run."""
    called = span.tag == "red" and not span.negated and _PATTERNS.called_yellow.search(span.words)
    return replace(span, tag="motion", value="yellow") if called else span


def _find_owner(spans: list[ReadSpan], match: re.Match[str], tag: str) -> tuple[int, ...]:
    """The road user that the words describe, where it is of a class: that of another span there,
    else the last one named."""
    inside = [s for s in spans if s.overlaps(match) and s.tag not in _NAMES and s.subjects]
    named = [span for span in spans if span.tag in _NAMES and span.end <= match.start()]
    about = inside[:1] or sorted(named, key=lambda span: span.end)[-1:]
    owner = about[0].subjects[:1] if about else ()
    of_class = any(span.tag == tag and {*owner} & {*span.subjects} for span in spans)
    return owner if of_class else ()


_NAMES = ("ped", "veh", "ref")


def settle_lanes(result: Interpretation) -> None:
    """Following close up is a manoeuvre of the follow that it belongs to."""
    for n, entry in enumerate(result.entries):
        agents = result.list_agents(entry.users)
        near = entry.span.words + result.text[entry.span.end : entry.span.end + _NEAR]
        if (
            entry.became == "relation"
            and entry.value == "follow"
            and _PATTERNS.close_up.search(near)
        ):
            for edge in result.draft.relations:
                if edge.type == "follow" and list(edge.ends) == agents:
                    edge.manoeuvre = find_marked("manoeuvre", "close")
                    result.entries[n] = replace(entry, became="manoeuvre", value=edge.manoeuvre)


def _find_change(edge: RelationDraft) -> str | None:
    """What a lane change is to a relation."""
    return find_marked("manoeuvre", f"{edge.type} lane")


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
    pair = frozenset(agents)
    found = [e for e in result.draft.relations if e.type in kinds and e.pair == pair]
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
    other = edge.get_other(agent)
    if agent not in edge.ends or other.type != "vehicle":
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
    named = _PATTERNS.ahead.search(agent.head) or _PATTERNS.behind.search(other.head)
    into_the_back = any(
        _PATTERNS.into_the_back.search(entry.span.words)
        for entry in result.entries
        if entry.became == "relation" and result.list_agents(entry.users) == [other, agent]
    )
    return follows or named is not None or into_the_back


def _drop_follows(result: Interpretation) -> None:
    """An agent that hits or nearly hits a braking leader follows it: one relation says both."""
    relations, by_braking = result.draft.relations, find_marked("manoeuvre", "brakes")
    others = {e.pair for e in relations if e.manoeuvre == by_braking and e.type != "follow"}
    dropped = [e for e in relations if e.type == "follow" and e.pair in others]
    relations[:] = [relation for relation in relations if relation not in dropped]
    for n, entry in enumerate(result.entries):
        pair = frozenset(result.list_agents(entry.users))
        if entry.became == "relation" and entry.value == "follow" and pair in others:
            result.entries[n] = replace(entry, became="manoeuvre", value=by_braking)
