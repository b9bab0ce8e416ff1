"""The reasoner's question in words: the standstills that remaining words ask for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scenewright.backends import Prompt
from scenewright.nodes.event_reasoner.reply import build_stops_schema
from scenewright.nodes.prompts import (
    format_json,
    format_rejections,
    format_words,
    quote_text,
    render_prompt,
)
from scenewright.scene.behavior import AgentSummary, EventSummary


def render_stops_prompt(
    facts: Mapping[str, Any], summary: EventSummary, *, rejections: Sequence[str] = ()
) -> Prompt:
    """What a model is asked for standstills (paper 3.4, Eq. 5), and the schema of its reply.

    Args:
        summary: of the agents that the request names.
    """
    words = facts["words"]
    # When what was solved for happens: closest approach, contact, the beginning of a wait.
    solved = [
        f"{each['clause']} at {each['time']:g} s"
        for each in summary.evidence
        if each.get("time") is not None
    ]
    values = {
        "instruction": quote_text(facts["instruction"]),
        "relations": "; ".join(facts["relations"]) or "none",
        "evidence": f"Solved: {'; '.join(solved)}." if solved else "",
        "agents": format_json(
            {agent.agent: _describe_agent(agent, summary.duration) for agent in summary.agents}
        ),
        "words": format_words(words),
        "faults": format_rejections(rejections),
    }
    schema = build_stops_schema(summary.agents, len(words))
    return render_prompt("event_reasoner", "prompt.md", values, schema=schema)


def _describe_agent(agent: AgentSummary, duration: float) -> dict[str, Any]:
    """Places with the way [m] to them, and the segments that are written."""
    return {
        "places": [[anchor.id, round(anchor.s, 1)] for anchor in agent.anchors],
        "segments": [
            f"{each.status} {each.start:.1f}-{each.end:.1f} s {each.anchor}"
            for each in agent.suggest_segments(duration)
        ],
    }
