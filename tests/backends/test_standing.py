"""Words about what stands become objects of the plan, hidden pedestrians included."""

from __future__ import annotations

from typing import Any

import pytest

from scenewright.backends.builtin.planner import plan
from scenewright.scene.social import Refusal, SocialGraph

HIDES = {"hides": "pedestrian-1", "hidden_from": "vehicle-1"}


def read(text: str) -> SocialGraph:
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    return graph


@pytest.mark.parametrize(
    ("text", "objects"),
    [
        (
            "A pedestrian steps out from behind a parked truck and is hit by a car",
            [{"id": "object-1", "kind": "parked", "subtype": "truck", **HIDES}],
        ),
        (
            "A car hits a pedestrian who was occluded by a parked bus until 1.2 s before impact",
            [{"id": "object-1", "kind": "parked", "subtype": "bus", "lead": (1.05, 1.35), **HIDES}],
        ),
        (
            "A car narrowly misses a girl who comes out from behind a bus at the bus stop",
            [{"id": "object-1", "kind": "bus_stop", **HIDES}],
        ),
        (
            "A car from the north hits a pedestrian; the driver's view is blocked by a "
            "double-parked truck",
            [{"id": "object-1", "kind": "double_parked", "subtype": "truck", **HIDES}],
        ),
        (
            "A parked truck at the kerb hides a child who then runs out in front of a car.",
            [{"id": "object-1", "kind": "parked", "subtype": "truck", **HIDES}],
        ),
        (
            "A stalled bus stands in the south approach and two cars collide",
            [{"id": "object-1", "kind": "stalled", "subtype": "bus", "leg": "south"}],
        ),
        (
            "There is a bin on the sidewalk. A car yields to a pedestrian.",
            [{"id": "object-1", "kind": "bin"}],
        ),
    ],
)
def test_objects_are_read(text: str, objects: list[dict[str, Any]]) -> None:
    graph = read(text)
    assert [each.model_dump(exclude_none=True) for each in graph.objects] == objects
    said = [each for each in graph.said if each.became in ("object", "sight")]
    assert all(text[each.start : each.end] == each.words for each in said)
    wanted = {"object", "sight"} if "hides" in objects[0] else {"object"}
    assert {each.became for each in said} == wanted


@pytest.mark.parametrize(
    "text",
    [
        "A car comes out from behind a parked bus and hits a pedestrian",
        "A car comes out from behind a parked bus and hits a truck",
        "Two children emerge from between two parked vans; a car yields to them.",
        "A delivery van halted on the north leg blocks the view; a pedestrian walks out past its "
        "front and a car nearly hits them.",
        "A pedestrian walks out between stopped cars and a motorcycle hits them.",
    ],
)
def test_what_hides_no_one_pedestrian_is_refused(text: str) -> None:
    assert isinstance(plan(text), Refusal)


def test_a_plan_without_objects_has_no_such_key() -> None:
    assert "objects" not in read("Two cars collide").model_dump()
