"""What a text tells and no relation holds is asked back, not dropped."""

from __future__ import annotations

import pytest

from scenewright import synthesize
from scenewright.backends.builtin.planner import plan
from scenewright.errors import InputError, Unsatisfiable
from scenewright.scene.account import list_unrealised
from scenewright.scene.social import Refusal, SocialGraph


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("A car hits a wombat", "wombat"),
        ("A wombat from the east hits a car", "wombat"),
        ("A bus stops for a parade", "parade"),
        ("A swan walks down the avenue, drivers are stopping for it.", "swan"),
    ],
)
def test_what_is_not_understood_is_asked_back_with_its_word(text: str, word: str) -> None:
    verdict = plan(text)
    assert isinstance(verdict, Refusal)
    assert word in verdict.reason


@pytest.mark.parametrize(
    "text",
    [
        "A car hits a pedestrian and obliterates a truck",
        "A car yields to a pedestrian and then smooshes her",
        "A car hits a bus. The truck crashes.",
        "A right hook that does not happen. The lorry driver sees the cyclist and waits.",
        "All but one of four cars stop for a woman on the east crosswalk",
    ],
)
def test_no_scene_is_verified_that_leaves_out_a_deed(text: str) -> None:
    with pytest.raises((InputError, Unsatisfiable)):
        synthesize(text, refiner="none", seed=1)


def test_words_that_the_reader_takes_for_unrealisable_are_judged_by_the_account() -> None:
    text = "The car is not hit, the pedestrian doesn't run, the car lets her pass and moves on."
    found = plan(text)
    assert isinstance(found, SocialGraph)
    assert list_unrealised(found.said)
    assert synthesize(text, refiner="none", seed=1).proof.verdict == "verified"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "Two pedestrians cross in front of a waiting bus, then a car behind the bus "
            "rear-ends it",
            [
                ("yield_to", "vehicle-1", "pedestrian-1"),
                ("yield_to", "vehicle-1", "pedestrian-2"),
                ("collide_at", "vehicle-2", "vehicle-1"),
            ],
        ),
        (
            "A driver fails to notice a cyclist-free crosswalk and strikes a man walking across",
            [("collide_at", "vehicle-1", "pedestrian-1")],
        ),
        ("A car and a truck collide at the centre.", [("collide_at", "vehicle-1", "vehicle-2")]),
    ],
)
def test_what_is_understood_is_planned(text: str, expected: list[tuple[str, str, str]]) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    assert [(edge.type, edge.from_, edge.to) for edge in graph.relations] == expected


def test_hit_from_behind_is_by_a_vehicle_of_the_same_leg() -> None:
    graph = plan("A taxi brakes hard for a jaywalker and nearly gets hit from behind")
    assert isinstance(graph, SocialGraph)
    assert [agent.type for agent in graph.agents] == ["vehicle", "pedestrian", "vehicle"]


def test_between_intersections_is_off_the_crosswalks() -> None:
    graph = plan("A child runs into the street between intersections and is struck by a car")
    assert isinstance(graph, SocialGraph)
    assert graph.agents[0].movement == "jaywalking"


@pytest.mark.parametrize(
    "text",
    [
        "A truck rear-ends a car and pushes it into the van ahead",
        "A car is rear-ended by a truck and pushed into the van in front of it",
        "A truck rear-ends a stopped car, shunting it into the van",
    ],
)
def test_who_is_pushed_on_collides_twice(text: str) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    first, second = graph.relations
    assert (first.kind, second.kind, second.manoeuvre) == ("rear_end", "rear_end", "pushed")
    names = (first.from_, first.to, second.from_, second.to)
    truck, car, again, van = (graph.agent(name).subtype for name in names)
    assert (truck, car, again, van) == ("truck", "car", "car", "van")
    assert all(text[each.start : each.end] == each.words for each in graph.said)
    assert not list_unrealised(graph.said)


def test_a_chain_of_other_agents_is_refused() -> None:
    assert isinstance(plan("A car hits a pedestrian and pushes it into a van"), Refusal)


@pytest.mark.parametrize(
    ("text", "kind", "manoeuvre"),
    [
        ("A van hits the taxi in front of it", "rear_end", None),
        ("A van crashes into the taxi ahead of it at 8 am", "rear_end", None),
        ("A van hits a taxi", None, None),
    ],
)
def test_who_is_hit_ahead_is_hit_from_behind(
    text: str, kind: str | None, manoeuvre: str | None
) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    (edge,) = graph.relations
    assert (edge.kind, edge.manoeuvre, edge.first) == (kind, manoeuvre, None)


@pytest.mark.parametrize(
    ("text", "measure"),
    [
        ("A car cuts in ahead of a bus", None),
        ("A car cuts in ahead of a bus with a headway of 0.6 s", ("headway", 0.45, 0.75)),
        (
            "A van changes lanes and cuts in ahead of a taxi, leaving 4 m of space",
            ("gap", 3.7, 4.3),
        ),
    ],
)
def test_who_cuts_in_changes_lanes(text: str, measure: tuple[str, float, float] | None) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    (edge,) = graph.relations
    assert (edge.type, edge.manoeuvre, edge.first) == ("near_miss", "cuts_in", None)
    found = [(each.kind, each.low, each.high, each.agent) for each in graph.measures]
    assert found == ([] if measure is None else [(*measure, edge.to)])
    assert all(text[each.start : each.end] == each.words for each in graph.said)
