"""Figures in words, with their bounds."""

import pytest

from scenewright.backends.builtin.reader.measures import parse_range


@pytest.mark.parametrize(
    ("words", "bounds"),
    [
        ("minimum time to collision under one second", (0.0, 1.0)),
        ("at least 3 s", (3.0, None)),
        ("no more than 3 s", (0.0, 3.0)),
        ("no less than 3 s", (3.0, None)),
        ("not exceeding 3 s", (0.0, 3.0)),
        ("3 s or more", (3.0, None)),
        (">= 3 s", (3.0, None)),
        ("3 s", (2.5, 3.5)),
    ],
)
def test_the_last_words_of_a_bound_decide(words: str, bounds: tuple[float, float | None]) -> None:
    assert parse_range(words, "", 0.5) == (*bounds, "s")
