"""Two on foot that meet, and riders on crosswalks, as the builtin planner reads them."""

from __future__ import annotations

import pytest

from scenewright.backends.builtin.planner import plan
from scenewright.scene.social import Refusal, SocialGraph


def read(text: str) -> SocialGraph:
    found = plan(text)
    assert isinstance(found, SocialGraph), found
    return found


@pytest.mark.parametrize(
    ("text", "relation"),
    [
        ("A pedestrian from the west nearly bumps into a pedestrian from the east on the south "
         "crosswalk.", "near_miss"),
        ("A jogger collides with an old lady on the south crosswalk.", "collide_at"),
    ],
)  # fmt: skip
def test_both_are_on_foot_and_on_one_crosswalk(text: str, relation: str) -> None:
    graph = read(text)
    assert [agent.type for agent in graph.agents] == ["pedestrian", "pedestrian"]
    assert {agent.crosswalk for agent in graph.agents} == {"south"}
    assert [edge.type for edge in graph.relations] == [relation]


def test_the_one_who_bumps_into_the_other_is_the_first() -> None:
    (edge,) = read("A child runs into a man on the zebra crossing.").relations
    assert (edge.from_, edge.to) == ("pedestrian-1", "pedestrian-2")


def test_two_meet_at_a_corner_but_two_cars_do_not() -> None:
    (edge,) = read("Two pedestrians collide at the corner.").relations
    assert edge.pattern == "pedestrians_collide_at_corner"
    assert isinstance(plan("Two pedestrians yield to one another."), Refusal)


def test_a_rider_said_to_be_on_a_crosswalk_is_there() -> None:
    graph = read("A cyclist on the north crosswalk nearly hits a pedestrian.")
    assert {(a.type, a.crosswalk) for a in graph.agents} == {
        ("cyclist", "north"), ("pedestrian", "north"),
    }  # fmt: skip
    other = read("A cyclist hits a pedestrian on the north crosswalk.")
    assert {(a.type, a.crosswalk) for a in other.agents} == {
        ("cyclist", None), ("pedestrian", "north"),
    }  # fmt: skip
