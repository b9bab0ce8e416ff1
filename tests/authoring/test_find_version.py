"""Versions are found by what is said of them."""

from __future__ import annotations

from typing import Any, cast

import pytest

from scenewright.authoring.find_version import find_version
from scenewright.authoring.thread_state import ThreadState
from scenewright.authoring.turn_kind import read_name, spell_fully

CAR = {"id": "vehicle-1", "type": "vehicle", "subtype": "car"}
WALKER = {"id": "pedestrian-1", "type": "pedestrian"}
BUS = {"id": "vehicle-2", "type": "vehicle", "subtype": "bus"}


def write_version(number: int, words: str, event: str, *agents: dict[str, Any]) -> dict[str, Any]:
    graph = {"agents": agents, "relations": [{"type": event}], "context": {}}
    return {"number": number, "parent": number - 1 or None, "words": words, "graph": graph}


STATE = cast(
    ThreadState,
    {
        "current": 4,
        "versions": [
            write_version(1, "a car nearly hits a pedestrian", "near_miss", CAR, WALKER),
            write_version(2, "let it be closer", "near_miss", CAR, WALKER),
            write_version(3, "now the car waits for her", "yield_to", CAR, WALKER),
            write_version(4, "add a bus", "yield_to", CAR, WALKER, BUS),
        ],
    },
)


@pytest.mark.parametrize(
    ("words", "number"),
    [
        ("go back to the bad one, the close one", 2),
        ("the yielding version please", 3),
        ("show me the version before i put the bus in", 3),
        ("put it back to how it was without the bus", 3),
        ("back to the latest", 4),
        ("the very first one", 1),
        ("the one with the elephant", None),
    ],
)
def test_a_version_is_found_by_its_description(words: str, number: int | None) -> None:
    assert find_version(words, STATE) == number


def test_names_to_save_under_are_plain_file_names() -> None:
    assert read_name('keep it for me as "chapter nine"') == "chapter_nine"
    assert read_name("save it as lesson7") == "lesson7"
    assert read_name("save as ../../etc/passwd") is None or "/" not in str(
        read_name("save as ../../etc/passwd")
    )
    assert read_name("save it as a gif") is None


def test_shorthand_is_spelt_and_identifiers_are_not() -> None:
    assert spell_fully("whats that, r u sure") == "what's that, are you sure"
    assert spell_fully("car(N->S), w=3") == "car(N->S), w=3"
