"""Candidate and entry time of background agents, which no relation binds.

Each agent in turn takes the first of its options that keeps clear of those assigned before it, as
near to its drawn entry time as possible; an agent without a free option is replaced by a reserve
agent. That is a draw among the surviving combinations, and where options come by ascending cost, a
cheap one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from scenewright.scene.base import AgentClass
from scenewright.scene.track import STEP
from scenewright.tools.solver.reservation import ReservationTable, Steps
from scenewright.tools.solver.scheduled_agent import ScheduledAgent


@dataclass(frozen=True, eq=False)
class Option:
    """One option of an agent: a candidate with its allowed entry times.

    Attributes:
        make: builds candidate and motion, entering at time 0, when first looked at.
        starts: [N] allowed entry times in steps of 0.1 s, ascending.
        drawn_time: the entry time [steps] drawn for it.
        follows: whether it drives behind the vehicle ahead.
    """

    make: Callable[[], ScheduledAgent]
    index: int
    starts: Steps
    drawn_time: int = 0
    follows: bool = False

    @cached_property
    def actor(self) -> ScheduledAgent:
        """Build the agent with this option; its entry time is a placeholder."""
        return self.make()


@dataclass(eq=False)
class AssignedAgents:
    """The agents assigned so far, in scene time.

    Attributes:
        standing: all of them; present: their reservations; None where all are assigned at once.
        chosen: option and entry time [steps] of those in the background, by name.
    """

    standing: list[ScheduledAgent] = field(default_factory=list)
    present: ReservationTable | None = None
    chosen: dict[str, tuple[Option, int]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class BackgroundAgent:
    """A background agent to be placed.

    Attributes:
        make: builds its options, lazily, the likeliest of a candidate first, given the agents that
            it may meet, queue behind or walk with.
        foreground: keeps the stricter distance to all, and must take part.
        reserve: drawn beyond the number wanted; takes part only if another agent cannot.
    """

    name: str
    type: AgentClass
    foreground: bool
    make: Callable[[AssignedAgents], Iterable[Option]]
    reserve: bool = False

    @cached_property
    def options(self) -> tuple[Option, ...]:
        """List its options with no other agent present."""
        return tuple(self.make(AssignedAgents()))


Assignment = Mapping[str, tuple[Option, int]]
"""Chosen option and entry time [steps] of every background agent that takes part."""


def assign_in_turn(
    agents: Sequence[BackgroundAgent],
    fixed: Iterable[ScheduledAgent],
    wanted: Mapping[AgentClass, int],
    least: Mapping[AgentClass, int] | None = None,
) -> Assignment | str:
    """Assign agents in the order given until every class has as many as wanted.

    Args:
        fixed: agents whose times are settled.
        least: how many of each class suffice if no more fit; None for as many as wanted.
    """
    left = dict(wanted)
    fixed = list(fixed)
    present = ReservationTable(fixed)
    assigned = AssignedAgents(fixed, present)
    for agent in sorted(agents, key=lambda each: not each.foreground):
        if not agent.foreground and left[agent.type] <= 0:
            continue
        found = _find_free_option(agent, present, assigned)
        if found is not None:
            option, start = assigned.chosen[agent.name] = found
            assigned.standing.append(option.actor.shift(STEP * start))
            present.add(assigned.standing[-1], foreground=agent.foreground)
            left[agent.type] -= not agent.foreground
        elif agent.foreground:
            return f"{agent.name} finds no moment at which it would not interact"
    enough = wanted if least is None else least
    if any(wanted[kind] - left[kind] < enough.get(kind, wanted[kind]) for kind in wanted):
        return f"no room for {sum(left.values())} of {sum(wanted.values())} further agents"
    return assigned.chosen


def _find_free_option(
    agent: BackgroundAgent, present: ReservationTable, assigned: AssignedAgents
) -> tuple[Option, int] | None:
    """Find the agent's first feasible option, and its entry time nearest to the drawn one."""
    for option in agent.make(assigned):
        free = present.find_free_times(
            option.actor, option.starts, foreground=agent.foreground, follows=option.follows
        )
        if len(free):
            return option, int(free[np.argmin(np.abs(free - option.drawn_time))])
    return None
