"""Orders that a relation cannot have are refused by name; the others become a clause."""

from __future__ import annotations

from typing import Any

import pytest

from scenewright.errors import Rejected
from scenewright.intersections import load_map
from scenewright.scene.social import RelationEdge, SocialGraph
from scenewright.tools.dsl_validator.parse import format_program
from scenewright.tools.dsl_validator.write import write_program
from scenewright.tools.map_grounding.grounding import ground_graph

MAP = load_map("amsterdam_120")
CAR, VAN, WALKER = "vehicle-1", "vehicle-2", "pedestrian-1"


def graph(**edge: Any) -> SocialGraph:
    names = {edge["from"], edge["to"]}
    agents = [{"id": name, "type": name.partition("-")[0]} for name in sorted(names)]
    return SocialGraph.model_validate({"agents": agents, "relations": [edge]})


@pytest.mark.parametrize(
    ("edge", "told"),
    [
        ({"type": "follow", "to": VAN, "first": VAN}, "no order of passing"),
        ({"type": "collide_at", "to": VAN, "kind": "rear_end", "first": VAN}, "no order"),
        ({"type": "yield_to", "to": VAN, "first": CAR}, "vehicle-1 gives way"),
        ({"type": "near_miss", "to": WALKER, "first": CAR, "target_ttc": 1.0}, "no brakes"),
        (
            {"type": "near_miss", "to": VAN, "first": CAR, "cause": "late_brake", "braker": CAR},
            "brakes hard and so lets vehicle-2 pass",
        ),
    ],
)
def test_an_order_that_cannot_be_is_refused_with_what_would_work(
    edge: dict[str, Any], told: str
) -> None:
    with pytest.raises(Rejected, match=told) as caught:
        ground_graph(graph(**{"from": CAR, **edge}), intersection_map=MAP)
    assert caught.value.rejection.code == "ungroundable"


@pytest.mark.parametrize("kind", ["near_miss", "collide_at"])
def test_an_order_of_two_that_cross_can_be(kind: str) -> None:
    asked = graph(**{"type": kind, "from": CAR, "to": VAN, "first": VAN})
    assert ground_graph(asked, intersection_map=MAP).routes


def test_an_order_is_a_clause_and_says_who_brakes() -> None:
    fact = {
        "type": "near_miss", "from": CAR, "to": VAN, "striker": CAR, "struck": VAN, "cause": None,
        "target_pet": None, "target_ttc": None, "pattern": "straight_crossing_near_miss",
        "first": VAN,
    }  # fmt: skip
    facts = {"agents": [], "violators": [], "relations": [fact]}
    assert f"before({VAN}, {CAR})" in format_program(write_program(facts))
    hard = {**facts, "relations": [{**fact, "first": CAR, "cause": "late_brake"}]}
    assert f"brakes_for({VAN}, {CAR})" in format_program(write_program(hard))


def test_a_plan_without_an_order_is_written_as_before() -> None:
    plain = {"type": "near_miss", "from": CAR, "to": VAN}
    edge = RelationEdge.model_validate(plain)
    assert "first" not in edge.model_dump()
    assert RelationEdge.model_validate({**plain, "first": VAN}).model_dump()["first"] == VAN
    with pytest.raises(ValueError, match="first must be"):
        RelationEdge.model_validate({**plain, "first": WALKER})
