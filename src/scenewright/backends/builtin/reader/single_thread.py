"""Matrix products of the encoder on one core."""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import Any


class SingleThread:
    """Within it BLAS computes on one core, until the last thread of the process that is in leaves.

    The matrices of a sentence are so small that further cores only wait for one another: on two
    busy cores 41 instructions took 7.4 s of processor time, on one 0.8 s, with the same bits.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._limiter: Any = None

    def __enter__(self) -> None:
        with self._lock:
            self._inside += 1
            if self._inside == 1:
                self._limiter = _find_libraries().limit(limits=1, user_api="blas")

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                self._limiter.restore_original_limits()


SINGLE_THREAD = SingleThread()


@lru_cache(maxsize=1)
def _find_libraries() -> Any:
    """The BLAS libraries that are loaded; numpy's is, as arrays have come this far."""
    import threadpoolctl

    controller: Any = threadpoolctl.ThreadpoolController
    return controller()
