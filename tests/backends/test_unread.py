"""What a text tells and no relation holds is asked back, not dropped."""

from __future__ import annotations

import pytest

from scenewright.backends.builtin.beyond import note_beyond
from scenewright.backends.builtin.grammar_plan import read_by_grammar as plan
from scenewright.scene.social import Refusal, SocialGraph


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("A car hits a wombat", "wombat"),
        ("A wombat from the east hits a car", "wombat"),
        ("A bus stops for a parade", "parade"),
        ("A car hits a pedestrian and obliterates a truck", "obliterates"),
        ("A car yields to a pedestrian and then smooshes her", "smooshes"),
        ("A car hits a bus. The truck crashes.", "truck"),
        ("A car hits a pedestrian while a police officer watches", "officer"),
        ("Ambulance passes, everyone yields", "everyone"),
        ("A swan walks down the avenue, drivers are stopping for it.", "it"),
    ],
)
def test_what_is_not_understood_is_asked_back_with_its_word(text: str, word: str) -> None:
    verdict = plan(text)
    assert isinstance(verdict, Refusal)
    assert f"'{word}'" in verdict.reason or f"the {word}" in verdict.reason


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
    assert [tie.side for tie in graph.ties] == ["same"]


def test_between_intersections_is_off_the_crosswalks() -> None:
    graph = plan("A child runs into the street between intersections and is struck by a car")
    assert isinstance(graph, SocialGraph)
    assert graph.agents[0].movement == "jaywalking"


def test_what_no_scene_shows_stands_in_the_account() -> None:
    text = "A van hits a taxi and shunts it into a bus"
    graph = note_beyond(SocialGraph(agents=()), text)
    assert [(each.words, each.became) for each in graph.said] == [("shunts it into", "nothing")]
