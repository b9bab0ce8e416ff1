"""The wording of a slot of an order: thought up, written and read back; and the book of them.

The book, order.jsonl, is append-only, and written before the scenes are made: an order that is
killed goes on with the same texts, written by a model or not.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Collection
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from scenewright.dataset.batch.answering import BUILTIN, Names
from scenewright.dataset.batch.journal import cut_torn_line
from scenewright.dataset.batch.worker import Options
from scenewright.dataset.orders.order_spec import OrderSpec, Quota
from scenewright.dataset.orders.scenario_spec import (
    Party,
    Story,
    draw_minute,
    draw_passers,
    format_clock,
    list_parties,
)
from scenewright.dataset.orders.templates import list_voices, render_text
from scenewright.dataset.orders.writers import BuiltinWriter, StoryRequest, Writer, WrittenText
from scenewright.errors import InputError
from scenewright.files import format_json_line
from scenewright.intersections import load_map
from scenewright.scene.relations import get_pattern
from scenewright.scene.social import Density
from scenewright.tools.map_grounding.route_meetings import can_be_lawful

BOOK = "order.jsonl"


@dataclass(frozen=True)
class OrderEntry:
    """One instruction.

    Attributes:
        id: of its row; slot: which of the order's scenes it is for; attempt: from 1 on.
        event, leaf: what it is to show; voice: how it is worded.
        backend: name of the planner; intersection: where it happens.
        context: what the scene's context has beside the text: numbers that the order fixes, and
            the time of day where the text gives none.
        time: of day, HH:MM, where the order sees to it.
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
    context: dict[str, Any]
    intersection: str
    time: str | None = None


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
        cut_torn_line(self._file)
        try:
            lines = self._file.read_bytes().splitlines()
            self.entries = [OrderEntry(**json.loads(line)) for line in lines]
        except (ValueError, TypeError) as error:
            raise InputError(f"{self._file} is damaged; begin in another folder") from error
        self._known = {(entry.slot, entry.attempt): entry for entry in self.entries}
        self.number = {each.id: k for k, each in enumerate(self.entries)}
        self.texts = {entry.text for entry in self.entries}

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


REWORDED = 2
"""Attempts at one pattern before another one of the kind takes its place."""
STORIES = 12
"""Stories that are thought up for one attempt at most."""
_DETAIL = (0.25, 0.35, 0.4)
"""How often a text gives the movements alone, one place as well, and both sides."""
_DENSITIES: tuple[Density | None, ...] = (None, None, "low", "medium", "high")
_TIME_GIVEN = 0.8


@dataclass(frozen=True)
class Slot:
    """One scene that the order wants.

    Attributes:
        name: begins the ids of its rows; key: what chance goes by.
        leaves: patterns to try, one after the other; intersection: where it happens.
        share: how far into the hours of the order it lies, from 0 to 1.
        attempts: made so far; filled: id of the row that serves it.
        waiting: whether its backend could not be reached, so that no other words would help.
    """

    number: int
    name: str
    key: str
    quota: Quota
    leaves: tuple[str, ...]
    intersection: str
    share: float
    attempts: int = 0
    filled: str | None = None
    waiting: bool = False

    @property
    def open(self) -> bool:
        """Whether another instruction may fill it."""
        return self.filled is None and not self.waiting

    @property
    def row(self) -> str:
        """The id of the row of its last attempt."""
        return self.name if self.attempts == 1 else f"{self.name}-try{self.attempts}"


@dataclass(frozen=True)
class WordingTask:
    """A slot, and all that its text depends on.

    Attributes:
        earlier: texts of this slot that were refused.
    """

    slot: Slot
    wish: OrderSpec
    options: Options
    earlier: tuple[str, ...]


def word_by_templates(task: WordingTask) -> OrderEntry:
    """Word a slot by the builtin templates; as a worker does, for which a place is loaded once."""
    writer = _load_templates(task.slot.intersection, task.options.lawful)
    return word_slot(task, writer, ())


@cache
def _load_templates(intersection: str, lawful: bool) -> BuiltinWriter:
    return BuiltinWriter(load_map(intersection), lawful=lawful)


def word_slot(task: WordingTask, writer: Writer, taken: Collection[str]) -> OrderEntry:
    """Word a slot; a story that the place has no room for is thought up anew.

    Args:
        taken: texts of the whole order.
    """
    slot, options = task.slot, task.options
    rng = make_rng(options.seed, slot.key, slot.attempts)
    turn = slot.number + 5 * (slot.attempts - 1)
    asked = StoryRequest(turn, task.earlier, taken, choose_planner(slot, options) == BUILTIN)
    wish, minute = task.wish, None
    if wish.windows or wish.even:
        minute = draw_minute(wish.windows, rng, slot.share if wish.even else None)
    for _ in range(STORIES):
        story = draw_story(slot, wish, options, rng, minute=minute)
        written = writer.write_text(story, asked, rng=rng)
        if written is not None:
            break
    else:  # written as it is: the pipeline will report what is wrong with it
        voice = list_voices(story)[0]
        written = WrittenText(render_text(story, voice, rng), voice, STORIES)
    background = wish.context.background
    context: dict[str, Any] = {}
    if background is not None:
        context["background"] = background.model_dump(exclude_none=True)
    time = None if minute is None else format_clock(minute)
    if story.minute is None and time is not None:
        context["time_of_day"] = time
    return OrderEntry(
        id=slot.row, slot=slot.number, attempt=slot.attempts, event=slot.quota.event,
        leaf=story.leaf, voice=written.voice, text=written.text, seed=int(rng.integers(2**31)),
        backend=list(choose_planner(slot, options)), intersection=slot.intersection,
        context=context, time=time,
    )  # fmt: skip


def choose_planner(slot: Slot, options: Options) -> Names:
    """The backend that plans a slot's text: its quota's own, or the order's."""
    return options.backend if slot.quota.backend is None else (slot.quota.backend,)


def draw_story(
    slot: Slot,
    wish: OrderSpec,
    options: Options,
    rng: np.random.Generator,
    *,
    minute: int | None = None,
) -> Story:
    """What this attempt is to show; its text gives the minute of the day, or leaves it out."""
    intersection_map = load_map(slot.intersection)
    nth = (slot.attempts - 1) // REWORDED
    leaf = slot.leaves[nth % len(slot.leaves)] if slot.leaves else None
    parties: tuple[Party, ...] = ()
    if leaf is not None:
        detail = int(rng.choice(len(_DETAIL), p=_DETAIL))
        parties = list_parties(
            get_pattern(leaf),
            intersection_map=intersection_map,
            detail=detail,
            rng=rng,
            rider=slot.quota.rider,
        )
    elif slot.quota.foreground:
        parties = draw_passers(intersection_map, rng)
    if not wish.windows and rng.random() >= _TIME_GIVEN:
        minute = None
    drawn = _DENSITIES[int(rng.integers(len(_DENSITIES)))]
    density = wish.context.density or drawn
    runner = choose_runner(leaf, slot.intersection) if options.lawful else None
    return Story(slot.quota.event, leaf, parties, minute, density, runner)


@cache
def choose_runner(leaf: str | None, intersection: str) -> int | None:
    """The party that a text has run a red light, as without that the pattern cannot be there."""
    if leaf is None or can_be_lawful(get_pattern(leaf), intersection_map=load_map(intersection)):
        return None
    return 0 if get_pattern(leaf).violator == "from" else 1


def make_rng(*key: int | str) -> np.random.Generator:
    """A generator of random numbers by numbers and names."""
    numbers = [part if isinstance(part, int) else zlib.crc32(part.encode()) for part in key]
    return np.random.default_rng(np.random.SeedSequence(numbers))
