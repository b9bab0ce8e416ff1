"""What people read: agents as the instruction calls them, and no words of programs."""

from __future__ import annotations

import pytest

from scenewright.scene.account import SaidRecord
from scenewright.scene.phrasing import call_agents, speak_plainly
from scenewright.scene.record import SceneRecord


def say(*rows: tuple[int, str, tuple[int, ...], str | None]) -> tuple[SaidRecord, ...]:
    return tuple(
        SaidRecord(start=at, end=at + len(words), words=words, became="agent", agents=ids, value=v)
        for at, words, ids, v in rows
    )


@pytest.mark.parametrize(
    ("said", "names"),
    [
        ((), ["the car", "the pedestrian"]),
        (((0, "My taxi", (1,), "taxi"), (9, "an old lady", (2,), "pedestrian")),
         ["the taxi", "the old lady"]),
        (((0, "Two kids", (1,), "car"), (0, "Two kids", (2,), "pedestrian")),
         ["the car", "the pedestrian"]),
        (((0, "the one", (1,), "car"), (9, "the one", (2,), "car")), ["one 1", "one 2"]),
        (((0, "a bus", (1,), "bus"), (9, "both", (1, 2), None), (20, "it", (1,), "bus")),
         ["the bus", "the pedestrian"]),
        (((0, "a <b>car</b>", (1,), "car"),), ["the car", "the pedestrian"]),
        (((0, "SUV", (1,), "car"), (9, "she", (2,), "pedestrian")), ["the SUV", "the pedestrian"]),
        (((0, "A TAXI", (1,), "taxi"), (9, "JOGGER", (2,), "pedestrian")),
         ["the taxi", "the jogger"]),
    ],
)  # fmt: skip
def test_agents_are_called_as_the_instruction_calls_them(
    scene: SceneRecord, said: tuple[tuple[int, str, tuple[int, ...], str]], names: list[str]
) -> None:
    called = call_agents(scene.model_copy(update={"said": say(*said)}))
    assert [called[1], called[2]] == names


def test_those_that_are_not_named_keep_the_name_that_edits_know(scene: SceneRecord) -> None:
    called = call_agents(scene)
    assert {
        name for agent in scene.agents if agent.role == "background" for name in [called[agent.id]]
    } == {agent.name for agent in scene.agents if agent.role == "background"}


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("vehicle-1 (car, north to east) hits pedestrian-2 (pedestrian)",
         "the car (north to east) hits the pedestrian"),
        ("collision of 1 and 2 at 5.3 s", "collision of the car and the pedestrian at 5.3 s"),
        ("speed of 2 and 3 m/s", "speed of 2 and 3 m/s"),
        ("a red_light run of agent 1, 2", "a red light run of the car, the pedestrian"),
        ("contact(vehicle-1, pedestrian-2, pedestrian_strike): too late",
         "contact of the car, the pedestrian, pedestrian strike: too late"),
        ("collide_at of vehicle-12", "collision of vehicle-12"),
        ("yielding of the car at 4 s (1 such; 1 is vehicle-1; 22 is pedestrian-8)",
         "yielding of the car at 4 s"),
    ],
)  # fmt: skip
def test_no_word_of_a_program_is_read(scene: SceneRecord, text: str, plain: str) -> None:
    assert speak_plainly(text, scene) == plain


def test_agents_of_a_plan_that_came_to_no_scene_are_called_too() -> None:
    text = "no_interaction(vehicle-3, vehicle-2) (115x)"
    called = {"vehicle-2": "the taxi", "vehicle-3": "the van"}
    assert speak_plainly(text, None, called) == "no interaction of the van, the taxi"
