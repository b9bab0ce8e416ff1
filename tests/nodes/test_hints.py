"""Hints of a language model on words of a request."""

from __future__ import annotations

import re
from typing import Any

import pytest

from benchmarks.inlined_schema import inline_references
from scenewright.backends import Question
from scenewright.errors import Rejected
from scenewright.nodes.scene_planner import FOUR_LEGS, PlanReply, ask_for_plan
from scenewright.nodes.scene_planner.hints import HINTS, locate_hints
from scenewright.nodes.scene_planner.prompts import render_plan_prompt
from scenewright.scene.social import SocialGraph
from scripted import build_scripted_backend

TEXT = "Two cars crash, not at night, in the rain, and a car runs"


def build_plan(*said: dict[str, Any]) -> SocialGraph:
    agents = [{"id": "vehicle-1"}, {"id": "vehicle-2"}, {"id": "pedestrian-1", "motion": "runs"}]
    edge = {"type": "collide_at", "from": "vehicle-1", "to": "vehicle-2", "first": "vehicle-2"}
    reply = {"agents": agents, "relations": [edge], "said": list(said)}
    plan = PlanReply.model_validate(reply).root
    assert isinstance(plan, SocialGraph)
    return plan


def test_words_are_found_in_the_request_and_others_dropped() -> None:
    words = ("in the rain", "three cars", "not at night", "in the")
    found = list(
        locate_hints(build_plan(*({"words": w, "became": "nothing"} for w in words)), TEXT)
    )
    assert [each.words for each in found] == ["in the rain", "not at night", "in the"]
    assert [TEXT[each.start : each.end] for each in found] == [each.words for each in found]


@pytest.mark.parametrize(
    ("became", "agents", "found"),
    [
        ("relation", ["vehicle-2"], [(("vehicle-1", "vehicle-2"), "collide_at")]),
        ("relation", ["pedestrian-1"], []),
        ("constraint", ["vehicle-1"], [(("vehicle-1",), None)]),
        ("cause", ["vehicle-1"], [(("vehicle-1",), None)]),
        ("measure", ["vehicle-1"], []),
        ("entry", ["vehicle-1"], []),
    ],
)
def test_the_plan_says_what_exactly_the_words_became(
    became: str, agents: list[str], found: list[Any]
) -> None:
    """A value that the model gives is none; what no later stage uses and the plan lacks no hint."""
    entry = {"words": "crash", "became": became, "agents": agents, "value": "follow"}
    hints = locate_hints(build_plan(entry), TEXT)
    assert [(each.agents, each.value) for each in hints] == found


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ("A car = agent vehicle-1", r"said\.0: Input should be a valid dictionary"),
        ({"words": "a car", "became": "unheard-of"}, r"became: Input should be 'agent', 'entry'"),
        ({"words": "", "became": "nothing"}, "words: .*at least 1 character"),
        ({"became": "nothing"}, "words: is missing"),
        ({"words": "a car", "became": "agent", "whose": 1}, "whose: there is no such key"),
    ],
)
def test_a_malformed_entry_is_told_and_not_dropped(entry: Any, reason: str) -> None:
    reply = {"agents": [{"id": "vehicle-1"}], "relations": [], "said": [entry]}
    question = Question(
        "plan", {"instruction": TEXT}, prompt=lambda: render_plan_prompt(TEXT, None, FOUR_LEGS)
    )
    with pytest.raises(Rejected, match=reason) as caught:
        ask_for_plan(build_scripted_backend({"plan": [reply]}), question, FOUR_LEGS)
    assert caught.value.rejection.code == "malformed_reply"


@pytest.mark.parametrize(
    "words", ["90 km/h = zu schnell", "vehicle_1, für Fußgänger", "the driver's 0.5 s…"]
)
def test_the_schema_lets_through_what_requests_hold(words: str) -> None:
    schema = inline_references(render_plan_prompt(TEXT, None, FOUR_LEGS).schema)
    entry = schema["properties"]["said"]["items"]["properties"]
    assert re.search(entry["words"]["pattern"], words)
    assert entry["became"]["enum"] == list(HINTS)
    assert not re.search(entry["words"]["pattern"], 'a "quoted" car')
