"""Backends that answer the questions of many rows, and how they are asked: at once, in turn."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filelock import BaseFileLock, FileLock, Timeout

from scenewright.backends import Backend, Question, Task, load_backend
from scenewright.backends.staged import Staged
from scenewright.errors import InputError

Names = tuple[str, ...]
"""Backends as the command line names them: one name, or STAGE=NAME several times."""
BUILTIN: Names = ("builtin",)
MOST_AT_ONCE = 256
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


def label(names: Names) -> str:
    """A backend's name in tables and journals."""
    return ", ".join(names)


def make_plain_name(names: Names) -> str:
    """The same as part of the names of files and rows."""
    joined = ", ".join(_shorten_name(name) for name in names).lower()
    return re.sub(r"[^a-z0-9]+", "-", joined).strip("-")[:60] or "backend"


def _shorten_name(name: str) -> str:
    """Without the company or the folder."""
    kind, colon, rest = name.partition(":")
    if kind == "recorded":
        return f"recorded-{Path(rest).stem}"
    return rest if colon and kind in ("openai", "anthropic") else name


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
    return _make_take_turns(backend, _Turns(asking.turns, asking.at_once))


def find_url(names: Sequence[str], base_url: str | None) -> str | None:
    """The endpoint, for those that have one."""
    return base_url if any("openai:" in name for name in names) else None


def check_asking(asking: Asking, *, one_machine: bool) -> None:
    """InputError where an option of how to ask cannot be used."""
    if asking.at_once is not None and not 1 <= asking.at_once <= MOST_AT_ONCE:
        raise InputError(f"--at-once is a number from 1 to {MOST_AT_ONCE}, got {asking.at_once}")
    if one_machine:
        return
    for name, value in (("--record", asking.record), ("--at-once", asking.at_once)):
        if value is not None:
            raise InputError(f"{name} works on one machine: leave it out with --engine ray")


class _Turns:
    """So many may go on at a time, over all processes that share the folder.

    A turn is a lock on a file: a process that dies releases it.
    """

    def __init__(self, folder: Path, most: int) -> None:
        self._files = [folder / f".asking-{k + 1}.lock" for k in range(most)]

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Waits for one and holds it."""
        lock = self._take()
        try:
            yield
        finally:
            lock.release()

    def _take(self) -> BaseFileLock:
        # Each begins elsewhere, so that not all of them try for the first one.
        first = os.getpid() % len(self._files)
        while True:
            for file in (*self._files[first:], *self._files[:first]):
                lock = FileLock(file)
                with suppress(Timeout):
                    lock.acquire(blocking=False)
                    return lock
            time.sleep(_PAUSE)


def _make_take_turns(backend: Backend, turns: _Turns) -> Backend:
    speakers: Mapping[Task, Backend] | None = getattr(backend, "speakers", None)
    if speakers is not None:
        return Staged({task: _make_one_take_turns(each, turns) for task, each in speakers.items()})
    return _make_one_take_turns(backend, turns)


def _make_one_take_turns(backend: Backend, turns: _Turns) -> Backend:
    """The offline backend takes no turns; it answers at once."""
    return backend if backend.deterministic else _InTurn(backend, turns)


class _InTurn:
    """A backend that is asked when a turn is free."""

    def __init__(self, backend: Backend, turns: _Turns) -> None:
        self.name, self.deterministic = backend.name, backend.deterministic
        self._backend, self._turns = backend, turns

    def __getattr__(self, name: str) -> Any:
        return getattr(self._backend, name)

    def answer(self, question: Question) -> dict[str, Any]:
        """The backend's reply (see `Backend`)."""
        with self._turns.turn():
            return self._backend.answer(question)
