"""The reasoner's two questions in words: which places matter, and which segments there are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scenewright.backends import Wording
from scenewright.nodes.event_reasoner.reply import behavior_schema, summary_schema
from scenewright.nodes.wording import (
    Example,
    compact,
    faults_told,
    quoted,
    worded,
)
from scenewright.scene.behavior import AgentSummary, EventSummary


def worded_summary(
    instruction: str,
    summary: EventSummary,
    owed: Mapping[str, Sequence[str]],
    relations: Sequence[str],
    *,
    rejections: Sequence[str] = (),
) -> Wording:
    """What a model is asked for an event summary (paper 3.4), and the schema of its reply."""
    agents = bound(summary, owed)
    ways = {
        each.agent: {
            "anchors": _passed(each),
            **({"stays": [stay.anchor for stay in each.stays]} if each.stays else {}),
        }
        for each in agents
    }
    values = _shared(instruction, summary, relations, agents, rejections) | {
        "agents": compact(ways)
    }
    return worded("event_reasoner", "summary.md", values, schema=summary_schema(agents))


def worded_behavior(
    instruction: str,
    summary: EventSummary,
    owed: Mapping[str, Sequence[str]],
    relations: Sequence[str],
    *,
    rejections: Sequence[str] = (),
    examples: Sequence[Example] = (),
) -> Wording:
    """What a model is asked for segments (paper Eq. 5), and the schema of its reply."""
    agents = bound(summary, owed)
    values = _shared(instruction, summary, relations, agents, rejections) | {
        "agents": compact(
            {each.agent: _agent(each, owed[each.agent], summary.duration) for each in agents}
        ),
    }
    schema = behavior_schema(agents, summary.duration)
    return worded("event_reasoner", "prompt.md", values, schema=schema, examples=examples)


def bound(summary: EventSummary, owed: Mapping[str, Sequence[str]]) -> tuple[AgentSummary, ...]:
    """Those whom relations bind; the others keep to what the solver found."""
    return tuple(each for each in summary.agents if each.agent in owed)


def _shared(
    instruction: str,
    summary: EventSummary,
    relations: Sequence[str],
    agents: Sequence[AgentSummary],
    rejections: Sequence[str],
) -> dict[str, str]:
    return {
        "instruction": quoted(instruction),
        "relations": "; ".join(relations),
        "evidence": _evidence(summary),
        "names": ", ".join(each.agent for each in agents),
        "faults": faults_told(rejections),
    }


def _evidence(summary: EventSummary) -> str:
    """When what was solved for happens: closest approach, contact, the beginning of a wait."""
    told = [
        f"{each['clause']} at {each['time']:g} s"
        for each in summary.evidence
        if each.get("time") is not None
    ]
    return f"Solved: {'; '.join(told)}." if told else ""


def _agent(agent: AgentSummary, owed: Sequence[str], duration: float) -> dict[str, Any]:
    told: dict[str, Any] = {
        "enters": max(agent.enters, 0.0),
        "leaves": agent.leaves,
        "anchors": _passed(agent),
    }
    if agent.stays:
        told["stays"] = [[stay.anchor, stay.start, stay.until] for stay in agent.stays]
    if agent.contact is not None:
        told["contact"] = agent.contact
    # Who stands until it is hit, say, has nothing left to proceed to.
    possible = {segment.status for segment in agent.suggest_segments(duration)}
    return {**told, "needs": [status for status in owed if status in possible]}


def _passed(agent: AgentSummary) -> list[list[Any]]:
    return [[each.id, None if each.time is None else round(each.time, 1)] for each in agent.anchors]
