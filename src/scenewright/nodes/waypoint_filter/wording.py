"""The filter's question in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scenewright.backends import Wording
from scenewright.nodes.waypoint_filter.reply import program_schema, wanted_by
from scenewright.nodes.wording import (
    Example,
    compact,
    examples_told,
    faults_told,
    quoted,
    worded,
)
from scenewright.scene.relations import pattern_named

_SEVERITY = (
    "kind", "cause", "target_pet", "target_ttc", "impact_speed", "point_from", "point_to",
)  # fmt: skip


def worded_program(
    facts: Mapping[str, Any],
    legs: Sequence[str],
    *,
    rejections: Sequence[str] = (),
    examples: Sequence[Example] = (),
) -> Wording:
    """What a model is asked for constraints, and the schema of its reply.

    Only those that the request tells of are shown; everybody else is seated around them.
    """
    agents = facts["told"]
    values = {
        "agents": ", ".join(f"{each['id']} ({each['movement']})" for each in agents) or "none",
        "relations": compact([_relation(each) for each in facts["relations"]]),
        "violators": ", ".join(facts["violators"]) or "nobody",
        "examples": examples_told(examples),
        "instruction": quoted(facts["instruction"]),
        "faults": faults_told(rejections),
    }
    return worded("waypoint_filter", "prompt.md", values, schema=program_schema(agents, legs))


def _relation(relation: Mapping[str, Any]) -> dict[str, Any]:
    severity = {key: relation[key] for key in _SEVERITY if relation[key] is not None}
    wants = wanted_by(
        pattern_named(relation["pattern"]),
        from_=relation["from"],
        to=relation["to"],
        striker=relation["striker"],
        struck=relation["struck"],
    )
    ends = {"type": relation["type"], "from": relation["striker"], "to": relation["struck"]}
    return {**ends, **severity, "wants": wants}
