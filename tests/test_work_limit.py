"""What is made is decided by counted work: the same under any load, and it ends."""

from __future__ import annotations

import pytest

from scenewright import synthesize, time_limit, work_limit
from scenewright.dataset.batch.worker import Job, Options, work
from scenewright.errors import Unsatisfiable
from scenewright.graph import run
from scenewright.work_limit import WorkLimitReachedError, count_work, limit_work

TEXT = "A vehicle yields to a pedestrian at 8 am"
HOPELESS = "A car waits 20 s for a pedestrian."


def test_the_smaller_of_two_limits_counts() -> None:
    count_work(10**9)
    with limit_work(3), limit_work(5):
        count_work(3)
        with pytest.raises(WorkLimitReachedError, match="3 steps"):
            count_work()
    count_work()


def test_inner_work_is_work_of_the_outer_request_too() -> None:
    with limit_work(4):
        for _ in range(2):
            with limit_work(2):
                count_work(2)
        with pytest.raises(WorkLimitReachedError, match="4 steps"):
            count_work()


def test_a_request_whose_work_is_spent_is_refused_for_good(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "MOST_WORK", 3)
    cut = "within 3 steps of the search, the limit of work, and 0 attempts: it cut off the waypoint"
    with pytest.raises(Unsatisfiable, match=cut) as refused:
        synthesize(TEXT, refiner="none")
    last = refused.value.rejections[-1]
    assert (last.stage, last.code) == ("waypoint_filter", "work_spent")
    job = Job(0, "a", "a", TEXT, 0, Options("amsterdam_120"))
    outcome = work(job)
    assert (outcome.status, outcome.code) == ("refused", "work_spent")


@pytest.mark.parametrize("text", [TEXT, HOPELESS])
def test_a_slow_machine_gives_the_same_answer(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock that says an hour between two looks, as under any load; none decides."""
    monkeypatch.setattr(run, "MOST_WORK", 2000)
    calm = work(Job(0, "a", "a", text, 0, Options("amsterdam_120")))
    spent: list[int] = []
    monkeypatch.setattr(work_limit, "check_time", lambda: spent.append(1))
    monkeypatch.setattr(time_limit.time, "monotonic", lambda: 3600.0 * len(spent))
    busy = work(Job(0, "a", "a", text, 0, Options("amsterdam_120")))
    assert len(spent) > 10
    assert (busy.status, busy.code, busy.reason) == (calm.status, calm.code, calm.reason)
    assert (busy.files, busy.attempts) == (calm.files, calm.attempts)


def test_the_count_is_the_same_when_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    counts = []
    for _ in range(2):
        spent: list[int] = []
        monkeypatch.setattr(work_limit, "check_time", lambda spent=spent: spent.append(1))
        synthesize(TEXT, seed=5, refiner="none")
        counts.append(len(spent))
    assert counts[0] == counts[1] > 10
