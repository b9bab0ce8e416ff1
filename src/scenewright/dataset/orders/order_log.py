"""order.jsonl: every instruction that was written for an order, in order; append-only.

Written before its scene is made, so an order that is killed goes on with the same texts, written
by a model or not.
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scenewright.dataset.batch.worker import format_json_line
from scenewright.errors import InputError

BOOK = "order.jsonl"


@dataclass(frozen=True)
class OrderEntry:
    """One instruction.

    Attributes:
        id: of its row; slot: which of the order's scenes it is for; attempt: from 1 on.
        event, leaf: what it is to show; voice: how it is worded.
        backend: name of the planner; background: numbers that the order fixes.
        intersection: where it happens, if the order names several places.
    """

    id: str
    slot: int
    attempt: int
    event: str
    leaf: str | None
    voice: str
    text: str
    seed: int
    backend: list[str]
    background: dict[str, Any] | None = None
    intersection: str | None = None


class Book:
    """The instructions so far.

    Attributes:
        entries: in the order in which they were written; number: id -> place among them.
        texts: all of them.
    """

    def __init__(self, folder: Path) -> None:
        """Reads what an earlier run wrote; a line that a kill cut short is dropped.

        Raises:
            InputError: the file is damaged.
        """
        self._file = folder / BOOK
        self._file.touch()
        data = self._file.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        if len(whole) < len(data):
            os.truncate(self._file, len(whole))
        try:
            self.entries = [OrderEntry(**json.loads(line)) for line in whole.splitlines()]
        except (ValueError, TypeError) as error:
            raise InputError(f"{self._file} is damaged; begin in another folder") from error
        self._known = {(each.slot, each.attempt): each for each in self.entries}
        self.number = {each.id: k for k, each in enumerate(self.entries)}
        self.texts = {each.text for each in self.entries}

    def find(self, slot: int, attempt: int) -> OrderEntry | None:
        """What was written for this attempt at a slot."""
        return self._known.get((slot, attempt))

    def add(self, entry: OrderEntry) -> None:
        """Writes one more."""
        with self._file.open("ab", buffering=0) as stream:
            stream.write(format_json_line(asdict(entry)))
        self.number[entry.id] = len(self.entries)
        self.entries.append(entry)
        self.texts.add(entry.text)
        self._known[entry.slot, entry.attempt] = entry
