"""Everybody else in time: candidate and entry time of agents that no relation binds.

Two ways. In turn (`assign_in_turn`): each agent takes the first of its options that keeps clear of
those seated before it, as near to the time it was drawn for as may be; who finds no room makes way
for a spare. That is a draw among the surviving combinations, one agent after the other.

At once, at least cost: see `assignment`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from scenewright.scene.base import AgentClass
from scenewright.scene.track import STEP
from scenewright.tools.solver.reservation import ReservationTable, Steps, find_blocked_offsets
from scenewright.tools.solver.scheduled_agent import ScheduledAgent


@dataclass(frozen=True, eq=False)
class Option:
    """One way in which an agent may take part.

    Attributes:
        make: builds candidate and motion, entering at time 0, when first looked at.
        starts: [N] allowed entry times in steps of 0.1 s, ascending.
        cost: -log density of it [nats].
        drawn_time: entry time [steps] that it was drawn for.
        follows: it drives behind who is ahead of it.
    """

    make: Callable[[], ScheduledAgent]
    index: int
    starts: Steps
    cost: float
    drawn_time: int = 0
    follows: bool = False

    @cached_property
    def actor(self) -> ScheduledAgent:
        """The agent as this option has it; its entry time is a placeholder."""
        return self.make()


@dataclass(eq=False)
class Seated:
    """Who has a place already, in scene time.

    Attributes:
        standing: everybody; present: the same as reservations; None where all are seated at once.
        chosen: option and entry time [steps] of those in the background, by name.
    """

    standing: list[ScheduledAgent] = field(default_factory=list)
    present: ReservationTable | None = None
    chosen: dict[str, tuple[Option, int]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class BackgroundAgent:
    """An agent to be placed.

    Attributes:
        make: builds its options, lazily, the likeliest of a candidate first, given those in whose
            way or behind whom it may come to stand, or whom it walks with.
        foreground: keeps the stricter distance to all, and must take part.
        reserve: drawn beyond the number wanted; takes part only if another agent cannot.
    """

    name: str
    type: AgentClass
    foreground: bool
    make: Callable[[Seated], Iterable[Option]]
    reserve: bool = False

    @cached_property
    def options(self) -> tuple[Option, ...]:
        """The ways in which it may take part, if nobody stands anywhere."""
        return tuple(self.make(Seated()))


@dataclass(frozen=True, eq=False)
class Assignment:
    """Chosen option and entry time [steps] of every guest that takes part."""

    chosen: Mapping[str, tuple[Option, int]]
    optimal: bool
    rounds: int
    pairs: int


def assign_in_turn(
    agents: Sequence[BackgroundAgent],
    table: ConflictTable,
    wanted: Mapping[AgentClass, int],
    least: Mapping[AgentClass, int] | None = None,
) -> Assignment | str:
    """Guests seated in the order given until every class has as many as wanted.

    Args:
        least: how many of each class suffice where no more find room; None for as many as wanted.
    """
    left = dict(wanted)
    present = ReservationTable(table.fixed)
    seated = Seated(list(table.fixed), present)
    for agent in sorted(agents, key=lambda each: not each.foreground):
        if not agent.foreground and left[agent.type] <= 0:
            continue
        found = _first_room(agent, present, seated)
        if found is not None:
            option, start = seated.chosen[agent.name] = found
            seated.standing.append(option.actor.shifted(STEP * start))
            present.add(seated.standing[-1], foreground=agent.foreground)
            left[agent.type] -= not agent.foreground
        elif agent.foreground:
            return f"{agent.name} finds no moment at which it would not interact"
    enough = wanted if least is None else least
    if any(wanted[kind] - left[kind] < enough.get(kind, wanted[kind]) for kind in wanted):
        return f"no room for {sum(left.values())} of {sum(wanted.values())} further agents"
    return Assignment(seated.chosen, optimal=False, rounds=1, pairs=len(seated.chosen))


def _first_room(
    agent: BackgroundAgent, present: ReservationTable, seated: Seated
) -> tuple[Option, int] | None:
    """The guest's first way with room, and its entry time nearest to the one wished for."""
    for option in agent.make(seated):
        free = present.find_free_times(
            option.actor, option.starts, foreground=agent.foreground, follows=option.follows
        )
        if len(free):
            return option, int(free[np.argmin(np.abs(free - option.drawn_time))])
    return None


class ConflictTable:
    """Forbidden differences of entry times, computed once per pair of options that meet.

    Args:
        fixed: actors whose times are settled. Options are known by identity: keep them alive.
    """

    def __init__(self, fixed: Iterable[ScheduledAgent]) -> None:
        self.fixed = list(fixed)
        self._free: dict[int, Steps] = {}
        self._pairs: dict[tuple[int, int], list[tuple[int, int]]] = {}
        self.evaluated = 0

    @cached_property
    def _present(self) -> ReservationTable:
        return ReservationTable(self.fixed)

    def clear_of_fixed(self, option: Option) -> Steps:
        """The option's entry times [steps] that keep clear of every fixed actor."""
        key = id(option)
        if key not in self._free:
            self._free[key] = self._present.find_free_times(
                option.actor, option.starts, foreground=True
            )
        return self._free[key]

    def open_starts(self, option: Option) -> Steps:
        """Entry times to choose among; a single one is checked only once it is chosen."""
        return option.starts if len(option.starts) == 1 else self.clear_of_fixed(option)

    def between(self, a: Option, b: Option, strict: bool) -> list[tuple[int, int]]:
        """What the two options forbid of the difference of their entry times [steps]."""
        key = (id(a), id(b))
        if key not in self._pairs:
            self.evaluated += 1
            self._pairs[key] = find_blocked_offsets(a.actor, b.actor, strict=strict)
        return self._pairs[key]
