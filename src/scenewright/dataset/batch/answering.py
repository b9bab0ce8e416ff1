"""Backends that answer the questions of many rows, and how they are asked: at once, in turn."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from scenewright.backends import Backend, Question, Task, load_backend
from scenewright.backends.choosing import StagedBackend

Names = tuple[str, ...]
"""Backends as the command line names them: one name, or STAGE=NAME several times."""
BUILTIN: Names = ("builtin",)
_PAUSE = 0.02


@dataclass(frozen=True)
class Asking:
    """How questions are put. It changes no scene, so it may change from run to run.

    Attributes:
        record: file that keeps every answer; timeout: longest wait for one reply [s].
        at_once: questions to models at a time, over all workers of this machine; None: each worker
            puts its own.
        turns: folder for the locks that see to that.
    """

    record: Path | None = None
    timeout: float | None = None
    at_once: int | None = None
    turns: Path | None = None


PLAINLY = Asking()
"""Nothing recorded, no limit on questions at once."""


def make_plain_name(names: Names) -> str:
    """A backend as part of the names of files and rows, without company or folder."""
    plain = []
    for name in names:
        kind, colon, rest = name.partition(":")
        if kind == "recorded":
            plain.append(f"recorded-{Path(rest).stem}")
        else:
            plain.append(rest if colon and kind in ("openai", "anthropic") else name)
    return re.sub(r"[^a-z0-9]+", "-", ", ".join(plain).lower()).strip("-")[:60] or "backend"


def find_record_path(record: Path | None, name: str) -> Path | None:
    """The file of further answers next to one: `answers.jsonl` -> `answers-NAME.jsonl`."""
    return record and record.with_name(f"{record.stem}-{name}{record.suffix}")


def load_speaking_backend(
    names: Names, base_url: str | None = None, asking: Asking = PLAINLY
) -> Backend:
    """The backend of these names.

    Raises:
        InputError: there is none such, or a file of answers cannot be used.
    """
    backend = load_backend(
        names[0] if len(names) == 1 else names,
        base_url=base_url, record=asking.record, timeout=asking.timeout,
    )  # fmt: skip
    if asking.at_once is None or asking.turns is None:
        return backend
    turns = [asking.turns / f".asking-{k + 1}.lock" for k in range(asking.at_once)]
    return _make_take_turns(backend, turns)


def find_url(names: Sequence[str], base_url: str | None) -> str | None:
    """The endpoint, for those that have one."""
    return base_url if any("openai:" in name for name in names) else None


def _make_take_turns(backend: Backend, turns: Sequence[Path]) -> Backend:
    """The backend, or its stages, asked in turn; the offline one answers at once."""
    speakers: Mapping[Task, Backend] | None = getattr(backend, "by_task", None)
    if speakers is not None:
        return StagedBackend(
            {task: _make_take_turns(each, turns) for task, each in speakers.items()}
        )
    return backend if backend.deterministic else _InTurn(backend, turns)


class WrappedBackend:
    """A backend whose `answer` does more than that of the one within it."""

    def __init__(self, backend: Backend) -> None:
        self.name, self.deterministic, self._backend = backend.name, backend.deterministic, backend

    def __getattr__(self, name: str) -> Any:
        return getattr(self._backend, name)


class _InTurn(WrappedBackend):
    """A backend that is asked when one of the turns is free, over all processes that share them.

    A turn is a lock on a file: a process that dies releases it.
    """

    def __init__(self, backend: Backend, turns: Sequence[Path]) -> None:
        super().__init__(backend)
        self._turns = turns

    def answer(self, question: Question) -> dict[str, Any]:
        """The backend's reply (see `Backend`)."""
        # Each begins elsewhere, so that not all of them try for the first one.
        first = os.getpid() % len(self._turns)
        while True:
            for file in (*self._turns[first:], *self._turns[:first]):
                with suppress(Timeout), FileLock(file).acquire(blocking=False):
                    return self._backend.answer(question)
            time.sleep(_PAUSE)
