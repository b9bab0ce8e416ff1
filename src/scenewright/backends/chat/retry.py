"""Asking again after a fault that may pass: a few times, with growing pauses."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from tenacity import RetryCallState, Retrying, retry_if_exception_type, stop_after_attempt

from scenewright.errors import BackendFault

ResultT = TypeVar("ResultT")


class TransientError(Exception):
    """A fault that may pass.

    Attributes:
        after: seconds that the endpoint asks to wait; None if it says nothing.
    """

    def __init__(self, reason: str, *, after: float | None = None) -> None:
        super().__init__(reason)
        self.after = after


@dataclass(frozen=True)
class RetryPolicy:
    """How often to ask, and how long to wait in between.

    Attributes:
        attempts: in all; first, longest: pauses [s], each twice the one before.
    """

    attempts: int = 4
    first: float = 1.0
    longest: float = 20.0

    def compute_pause(self, state: RetryCallState) -> float:
        """Seconds to wait after a failed attempt; longer where the endpoint asks for it."""
        fault = state.outcome.exception() if state.outcome else None
        asked_for = fault.after if isinstance(fault, TransientError) else None
        pause = self.first * 2.0 ** (state.attempt_number - 1)
        return min(max(pause, asked_for or 0.0), self.longest)


def retry_transient(ask: Callable[[], ResultT], *, policy: RetryPolicy) -> tuple[ResultT, int]:
    """What `ask` returns, and how often it was called.

    Raises:
        BackendFault: every attempt failed, or one for good; says how, and how many there were.
    """
    retrying = Retrying(
        stop=stop_after_attempt(policy.attempts),
        wait=policy.compute_pause,
        retry=retry_if_exception_type(TransientError),
        sleep=time.sleep,
        reraise=True,
    )
    try:
        found = retrying(ask)
    except TransientError as fault:
        words = f"{fault} ({policy.attempts} attempts)"
        raise BackendFault(words, final=True, asked=policy.attempts) from None
    except BackendFault as fault:
        fault.asked = retrying.statistics["attempt_number"]
        raise
    return found, int(retrying.statistics["attempt_number"])
