"""Language models that plan something other than the request get no verified scene."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import pytest

from scenewright import synthesize
from scenewright.backends import Question
from scenewright.errors import BackendFault, InputError
from scenewright.graph.run import Scene
from scripted import Script, build_scripted_backend

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
HOSTILE: Any = importlib.import_module("hostile_models")
ATTACKS = list(HOSTILE.list_attacks())
QUICK = ATTACKS[::5]  # benchmarks/hostile_models.py makes them all
HALF = "A car yields to a pedestrian and a truck runs a red light and hits a van"
YIELD = {
    "agents": [{"id": "vehicle-1", "subtype": "car"}, {"id": "pedestrian-1"}],
    "relations": [{"type": "yield_to", "from": "vehicle-1", "to": "pedestrian-1"}],
    "context": {"background": {"vehicles": 0, "pedestrians": 0}},
}


def make(text: str, plan: Script) -> Scene:
    backend = build_scripted_backend({"plan": [plan]}, forever=True)
    return synthesize(text, backend=backend, seed=1, refiner="none")


@pytest.mark.parametrize("attack", QUICK, ids=[each.name for each in QUICK])
def test_a_hostile_model_gets_no_verified_scene(attack: Any) -> None:
    scene = attack.make()
    assert scene is None or scene.proof.verdict != "verified"


@pytest.mark.parametrize(("text", "roles"), HOSTILE.CLAUSES)
def test_an_honest_model_gets_one(text: str, roles: str) -> None:
    """Otherwise the attacks would prove nothing."""
    plan = HOSTILE.build_plan(roles, text, "", "half")
    scene = HOSTILE.Attack("honest", text, plan, seed=1).make()
    assert scene.proof.verdict == "verified"


def test_words_of_a_half_planned_request_go_back_once_and_are_refused() -> None:
    asked: list[Question] = []

    def plan(question: Question) -> dict[str, Any]:
        asked.append(question)
        words = [("A car", "agent"), ("yields to", "relation"), ("a pedestrian", "agent")]
        return {**YIELD, "said": [{"words": w, "became": b} for w, b in words]}

    with pytest.raises(InputError, match="something else than") as caught:
        make(HALF, plan)
    first, second = asked
    assert first.rejections == ()
    assert "note them in said as constraint or behavior" in second.rejections[0]
    for word in ("truck", "red light", "hits", "van"):
        assert f"'{word}'" in second.rejections[0]
        assert f"'{word}'" in str(caught.value)


def test_an_account_in_another_form_is_told_and_not_dropped() -> None:
    said = ["A car = agent vehicle-1", "yields to = relation vehicle-1 pedestrian-1"]
    with pytest.raises(BackendFault, match=r"said\.0: Input should be a valid dictionary"):
        make(HALF, {**YIELD, "said": said})


def test_a_plan_of_nothing_is_no_scene_where_the_request_names_an_event() -> None:
    nothing: dict[str, Any] = {"agents": [], "relations": []}
    with pytest.raises(InputError, match=r"something else than 'car'.*'hits'.*'bus'"):
        make("A car hits a bus", nothing)
    scene = make("Quiet traffic at 8 am, nothing happens", {**nothing, "context": {
        "density": "low", "time_of_day": "08:00"}})  # fmt: skip
    assert scene.proof.verdict == "verified"
