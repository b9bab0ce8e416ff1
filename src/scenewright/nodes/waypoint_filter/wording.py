"""The filter's question in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scenewright.backends import Wording
from scenewright.nodes.waypoint_filter.reply import Offer, offered, program_schema, wanted_by
from scenewright.nodes.wording import (
    Example,
    compact,
    faults_told,
    quoted,
    traffic_told,
    worded,
)
from scenewright.scene.relations import get_pattern

_MEANS = {
    "min_length": "the path is that long",
    "speed": "its free speed; cars drive 5 to 14, people walk 1 to 1.7, nobody faster",
    "passes_through": "the path crosses it",
    "runs_red": "it ignores its red light",
    "near": "their paths come that close",
    "same_lane": "their paths share a lane for so long",
    "headway": "first follows second so many seconds behind",
    "before": "first passes the place where they meet first",
    "time_gap": "seconds between the two there (PET)",
    "contact": "first hits second; only first and second are needed",
    "gives_way": "first slows or waits until second has passed",
    "brakes_for": "first, a vehicle, brakes hard for second; low, high bound the time to contact",
    "no_interaction": "they have nothing to do with one another",
}
_SEVERITY = (
    "kind", "cause", "braker", "target_pet", "target_ttc", "impact_speed", "point_from", "point_to",
)  # fmt: skip


def worded_program(
    facts: Mapping[str, Any],
    legs: Sequence[str],
    *,
    left_hand: bool = False,
    rejections: Sequence[str] = (),
    examples: Sequence[Example] = (),
) -> Wording:
    """What a model is asked for constraints, and the schema of its reply.

    Only those that the request tells of are shown; everybody else is seated around them.
    """
    agents = facts["told"]
    relations = [_relation(each) for each in facts["relations"]]
    offer = offered(relations, violators=facts["violators"], instruction=facts["instruction"])
    values = {
        "clauses": "\n".join(_clause(kind, keys) for kind, keys in offer.items()) or "none",
        "changes": "".join(f"- {told}\n" for told in _changes(offer, relations)),
        "traffic": traffic_told(left_hand and "contact" in offer),
        "agents": ", ".join(f"{each['id']} ({each['movement']})" for each in agents) or "none",
        "relations": compact(relations),
        "violators": ", ".join(facts["violators"]) or "nobody",
        "instruction": quoted(facts["instruction"]),
        "faults": faults_told(rejections),
    }
    schema = program_schema(agents, legs, offer, relations)
    return worded("waypoint_filter", "prompt.md", values, schema=schema, examples=examples)


def _relation(relation: Mapping[str, Any]) -> dict[str, Any]:
    severity = {key: relation[key] for key in _SEVERITY if relation.get(key) is not None}
    wants = wanted_by(
        get_pattern(relation["pattern"]),
        from_=relation["from"],
        to=relation["to"],
        striker=relation["striker"],
        struck=relation["struck"],
    )
    ends = {"type": relation["type"], "from": relation["striker"], "to": relation["struck"]}
    return {**ends, **severity, "wants": wants}


def _clause(kind: str, keys: Sequence[str]) -> str:
    return f"{kind}({', '.join(keys)}): {_MEANS[kind]}"


def _changes(offer: Offer, relations: Sequence[Mapping[str, Any]]) -> list[str]:
    """What a program has besides, or in place of, what the patterns want."""
    rules = []
    if any("target_pet" in each for each in relations):
        rules.append(
            "target_pet P: time_gap low P-0.05, high P+0.05, in place of the pattern's; for "
            "yield_to beside gives_way."
        )
    if "brakes_for" in offer:
        rules.append(
            "target_ttc T, or cause late_brake with near_miss: brakes_for in place of time_gap "
            "and before, first the braker, low T-0.08, high T+0.08, else 0.7 to 1.35."
        )
    contact = offer.get("contact", ())
    if contact:
        rules.append("Told that the other one strikes: swap first and second of contact.")
    if "speed" in contact:
        rules.append("impact_speed V: speed V in contact.")
    if "point_first" in contact:
        rules.append("point_from, point_to: points of the striking and the struck agent.")
    if "cause" in contact:
        rules.append("cause late_brake with collide_at: cause late_brake in contact.")
    if "runs_red" in offer:
        rules.append('runs_red for everybody under "Runs red", and for nobody else.')
    if "speed" in offer:
        rules.append("speed only if the request gives an agent a figure; leave room around it.")
    return rules
