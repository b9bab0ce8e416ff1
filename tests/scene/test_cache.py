"""Values are made once for a key and what they are made from, and the oldest go first."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from scenewright.scene.cache import RecentCache


def counting() -> tuple[list[int], Callable[[], int]]:
    made: list[int] = []

    def make() -> int:
        made.append(len(made))
        return made[-1]

    return made, make


def test_a_value_is_made_once_for_a_key_and_its_origin() -> None:
    recent, (made, make), origin = RecentCache[str, int](most=4), counting(), [1]
    assert [recent.get("a", origin, make=make) for _ in range(3)] == [0, 0, 0]
    assert recent.get("a", [1], make=make) == 1, "an equal origin is another one"
    assert recent.get("b", origin, make=make) == 2
    assert made == [0, 1, 2]


def test_the_oldest_goes_first() -> None:
    recent, (made, make) = RecentCache[int, int](most=2), counting()
    for key in (1, 2, 3):
        recent.get(key, make=make)
    assert recent.get(3, make=make) == 2
    assert recent.get(2, make=make) == 1
    assert recent.get(1, make=make) == 3
    assert len(made) == 4


def test_an_error_is_not_kept() -> None:
    recent = RecentCache[str, int](most=2)
    with pytest.raises(ZeroDivisionError):
        recent.get("a", make=lambda: 1 // 0)
    assert recent.get("a", make=lambda: 7) == 7
