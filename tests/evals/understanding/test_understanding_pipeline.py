"""A language model reads the scene in words and answers in names that exist."""

from __future__ import annotations

import json
import math
import re
from typing import Any

import pytest

from scenewright.backends import Question, load_backend
from scenewright.errors import BackendFault, InputError
from scenewright.evals.understanding.cases import SceneCase
from scenewright.evals.understanding.language_model import TASK, name_agents, require_language_model
from scenewright.evals.understanding.observation import ObservationRow, observe
from scenewright.evals.understanding.pipeline import (
    ATTEMPTS,
    METHODS,
    MethodSettings,
    find_method,
    understand,
)
from scenewright.evals.understanding.rule_baseline import predict_constant_velocity
from scripted import build_scripted_backend


def asking(*replies: Any) -> tuple[MethodSettings, Any]:
    backend = build_scripted_backend({TASK: list(replies)})
    settings = MethodSettings(
        "posterior",
        "language_model",
        predict_constant_velocity,
        "constant velocity",
        backend=backend,
    )
    return settings, backend


def all_north(question: Question, *relations: tuple[str, str, str]) -> dict[str, Any]:
    return {
        "exits": dict.fromkeys(question.facts["agents"], "north"),
        "relations": [{"type": t, "from": a, "to": b} for t, a, b in relations],
    }


@pytest.fixture
def row(cases: dict[str, SceneCase]) -> ObservationRow:
    """A car and the pedestrian whom it will hit, both in sight."""
    record = cases["struck"].record
    begun = max(agent.spawn_time for agent in record.agents[:2])
    return observe(record, scene="struck", window=math.ceil(begun) + 2.0)


def test_the_answer_is_converted_to_ids(row: ObservationRow) -> None:
    def reply(question: Question) -> dict[str, Any]:
        one, two = question.facts["agents"][:2]
        return all_north(question, ("yielding", two, one))

    settings, backend = asking(reply)
    said = understand(row, settings)
    codes = [agent.id for agent in row.agents]
    assert said.exits == dict.fromkeys(codes, "north")
    names = dict(zip(backend.text_model.asked[0][0].facts["agents"], codes, strict=True))
    (found,) = said.relations or ()
    one, two = list(names)[:2]
    assert found.key == ("yielding", names[two], names[one])


def test_the_prompt_holds_entrances_and_findings_and_no_coordinates(row: ObservationRow) -> None:
    settings, backend = asking(all_north)
    understand(row, settings)
    _, prompt = backend.text_model.asked[0]
    assert "first seen" in prompt.user
    assert "Rule checker on the tracks that constant velocity predicts" in prompt.user
    assert "north crosswalk" in prompt.user
    assert "statistical model: leaves" in prompt.user
    for agent in row.agents:
        assert agent.id not in prompt.user
        for x, y in agent.trajectory:
            for number in (f"{x:.2f}", f"{y:.2f}", f"{x:.1f}", f"{y:.1f}"):
                assert number.lstrip("-") not in re.findall(r"\d+\.\d+", prompt.user)
    schema = json.dumps(prompt.schema)
    assert "vehicle-1" in schema
    assert "vehicle-99" not in schema


def test_names_that_do_not_exist_go_back_with_the_reason(row: ObservationRow) -> None:
    settings, backend = asking(
        lambda question: all_north(question, ("collision", "vehicle-99", "vehicle-1")),
        lambda question: all_north(question, ("collision", "vehicle-1", "vehicle-1")),
        all_north,
    )
    said = understand(row, settings)
    assert said.relations == ()
    users = [prompt.user for _, prompt in backend.text_model.asked]
    assert "refused" not in users[0]
    assert "vehicle-99" in users[1]
    assert "with itself" in users[2]


def test_after_all_attempts_model_and_checker_answer(
    row: ObservationRow,
) -> None:
    settings, backend = asking(*["I do not know"] * ATTEMPTS)
    said = understand(row, settings)
    assert len(backend.text_model.asked) == ATTEMPTS
    alone = understand(
        row, MethodSettings("posterior", "rules", predict_constant_velocity, "constant velocity")
    )
    assert (said.exits, said.relations) == (alone.exits, alone.relations)


def test_a_backend_that_fails_for_good_raises(row: ObservationRow) -> None:
    settings, _ = asking()
    with pytest.raises(BackendFault):
        understand(row, settings)


def test_names_are_numbered_by_code(cases: dict[str, SceneCase]) -> None:
    from scenewright.evals.understanding.observation import to_arrays

    seen = to_arrays(observe(cases["plain"].record, scene="plain", window=5.0))
    names = name_agents(seen)
    assert list(names) == sorted(names)
    assert len(set(names.values())) == len(names)


def test_methods_that_lack_something_say_what() -> None:
    place = "amsterdam_120"
    with pytest.raises(InputError, match="needs --backend"):
        find_method("agent", intersection=place)
    with pytest.raises(InputError, match="which builtin is not"):
        require_language_model(load_backend("builtin"))
    with pytest.raises(InputError, match="one of: gmm"):
        find_method("gpt", intersection=place)
    for name in set(METHODS) - {"agent", "trajnet"}:
        assert find_method(name, intersection=place).name == name
