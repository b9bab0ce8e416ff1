"""Turns of a conversation about what stands."""

from __future__ import annotations

from typing import Any

import pytest

from scenewright.backends.builtin.planner import plan
from scenewright.backends.builtin.revising import read
from scenewright.scene.edits import AgentView, Edits, Situation, apply_edits
from scenewright.scene.social import AgentNode, SocialGraph

PLAIN = "A car from the north nearly hits a pedestrian"
HIDDEN = "A pedestrian steps out from behind a parked truck and is hit by a car"
HIDES = {"hides": "pedestrian-1", "hidden_from": "vehicle-1"}


def view(node: AgentNode) -> AgentView:
    """An agent of a graph as it might drive or walk."""
    walks = node.type == "pedestrian"
    return AgentView(
        id=node.id, number=1, type=node.type, subtype=None if walks else "car", entry="north",
        exit="south", movement="crossing" if walks else "straight", role="foreground", speed=1.4,
    )  # fmt: skip


def turn(text: str, words: str) -> tuple[SocialGraph, SocialGraph]:
    """The graph of a text, and what words then make of it."""
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    present = tuple(map(view, graph.agents))
    reading = read(words, Situation(graph=graph, present=present))
    assert isinstance(reading, Edits), reading
    return graph, apply_edits(graph, reading.edits)


@pytest.mark.parametrize(
    ("words", "node"),
    [
        ("add a parked truck on the north leg", {"subtype": "truck", "leg": "north"}),
        ("have her step out from behind a parked bus", {"subtype": "bus", **HIDES}),
        (
            "add a parked bus that hides the pedestrian until 0.9 s before the impact",
            {"subtype": "bus", "lead": (0.75, 1.05), **HIDES},
        ),
    ],
)
def test_objects_are_added(words: str, node: dict[str, Any]) -> None:
    before, after = turn(PLAIN, words)
    (found,) = after.objects
    assert found.model_dump(exclude_none=True) == {"id": "object-1", "kind": "parked", **node}
    assert (after.agents, after.relations) == (before.agents, before.relations)


@pytest.mark.parametrize("words", ["remove the parked truck", "remove the truck", "drop object-1"])
def test_objects_are_removed(words: str) -> None:
    before, after = turn(HIDDEN, words)
    assert before.objects
    assert not after.objects
    assert not {"object", "sight"} & {each.became for each in after.said}
    assert after.agents == before.agents


def test_other_changes_leave_objects_alone_but_for_whom_they_hide() -> None:
    before, after = turn(HIDDEN, "make it a near miss")
    assert after.objects == before.objects
    before, after = turn(HIDDEN, "remove the collision")
    assert [each.hides for each in after.objects] == [None]
