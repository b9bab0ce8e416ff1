"""What is done, as an append-only file: one header, then one line for each row that came to an end.

A line is written by one call and counts only with its newline, so a run may be killed anywhere.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Self

from filelock import FileLock, Timeout

from scenewright.errors import InputError
from scenewright.files import format_json_line, write_atomically


@dataclass(frozen=True)
class JournalEntry:
    """What became of a row, as the journal has it.

    Attributes:
        sha256: name -> hash of each file of its folder.
        paid: requests to models and their tokens.
    """

    number: int
    key: str
    folder: str
    status: str
    code: str | None
    reason: str | None
    sha256: Mapping[str, str]
    attempts: int
    seconds: float
    paid: Mapping[str, int] = field(default_factory=dict)


class Journal:
    """The journals of a folder, of which this run appends to one."""

    def __init__(self, folder: Path, *, name: str | None, header: Mapping[str, Any]) -> None:
        """Opens or begins the journal of that name; None: only reads those that there are.

        Raises:
            InputError: the folder's journals are of another input or of other options.
        """
        self._lines: dict[int, bytes] = {}
        self._writer: BinaryIO | None = None
        if name is not None:
            if not (folder / name).exists():  # it has its header or does not exist
                write_atomically(folder / name, format_json_line(header))
            cut_torn_line(folder / name)
        for path in sorted(folder.glob("journal*.jsonl")):
            self._load(path, dict(header))
        if name is not None:
            self._writer = (folder / name).open("ab", buffering=0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Lets go of the file."""
        if self._writer is not None:
            self._writer.close()

    def append(self, entry: JournalEntry) -> None:
        """Adds a line, at once and whole."""
        if self._writer is None:
            raise ValueError("this journal is only read")
        data = format_json_line(vars(entry))
        if self._writer.write(data) != len(data):
            raise InputError("cannot write the journal: no space left")
        self._lines[entry.number] = data

    def get_entry(self, number: int) -> JournalEntry | None:
        """The last line about a row."""
        line = self._lines.get(number)
        return None if line is None else JournalEntry(**json.loads(line))

    def _load(self, path: Path, header: dict[str, Any]) -> None:
        first, *lines = _read_lines(path)
        try:
            found = json.loads(first)
        except ValueError as error:
            raise InputError(f"{path} is no journal of a batch; choose another --out") from error
        if found != header:
            changed = [key for key in header if found.get(key) != header[key]]
            changes = (f"{key} was {found.get(key)!r}, now {header[key]!r}" for key in changed)
            what = ", ".join(changes) or "another layout"
            what = "the input has changed" if "input" in changed else what
            raise InputError(
                f"{path.parent} was begun otherwise ({what}); what is there cannot be gone on "
                "with: give the same input and options, or choose another --out"
            )
        try:
            self._lines.update((int(json.loads(line)["number"]), line) for line in lines)
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path} is damaged; remove the folder and begin anew") from error


def read_entries(path: Path) -> list[JournalEntry]:
    """What a journal says of the rows that came to an end, in order; no file, no rows."""
    if not path.exists():
        return []
    return [JournalEntry(**json.loads(line)) for line in _read_lines(path)[1:]]


def _read_lines(path: Path) -> list[bytes]:
    """The header and the lines after it; one without its newline is none."""
    header, *lines = path.read_bytes().splitlines(keepends=True) or [b""]
    return [header, *(line for line in lines if line.endswith(b"\n"))]


def cut_torn_line(path: Path) -> None:
    """Drops what stands behind the last newline: a write that a kill cut short."""
    with path.open("r+b") as stream:
        begin = end = stream.seek(0, os.SEEK_END)
        at = -1
        while begin and at < 0:
            begin = max(begin - 65536, 0)
            stream.seek(begin)
            at = stream.read(min(65536, end - begin)).rfind(b"\n")
        if begin + at + 1 < end:
            stream.truncate(begin + at + 1)


@contextmanager
def lock_journal(folder: Path, name: str, *, patient: bool = False) -> Iterator[None]:
    """Keeps a second run of the same journal out for as long as this one lives.

    Args:
        patient: wait for the other run to end.

    Raises:
        InputError: there is one.
    """
    lock = FileLock(folder / f".{name}.lock")
    try:
        lock.acquire(blocking=patient)
    except Timeout as error:
        raise InputError(f"another run is writing into {folder}; wait for it") from error
    try:
        yield
    finally:
        lock.release()
