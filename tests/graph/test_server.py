"""The graph as a LangGraph server runs it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenewright.graph.run import synthesize
from scenewright.graph.server import make_graph

QUICK = "Light traffic at dawn, no incidents."
CONFIG = Path(__file__).parents[2] / "langgraph.json"


def test_the_server_makes_the_scene_that_python_makes() -> None:
    reply = make_graph().invoke({"instruction": QUICK, "seed": 3})
    assert reply["scene"] == synthesize(QUICK, seed=3).record.to_json()
    assert reply["proof"]["verified"] is True
    assert reply["refusal"] is None
    json.dumps(reply)


@pytest.mark.parametrize(
    ("request_", "code", "reason"),
    [
        ({"instruction": "Write a poem."}, "unusable_input", "traffic"),
        ({"instruction": 3}, "unusable_input", "string"),
        ({"seed": 3}, "unusable_input", "instruction"),
        ({"instruction": QUICK, "seed": "3"}, "unusable_input", "seed"),
        ({"instruction": QUICK, "seed": -3}, "unusable_input", "seed"),
        ({"instruction": QUICK, "intersection": "nowhere"}, "unusable_input", "nowhere"),
        (
            {"instruction": "A car turns left from the north and leaves to the north."},
            "unsatisfiable",
            "north",
        ),
    ],
)
def test_a_refusal_is_an_answer(request_: dict[str, object], code: str, reason: str) -> None:
    reply = make_graph().invoke(request_)
    assert (reply["scene"], reply["proof"], reply["refusal"]["code"]) == (None, None, code)
    assert reason in reply["refusal"]["reason"]


def test_stages_are_streamed_as_they_go() -> None:
    said = list(make_graph().stream({"instruction": QUICK}, stream_mode="custom"))
    assert [each["stage"] for each in said][:2] == ["scene_planner", "agent_generator"]
    assert said[-1]["stage"] == "scene_verifier"


def test_a_client_can_see_what_to_send() -> None:
    schema = make_graph().get_input_jsonschema()
    assert schema["required"] == ["instruction"]
    assert set(schema["properties"]) == {"instruction", "seed", "intersection"}


def test_the_server_finds_the_factory() -> None:
    path, factory = json.loads(CONFIG.read_text())["graphs"]["make"]["path"].split(":")
    assert (CONFIG.parent / path).is_file()
    assert factory == make_graph.__name__
