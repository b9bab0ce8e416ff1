"""Python's collector of cyclic objects, which looks less often while scenes are made.

A run makes hundreds of thousands of small objects, most of which live until its end, and hardly any
cycles. At its usual pace the collector takes a tenth of the time of a run, to look through
everything that has been loaded over and over.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_RARELY = (20_000, 20, 20)
"""Objects made before the young are looked through; and passes before the older are."""

HARDLY_EVER = (100_000, 50, 50)
"""The same for a process that does nothing else, in which what is loaded stays."""

_LOCK = threading.Lock()
_usual: list[tuple[int, int, int]] = []
"""The thresholds before, once for each run that is going on."""


@contextmanager
def collect_rarely() -> Iterator[None]:
    """Look for cycles less often until the last of the runs that are going on has ended."""
    with _LOCK:
        before = _usual[0] if _usual else gc.get_threshold()
        _usual.append(before)
        if 0 < before[0] < _RARELY[0]:  # 0: it has been switched off
            gc.set_threshold(*_RARELY)
    try:
        yield
    finally:
        with _LOCK:
            _usual.pop()
            if not _usual:
                gc.set_threshold(*before)
