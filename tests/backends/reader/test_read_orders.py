"""Who goes first in words: active and passive, denied, turned round by "after" and "second"."""

from __future__ import annotations

import pytest

from lab.planner.plain_sentences import build_reading
from scenewright.backends.builtin.draft import Site
from scenewright.backends.builtin.reader.annotation import parse_annotation
from scenewright.backends.builtin.reader.learned_plan import plan_reading
from scenewright.scene.social import Plan, Refusal, SocialGraph

TWO = "[veh:1 A car] from the [from:1 north] and [veh:2 a van] from the [from:2 east]"


def plan_of(line: str) -> Plan:
    row = parse_annotation(line)
    return plan_reading(build_reading(row), Site(), row.text).plan


def order_of(line: str) -> tuple[str, str | None]:
    graph = plan_of(line)
    assert isinstance(graph, SocialGraph), graph
    (edge,) = graph.relations
    return edge.type, edge.get_first()


@pytest.mark.parametrize(
    ("words", "first"),
    [
        ("[near:1>2 nearly collide]; [ref:2 the van] [first:2>1 passes first]", 2),
        ("[near:1>2 nearly collide]; [ref:2 the van] [first:2>1 goes second]", 1),
        ("[near:1>2 nearly collide]; [ref:1 the car] is [first:1>2 second] to [ref:2 the van]", 2),
        ("[near:1>2 nearly collide], [ref:1 one] [first:1>2 only after] [ref:2 the other]", 2),
        ("[near:1>2 nearly collide], [ref:1 it] is [first:2>1 just ahead of] [ref:2 the van]", 1),
        ("[near:1>2 nearly collide], [ref:1 it] passes [first:1>2 behind] [ref:2 the van]", 2),
        ("[near:1>2 nearly collide]; [first:1>2 first through is] [ref:2 the van]", 2),
        ("[near:1>2 nearly collide]; [ref:1 the car] [!first:1>2 does not go first]", 2),
        ("[hit:1>2 collide]; [ref:2 the van] [first:2>1 is there first]", 2),
        (": [near=cutoff:2>1 the second cuts off the first]", 2),
    ],
)  # fmt: skip
def test_the_words_say_who_goes_first(words: str, first: int) -> None:
    assert order_of(f"{TWO} {words}")[1] == f"vehicle-{first}"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (
            "[ped:1 A boy] [near=cutoff:1>2 steps out in front of] [veh:2 a car]",
            ("near_miss", "pedestrian-1"),
        ),
        (
            "[veh:1 A car] [near=cutoff:2>1 is cut off by] [veh:2 a van], which [hit:1>2 it hits]",
            ("collide_at", "vehicle-2"),
        ),
        ("[veh:1 A car] [first:1>2 beats] [veh:2 a van]", ("yield_to", "vehicle-1")),
        (
            "[veh:1 A car] [yield:1>2 lets nobody go first], [veh:2 a van] [yield:2>1 waits]",
            ("yield_to", "vehicle-1"),
        ),
    ],
)
def test_an_order_belongs_to_what_the_two_do(words: str, expected: tuple[str, str]) -> None:
    assert order_of(words) == expected


@pytest.mark.parametrize(
    "words",
    [
        "[yield:1>2 yields to it]; [ref:1 the car] [first:1>2 passes first]",
        "[near:1>2 nearly collide]; [ref:1 the car] [first:1>2 passes first], "
        "[ref:2 the van] [first:2>1 passes first]",
        ": [near=cutoff:1>2 the car cuts off the van] and [brake:1 brakes hard]",
    ],
)
def test_two_orders_are_refused(words: str) -> None:
    plan = plan_of(f"{TWO} {words}")
    assert isinstance(plan, Refusal)
    assert plan.code == "contradictory"


def test_the_account_holds_the_order_beside_the_event() -> None:
    graph = plan_of("[veh:1 A car] [near=cutoff:1>2 cuts off] [veh:2 a van]")
    assert isinstance(graph, SocialGraph)
    said = [(each.became, each.agents) for each in graph.said if each.words == "cuts off"]
    both = ("vehicle-1", "vehicle-2")
    assert said == [("relation", both), ("order", both)]
