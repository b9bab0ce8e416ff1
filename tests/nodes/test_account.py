"""The account of words of a language model's plan."""

from __future__ import annotations

from typing import Any

import pytest

from scenewright.backends import Question
from scenewright.errors import Rejected
from scenewright.nodes.scene_planner import PlanReply
from scenewright.nodes.scene_planner.account import UNSAID, complete_account
from scenewright.scene.social import SocialGraph

TEXT = "Two cars crash, not at night, in the rain"


def graph(*said: tuple[str, str]) -> SocialGraph:
    agents = [{"id": f"vehicle-{k}", "type": "vehicle"} for k in (1, 2)]
    edges = [{"type": "collide_at", "from": "vehicle-1", "to": "vehicle-2"}]
    entries: list[dict[str, Any]] = [{"words": words, "became": became} for words, became in said]
    return SocialGraph.model_validate({"agents": agents, "relations": edges, "said": entries})


def question(*rejections: str) -> Question:
    return Question("plan", {"instruction": TEXT, "previous": None}, rejections=rejections)


ALL = (("Two cars", "agent"), ("crash", "relation"), ("not at night", "nothing"),
       ("in the rain", "nothing"))  # fmt: skip


def test_words_are_found_in_the_request() -> None:
    said = complete_account(graph(*ALL), question())
    assert [TEXT[each.start : each.end] for each in said] == [words for words, _ in ALL]


def test_words_that_the_request_does_not_hold_are_no_account_of_it() -> None:
    said = complete_account(graph(("three cars", "agent"), *ALL), question())
    assert [each.words for each in said] == [words for words, _ in ALL]


def test_a_model_writes_its_account_in_short() -> None:
    reply = {
        "agents": [{"id": "vehicle-1"}], "relations": [],
        "said": ["A car = agent vehicle-1", "in the rain = nothing", "no entry", "x = unheard-of"],
    }  # fmt: skip
    plan = PlanReply.model_validate(reply).root
    assert isinstance(plan, SocialGraph)
    assert [(each.words, each.became, each.agents) for each in plan.said] == [
        ("A car", "agent", ("vehicle-1",)), ("in the rain", "nothing", ()),
    ]  # fmt: skip


def test_the_plan_says_what_exactly_the_words_became() -> None:
    agents = [
        {"id": "vehicle-1", "type": "vehicle", "entry": "north"},
        {"id": "vehicle-2", "type": "vehicle", "entry": "east"},
    ]
    edges = [{"type": "near_miss", "from": "vehicle-1", "to": "vehicle-2"}]
    said = [
        {"words": "Two cars", "became": "entry", "agents": ["vehicle-1", "vehicle-2"]},
        {"words": "crash", "became": "relation", "agents": ["vehicle-2"]},
        {"words": "not at night", "became": "time_of_day"},
        {"words": "in the rain", "became": "nothing"},
    ]
    context = {"time_of_day": "08:00"}
    plan = {"agents": agents, "relations": edges, "context": context, "said": said}
    found = complete_account(SocialGraph.model_validate(plan), question())
    assert [(each.became, each.agents, each.value) for each in found] == [
        ("entry", ("vehicle-1",), "north"), ("entry", ("vehicle-2",), "east"),
        ("relation", ("vehicle-1", "vehicle-2"), "near_miss"),
        ("time_of_day", (), "08:00"), ("nothing", (), None),
    ]  # fmt: skip


def test_words_called_what_the_plan_lacks_are_asked_for_once() -> None:
    claimed = graph(("Two cars", "agent"), ("crash", "movement"), ("not at night", "nothing"),
                    ("in the rain", "nothing"))  # fmt: skip
    with pytest.raises(Rejected, match=f"{UNSAID} 'crash'") as caught:
        complete_account(claimed, question())
    said = complete_account(claimed, question(caught.value.rejection.detail))
    (crash,) = (each for each in said if each.words == "crash")
    assert (crash.became, crash.note) == ("nothing", "the plan says nothing of it")


def test_a_number_and_a_negation_left_out_are_asked_for_once() -> None:
    part = graph(("crash", "relation"), ("in the rain", "nothing"))
    with pytest.raises(Rejected, match=UNSAID) as caught:
        complete_account(part, question())
    assert "'Two'" in str(caught.value)
    assert "'not'" in str(caught.value)
    said = complete_account(part, question(caught.value.rejection.detail))
    assert {each.words for each in said if each.became == "nothing"} >= {"Two", "not"}
