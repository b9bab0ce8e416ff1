"""What is remembered, for how long, and what it changes in a prompt."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenewright import synthesize
from scenewright.backends.text_backend import TextBackend
from scenewright.errors import BackendFault
from scenewright.graph.examples import recall_from
from scenewright.memory.episodes import Episodes
from scripted import ScriptedModel

YIELD = "A car from the south yields to a pedestrian on the north crosswalk"
GRAPH = {
    "agents": [{"id": "vehicle-1", "type": "vehicle", "entry": "south"},
               {"id": "pedestrian-1", "type": "pedestrian", "crosswalk": "north"}],
    "relations": [{"type": "yield_to", "from": "vehicle-1", "to": "pedestrian-1"}],
}  # fmt: skip


@pytest.fixture
def memory(tmp_path: Path) -> Episodes:
    return Episodes(tmp_path / "deep" / "memory.jsonl", most=5)


def test_what_is_alike_is_recalled_first(memory: Episodes) -> None:
    memory.accept(request=YIELD, graph=GRAPH, taxonomy=["yield"])
    memory.accept(request="A truck hits a bus head-on", graph=GRAPH, taxonomy=["head-on"])
    memory.accept(request="A bus follows a taxi at noon", graph=GRAPH, taxonomy=["follow"])
    first = memory.recall("A van from the south yields to a pedestrian", 2)
    assert first[0].request == YIELD
    assert memory.recall("zebra quartz jump", 3) == ()
    assert memory.recall(YIELD, 3) == memory.recall(YIELD, 3)


def test_examples_differ_in_kind_before_they_repeat(memory: Episodes) -> None:
    for n in range(3):
        memory.accept(request=f"{YIELD} {n}", graph=GRAPH, taxonomy=["yield"])
    memory.accept(
        request="A car from the south hits a pedestrian on the north crosswalk",
        graph=GRAPH,
        taxonomy=["strike"],
    )
    assert {each.taxonomy for each in memory.recall(YIELD, 2)} == {("yield",), ("strike",)}


def test_memory_is_bounded_and_can_be_wiped(memory: Episodes) -> None:
    for n in range(9):
        memory.accept(request=f"request {n}", graph=GRAPH, taxonomy=[])
    memory.accept(request="request 6", graph=GRAPH, taxonomy=["again"])
    assert [each.request[-1] for each in memory.list_all()] == ["4", "5", "7", "8", "6"]
    assert memory.wipe() == 5
    assert memory.list_all() == []
    assert memory.wipe() == 0


def test_what_others_wrote_into_the_file_does_no_harm(memory: Episodes) -> None:
    memory.accept(request=YIELD, graph=GRAPH, taxonomy=["yield"])
    evil = {"request": YIELD, "graph": {"agents": "rm -rf"}, "taxonomy": []}
    with memory.path.open("a", encoding="utf-8") as file:
        file.write(f"no json\n[1, 2]\n{json.dumps(evil)}\n" + "\x00\n")
    assert len(memory.list_all()) == 2
    examples = recall_from(memory)("plan", YIELD)
    assert [each.request for each in examples] == [YIELD]
    assert examples[0].answer == GRAPH


def prompt(memory: Episodes | None) -> str:
    """What the planner's model is sent."""
    text_model = ScriptedModel({"plan": []})
    recall = None if memory is None else recall_from(memory)
    with pytest.raises(BackendFault):
        synthesize(YIELD, backend=TextBackend(text_model), refiner="none", recall=recall)
    return text_model.asked[0][1].user


def test_recall_changes_the_prompt_as_meant(memory: Episodes) -> None:
    without = prompt(None)
    assert prompt(memory) == without
    earlier = "A taxi from the south yields to a pedestrian on the west crosswalk"
    memory.accept(request=earlier, graph=GRAPH, taxonomy=["yield"])
    memory.accept(request="A truck hits a bus", graph=GRAPH, taxonomy=["hit"])
    given = prompt(memory)
    assert given != without
    assert json.dumps(earlier) in given
    untyped = [{k: v for k, v in each.items() if k != "type"} for each in GRAPH["agents"]]
    assert json.dumps({**GRAPH, "agents": untyped}, separators=(",", ":")) in given
    assert "A truck hits a bus" not in given
    assert given.replace(
        given[given.index("Accepted before:") : given.index('Request: "A car')], ""
    ) == (without)
