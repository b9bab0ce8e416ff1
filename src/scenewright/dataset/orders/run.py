"""One order from end to end: the agent's rounds, the dataset, and what came of the order."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from scenewright.dataset.batch.answering import Asking, Names, find_record_path, find_url
from scenewright.dataset.batch.carry_out import BatchFolder, ProgressCallback
from scenewright.dataset.batch.finish import finish_run
from scenewright.dataset.batch.journal import Journal
from scenewright.dataset.batch.run import check_options, hash_bundle, list_settings
from scenewright.dataset.orders.agent import Order, OrderContext, build_jobs, fill_slots
from scenewright.dataset.orders.order_spec import NORMAL, OrderSpec, Quota
from scenewright.dataset.orders.templates import VOICES
from scenewright.dataset.orders.wording import BOOK, Book, Slot
from scenewright.dataset.orders.writers import load_writer
from scenewright.errors import InputError
from scenewright.files import format_json_line, write_atomically
from scenewright.intersections import load_map
from scenewright.scene.relations import load_patterns
from scenewright.scene.social import SceneContext

REPORT = "report.json"


def fill(order: Order, *, log: ProgressCallback = lambda _: None) -> dict[str, Any]:
    """Fills an order and writes its dataset; the report.

    Raises:
        InputError: an option or the folder cannot be used.
        BackendFault: the writer failed for good.
    """
    speakers = order.map_speakers()
    check_order(order, speakers)
    kept = find_record_path(order.asking.record, "writer")
    writers = {
        place: load_writer(
            order.writer,
            intersection_map=load_map(place),
            base_url=order.options.base_url,
            asking=replace(order.asking, record=kept),
            lawful=order.options.lawful,
        )
        for place in order.all_places
    }
    header = build_order_header(order)
    with BatchFolder(order.out, header=header) as batch:
        book = Book(order.out)
        context = OrderContext(order, batch, book, writers, speakers, log)
        before = _list_sizes(order.out)
        slots = fill_slots(context)
        with batch.lock_journals() as journal:
            report = report_of(order, slots, book, journal)
            write_atomically(order.out / REPORT, format_json_line(report))
            finish_run(
                batch, journal, build_jobs(order, book.entries, slots, speakers),
                changed=before != _list_sizes(order.out), given=len(book.entries),
                title=order.title, complete=report["filled"], extra=(BOOK, REPORT),
            )  # fmt: skip
    return report


def check_order(order: Order, speakers: Mapping[Names, Asking]) -> None:
    """InputError where an option cannot be used."""
    order.check_work()
    if order.most < order.wish.count:
        raise InputError(f"a budget of {order.most} is below the {order.wish.count} scenes ordered")
    url = order.options.base_url
    all_names = [*(name for names in speakers for name in names), order.writer]
    if url is not None and find_url(all_names, url) is None:
        raise InputError("--base-url is where a model is reached; name one, as openai:MODEL")
    for names, asking in speakers.items():
        options = replace(order.options, backend=names, base_url=find_url(names, url))
        check_options(options, asking)


def _list_sizes(out: Path) -> tuple[int, ...]:
    """Sizes of what grows as an order is filled."""
    return tuple(path.stat().st_size for path in (*sorted(out.glob("journal*.jsonl")), out / BOOK))


def build_order_header(order: Order) -> dict[str, Any]:
    """What decides the scenes of an order."""
    from scenewright import __version__

    return {
        "journal": 3,
        "scenewright": __version__,
        "order": order.text,
        "writer": order.writer,
        "budget": order.most,
        **list_settings(order.options),
    } | (
        {"intersections": {name: hash_bundle(name) for name in order.places}}
        if order.places
        else {}
    )


def report_of(order: Order, slots: Sequence[Slot], book: Book, journal: Journal) -> dict[str, Any]:
    """What was wanted, what there is, and why the rest could not be."""
    quotas = [_report_quota(quota, slots, book, journal, order.out) for quota in order.wish.quotas]
    made = [book.entries[book.number[slot.filled]] for slot in slots if slot.filled is not None]
    return {
        "order": order.text,
        "understood": order.wish.lines(),
        "filled": all(slot.filled is not None for slot in slots),
        "scenes": len(made),
        "waiting": sum(slot.waiting for slot in slots),
        "instructions": len(book.entries),
        "budget": order.most,
        "by the builtin writer": sum(entry.voice in VOICES for entry in book.entries),
        "held_out": list(order.held),
        "places": dict(sorted(Counter(each.intersection for each in made).items())),
        "hours": dict(sorted(Counter(each.time[:2] for each in made if each.time).items())),
        "voices": dict(sorted(Counter(entry.voice for entry in book.entries).items())),
        "quotas": quotas,
    }


def _report_quota(
    quota: Quota, all_slots: Sequence[Slot], book: Book, journal: Journal, out: Path
) -> dict[str, Any]:
    slots = [slot for slot in all_slots if slot.quota == quota]
    mine = {slot.number for slot in slots}
    leaves, refused = Counter[str](dict.fromkeys(quota.leaves, 0)), Counter[str]()
    for slot in slots:
        done = None if slot.filled is None else journal.get_entry(book.number[slot.filled])
        if done is not None:
            leaves.update(
                json.loads((out / done.folder / "provenance.json").read_bytes())["patterns"]
            )
    for k, entry in enumerate(book.entries):
        done = journal.get_entry(k)
        if entry.slot in mine and done is not None and done.status != "made":
            refused[f"{entry.leaf or NORMAL}: {done.code}"] += 1
    return {
        "name": quota.name,
        "event": quota.event,
        "backend": quota.backend,
        "wanted": quota.count,
        "filled": sum(slot.filled is not None for slot in slots),
        "first_attempt": sum(slot.filled is not None and slot.attempts == 1 for slot in slots),
        "attempts": sum(slot.attempts for slot in slots),
        "patterns": dict(leaves),
        "refused": dict(refused.most_common()),
        "open": [slot.name for slot in slots if slot.filled is None],
    }


def build_paper_order(backends: Sequence[str], *, scale: float = 1.0) -> OrderSpec:
    """The paper's composition (4.1): 100 normal scenes, and 40 collisions and 50 yields of each
    backend, two agents in the foreground, medium density.

    Args:
        scale: of the counts, for a small one to try.
    """
    normal, collision, yielding = (max(round(scale * n), 1) for n in (100, 40, 50))
    quotas = [Quota(NORMAL, normal, NORMAL, backend=None, foreground=True)]
    leaves = {
        relation: tuple(
            pattern.id
            for pattern in load_patterns()
            if pattern.relation == relation and pattern.is_common and pattern.is_of_paper
        )
        for relation in ("collide_at", "yield_to")
    }
    for place, backend in enumerate(backends):
        quotas += [
            Quota("collision", collision, "collision", leaves["collide_at"], backend, place=place),
            Quota("yielding", yielding, "yielding", leaves["yield_to"], backend, place=place),
        ]
    return OrderSpec(tuple(quotas), context=SceneContext(density="medium"))
