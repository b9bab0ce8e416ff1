"""What many requests share, made once: seeds of one text, scenes of one map."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class RecentCache(Generic[K, V]):
    """The last values by key, each as long as what else it was made from is the same object.

    For what `functools.lru_cache` does not do: maps and relation files are slow to hash, or cannot
    be, and are known by identity. Threads may share one.
    """

    def __init__(self, *, most: int) -> None:
        self._most = most
        self._known: dict[K, tuple[tuple[object, ...], V]] = {}
        self._lock = threading.Lock()

    def get(self, key: K, *made_from: object, make: Callable[[], V]) -> V:
        """The value of a key; made where there is none, or none from these. Errors are not kept."""
        with self._lock:
            known = self._known.get(key)
        if known is None or any(a is not b for a, b in zip(known[0], made_from, strict=True)):
            known = made_from, make()  # outside the lock: two threads may make the same value
            with self._lock:
                self._known[key] = known
                while len(self._known) > self._most:
                    del self._known[next(iter(self._known))]
        return known[1]
