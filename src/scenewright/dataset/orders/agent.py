"""The agent that fills an order: a LangGraph of `write`, `make`, `settle`, round and round.

    read -> write -> make -> settle -> write ... -> report

What the order wants becomes slots, one for each scene. `write` words an instruction for every open
slot, `make` has the pipeline carry them out, `settle` looks at what came of it. A slot whose
instruction was refused is worded anew, then given another pattern of its kind, until the budget is
spent. Every step can be repeated: what was written stands in order.jsonl, what was made in the
journal, so a run that is killed goes on where it was.
"""

from __future__ import annotations

import json
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypedDict

import numpy as np
from langgraph.graph import END, START, StateGraph
from langgraph.runtime import Runtime

from scenewright.dataset.batch.answering import BUILTIN, Asking, Names, find_url, make_plain_name
from scenewright.dataset.batch.carry_out import BatchFolder, Engine, ProgressCallback
from scenewright.dataset.batch.journal import JournalEntry as Done
from scenewright.dataset.batch.worker import Job, Options
from scenewright.dataset.orders.order_log import Book, OrderEntry
from scenewright.dataset.orders.order_spec import OrderSpec, Quota
from scenewright.dataset.orders.scenario_spec import (
    Party,
    Story,
    draw_minute,
    draw_passers,
    list_parties,
)
from scenewright.dataset.orders.templates import list_voices, render_text
from scenewright.dataset.orders.writers import StoryRequest, Writer, WrittenText
from scenewright.intersections import load_map
from scenewright.scene.relations import get_pattern
from scenewright.scene.social import Density
from scenewright.tools.map_grounding.grounding import can_be_lawful

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
        leaves: patterns to try, one after the other.
        attempts: made so far; filled: id of the row that serves it.
        waiting: whether its backend could not be reached, so that no other words would help.
    """

    number: int
    name: str
    key: str
    quota: Quota
    leaves: tuple[str, ...]
    attempts: int = 0
    filled: str | None = None
    waiting: bool = False

    @property
    def open(self) -> bool:
        """Whether another instruction may fill it."""
        return self.filled is None and not self.waiting


class OrderState(TypedDict, total=False):
    """Channels of the agent."""

    slots: tuple[Slot, ...]
    due: tuple[OrderEntry, ...]
    spent: int


@dataclass(frozen=True)
class OrderContext:
    """What the agent works with.

    Attributes:
        budget: instructions that may be written in all; limit: longest a row may take [s].
        asking: backend -> how its questions are put.
    """

    wish: OrderSpec
    batch: BatchFolder
    book: Book
    writer: Writer
    options: Options
    budget: int
    workers: int
    engine: Engine
    limit: float
    asking: Mapping[Names, Asking]
    log: ProgressCallback


class WriteReads(TypedDict):
    """Channels that `write` reads."""

    slots: tuple[Slot, ...]
    spent: int


def read(state: OrderState, *, runtime: Runtime[OrderContext]) -> OrderState:
    """The wish becomes slots, patterns dealt out evenly."""
    del state
    context = runtime.context
    return {"slots": tuple(build_slots(context.wish, seed=context.options.seed)), "spent": 0}


def write(state: WriteReads, *, runtime: Runtime[OrderContext]) -> OrderState:
    """An instruction for every open slot, as far as the budget goes."""
    context = runtime.context
    open_slots = [slot for slot in state["slots"] if slot.open]
    due = open_slots[: context.budget - state["spent"]]
    slots = {slot.number: replace(slot, attempts=slot.attempts + 1) for slot in due}
    entries = tuple(_write_instruction(slots[slot.number], context) for slot in due)
    after = tuple(slots.get(slot.number, slot) for slot in state["slots"])
    return {"slots": after, "due": entries, "spent": state["spent"] + len(due)}


def make(state: OrderState, *, runtime: Runtime[OrderContext]) -> OrderState:
    """The pipeline carries out all that was written; what is done is left alone."""
    del state
    context = runtime.context
    jobs = build_jobs(context.book.entries, context.options, context.asking)
    context.batch.carry_out(
        jobs, of=len(jobs), workers=context.workers, engine=context.engine, limit=context.limit,
        log=context.log,
    )  # fmt: skip
    return {}


class SettleReads(TypedDict):
    """Channels that `settle` reads."""

    slots: tuple[Slot, ...]
    due: tuple[OrderEntry, ...]


def settle(state: SettleReads, *, runtime: Runtime[OrderContext]) -> OrderState:
    """A slot is filled by a scene that shows what the slot is for."""
    context = runtime.context
    slots = {slot.number: slot for slot in state["slots"]}
    for entry in state["due"]:
        slot = slots[entry.slot]
        done = context.batch.journal.get_entry(context.book.number[entry.id])
        if done is not None and done.code == "backend_failed":
            slots[slot.number] = replace(slot, waiting=True)
        elif done is not None and is_slot_served(slot, done, context.batch.out):
            slots[slot.number] = replace(slot, filled=entry.id)
    return {"slots": tuple(slots.values())}


class RouteReads(TypedDict):
    """Channels that the route reads."""

    slots: tuple[Slot, ...]
    due: tuple[OrderEntry, ...]
    spent: int


def choose_next(state: RouteReads, *, runtime: Runtime[OrderContext]) -> Literal["write", "end"]:
    """Another round, as long as slots are open and the budget is not spent."""
    left = runtime.context.budget - state["spent"]
    return "write" if left > 0 and any(slot.open for slot in state["slots"]) else "end"


@cache
def build_order_graph() -> Any:
    """The compiled agent."""
    graph: StateGraph[OrderState, OrderContext, OrderState, OrderState] = StateGraph(
        OrderState, context_schema=OrderContext
    )
    for name, node in (("read", read), ("write", write), ("make", make), ("settle", settle)):
        graph.add_node(name, node)
    graph.add_edge(START, "read")
    graph.add_edge("read", "write")
    graph.add_edge("write", "make")
    graph.add_edge("make", "settle")
    graph.add_conditional_edges("settle", choose_next, {"write": "write", "end": END})
    return graph.compile(name="order")


def build_slots(wish: OrderSpec, *, seed: int) -> Iterator[Slot]:
    """A slot for each scene; each quota's patterns in turn, in an order that the seed decides."""
    number, names = 0, _choose_id_prefixes(wish)
    for quota in wish.quotas:
        key = quota.name if quota.place is None else f"{quota.place}-{quota.name}"
        rng = _make_rng(seed, key)
        leaves = [quota.leaves[int(k)] for k in rng.permutation(len(quota.leaves))]
        name = quota.name if quota.backend is None else f"{names[quota.backend]}-{quota.name}"
        digits = max(len(str(quota.count)), 2)
        for k in range(quota.count):
            turned = leaves[k % len(leaves) :] + leaves[: k % len(leaves)] if leaves else []
            count = f"{k + 1:0{digits}d}"
            yield Slot(number, f"{name}-{count}", f"{key}-{count}", quota, tuple(turned))
            number += 1


def _choose_id_prefixes(wish: OrderSpec) -> dict[str, str]:
    """Backend -> how the ids of its rows begin; no two alike."""
    backends = dict.fromkeys(quota.backend for quota in wish.quotas if quota.backend)
    plain = {backend: make_plain_name((backend,)) for backend in backends}
    often = Counter(plain.values())
    return {
        backend: name if often[name] == 1 else f"{name}-{k + 1}"
        for k, (backend, name) in enumerate(plain.items())
    }


def _make_rng(*key: int | str) -> np.random.Generator:
    numbers = [part if isinstance(part, int) else zlib.crc32(part.encode()) for part in key]
    return np.random.default_rng(np.random.SeedSequence(numbers))


def _write_instruction(slot: Slot, context: OrderContext) -> OrderEntry:
    """The instruction of this attempt: as it was written before, or a new one."""
    known = context.book.find(slot.number, slot.attempts)
    if known is not None:
        return known
    rng = _make_rng(context.options.seed, slot.key, slot.attempts)
    earlier = [context.book.find(slot.number, k) for k in range(1, slot.attempts)]
    story, written = _word_story(slot, context, [each.text for each in earlier if each], rng)
    background = context.wish.context.background
    entry = OrderEntry(
        id=slot.name if slot.attempts == 1 else f"{slot.name}-try{slot.attempts}",
        slot=slot.number,
        attempt=slot.attempts,
        event=slot.quota.event,
        leaf=story.leaf,
        voice=written.voice,
        text=written.text,
        seed=int(rng.integers(2**31)),
        backend=list(_choose_planner(slot, context)),
        background=None if background is None else background.model_dump(exclude_none=True),
    )
    context.book.add(entry)
    return entry


def _choose_planner(slot: Slot, context: OrderContext) -> Names:
    return context.options.backend if slot.quota.backend is None else (slot.quota.backend,)


def _word_story(
    slot: Slot, context: OrderContext, avoid: list[str], rng: np.random.Generator
) -> tuple[Story, WrittenText]:
    """A story with its text; one that the place has no room for is thought up anew."""
    turn = slot.number + 5 * (slot.attempts - 1)
    asked = StoryRequest(
        turn, tuple(avoid), context.book.texts, _choose_planner(slot, context) == BUILTIN
    )
    for _ in range(STORIES):
        story = draw_story(slot, context, rng)
        written = context.writer.write_text(story, asked, rng=rng)
        if written is not None:
            return story, written
    # Written as it is: the pipeline will report what is wrong with it.
    voice = list_voices(story)[0]
    return story, WrittenText(render_text(story, voice, rng), voice, STORIES)


def draw_story(slot: Slot, context: OrderContext, rng: np.random.Generator) -> Story:
    """What this attempt is to show."""
    intersection_map = load_map(context.options.intersection)
    leaf = _choose_leaf(slot)
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
    windows = context.wish.windows
    is_given = bool(windows) or rng.random() < _TIME_GIVEN
    minute = draw_minute(windows, rng) if is_given else None
    drawn = _DENSITIES[int(rng.integers(len(_DENSITIES)))]
    density = context.wish.context.density or drawn
    runner = choose_runner(leaf, context.options.intersection) if context.options.lawful else None
    return Story(slot.quota.event, leaf, parties, minute, density, runner)


@cache
def choose_runner(leaf: str | None, intersection: str) -> int | None:
    """The party that a text has run a red light, as without that the pattern cannot be there."""
    if leaf is None or can_be_lawful(get_pattern(leaf), intersection_map=load_map(intersection)):
        return None
    return 0 if get_pattern(leaf).violator == "from" else 1


def _choose_leaf(slot: Slot) -> str | None:
    if not slot.leaves:
        return None
    return slot.leaves[(slot.attempts - 1) // REWORDED % len(slot.leaves)]


def build_jobs(
    entries: Iterable[OrderEntry], options: Options, asking: Mapping[Names, Asking]
) -> list[Job]:
    """The jobs of all that was written."""
    return [
        Job(
            number=number,
            key=entry.id,
            folder=entry.id,
            text=entry.text,
            seed=entry.seed,
            intersection=options.intersection,
            backend=tuple(entry.backend),
            refiner=options.refiner,
            selection=options.selection,
            context={} if entry.background is None else {"background": entry.background},
            asked=entry.event,
            voice=entry.voice,
            base_url=find_url(entry.backend, options.base_url),
            lawful=options.lawful,
            time_limit=options.time_limit,
            asking=asking[tuple(entry.backend)],
        )
        for number, entry in enumerate(entries)
    ]


def is_slot_served(slot: Slot, done: Done, out: Path) -> bool:
    """Whether a row's scene shows what its slot is for."""
    if done.status != "made":
        return False
    shown = list_shown(out, done)
    if slot.quota.event == "normal":
        return shown == ([], [])
    events, leaves = shown
    return events == [slot.quota.event] and set(leaves) <= set(slot.quota.leaves)


def list_shown(out: Path, done: Done) -> tuple[list[str], list[str]]:
    """The events that a scene was made for, and the patterns that play them."""
    folder = out / done.folder
    scene = json.loads((folder / "scene.json").read_bytes())
    about = json.loads((folder / "provenance.json").read_bytes())
    return [each["type"] for each in scene["relations"]], list(about["patterns"])
