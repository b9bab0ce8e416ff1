"""The collector of cyclic objects is as it was once the last run has ended."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest

from scenewright.graph.collector import collect_rarely


@pytest.fixture(autouse=True)
def usual() -> Iterator[None]:
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)


def test_it_looks_less_often_until_the_last_of_several_runs_ends() -> None:
    gc.set_threshold(700, 10, 10)
    first, second = collect_rarely(), collect_rarely()
    first.__enter__()
    second.__enter__()
    assert gc.get_threshold()[0] > 700
    first.__exit__(None, None, None)
    assert gc.get_threshold()[0] > 700
    second.__exit__(None, None, None)
    assert gc.get_threshold() == (700, 10, 10)


def test_it_is_as_before_after_an_error() -> None:
    gc.set_threshold(700, 10, 10)
    with pytest.raises(ValueError, match="so"), collect_rarely():
        raise ValueError("so")
    assert gc.get_threshold() == (700, 10, 10)


def test_who_has_switched_it_off_has_it_off() -> None:
    gc.set_threshold(0, 10, 10)
    with collect_rarely():
        assert gc.get_threshold()[0] == 0
    assert gc.get_threshold() == (0, 10, 10)


def test_who_lets_it_look_more_rarely_still_keeps_that() -> None:
    gc.set_threshold(100_000, 50, 50)
    with collect_rarely():
        assert gc.get_threshold() == (100_000, 50, 50)
