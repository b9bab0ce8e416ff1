"""A language model reads the scene in words and answers in names that exist."""

from __future__ import annotations

import json
import math
import re
from typing import Any

import pytest

from scenewright.backends import Question, load_backend
from scenewright.errors import BackendFault, InputError
from scenewright.evals.understanding.cases import ObservedScene, SceneCase, observe
from scenewright.evals.understanding.language_model import TASK, name_agents
from scenewright.evals.understanding.pipeline import (
    ATTEMPTS,
    METHODS,
    apply_rules,
    ask_agent,
    find_method,
    predict_constant_velocity,
    reason,
)
from scenewright.evals.understanding.scoring import ScenePrediction
from scripted import build_scripted_backend


def ask(row: ObservedScene, *replies: Any) -> tuple[ScenePrediction, list[Any]]:
    """What is predicted after these replies of the model, and what it was asked."""
    backend = build_scripted_backend({TASK: list(replies)})
    said = ask_agent(row, backend, predict_constant_velocity, "constant velocity")
    return said, backend.text_model.asked


def all_north(question: Question, *relations: tuple[str, str, str]) -> dict[str, Any]:
    return {
        "exits": dict.fromkeys(question.facts["agents"], "north"),
        "relations": [{"type": t, "from": a, "to": b} for t, a, b in relations],
    }


@pytest.fixture
def row(cases: dict[str, SceneCase]) -> ObservedScene:
    """A car and the pedestrian whom it will hit, both in sight."""
    record = cases["struck"].record
    begun = max(agent.spawn_time for agent in record.agents[:2])
    return observe(record, scene="struck", window=math.ceil(begun) + 2.0)


def test_the_answer_is_converted_to_ids(row: ObservedScene) -> None:
    def reply(question: Question) -> dict[str, Any]:
        one, two = question.facts["agents"][:2]
        return all_north(question, ("yielding", two, one))

    said, asked = ask(row, reply)
    codes = [agent.id for agent in row.agents]
    assert said.exits == dict.fromkeys(codes, "north")
    names = dict(zip(asked[0][0].facts["agents"], codes, strict=True))
    (found,) = said.relations or ()
    one, two = list(names)[:2]
    assert found.key == ("yielding", names[two], names[one])


def test_the_prompt_holds_entrances_and_findings_and_no_coordinates(row: ObservedScene) -> None:
    _, ((_, prompt),) = ask(row, all_north)
    assert "first seen" in prompt.user
    assert "Rule checker on the tracks that constant velocity predicts" in prompt.user
    assert "north crosswalk" in prompt.user
    assert "statistical model: leaves" in prompt.user
    for agent in row.agents:
        assert agent.id not in prompt.user
        for x, y in agent.xy.tolist():
            for number in (f"{x:.2f}", f"{y:.2f}", f"{x:.1f}", f"{y:.1f}"):
                assert number.lstrip("-") not in re.findall(r"\d+\.\d+", prompt.user)
    schema = json.dumps(prompt.schema)
    assert "vehicle-1" in schema
    assert "vehicle-99" not in schema


def test_names_that_do_not_exist_go_back_with_the_reason(row: ObservedScene) -> None:
    said, asked = ask(
        row,
        lambda question: all_north(question, ("collision", "vehicle-99", "vehicle-1")),
        lambda question: all_north(question, ("collision", "vehicle-1", "vehicle-1")),
        all_north,
    )
    assert said.relations == ()
    users = [prompt.user for _, prompt in asked]
    assert "refused" not in users[0]
    assert "vehicle-99" in users[1]
    assert "with itself" in users[2]


def test_after_all_attempts_model_and_checker_answer(
    row: ObservedScene,
) -> None:
    said, asked = ask(row, *["I do not know"] * ATTEMPTS)
    assert len(asked) == ATTEMPTS
    by_rules = apply_rules(row, predict_constant_velocity)
    assert (said.exits, said.relations) == (reason(row).exits, by_rules.relations)


def test_a_backend_that_fails_for_good_raises(row: ObservedScene) -> None:
    with pytest.raises(BackendFault):
        ask(row)


def test_names_are_numbered_by_code(cases: dict[str, SceneCase]) -> None:
    names = name_agents(observe(cases["plain"].record, scene="plain", window=5.0))
    assert list(names) == sorted(names)
    assert len(set(names.values())) == len(names)


def test_methods_that_lack_something_say_what() -> None:
    place = "amsterdam_120"
    with pytest.raises(InputError, match="needs --backend"):
        find_method("agent", intersection=place)
    with pytest.raises(InputError, match="which builtin is not"):
        find_method("agent", intersection=place, backend=load_backend("builtin"))
    with pytest.raises(InputError, match="one of: gmm"):
        find_method("gpt", intersection=place)
    for name in set(METHODS) - {"agent", "trajnet"}:
        assert find_method(name, intersection=place).name == name
