"""Events that share no agent are moved in time against one another until their agents keep apart.

Each event is scheduled by itself, so several of them in one scene would meet by chance. What is
moved are whole groups of agents that events bind to one another, to times that the lights allow all
of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.constraints import PairClause
from scenewright.scene.track import STEP
from scenewright.tools.solver.context import APART
from scenewright.tools.solver.reservation import find_blocked_offsets
from scenewright.tools.solver.schedule import PartialSchedule, find_needed_end, get_pair

_FARTHEST = 20.0
"""How far a group of agents is moved at most, to either side [s]."""

_LONGEST = 29.0
"""From the beginning of the first event to the end of the last [s], so that a scene holds both."""

_GRID = 0.5
"""Spacing of the signal programme's offsets, and of the times by which groups are moved [s]."""

FindOffsets = Callable[[PartialSchedule], NDArray[np.bool_]]
"""Whether each offset of the signal programme, on its grid, is lawful for all agents."""

_TRIES = 8
"""How many orders of the groups are tried."""


def list_separations(
    schedule: PartialSchedule, rng: np.random.Generator, find_offsets: FindOffsets
) -> Iterator[PartialSchedule]:
    """List the schedule, and others in which unrelated agents of its events keep apart."""
    yield schedule
    parts = split_by_agents(schedule)
    if len(parts) < 2:
        return
    lights = [find_offsets(part) for part in parts]
    for _ in range(_TRIES):
        order = rng.permutation(len(parts))
        moved = _move_apart([parts[k] for k in order], [lights[k] for k in order], rng)
        if moved is not None:
            # The agents' order decides what is drawn for them later.
            yield replace(moved, actors={name: moved.actors[name] for name in schedule.actors})


def split_by_agents(schedule: PartialSchedule) -> list[PartialSchedule]:
    """Split a schedule into parts that share no agent; an agent without an event is a part."""
    groups = join_names(schedule.actors, (get_pair(each.clause) for each in schedule.events))
    return [
        PartialSchedule(
            {name: each for name, each in schedule.actors.items() if name in group},
            tuple(each for each in schedule.events if get_pair(each.clause)[0] in group),
        )
        for group in groups
    ]


def split_clauses(clauses: Sequence[PairClause]) -> list[tuple[PairClause, ...]]:
    """Split clauses into lists that share no agent, each in the order given."""
    groups = join_names((), map(get_pair, clauses))
    return [tuple(each for each in clauses if get_pair(each)[0] in group) for group in groups]


def join_names(names: Iterable[str], pairs: Iterable[tuple[str, str]]) -> list[set[str]]:
    """Group names that pairs connect.

    >>> [sorted(each) for each in join_names("a", [("b", "c"), ("d", "e"), ("c", "f")])]
    [['a'], ['d', 'e'], ['b', 'c', 'f']]
    """
    groups = [{name} for name in names]
    for pair in pairs:
        joined = set(pair).union(*(group for group in groups if group & set(pair)))
        groups = [*(group for group in groups if not group & set(pair)), joined]
    return groups


def join_schedules(parts: Sequence[PartialSchedule], rng: np.random.Generator) -> PartialSchedule:
    """Join schedules that share no agent, all but the first moved in time."""
    moved = [parts[0], *(each.shift(round(float(rng.uniform(*APART)), 1)) for each in parts[1:])]
    actors = {name: actor for each in moved for name, actor in each.actors.items()}
    return PartialSchedule(actors, tuple(event for each in moved for event in each.events))


def _move_apart(
    parts: Sequence[PartialSchedule], lights: Sequence[NDArray[np.bool_]], rng: np.random.Generator
) -> PartialSchedule | None:
    """Place one part after the other at a time drawn among those without a conflict, if any."""
    placed, lawful = parts[0], lights[0]
    for part, own in zip(parts[1:], lights[1:], strict=True):
        # A part that comes later needs what the programme shows that much later.
        shifts = [k for k in _find_free_shifts(placed, part) if (lawful & np.roll(own, -k)).any()]
        if not shifts:
            return None
        k = int(rng.choice(shifts))
        moved, lawful = part.shift(round(k * _GRID, 1)), lawful & np.roll(own, -k)
        placed = PartialSchedule({**placed.actors, **moved.actors}, (*placed.events, *moved.events))
    return placed


def _find_free_shifts(placed: PartialSchedule, part: PartialSchedule) -> list[int]:
    """Find by how much [grid steps] a part can be moved so that no agent meets one placed."""
    reach = round(_FARTHEST / _GRID)
    shifts = np.arange(-reach, reach + 1)
    free = np.ones(len(shifts), dtype=np.bool_)
    if placed.events and part.events:
        moved, ends = shifts * _GRID, [find_needed_end(each) for each in (placed, part)]
        begins = [min(event.begins for event in each.events) for each in (placed, part)]
        last = np.maximum(ends[0], ends[1] + moved)
        free = last - np.minimum(begins[0], begins[1] + moved) <= _LONGEST
    steps = shifts * (_GRID / STEP)
    for a, b in product(placed.actors.values(), part.actors.values()):
        apart = (b.enters - a.enters) / STEP
        for low, high in find_blocked_offsets(a, b, strict=True):
            free &= (steps + apart <= low) | (steps + apart >= high)
    return [int(each) for each in shifts[free]]
