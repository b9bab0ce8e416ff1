"""Plurals without a number: two are made where the rest is understood, and the account says so."""

from __future__ import annotations

import pytest

from scenewright.backends.builtin.planner import plan
from scenewright.backends.builtin.reader.groups import count_plurals
from scenewright.backends.builtin.reader.reading import read_text
from scenewright.scene.social import Refusal, SocialGraph


@pytest.mark.parametrize(
    ("text", "words", "many"),
    [
        ("An ambulance runs a red light and cars give way", "cars", 2),
        ("An ambulance runs red and everyone gives way", "everyone", 2),
        ("All traffic stops for an ambulance that runs the red light", "All traffic", 2),
        ("Several cars yield to a fire engine that runs red", "Several cars", 3),
        ("A car waits for kids to cross", "kids", 2),
    ],
)
def test_a_plural_without_a_number_is_so_many_and_noted(text: str, words: str, many: int) -> None:
    made = plan(text)
    assert isinstance(made, SocialGraph)
    said = [each for each in made.said if each.became == "agent" and each.words == words]
    assert [text[each.start : each.end] for each in said] == [words] * many
    assert {each.note for each in said} == {
        f"the words leave open how many; {'three' if many == 3 else 'two'} are made"
    }
    assert len(made.relations) == many


@pytest.mark.parametrize(
    "text",
    [
        "Everything is calm, cars and people move through without conflicts at 10:00.",
        "A vehicle waits at a red light while pedestrians cross normally; no conflict.",
    ],
)
def test_plurals_of_a_text_in_which_nothing_happens_are_no_parties(text: str) -> None:
    graph = plan(text)
    assert isinstance(graph, Refusal) or not graph.relations


@pytest.mark.parametrize(
    "text",
    [
        "Three blue cars wait",
        "No other cars are there",
        "A car between parked cars",
        "Two vans",
        "Teenagers jaywalk across the south leg in a group of three",
        "Kids run out and a car hits one of them",
    ],
)
def test_numbered_and_standing_plurals_are_left_alone(text: str) -> None:
    reading = read_text(text)
    assert count_plurals(reading) == reading


def test_a_number_said_apart_from_the_noun_is_asked_for() -> None:
    found = plan("Kids run across and a car hits one of them")
    assert isinstance(found, Refusal)
    assert "say a number" in found.reason
