"""Ctrl-C and SIGTERM end a run at its next step, even where a library swallows the exception."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_received: list[int] = []
_kept: list[str] = []
"""What an interrupted command has to say: not always that nothing was written."""


@contextmanager
def watch_signals() -> Iterator[None]:
    """Takes note of the signals; those that are ignored or handled by others are left alone."""
    _received.clear()
    _kept.clear()
    before: dict[signal.Signals, Any] = {
        signal.SIGINT: signal.default_int_handler,
        signal.SIGTERM: signal.SIG_DFL,
    }
    ours = threading.current_thread() is threading.main_thread()
    taken = [number for number in before if ours and signal.getsignal(number) == before[number]]
    for number in taken:
        signal.signal(number, _note)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, before[number])


def _note(number: int, frame: FrameType | None) -> None:
    del frame
    _received.append(number)
    raise KeyboardInterrupt


def stop_if_asked() -> None:
    """Raises KeyboardInterrupt again if one has come and got lost."""
    if _received:
        raise KeyboardInterrupt


def forget_interrupt() -> None:
    """Ctrl-C has been heeded, and what runs goes on: in a conversation it ends a turn alone."""
    _received[:] = [number for number in _received if number != signal.SIGINT]


def has_stop_signal() -> bool:
    """Whether a signal has come."""
    return bool(_received)


def has_terminate_signal() -> bool:
    """Whether the signal was SIGTERM."""
    return signal.SIGTERM in _received


def keep(word: str) -> None:
    """Notes what is kept if the command is interrupted from now on; the last word counts."""
    _kept[:] = [word]


def get_note() -> str | None:
    """What was noted last."""
    return _kept[0] if _kept else None
