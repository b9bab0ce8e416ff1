"""The most work that one request may take, counted, so that no other load on the machine decides.

    with limit_work(10_000):
        ...                 # whatever calls `count_work` in here ends after so many units

A unit is one step of a search: a tuple tried, two motions compared, the way of an agent past all
others. The same request does the same steps on any machine, so it ends at the same one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from scenewright.time_limit import check_time

MOST_WORK = 10_000
"""Units of one request. Of 191 everyday requests that became scenes two took more than 5,000;
10,000 take some three to five seconds of an idle core."""


class WorkLimitReachedError(Exception):
    """The work is spent; `units` were allowed; `stage` is the one that was cut off."""

    stage = ""

    def __init__(self, units: int) -> None:
        super().__init__(f"the limit of {units:,} steps of the search is reached")
        self.units = units


class _Count:
    """How much work is left, and the count around this one."""

    def __init__(self, units: int, outer: _Count | None) -> None:
        self.units, self.left, self.outer = units, units, outer


_running: ContextVar[_Count | None] = ContextVar("running", default=None)


@contextmanager
def limit_work(units: int) -> Iterator[None]:
    """Within it `count_work` raises once so many units are counted; an outer limit counts, too."""
    token = _running.set(_Count(units, _running.get()))
    try:
        yield
    finally:
        _running.reset(token)


def count_work(units: int = 1) -> None:
    """Counts work, and looks at the clock.

    Raises:
        WorkLimitReachedError: the work of the request is spent.
        TimeLimitReachedError: its time is over.
    """
    count = _running.get()
    while count is not None:
        count.left -= units
        if count.left < 0:
            raise WorkLimitReachedError(count.units)
        count = count.outer
    check_time()
