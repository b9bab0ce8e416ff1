"""Every request ends in time, and a limit changes nothing but whether there is a result."""

from __future__ import annotations

from functools import cache

import pytest

from scenewright import synthesize, time_limit
from scenewright.dataset.batch.worker import Job, Options, work
from scenewright.errors import InputError, OutOfTime
from scenewright.graph import run
from scenewright.time_limit import (
    TimeLimitReachedError,
    check_time,
    limit_time,
    stop_clock,
)

TEXT = "A vehicle yields to a pedestrian at 8 am"


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time; what is put at its first place is the present."""
    told = [100.0]
    monkeypatch.setattr(time_limit.time, "monotonic", lambda: told[0])
    return told


def test_the_earlier_of_two_limits_counts(now: list[float]) -> None:
    check_time()
    with limit_time(5.0), limit_time(10.0), limit_time(None):
        now[0] = 104.0
        check_time()
        now[0] = 106.0
        with pytest.raises(TimeLimitReachedError, match="5 s"):
            check_time()
    check_time()


def test_what_passes_while_the_clock_stands_does_not_count(now: list[float]) -> None:
    with limit_time(5.0), limit_time(3.0):
        with stop_clock():
            now[0] = 150.0
        check_time()
        now[0] = 152.9
        check_time()
        now[0] = 153.1
        with pytest.raises(TimeLimitReachedError, match="3 s"):
            check_time()


def test_what_a_process_loads_once_does_not_count(
    now: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = run._compile_graph()

    def load() -> object:
        now[0] += 60.0
        return graph

    monkeypatch.setattr(run, "_compile_graph", cache(load))
    run._load_stages.cache_clear()
    assert synthesize(TEXT, refiner="none", time_limit=5.0).proof
    assert now[0] == 160.0


def test_a_request_that_reaches_its_limit_is_refused() -> None:
    cut = "time limit, and 0 attempts: it cut off the scene planner; the first attempt was not done"
    with pytest.raises(OutOfTime, match=cut):
        synthesize(TEXT, refiner="none", time_limit=1e-6)
    with pytest.raises(InputError, match="time limit"):
        synthesize(TEXT, time_limit=0.0)


def test_a_row_that_reaches_its_limit_may_be_tried_again() -> None:
    job = Job(0, "a", "a", TEXT, 0, Options("amsterdam_120", time_limit=1e-6))
    outcome = work(job)
    assert (outcome.status, outcome.code) == ("failed", "time_limit")


def test_long_instructions_are_refused_before_any_work() -> None:
    with pytest.raises(InputError, match=r"2,001 characters; at most 2,000"):
        synthesize("a" * 2001, backend="recorded:there-is-no-such-file")
