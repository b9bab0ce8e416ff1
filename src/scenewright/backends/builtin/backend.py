"""The builtin backend: it plans by its reader, and reads the speeds that words give. No model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scenewright.backends import Question
from scenewright.backends.builtin.draft import Site, is_compass
from scenewright.backends.builtin.planner import plan
from scenewright.backends.builtin.reader.measures import parse_speed_range


class BuiltinBackend:
    """Answers every question by rule, offline; the same question gets the same answer."""

    name = "builtin"
    deterministic = True

    def answer(self, question: Question) -> dict[str, Any]:
        """The reply to a question (see `Backend`)."""
        match question.task:
            case "plan":
                return _plan(question)
            case "constraints":
                return _build_clauses(question.facts["words"])
            case "behavior":
                return {"stops": [], "cannot": [fact["number"] for fact in question.facts["words"]]}
            case "summary" | "edits":
                raise TypeError(f"the builtin backend is not asked for {question.task}")


def _plan(question: Question) -> dict[str, Any]:
    facts = question.facts
    site = Site(
        compass=is_compass(facts.get("legs", ())),
        left_hand=facts.get("left_hand", False),
        roads=tuple(facts.get("roads", {}).items()),
        can_serve=question.can_serve,
    )
    previous = facts.get("previous")
    understood = plan(facts["instruction"], previous=previous, site=site, seed=question.seed)
    return understood.model_dump(mode="json", by_alias=True)


def _build_clauses(words: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Clauses for words that give agents a speed; no others can be read by rule."""
    clauses = [
        {"words": each["number"], "clause": "speed", "agent": agent}
        | dict(zip(("low", "high"), speed, strict=True))
        for each in words
        if all(parse_speed_range(each["words"], agent) for agent in each["agents"])
        for agent in each["agents"]
        if (speed := parse_speed_range(each["words"], agent))
    ]
    served = {clause["words"] for clause in clauses}
    cannot = [word["number"] for word in words if word["number"] not in served]
    return {"clauses": clauses, "cannot": cannot}
