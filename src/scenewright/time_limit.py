"""The longest that one request may take: a clock that long computations look at.

    with limit_time(600.0):
        ...                 # whatever calls `check_time` in here ends in time

A limit only ever turns a result into a refusal. What a request gives is decided by counted
attempts and counted work (`work_limit`), so that the same seed gives the same bytes on any machine
under any load; the clock is the user's emergency brake. It stands still while models are asked and
code is compiled.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from scenewright.errors import InputError

DEFAULT_LIMIT = 600.0
"""[s] What is counted ends within half a minute on an idle core, so that this decides nothing
unless twenty processes share that core."""
LONGEST_LIMIT = 86400.0


class TimeLimitReachedError(Exception):
    """The time is over; `seconds` were allowed; `stage` is the one that was cut off."""

    stage = ""

    def __init__(self, seconds: float) -> None:
        super().__init__(f"the time limit of {seconds:g} s is reached")
        self.seconds = seconds


class _Deadline:
    """When the time is over, by `time.monotonic` [s], and how much was allowed."""

    def __init__(self, seconds: float, outer: _Deadline | None) -> None:
        self.seconds, self._outer = seconds, outer
        self._ends = time.monotonic() + seconds

    def check(self) -> None:
        """Raises TimeLimitReachedError if this clock, or one around it, has run out."""
        if time.monotonic() > self._ends:
            raise TimeLimitReachedError(self.seconds)
        if self._outer is not None:
            self._outer.check()

    def extend(self, seconds: float) -> None:
        """Puts the end off, of the outer clocks too."""
        self._ends += seconds
        if self._outer is not None:
            self._outer.extend(seconds)


_running: ContextVar[_Deadline | None] = ContextVar("running", default=None)


@contextmanager
def limit_time(seconds: float | None) -> Iterator[None]:
    """Within it `check_time` raises once so many seconds are over; None sets no limit."""
    if seconds is None:
        yield
        return
    token = _running.set(_Deadline(seconds, _running.get()))
    try:
        yield
    finally:
        _running.reset(token)


def check_time() -> None:
    """Raises TimeLimitReachedError if the time of the request is over."""
    clock = _running.get()
    if clock is not None:
        clock.check()


@contextmanager
def stop_clock() -> Iterator[None]:
    """Stop the clock: time within it does not count."""
    clock, since = _running.get(), time.monotonic()
    try:
        yield
    finally:
        if clock is not None:
            clock.extend(time.monotonic() - since)


@contextmanager
def raise_after(seconds: float, error: BaseException) -> Iterator[None]:
    """Raises the error in the block after so long, by an alarm of the system.

    Only where the system has alarms and in the main thread; elsewhere the block is not limited.
    """
    main = threading.current_thread() is threading.main_thread()
    if not main or not hasattr(signal, "setitimer"):
        yield
        return

    def ring(*_: object) -> None:
        raise error

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def check_time_limit(seconds: float | None) -> None:
    """Raises InputError for a time limit that is none."""
    if seconds is not None and not 0.0 < seconds <= LONGEST_LIMIT:
        raise InputError(
            f"a time limit is a number of seconds up to {LONGEST_LIMIT:g}, got {seconds:g}"
        )
