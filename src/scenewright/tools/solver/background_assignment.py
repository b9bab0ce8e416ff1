"""Candidate and entry time of background agents, which no relation binds.

Each agent in turn takes the first of its candidates and entry times at which it keeps clear of
those placed before it; an agent without room is replaced by a reserve agent. That is a draw among
the surviving combinations, and where candidates come by ascending cost, a cheap one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from scenewright.scene.base import AgentClass
from scenewright.tools.solver.reservation import ReservationTable
from scenewright.tools.solver.scheduled_agent import ScheduledAgent


@dataclass(frozen=True, eq=False)
class PlacedAgent:
    """A background agent in scene time, with the index of its candidate."""

    actor: ScheduledAgent
    index: int


Assignment = Mapping[str, PlacedAgent]
"""Every background agent that takes part."""


@dataclass(frozen=True, eq=False)
class Street:
    """The agents placed so far, in scene time.

    Attributes:
        present: reservations of all; placed: those of the background by name.
    """

    present: ReservationTable
    placed: dict[str, PlacedAgent] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class BackgroundAgent:
    """A background agent to be placed.

    Attributes:
        place: places it on a street; None where it finds no room.
        foreground: keeps the stricter distance to all, and must take part.
    """

    name: str
    type: AgentClass
    foreground: bool
    place: Callable[[Street], PlacedAgent | None]


def assign_in_turn(
    agents: Sequence[BackgroundAgent],
    fixed: Iterable[ScheduledAgent],
    wanted: Mapping[AgentClass, int],
    least: Mapping[AgentClass, int] | None = None,
) -> Assignment | str:
    """Place agents in the order given until every class has as many as wanted.

    Args:
        fixed: agents whose times are settled.
        least: how many of each class suffice if no more fit; None for as many as wanted.

    Returns:
        The agents placed, or why some cannot be.
    """
    left, street = dict(wanted), Street(ReservationTable(fixed))
    for agent in sorted(agents, key=lambda each: not each.foreground):
        if not agent.foreground and left[agent.type] <= 0:
            continue
        found = agent.place(street)
        if found is not None:
            street.placed[agent.name] = found
            street.present.add(found.actor, foreground=agent.foreground)
            left[agent.type] -= not agent.foreground
        elif agent.foreground:
            return f"{agent.name} finds no moment at which it would not interact"
    enough = wanted if least is None else least
    if any(wanted[kind] - left[kind] < enough.get(kind, wanted[kind]) for kind in wanted):
        return f"no room for {sum(left.values())} of {sum(wanted.values())} further agents"
    return street.placed
