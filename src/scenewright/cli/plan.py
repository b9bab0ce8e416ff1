"""`scenewright plan`: rows of text in, rows of social graphs out."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from multiprocessing.pool import ThreadPool
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenewright.backends import Backend, Call, Named, Question, get_backend_of_task, load_backend
from scenewright.cli.console import format_one_line, log_line
from scenewright.cli.errors import to_cli_error
from scenewright.cli.interrupts import stop_if_asked
from scenewright.cli.make import read_instruction
from scenewright.errors import BackendFault, InputError, Rejected
from scenewright.intersections import load_map
from scenewright.nodes import scene_planner
from scenewright.nodes.scene_planner.prompts import render_plan_prompt
from scenewright.scene.map import IntersectionMap
from scenewright.scene.plan_row import plan_to_row
from scenewright.scene.social import Plan, Refusal

if TYPE_CHECKING:
    from scenewright.scene.plan_file import LogicalPlan

ATTEMPTS = 3


def read_rows(path: str) -> list[Any]:
    """The JSON values of a file of lines, in order; `-` is stdin. Blank lines are none.

    Raises:
        InputError: unreadable, not UTF-8, or a line that is not JSON; says which.
    """
    name = "standard input" if path == "-" else path
    try:
        if path == "-":
            data = sys.stdin.buffer.read() if sys.stdin is not None else b""
        else:
            data = Path(path).read_bytes()
        text = data.decode("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot read {name}: {reason}") from error
    found = []
    for number, line in enumerate(text.split("\n"), start=1):
        if line.strip():
            try:
                found.append(json.loads(line))
            except (ValueError, RecursionError) as error:
                raise InputError(f"{name}, line {number}: not JSON: {error}") from error
    return found


def plan(
    text: str,
    *,
    previous: str | None = None,
    intersection: str | None = None,
    backend: Named | Backend = "builtin",
) -> dict[str, Any]:
    """What is understood of an instruction: the row that `scenewright plan` writes, without an id.

    Args:
        previous: an earlier instruction that the text may change.
        intersection: where it happens; None: four legs, in right-hand traffic.
        backend: as in `synthesize`.

    Raises:
        InputError: no such intersection or backend.
        BackendFault: the backend failed for good.
    """
    if isinstance(backend, str | Sequence | Mapping):
        backend = load_backend(backend)
    (row,), _ = plan_all([{"id": "", "text": text, "previous": previous}], backend, intersection)
    del row["id"]
    return row


def plan_all(
    rows: list[Any], backend: Backend, intersection: str | None = None
) -> tuple[list[dict[str, Any]], dict[str, int]]:
    """One row out per row in, in order; a row that cannot be planned is a refusal.

    Args:
        intersection: that the rows are about; None: four legs, in right-hand traffic.

    Returns:
        The rows; and requests to models, with tokens as far as counted, if any were asked.

    Raises:
        InputError: no such intersection.
        BackendFault: the backend failed for good; carries what answers have cost.
    """

    place, calls = None if intersection is None else load_map(intersection), list[Call]()

    def plan_one(row: Any) -> Plan:
        """A bug that one text brings out must not cost all the other rows."""
        if fault := _find_fault(row):
            return build_refusal(fault)
        try:
            return ask_for_plan(row, backend, intersection_map=place, account=calls.append)
        except BackendFault:
            raise
        except Exception as error:
            if os.environ.get("SCENEWRIGHT_TRACEBACK"):
                raise
            reason = to_cli_error(error).reason
            log_line(f"warning: row {format_one_line(row['id'], limit=60)!r}: {reason}")
            return build_refusal(reason)

    many = min(int(getattr(get_backend_of_task(backend, "plan"), "at_once", 1)), len(rows))
    planned: list[dict[str, Any]] = []
    # Several at a time for a backend that has to be awaited; an interruption ends the threads.
    pool = ThreadPool(many) if many > 1 else nullcontext()
    try:
        with pool as several:
            plans = map(plan_one, rows) if several is None else several.imap(plan_one, rows)
            for row, plan in zip(rows, plans, strict=True):
                stop_if_asked()
                name = row.get("id") if isinstance(row, dict) else None
                # the id that a row came with, right or wrong, as far as one can be read from it
                own = name if isinstance(name, str | int) else None
                planned.append({**plan_to_row("", plan), "id": own})
    except BackendFault as fault:
        from scenewright.graph.provenance import sum_costs_by_task

        fault.models = sum_costs_by_task(calls)
        raise
    asked = sum(call.asked for call in calls)
    if not asked:
        return planned, {}
    return planned, {
        "requests": asked,
        "input_tokens": sum(call.input_tokens or 0 for call in calls),
        "output_tokens": sum(call.output_tokens or 0 for call in calls),
    }


def _find_fault(row: Any) -> str | None:
    """What is wrong with a row, if anything."""
    if not isinstance(row, dict):
        return "A row is an object with 'id' and 'text'."
    for key in ("id", "text"):
        if not isinstance(row.get(key), str):
            return f"The row needs {key!r} as a string."
    if not isinstance(row.get("previous"), str | None):
        return "'previous' must be a string, the text of the earlier turn."
    return None


def build_refusal(reason: str) -> Refusal:
    """A row's no."""
    return Refusal(code="out_of_scope", reason=reason)


def ask_for_plan(
    row: dict[str, Any],
    backend: Backend,
    *,
    intersection_map: IntersectionMap | None = None,
    account: Callable[[Call], None] = lambda _call: None,
) -> Plan:
    """The backend's plan; given what was wrong, it may mend a malformed one."""
    ways, left_hand, roads = scene_planner.FOUR_LEGS, False, {}
    if intersection_map is not None:
        ways = scene_planner.describe_routes(intersection_map)
        left_hand = intersection_map.left_hand_traffic
        roads = {leg.name: leg.road for leg in intersection_map.legs}
    text, previous = row["text"], row.get("previous")
    wrong: tuple[str, ...] = ()
    for _ in range(1 if get_backend_of_task(backend, "plan").deterministic else ATTEMPTS):
        question = Question(
            task="plan",
            facts={
                "instruction": text,
                "previous": previous,
                "legs": list(dict.fromkeys(way.entry for way in ways)),
                "left_hand": left_hand,
                "roads": roads,
            },
            rejections=wrong,
            prompt=lambda wrong=wrong: render_plan_prompt(  # type: ignore[misc]
                text, previous, ways, left_hand=left_hand, rejections=wrong
            ),
            account=account,
        )
        try:
            return scene_planner.ask_for_plan(backend, question, ways)
        except Rejected as error:
            wrong = (*wrong, error.rejection.detail)
    return build_refusal(f"The backend gave no usable plan: {wrong[-1]}")


def format_plan_of(text: str, backend: Backend, intersection: str | None, *, osc: bool) -> str:
    """The plan of a file, or of an instruction as `make` plans it, as YAML.

    Args:
        osc: in OpenSCENARIO DSL instead, with what a file leaves open.

    Raises:
        InputError, Unsatisfiable, BackendFault: as `synthesize`.
    """
    from scenewright.files import is_plan_file
    from scenewright.graph.arguments import DEFAULT_INTERSECTION
    from scenewright.graph.run import plan_instruction
    from scenewright.scene.plan_file import LogicalPlan, format_plan, read_logical_plan, read_plan

    if is_plan_file(text):
        if osc:
            return read_logical_plan(text).format_osc_dsl()
        given = read_plan(text)
        return format_plan(given.plan, given.text if given.as_read else "")
    words, place = read_instruction(text), intersection or DEFAULT_INTERSECTION
    plan = plan_instruction(words, intersection=place, backend=backend)
    if not osc:
        return format_plan(plan, words)
    fields = plan.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    return LogicalPlan("words", {**fields, "text": words}).format_osc_dsl()


_POINTS = 16
"""Points tried of what a plan leaves open, before it counts as impossible."""


def _draw_points(logical: LogicalPlan, placed: LogicalPlan, place: str) -> Iterator[Any]:
    """The middle of what a plan leaves open, then, where that is asked for, other points of it."""
    from scenewright.dataset.batch.sweep import build_points

    yield {at: spread.compute_value(0.5) for at, spread in placed.spreads.items()}
    if placed.spreads:
        here = replace(logical, places=(place,))
        drawn = build_points(here, _POINTS, sampling="sobol", seed=0, place=place)
        yield from (each.values for each in drawn)


def check_plan_file(path: str, intersection: str | None) -> dict[str, Any]:
    """What a plan file says, with the middle of what it leaves open, or another point of it that
    is possible.

    Raises:
        InputError: it is no plan, or the place has no way for an agent; names line and field.
    """
    from scenewright.dataset.batch.sweep import load_places
    from scenewright.graph.arguments import DEFAULT_INTERSECTION
    from scenewright.graph.plan_faults import check_plan
    from scenewright.scene.phrasing import describe_graph
    from scenewright.scene.plan_file import read_logical_plan

    logical, place = read_logical_plan(path), intersection or DEFAULT_INTERSECTION
    places = load_places(logical, place)
    place = place if place in places else next(iter(places))
    placed = logical.place_at(places[place])
    faults: list[InputError] = []
    for values in _draw_points(logical, placed, place):
        try:
            if (broken := placed.find_broken(values)) is not None:
                raise broken
            given = placed.settle(values)
            check_plan(given, intersection=place)
            break
        except InputError as error:
            faults.append(error)
    else:
        raise faults[0]
    open_ = logical.describe_open()
    words = describe_graph(given.plan)
    if open_:
        left = "; ".join(f"{name}: {what}" for name, what in open_.items())
        words = f"For example: {words} Left open: {left}."
    return {"file": path, "summary": words, "as_read": given.as_read, "open": open_}
