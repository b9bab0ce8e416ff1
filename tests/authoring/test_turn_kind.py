"""What kind of turn words are: a question never becomes a change, a request never a question."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.authoring.turn_kind import classify_turn


@pytest.mark.parametrize(
    "words",
    ["how fast is the car going?", "is the light green", "why is it dangerous?",
     "where does the pedestrian come from?", "does the car stop?", "what can I say?",
     "tell me how close", "so, did they collide?", "isn't that too slow?"],
)  # fmt: skip
def test_questions(words: str) -> None:
    assert classify_turn(words).kind == "question"


@pytest.mark.parametrize(
    ("words", "read"),
    [
        ("can you make the car faster?", "make the car faster"),
        ("Show me a car that yields to a pedestrian", "a car that yields to a pedestrian"),
        ("Could you show me a truck that hits a bus?", "a truck that hits a bus"),
        ("What if it were a truck?", "make it a truck"),
        ("make the pedestrian slower", "make the pedestrian slower"),
        ("A car waits. Is hit by a bus.", "A car waits. Is hit by a bus."),
    ],
)
def test_requests_and_descriptions_are_left_to_the_planner(words: str, read: str) -> None:
    turn = classify_turn(words)
    assert (turn.kind, turn.words) == ("words", read)


@pytest.mark.parametrize(
    ("words", "kind", "count", "number"),
    [
        ("undo", "undo", 1, None),
        ("go back two steps", "undo", 2, None),
        ("undo the last 3 changes", "undo", 3, None),
        ("undo twice", "undo", 2, None),
        ("go back", "undo", 1, None),
        ("go back to the second version", "version", 1, 2),
        ("version 12", "version", 1, 12),
        ("the first one", "version", 1, 1),
        ("start over", "restart", 1, None),
        ("show it", "show", 1, None),
        ("why was that refused?", "why", 1, None),
        ("why", "why", 1, None),
        ("thanks!", "talk", 1, None),
        ("good morning", "talk", 1, None),
        ("quit", "quit", 1, None),
    ],
)
def test_steps_between_versions_and_small_talk(
    words: str, kind: str, count: int, number: int | None
) -> None:
    turn = classify_turn(words)
    assert (turn.kind, turn.count, turn.number) == (kind, count, number)


@given(st.text(max_size=60))
def test_any_text_has_a_kind(words: str) -> None:
    assert classify_turn(words).words is not None
