"""Words that fix one agent by another, or by its light: sides, red lights, who does what."""

from __future__ import annotations

import pytest

from scenewright.backends.builtin.planner import plan
from scenewright.scene.social import EntrySide, SocialGraph

ONE, TWO, THREE = "vehicle-1", "vehicle-2", "vehicle-3"
WALKER, OTHER_WALKER = "pedestrian-1", "pedestrian-2"


def graph(text: str, previous: str | None = None) -> SocialGraph:
    result = plan(text, previous=previous)
    assert isinstance(result, SocialGraph), result
    return result


def edges(text: str) -> set[tuple[str, str, str]]:
    return {(each.type, each.from_, each.to) for each in graph(text).relations}


def runners(text: str) -> list[str]:
    return [agent.id for agent in graph(text).agents if agent.runs_red]


@pytest.mark.parametrize(
    ("text", "side"),
    [
        ("A car turning left hits an oncoming car.", "opposite"),
        ("A car and a bus from opposite directions nearly collide.", "opposite"),
        ("Two cars nearly collide head-on.", "opposite"),
        ("A car turning right yields to a car on the cross street.", "lateral"),
        ("A car collides with a car from the cross street.", "lateral"),
        ("A car nearly hits a car from its left.", "left"),
        ("A car yields to a car coming from its right.", "right"),
        ("A car nearly hits a car coming from the same approach.", "same"),
        ("A car yields to a bus on the other approach.", "other"),
    ],
)
def test_an_entry_that_only_another_one_fixes_is_tied_to_it(text: str, side: EntrySide) -> None:
    (tie,) = graph(text).ties
    assert (tie.agent, tie.of, tie.side) == (TWO, ONE, side)


@pytest.mark.parametrize(
    "text",
    [
        "A car from the north hits a car from the east.",
        "A car turns right onto the side street and hits a car.",
        "A car yields to a pedestrian crossing the side street.",
        "A car yields to a pedestrian from its left.",
    ],
)
def test_nothing_is_tied_where_the_text_ties_nothing(text: str) -> None:
    assert graph(text).ties == ()


def test_an_edit_unties_what_it_overrules() -> None:
    before = "A car from the south turning left yields to an oncoming car."
    assert [each.side for each in graph(before).ties] == ["opposite"]
    after = graph("the second car comes from the east instead", before)
    assert after.agent(TWO).entry == "east"
    assert after.ties == ()


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("A car turning left hits an oncoming car.", "left_turn"),
        ("A car and a bus from opposite directions crash as the car turns left.", "left_turn"),
        ("A car turning left from the north hits a car from the south.", "left_turn"),
        ("A car turning left from the north hits a car from the east.", None),
        ("A car going straight hits an oncoming car.", None),
        ("A car turning left hits an oncoming car turning left.", None),
    ],
)
def test_hitting_an_oncoming_vehicle_across_its_path_is_a_left_turn(
    text: str, kind: str | None
) -> None:
    assert [each.kind for each in graph(text).relations] == [kind]


@pytest.mark.parametrize(
    ("text", "who"),
    [
        ("A pedestrian ignores the red light and a car yields.", WALKER),
        ("A pedestrian walks on red and is hit by a car.", WALKER),
        ("A car hits a pedestrian who crosses against the light.", WALKER),
        ("A car hits a pedestrian on a red light.", ONE),
        ("A car hits a pedestrian, ignoring the red light.", ONE),
        ("A pedestrian is struck by a car after it ran a red light.", ONE),
        ("A pedestrian is hit by a car running the red light.", ONE),
        ("A car runs a red light and nobody is hit.", ONE),
    ],
)
def test_who_ignores_the_red_light(text: str, who: str) -> None:
    assert runners(text) == [who]


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("A car runs a red light and hits a bus.", "red_light_run"),
        ("A pedestrian ignores the red light and a car yields.", "red_light_run"),
        ("A car runs a red light and lets a pedestrian cross.", None),
        ("A car hits a bus.", None),
    ],
)
def test_a_red_light_run_is_a_cause_where_it_brings_the_relation_about(
    text: str, cause: str | None
) -> None:
    assert [each.cause for each in graph(text).relations] == [cause]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "A car yields to a pedestrian and a second car, on the other approach, yields to "
            "another pedestrian.",
            {("yield_to", ONE, WALKER), ("yield_to", TWO, OTHER_WALKER)},
        ),
        (
            "A car yields to a pedestrian, gets followed by a second car and a third car collides "
            "with the second.",
            {("yield_to", ONE, WALKER), ("follow", TWO, ONE), ("collide_at", THREE, TWO)},
        ),
        (
            "Two separate near misses: a car from the north with a pedestrian and a car from the "
            "west with another pedestrian.",
            {("near_miss", ONE, WALKER), ("near_miss", TWO, OTHER_WALKER)},
        ),
        (
            "Three cars in a row southbound, the last one follows the middle one which follows the "
            "first.",
            {("follow", THREE, TWO), ("follow", TWO, ONE)},
        ),
        (
            "A bus yields to a pedestrian while a car behind the bus follows it.",
            {("yield_to", ONE, WALKER), ("follow", TWO, ONE)},
        ),
    ],
)
def test_every_relation_of_a_text_finds_its_agents(
    text: str, expected: set[tuple[str, str, str]]
) -> None:
    assert edges(text) == expected


def test_a_row_is_a_chain() -> None:
    found = edges("Three cars in a row southbound.")
    assert [kind for kind, _, _ in found] == ["follow"] * 2
    assert len({who for _, who, _ in found}) == len({whom for _, _, whom in found}) == 2
