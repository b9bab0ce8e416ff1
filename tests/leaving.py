"""A backend that leaves words to every stage, and serves them by rule: all questions are asked."""

from __future__ import annotations

from typing import Any

from scenewright.backends import Question, load_backend

YIELD = "A car from the south turning right yields to a pedestrian. Nobody else is around."
LEFT = (("A car", "constraint", "vehicle-1"), ("pedestrian", "behavior", "pedestrian-1"))
"""Words of it, the account they get, and whose they are."""


class Leaving:
    """The builtin backend, whose plans leave words to the filter and to the reasoner."""

    name, deterministic = "leaving", False

    def __init__(self) -> None:
        self._rule = load_backend("builtin")

    def answer(self, question: Question) -> dict[str, Any]:
        match question.task:
            case "plan":
                reply = self._rule.answer(question)
                left = [{"words": w, "became": b, "agents": [a]} for w, b, a in LEFT]
                return {**reply, "said": [*reply["said"], *left]}
            case "constraints":
                speed = {"clause": "speed", "words": 1, "agent": "vehicle-1", "low": 1, "high": 19}
                return {"clauses": [speed], "cannot": []}
        walker = question.facts["agents"][-1]
        kerb = next(each["id"] for each in walker["anchors"] if "kerb" in each["id"])
        stop = {"words": 1, "agent": walker["agent"], "place": kerb, "ahead": 3.0, "lasts": 1.0}
        return {"stops": [stop], "cannot": []}
