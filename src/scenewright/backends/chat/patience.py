"""Asking again after a fault that may pass: a few times, with growing pauses."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from scenewright.errors import BackendFault

ResultT = TypeVar("ResultT")


@dataclass(frozen=True)
class RetryPolicy:
    """How long to insist.

    Attributes:
        attempts: in all; first, longest: pauses [s], each twice the one before.
    """

    attempts: int = 4
    first: float = 1.0
    longest: float = 20.0


class TransientError(Exception):
    """A fault that may pass.

    Attributes:
        after: seconds that the endpoint asks to wait; None if it says nothing.
    """

    def __init__(self, reason: str, *, after: float | None = None) -> None:
        super().__init__(reason)
        self.after = after


def retry_transient(ask: Callable[[], ResultT], *, patience: RetryPolicy) -> tuple[ResultT, int]:
    """What `ask` returns, and how often it was called.

    Raises:
        BackendFault: every attempt failed, or one for good; says how, and how many there were.
    """
    for attempt in range(1, patience.attempts + 1):
        try:
            return ask(), attempt
        except BackendFault as fault:
            fault.asked = attempt
            raise
        except TransientError as fault:
            if attempt == patience.attempts:
                words = f"{fault} ({attempt} attempts)"
                raise BackendFault(words, final=True, asked=attempt) from None
            time.sleep(_compute_pause(attempt, fault.after, patience))
    raise BackendFault("no attempt is allowed", final=True)


def _compute_pause(attempt: int, asked_for: float | None, patience: RetryPolicy) -> float:
    pause = patience.first * 2.0 ** (attempt - 1)
    return min(max(pause, asked_for or 0.0), patience.longest)
