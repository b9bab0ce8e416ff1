"""The agent that fills an order, round by round: it words, makes, and looks at what came of it.

What the order wants becomes slots, one for each scene. A round words an instruction for every open
slot, has the pipeline carry them out, and fills the slots of which there is a scene. A slot whose
instruction was refused is worded anew, then given another pattern of its kind, until the budget is
spent. Every step can be repeated: what was written stands in order.jsonl, what was made in the
journal, so a run that is killed goes on where it was.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from scenewright.dataset.batch.answering import Asking, Names, find_url, make_plain_name
from scenewright.dataset.batch.carry_out import (
    BatchFolder,
    Engine,
    ProgressCallback,
    ProgressClock,
)
from scenewright.dataset.batch.pool import spread
from scenewright.dataset.batch.worker import Job, Options
from scenewright.dataset.orders.order_log import Book, OrderEntry
from scenewright.dataset.orders.order_spec import OrderSpec
from scenewright.dataset.orders.wording import (
    Slot,
    Wording,
    WordingTask,
    choose_planner,
    make_rng,
    word_by_templates,
    word_slot,
)
from scenewright.dataset.orders.writers import Writer

FEW = 12
"""Texts for which no workers are started."""


@dataclass(frozen=True)
class OrderContext:
    """What the agent works with.

    Attributes:
        places: intersections that take turns; held: those whose scenes are all of the test split.
        writers: of the instructions, for each place.
        budget: instructions that may be written in all; limit: longest a row may take [s].
        asking: backend -> how its questions are put.
    """

    wish: OrderSpec
    batch: BatchFolder
    book: Book
    places: tuple[str, ...]
    held: tuple[str, ...]
    writers: Mapping[str, Writer]
    options: Options
    budget: int
    workers: int
    engine: Engine
    limit: float
    asking: Mapping[Names, Asking]
    log: ProgressCallback


def fill_slots(context: OrderContext) -> tuple[Slot, ...]:
    """Rounds, as long as slots are open and the budget is not spent; the slots as they end."""
    slots = {
        slot.number: slot
        for slot in build_slots(context.wish, seed=context.options.seed, places=context.places)
    }
    left = context.budget
    while due := [slot for slot in slots.values() if slot.open][: max(left, 0)]:
        left -= len(due)
        due = [replace(slot, attempts=slot.attempts + 1) for slot in due]
        slots.update({slot.number: slot for slot in due})
        new = [slot for slot in due if not context.book.find(slot.number, slot.attempts)]
        for slot, wording in zip(new, _word_slots(new, context), strict=True):
            context.book.add(_build_entry(slot, wording, context))
        jobs = build_jobs(
            context.book.entries, [*slots.values()], context.options, context.asking,
            held=context.held,
        )  # fmt: skip
        context.batch.carry_out(  # what is done is left alone
            jobs, of=len(jobs), workers=context.workers, engine=context.engine,
            limit=context.limit, log=context.log,
        )  # fmt: skip
        for slot in due:
            name = _name_row(slot)
            done = context.batch.journal.get_entry(context.book.number[name])
            if done is not None and done.code == "backend_failed":
                slots[slot.number] = replace(slot, waiting=True)
            elif done is not None and done.status == "made":
                slots[slot.number] = replace(slot, filled=name)
    return tuple(slots.values())


def build_slots(wish: OrderSpec, *, seed: int, places: Sequence[str]) -> Iterator[Slot]:
    """A slot for each scene; each quota's patterns in turn, in an order that the seed decides.

    Places take turns as well, begun one later when all patterns had their turn.
    """
    number, names = 0, _choose_id_prefixes(wish)
    for quota in wish.quotas:
        key = quota.name if quota.place is None else f"{quota.place}-{quota.name}"
        rng = make_rng(seed, key)
        leaves = [quota.leaves[int(k)] for k in rng.permutation(len(quota.leaves))]
        name = quota.name if quota.backend is None else f"{names[quota.backend]}-{quota.name}"
        digits = max(len(str(quota.count)), 2)
        for k in range(quota.count):
            turned = leaves[k % len(leaves) :] + leaves[: k % len(leaves)] if leaves else []
            count = f"{k + 1:0{digits}d}"
            turn, pattern = divmod(k, max(len(leaves), 1))
            place = places[(turn + pattern) % len(places)]
            yield Slot(number, f"{name}-{count}", f"{key}-{count}", quota, tuple(turned), place)
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


def _word_slots(slots: Sequence[Slot], context: OrderContext) -> Iterator[Wording]:
    """Word slots in their order; templates on all workers, as each text is read back."""
    tasks = []
    for slot in slots:
        earlier = (context.book.find(slot.number, k) for k in range(1, slot.attempts))
        texts = tuple(each.text for each in earlier if each is not None)
        tasks.append(WordingTask(slot, context.wish, context.options, texts))
    clock = ProgressClock(len(tasks), context.log, what="texts")
    if len(tasks) < FEW or any(each.name != "builtin" for each in context.writers.values()):
        for task in tasks:
            yield word_slot(task, context.writers[task.slot.intersection], context.book.texts)
            clock.log_end("made", now=True)
        return
    done: dict[int, Wording] = {}
    waiting = deque(task.slot.number for task in tasks)
    for task, result in spread(tasks, word_by_templates, workers=context.workers):
        worded = result if isinstance(result, Wording) else word_by_templates(task)
        done[task.slot.number] = worded
        clock.log_end("made", now=True)
        while waiting and waiting[0] in done:
            yield done.pop(waiting.popleft())


def _name_row(slot: Slot) -> str:
    return slot.name if slot.attempts == 1 else f"{slot.name}-try{slot.attempts}"


def _build_entry(slot: Slot, wording: Wording, context: OrderContext) -> OrderEntry:
    background = context.wish.context.background
    return OrderEntry(
        id=_name_row(slot), slot=slot.number, attempt=slot.attempts, event=slot.quota.event, leaf=wording.leaf,
        voice=wording.written.voice, text=wording.written.text, seed=wording.seed,
        backend=list(choose_planner(slot, context.options)),
        background=None if background is None else background.model_dump(exclude_none=True),
        intersection=slot.intersection,
    )  # fmt: skip


def build_jobs(
    entries: Iterable[OrderEntry],
    slots: Sequence[Slot],
    options: Options,
    asking: Mapping[Names, Asking],
    *,
    held: Sequence[str] = (),
) -> list[Job]:
    """The jobs of all that was written."""
    return [
        Job(
            number=number, key=entry.id, folder=entry.id, text=entry.text, seed=entry.seed,
            options=replace(
                options, intersection=entry.intersection or options.intersection,
                backend=tuple(entry.backend), base_url=find_url(entry.backend, options.base_url),
            ),
            context={} if entry.background is None else {"background": entry.background},
            asked=entry.event, voice=entry.voice,
            wanted=slots[entry.slot].quota.leaves,
            split="test" if entry.intersection in held else None,
            asking=asking[tuple(entry.backend)],
        )
        for number, entry in enumerate(entries)
    ]  # fmt: skip
