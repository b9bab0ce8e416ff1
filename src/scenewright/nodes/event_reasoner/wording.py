"""The reasoner's question in words: the standstills that remaining words ask for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scenewright.backends import Wording
from scenewright.nodes.event_reasoner.reply import stops_schema
from scenewright.nodes.wording import compact, faults_told, quoted, worded, words_told
from scenewright.scene.behavior import AgentSummary, EventSummary, Segment


def worded_stops(
    facts: Mapping[str, Any], summary: EventSummary, *, rejections: Sequence[str] = ()
) -> Wording:
    """What a model is asked for standstills (paper 3.4, Eq. 5), and the schema of its reply.

    Args:
        summary: of the agents that the request tells of.
    """
    words = facts["words"]
    values = {
        "instruction": quoted(facts["instruction"]),
        "relations": "; ".join(facts["relations"]) or "none",
        "evidence": _evidence(summary),
        "agents": compact({each.agent: _agent(each, summary.duration) for each in summary.agents}),
        "words": words_told(words),
        "faults": faults_told(rejections),
    }
    schema = stops_schema(summary.agents, len(words))
    return worded("event_reasoner", "prompt.md", values, schema=schema)


def _evidence(summary: EventSummary) -> str:
    """When what was solved for happens: closest approach, contact, the beginning of a wait."""
    told = [
        f"{each['clause']} at {each['time']:g} s"
        for each in summary.evidence
        if each.get("time") is not None
    ]
    return f"Solved: {'; '.join(told)}." if told else ""


def _agent(agent: AgentSummary, duration: float) -> dict[str, Any]:
    """Places with the way [m] to them, and the segments that are written."""
    return {
        "places": [[each.id, round(each.s, 1)] for each in agent.anchors],
        "segments": [_segment(each) for each in agent.suggest_segments(duration)],
    }


def _segment(segment: Segment) -> str:
    return f"{segment.status} {segment.start:.1f}-{segment.end:.1f} s {segment.anchor}"
