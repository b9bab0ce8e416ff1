"""The filter's question in words: the clauses that remaining words ask for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scenewright.backends import Prompt
from scenewright.nodes.prompts import (
    format_rejections,
    format_words,
    quote_text,
    render_prompt,
)
from scenewright.nodes.waypoint_filter.reply import build_clauses_schema, list_offered_kinds

_MEANS = {
    "speed": "its free speed; cars drive 5 to 14, people walk 1 to 1.7, nobody faster",
    "passes_through": "the path crosses it",
    "near": "their paths come that close",
    "headway": "first follows second so many seconds behind",
    "before": "first passes the place where they meet first",
    "time_gap": "seconds between the two there (PET)",
}


def render_clauses_prompt(
    facts: Mapping[str, Any],
    legs: Sequence[str],
    *,
    rejections: Sequence[str] = (),
) -> Prompt:
    """What a model is asked for clauses, and the schema of its reply."""
    agents, relations, words = facts["agents"], facts["relations"], facts["words"]
    offer = list_offered_kinds(relations)
    values = {
        "clauses": "\n".join(f"{k}({', '.join(keys)}): {_MEANS[k]}" for k, keys in offer.items()),
        "agents": ", ".join(f"{agent['id']} ({agent['movement']})" for agent in agents) or "none",
        "relations": "; ".join(f"{e['from']} {e['type']} {e['to']}" for e in relations) or "none",
        "program": "; ".join(facts["program"].splitlines()),
        "words": format_words(words),
        "instruction": quote_text(facts["instruction"]),
        "faults": format_rejections(rejections),
    }
    schema = build_clauses_schema(agents, legs, relations, len(words))
    return render_prompt("waypoint_filter", "prompt.md", values, schema=schema)
