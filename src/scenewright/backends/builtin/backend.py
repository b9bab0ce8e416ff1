"""The builtin backend: a grammar plans, relation files give clauses and segments. No model."""

from __future__ import annotations

from typing import Any

from scenewright.backends import Question
from scenewright.backends.builtin.planner import plan
from scenewright.scene.relations import Pattern, pattern_named


class BuiltinBackend:
    """Answers every question by rule, offline; the same question gets the same answer."""

    name = "builtin"
    deterministic = True

    def answer(self, question: Question) -> dict[str, Any]:
        """The reply to a question (see `Backend`)."""
        match question.task:
            case "plan":
                return _plan(question.facts)
            case "constraints":
                return {"program": _program(question.facts)}
            case "behavior":
                return {
                    "segments": {
                        each["agent"]: _segments(each, question.facts["duration"])
                        for each in question.facts["agents"]
                    }
                }


def _plan(facts: dict[str, Any]) -> dict[str, Any]:
    return plan(facts["instruction"], previous=facts.get("previous")).model_dump(
        mode="json", by_alias=True
    )


def _program(facts: dict[str, Any]) -> str:
    """Every relation's clauses, in order, then those of agents that no relation binds."""
    lines: list[str] = []
    for relation in facts["relations"]:
        lines += _clauses(pattern_named(relation["pattern"]), relation)
    for agent in facts["agents"]:
        name = agent["id"]
        if agent["movement"] != "jaywalking":
            lines.append(f"{'on_road' if agent['type'] == 'vehicle' else 'on_walkable'}({name})")
    for agent in facts["violators"]:
        lines.append(f"runs_red({agent})")
    return "\n".join(dict.fromkeys(lines))


def _clauses(pattern: Pattern, relation: dict[str, Any]) -> list[str]:
    names = {"from": relation["from"], "to": relation["to"]}
    struck = {"from": relation["striker"], "to": relation["struck"]}
    lines = [
        line.format(**(struck if _names_striker(line) else names)) for line in pattern.constraints
    ]
    pair = f"({relation['from']}, {relation['to']}"
    if relation["type"] == "near_miss" and relation["target_pet"] is not None:
        low, high = max(relation["target_pet"] - 0.05, 0.0), relation["target_pet"] + 0.05
        lines = [line for line in lines if not line.startswith("time_gap")]
        lines.append(f"time_gap{pair}) in [{low:g}, {high:g}] s")
    if relation["type"] == "collide_at" and relation["impact_speed"] is not None:
        lines = [
            f"{line[:-1]}, {relation['impact_speed']:g} m/s)" if "contact(" in line else line
            for line in lines
        ]
    return lines


def _names_striker(line: str) -> bool:
    """Contacts in which one drives into the other, whoever plays which role of the pattern."""
    return line.startswith("contact(") and not any(
        kind in line for kind in ("rear_end", "sideswipe", "head_on")
    )


def _segments(agent: dict[str, Any], duration: float) -> list[dict[str, Any]]:
    """Keep, then Stop and Proceed at every stay the solver found, Terminate at a contact."""
    now, moving, segments = agent["enters"], "keep", []
    for stay in agent["stays"]:
        start, until = min(stay["start"], agent["leaves"]), min(stay["until"], agent["leaves"])
        segments.append(_segment(now, start, stay["anchor"], moving))
        segments.append(_segment(start, until, stay["anchor"], "stop"))
        now, moving = until, "proceed"
    if agent["contact"] is not None:
        segments.append(_segment(now, agent["contact"], "contact", moving))
        now, moving = agent["contact"], "terminate"
        segments.append(_segment(now, now, "contact", moving))
    elif agent["leaves"] > now:
        segments.append(_segment(now, min(agent["leaves"], duration), "goal", moving))
    return [segment for segment in segments if segment["end"] >= 0.0]


def _segment(start: float, end: float, anchor: str, status: str) -> dict[str, Any]:
    return {
        "start": round(max(start, 0.0), 3),
        "end": round(max(end, 0.0), 3),
        "anchor": anchor,
        "status": status,
    }
