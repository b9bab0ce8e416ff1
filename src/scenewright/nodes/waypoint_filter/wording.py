"""The filter's question in words: the clauses that remaining words ask for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scenewright.backends import Wording
from scenewright.nodes.waypoint_filter.reply import clauses_schema, offered
from scenewright.nodes.wording import (
    faults_told,
    quoted,
    worded,
    words_told,
)

_MEANS = {
    "speed": "its free speed; cars drive 5 to 14, people walk 1 to 1.7, nobody faster",
    "passes_through": "the path crosses it",
    "near": "their paths come that close",
    "headway": "first follows second so many seconds behind",
    "before": "first passes the place where they meet first",
    "time_gap": "seconds between the two there (PET)",
}


def worded_clauses(
    facts: Mapping[str, Any],
    legs: Sequence[str],
    *,
    rejections: Sequence[str] = (),
) -> Wording:
    """What a model is asked for clauses, and the schema of its reply."""
    agents, relations, words = facts["agents"], facts["relations"], facts["words"]
    offer = offered(relations)
    values = {
        "clauses": "\n".join(f"{k}({', '.join(keys)}): {_MEANS[k]}" for k, keys in offer.items()),
        "agents": ", ".join(f"{each['id']} ({each['movement']})" for each in agents) or "none",
        "relations": "; ".join(f"{e['from']} {e['type']} {e['to']}" for e in relations) or "none",
        "program": "; ".join(facts["program"].splitlines()),
        "words": words_told(words),
        "instruction": quoted(facts["instruction"]),
        "faults": faults_told(rejections),
    }
    schema = clauses_schema(agents, legs, relations, len(words))
    return worded("waypoint_filter", "prompt.md", values, schema=schema)
