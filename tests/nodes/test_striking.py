"""Which words say who strikes in a collision."""

from __future__ import annotations

import pytest

from scenewright.backends.builtin.planner import plan
from scenewright.nodes.scene_planner import name_strikers
from scenewright.scene.social import SocialGraph


def find_striker(text: str) -> str | None:
    found = plan(text)
    assert isinstance(found, SocialGraph), found
    named = name_strikers(found, text)
    (edge,) = named.relations
    said = [each.agents for each in named.said if each.became == "striker"]
    assert said == ([] if edge.strikes is None else [(edge.strikes, edge.to)])
    return edge.strikes


@pytest.mark.parametrize(
    ("text", "striker"),
    [
        ("A right-turning van hits a cyclist going straight.", "vehicle-1"),
        ("A cyclist is hit by a right-turning van.", "vehicle-1"),
        ("A cyclist runs into the side of a right-turning van.", "cyclist-1"),
        ("A sideswipe by a van with a car in the next lane.", "vehicle-1"),
        ("A car is hit from behind by a bus.", "vehicle-2"),
        ("A van turning right and a cyclist going straight collide.", None),
        ("A sideswipe between a van and a car.", None),
        ("Two cars sideswipe each other.", None),
        ("A car hits a pedestrian on the north crosswalk.", None),
    ],
)
def test_words_say_who_strikes_or_leave_it_open(text: str, striker: str | None) -> None:
    assert find_striker(text) == striker


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("A truck right-hooks a cyclist.", "rider_right_hook_collision"),
        ("Right hook: a truck turning right hits a cyclist going straight.", None),
    ],
)
def test_a_phrase_yields_to_the_striker_that_is_said(text: str, pattern: str | None) -> None:
    """In the right hook of the relation files it is the cyclist that strikes."""
    found = plan(text)
    assert isinstance(found, SocialGraph), found
    (edge,) = name_strikers(found, text).relations
    assert edge.pattern == pattern
