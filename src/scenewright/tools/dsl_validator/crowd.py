"""Everybody else in time: candidate and entry time of agents that no relation binds.

Two ways. In turn (`seat_in_turn`): each agent takes the first of its options that keeps clear of
those seated before it, as near to the time it was drawn for as may be; who finds no room makes way
for a spare. That is a draw among the surviving combinations, one agent after the other.

At once, at least cost: see `seating`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import AgentClass
from scenewright.scene.track import STEP
from scenewright.tools.dsl_validator.actor import Actor
from scenewright.tools.dsl_validator.separation import Geometry, forbidden_offsets


@dataclass(frozen=True, eq=False)
class Option:
    """One way in which an agent may take part.

    Attributes:
        make: builds candidate and motion, entering at time 0, when first looked at.
        starts: [N] allowed entry times in steps of 0.1 s, ascending.
        cost: -log density of it [nats].
        wish: entry time [steps] that it was drawn for.
    """

    make: Callable[[], Actor]
    index: int
    starts: NDArray[np.int64]
    cost: float
    wish: int = 0

    @cached_property
    def actor(self) -> Actor:
        """The agent as this option has it; its entry time is a placeholder."""
        return self.make()


@dataclass(frozen=True, eq=False)
class Guest:
    """An agent to be placed.

    Attributes:
        make: builds its options when they are first looked at.
        foreground: keeps the stricter distance to all, and must take part.
        spare: drawn beyond the number wanted; takes part only if somebody else cannot.
        behind: an option that queues behind those who stand in its way, given them in scene time.
    """

    name: str
    type: AgentClass
    foreground: bool
    make: Callable[[], tuple[Option, ...]]
    spare: bool = False
    behind: Callable[[Sequence[Actor]], Option | None] | None = None

    @cached_property
    def options(self) -> tuple[Option, ...]:
        """The ways in which it may take part."""
        return self.make()


@dataclass(frozen=True, eq=False)
class Seating:
    """Chosen option and entry time [steps] of every guest that takes part."""

    chosen: Mapping[str, tuple[Option, int]]
    optimal: bool
    rounds: int
    pairs: int


def seat_in_turn(
    guests: Sequence[Guest], table: Table, wanted: Mapping[AgentClass, int]
) -> Seating | str:
    """Guests seated in the order given until every class has as many as wanted."""
    left = dict(wanted)
    seated: list[tuple[Guest, Option, int]] = []
    for guest in sorted(guests, key=lambda each: not each.foreground):
        if not guest.foreground and left[guest.type] <= 0:
            continue
        found = _first_room(guest, seated, table)
        if found is not None:
            seated.append((guest, *found))
            left[guest.type] -= not guest.foreground
        elif guest.foreground:
            return f"{guest.name} finds no moment at which it would not interact"
    if any(left.values()):
        return f"no room for {sum(left.values())} of {sum(wanted.values())} further agents"
    chosen = {guest.name: (option, start) for guest, option, start in seated}
    return Seating(chosen, optimal=False, rounds=1, pairs=table.evaluated)


def _first_room(
    guest: Guest, seated: list[tuple[Guest, Option, int]], table: Table
) -> tuple[Option, int] | None:
    """The guest's cheapest option with room, and its entry time nearest to the one wished for."""
    options = sorted(guest.options, key=lambda each: each.cost)
    for option in itertools.chain(options, _queueing(guest, seated, table)):
        free = table.clear_of_fixed(option)
        for other, taken, start in seated:
            if not len(free):
                break
            strict = guest.foreground or other.foreground
            free = _outside(free, start, table.between(taken, option, strict))
        if len(free):
            return option, int(free[np.argmin(np.abs(free - option.wish))])
    return None


def _queueing(
    guest: Guest, seated: list[tuple[Guest, Option, int]], table: Table
) -> Iterator[Option]:
    """Lazily, the option behind whoever stands: foreground, wrecks, and those seated."""
    if guest.behind is None:
        return
    present = [option.actor.shifted(STEP * start) for _, option, start in seated]
    option = guest.behind([*table.fixed, *present])
    if option is not None:
        yield option


def _outside(
    free: NDArray[np.int64], start: int, forbidden: list[tuple[int, int]]
) -> NDArray[np.int64]:
    """Entry times whose difference from `start` lies in none of the open intervals."""
    for low, high in forbidden:
        free = free[(free - start <= low) | (free - start >= high)]
    return free


class Table:
    """Forbidden differences of entry times, computed once per pair of options that meet.

    Args:
        fixed: actors whose times are settled. Options are known by identity: keep them alive.
    """

    def __init__(self, fixed: Iterable[Actor]) -> None:
        self.fixed = list(fixed)
        self._free: dict[int, NDArray[np.int64]] = {}
        self._pairs: dict[tuple[int, int], list[tuple[int, int]]] = {}
        self._geometry = Geometry()
        self.evaluated = 0

    def clear_of_fixed(self, option: Option) -> NDArray[np.int64]:
        """The option's entry times [steps] that keep clear of every fixed actor."""
        key = id(option)
        if key not in self._free:
            free = option.starts
            for actor in self.fixed if len(free) else ():
                shift = round(actor.enters / STEP)
                free = _outside(free, shift, self._forbidden(actor, option.actor, strict=True))
            self._free[key] = free
        return self._free[key]

    def open_starts(self, option: Option) -> NDArray[np.int64]:
        """Entry times to choose among; a single one is checked only once it is chosen."""
        return option.starts if len(option.starts) == 1 else self.clear_of_fixed(option)

    def between(self, a: Option, b: Option, strict: bool) -> list[tuple[int, int]]:
        """What the two options forbid of the difference of their entry times [steps]."""
        key = (id(a), id(b))
        if key not in self._pairs:
            self._pairs[key] = self._forbidden(a.actor, b.actor, strict=strict)
        return self._pairs[key]

    def _forbidden(self, a: Actor, b: Actor, *, strict: bool) -> list[tuple[int, int]]:
        self.evaluated += 1
        return forbidden_offsets(a, b, strict=strict, geometry=self._geometry)
