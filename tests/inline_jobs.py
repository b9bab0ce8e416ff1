"""The jobs of a batch in the process of the test, one after the other: no worker has to start."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import pytest

from scenewright.dataset.batch import audit, carry_out
from scenewright.dataset.orders import agent


def spread_inline(
    jobs: Iterable[Any], task: Callable[[Any], Any], *, workers: int, limit: Any = None
) -> Iterator[tuple[Any, Any]]:
    """What `pool.spread` gives, in order."""
    for job in jobs:
        yield job, task(job)


def run_jobs_inline(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have batches made and checked without worker processes, which tests/dataset tests."""
    for module in (audit, carry_out, agent):
        monkeypatch.setattr(module, "spread", spread_inline)
