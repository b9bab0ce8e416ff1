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
from pathlib import Path
from typing import Any

from scenewright.dataset.batch.answering import (
    Asking,
    Names,
    find_record_path,
    find_url,
    make_plain_name,
)
from scenewright.dataset.batch.carry_out import BatchFolder, Progress, ProgressCallback, Work
from scenewright.dataset.batch.pool import spread
from scenewright.dataset.batch.worker import Job, Options
from scenewright.dataset.orders.order_spec import OrderSpec
from scenewright.dataset.orders.wording import (
    Book,
    OrderEntry,
    Slot,
    WordingTask,
    make_rng,
    word_by_templates,
    word_slot,
)
from scenewright.dataset.orders.writers import Writer

SPARE = 20
"""Instructions beyond twice the scenes that a budget has if none is named."""
FEW = 12
"""Texts for which no workers are started."""


@dataclass(frozen=True)
class Order(Work):
    """What the agent was asked for.

    Attributes:
        text: the order as given, for the record; wish: as it was understood.
        places: intersections, if not the options' one alone; the later half of them is held out:
            their scenes are the test split.
        writer: name of the writer of the instructions.
        budget: most instructions; None: twice the scenes + 20.
        asking: where several are asked, each has a file of answers of its own beside the one that
            is named.
    """

    text: str
    wish: OrderSpec
    out: Path
    options: Options
    places: tuple[str, ...] = ()
    writer: str = "builtin"
    budget: int | None = None
    title: str = "Traffic scenes to order"

    @property
    def all_places(self) -> tuple[str, ...]:
        """Where its scenes are made."""
        return self.places or (self.options.intersection,)

    @property
    def held(self) -> tuple[str, ...]:
        """Places whose scenes are all of the test split."""
        return self.all_places[(len(self.all_places) + 1) // 2 :]

    @property
    def most(self) -> int:
        """Instructions that may be written."""
        return self.budget or 2 * self.wish.count + SPARE

    def map_speakers(self) -> dict[Names, Asking]:
        """Backend -> how its questions are put."""
        others = [(quota.backend,) for quota in self.wish.quotas if quota.backend]
        all_names: list[Names] = list(dict.fromkeys([self.options.backend, *others]))
        asking = replace(self.asking, turns=self.out)
        if len(all_names) == 1:
            return {all_names[0]: asking}
        return {
            name: replace(asking, record=find_record_path(asking.record, make_plain_name(name)))
            for name in all_names
        }


@dataclass(frozen=True)
class OrderContext:
    """What the agent works with.

    Attributes:
        writers: of the instructions, for each place; asking: backend -> how its questions are put.
    """

    order: Order
    batch: BatchFolder
    book: Book
    writers: Mapping[str, Writer]
    asking: Mapping[Names, Asking]
    log: ProgressCallback


def fill_slots(context: OrderContext) -> tuple[Slot, ...]:
    """Rounds, as long as slots are open and the budget is not spent; the slots as they end."""
    order = context.order
    slots = {
        slot.number: slot
        for slot in build_slots(order.wish, seed=order.options.seed, places=order.all_places)
    }
    left = order.most
    while due := [slot for slot in slots.values() if slot.open][: max(left, 0)]:
        left -= len(due)
        due = [replace(slot, attempts=slot.attempts + 1) for slot in due]
        slots.update({slot.number: slot for slot in due})
        write_instructions(due, context)
        jobs = build_jobs(order, context.book.entries, [*slots.values()], context.asking)
        # What is done is left alone.
        context.batch.carry_out(jobs, order, of=len(jobs), log=context.log)
        for slot in due:
            name = slot.row
            done = context.batch.journal.get_entry(context.book.number[name])
            if done is not None and done.code == "backend_failed":
                slots[slot.number] = replace(slot, waiting=True)
            elif done is not None and done.status == "made":
                slots[slot.number] = replace(slot, filled=name)
    return tuple(slots.values())


def build_slots(wish: OrderSpec, *, seed: int, places: Sequence[str]) -> Iterator[Slot]:
    """A slot for each scene; each quota's patterns in turn, in an order that the seed decides.

    A place is one with the fewest slots so far, of these one with the fewest of the pattern. The
    slots of a quota lie at equal distances in the day, in an order that the seed decides as well.
    """
    number, names, used = 0, _choose_id_prefixes(wish), Counter[Any]()
    for quota in wish.quotas:
        key = quota.name if quota.place is None else f"{quota.place}-{quota.name}"
        rng = make_rng(seed, key)
        leaves = [quota.leaves[int(k)] for k in rng.permutation(len(quota.leaves))]
        name = quota.name if quota.backend is None else f"{names[quota.backend]}-{quota.name}"
        digits = max(len(str(quota.count)), 2)
        # Of small quotas, each begins elsewhere in the day.
        shares = (rng.permutation(quota.count) + 0.618 * number % 1.0) / quota.count
        for k in range(quota.count):
            turned = leaves[k % len(leaves) :] + leaves[: k % len(leaves)] if leaves else []
            count, leaf = f"{k + 1:0{digits}d}", tuple(turned[:1])
            place = min(places, key=lambda each, leaf=leaf: (used[each], used[leaf, each]))  # type: ignore[misc]
            used.update((place, (leaf, place)))
            yield Slot(
                number, f"{name}-{count}", f"{key}-{count}", quota, tuple(turned), place,
                float(shares[k]),
            )  # fmt: skip
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


def write_instructions(due: Sequence[Slot], context: OrderContext) -> None:
    """Words each slot that has no instruction of this attempt yet, and enters it in the book.

    In the order of the slots; templates on all workers, as each text is read back.
    """
    book, order = context.book, context.order
    tasks = []
    for slot in (each for each in due if not book.find(each.number, each.attempts)):
        earlier = (book.find(slot.number, k) for k in range(1, slot.attempts))
        texts = tuple(each.text for each in earlier if each is not None)
        tasks.append(WordingTask(slot, order.wish, order.options, texts))
    progress = Progress(len(tasks), context.log, what="texts")
    if len(tasks) < FEW or any(writer.name != "builtin" for writer in context.writers.values()):
        for task in tasks:
            book.add(word_slot(task, context.writers[task.slot.intersection], book.texts))
            progress.log_end("made", now=True)
        return
    done: dict[int, OrderEntry] = {}
    waiting = deque(task.slot.number for task in tasks)
    for task, result in spread(tasks, word_by_templates, workers=order.workers):
        worded = result if isinstance(result, OrderEntry) else word_by_templates(task)
        done[task.slot.number] = worded
        progress.log_end("made", now=True)
        while waiting and waiting[0] in done:
            book.add(done.pop(waiting.popleft()))


def build_jobs(
    order: Order,
    entries: Iterable[OrderEntry],
    slots: Sequence[Slot],
    asking: Mapping[Names, Asking],
) -> list[Job]:
    """The jobs of all that was written."""
    options = order.options
    return [
        Job(
            number=number, key=entry.id, folder=entry.id, text=entry.text, seed=entry.seed,
            options=replace(
                options, intersection=entry.intersection or options.intersection,
                backend=tuple(entry.backend), base_url=find_url(entry.backend, options.base_url),
            ),
            context=entry.context, asked=entry.event, voice=entry.voice,
            wanted=slots[entry.slot].quota.leaves,
            split="test" if entry.intersection in order.held else None,
            asking=asking[tuple(entry.backend)],
        )
        for number, entry in enumerate(entries)
    ]  # fmt: skip
