"""Threads of conversation in one SQLite file: their checkpoints, and what versions are made of.

Checkpoints are LangGraph's, written by a serialiser that takes plain JSON values and nothing else.
Scenes and products of versions are kept beside them under their own fingerprint, so that a
checkpoint stays small and the same bytes are kept once.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
import threading
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import BaseFileLock, FileLock, Timeout
from langgraph.checkpoint.sqlite import SqliteSaver

from scenewright.errors import BusyError, InputError

_KEPT = "CREATE TABLE IF NOT EXISTS kept (key TEXT PRIMARY KEY, body BLOB NOT NULL)"
_PATIENCE = 10.0
"""How long another process may keep the file to itself [s]."""


class PlainSerializer:
    """Values of JSON, and no others, as bytes of JSON."""

    def dumps_typed(self, obj: Any) -> tuple[str, bytes]:
        """The value as bytes, with the name of their form.

        Raises:
            TypeError: the value is no plain one.
        """
        text = json.dumps(_make_plain(obj), allow_nan=False, ensure_ascii=False)
        return "json", text.encode("utf-8", "surrogatepass")

    def loads_typed(self, data: tuple[str, bytes]) -> Any:
        """The value; ValueError for any other form."""
        form, body = data
        if form != "json":
            raise ValueError(f"a checkpoint of the form {form!r} is not read")
        return json.loads(body.decode("utf-8", "surrogatepass"))


def _make_plain(value: Any) -> Any:
    """The value with tuples as lists; a fault that ended a step is kept as its words."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, dict):
        if not all(isinstance(key, str) for key in value):
            raise TypeError("a key of a checkpoint must be text")
        return {key: _make_plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_make_plain(each) for each in value]
    if isinstance(value, BaseException):
        return f"{type(value).__name__}: {value}"
    raise TypeError(f"a checkpoint holds plain values, not {type(value).__name__}")


class Threads:
    """All threads of one file.

    Args:
        path: the file; made with its folder if it is not there. `:memory:` keeps nothing.

    Raises:
        InputError: the file cannot be used.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = str(path)
        try:
            if self.path != ":memory:":
                Path(path).parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            self._connection = sqlite3.connect(
                self.path, check_same_thread=False, timeout=_PATIENCE
            )
            # A caller that forgets to close it must not leave the file open.
            self._close = weakref.finalize(self, self._connection.close)
            self._connection.execute("PRAGMA synchronous=FULL")
            self.saver = SqliteSaver(self._connection, serde=PlainSerializer())
            self.saver.setup()
            self._connection.execute(_KEPT)
            self._connection.commit()
        except (sqlite3.Error, OSError) as error:
            raise InputError(f"cannot use {self.path} for threads: {error}") from error
        self._lock = self.saver.lock
        self._held: BaseFileLock | None = None
        self._turns: dict[str, BaseFileLock | threading.RLock] = {}

    def keep(self, body: bytes) -> str:
        """The fingerprint under which the bytes are kept from now on."""
        key = hashlib.sha256(body).hexdigest()
        with self._lock, self._connection as connection:
            connection.execute("INSERT OR IGNORE INTO kept VALUES (?, ?)", (key, body))
        return key

    def get_bytes(self, key: str) -> bytes:
        """The bytes of a fingerprint.

        Raises:
            InputError: they are not there, or not what they were.
        """
        with self._lock:
            row = self._connection.execute("SELECT body FROM kept WHERE key = ?", (key,)).fetchone()
        if row is None or hashlib.sha256(row[0]).hexdigest() != key:
            raise InputError(f"{self.path} is damaged: a version of this thread is not in it")
        return bytes(row[0])

    def list_names(self) -> Sequence[str]:
        """The threads there are, last used first."""
        query = (
            "SELECT thread_id FROM checkpoints GROUP BY thread_id ORDER BY MAX(checkpoint_id) DESC"
        )
        with self._lock:
            return [str(row[0]) for row in self._connection.execute(query)]

    def hold(self, thread: str) -> None:
        """Keeps a thread from being worked on by two processes at once, until this one ends.

        Raises:
            InputError: another one has it.
        """
        if self.path == ":memory:":
            return
        # Another thread of this process may close it: requests come on any.
        self._held = FileLock(self._name_lock(thread), thread_local=False)
        try:
            self._held.acquire(blocking=False)
        except Timeout as error:
            raise InputError(
                f"thread {thread} is open in another process; use another one"
            ) from error

    @contextmanager
    def take_turn(self, thread: str, *, wait: bool = True) -> Iterator[None]:
        """Work on a thread alone, whatever other objects and processes use the same file.

        The one that works on it may take it again within.

        Raises:
            BusyError: another turn goes on and is not to be waited for.
        """
        lock = self._turns.get(thread)
        if lock is None:
            memory = self.path == ":memory:"
            new = threading.RLock() if memory else FileLock(self._name_lock(thread, ".turn"))
            lock = self._turns.setdefault(thread, new)
        try:
            taken = bool(lock.acquire(blocking=wait))
        except Timeout:
            taken = False
        if not taken:
            raise BusyError("a turn of this conversation is still being worked on")
        try:
            yield
        finally:
            lock.release()

    def _name_lock(self, thread: str, kind: str = "") -> str:
        name = hashlib.sha256(thread.encode("utf-8", "surrogatepass")).hexdigest()[:16]
        return f"{self.path}.{name}{kind}.lock"

    def close(self) -> None:
        """Lets go of the file."""
        if self._held is not None:
            self._held.release()
        with suppress(sqlite3.Error):
            self._close()
