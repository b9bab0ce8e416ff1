"""The foreground as far as it is placed: actors in time, and what happens among them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from scenewright.scene.base import Point
from scenewright.scene.constraints import PairClause
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

Pairing = tuple[str, str]


@dataclass(frozen=True)
class ScheduledEvent:
    """An event that the staging brings about: when [s] and where.

    Attributes:
        begins, ends: [s] the span that must be seen, and until which `first` is busy with it.
        freed: [s] until when `second` is busy with it.
    """

    clause: PairClause
    time: float
    begins: float
    ends: float
    freed: float
    location: Point

    def shifted(self, seconds: float) -> ScheduledEvent:
        """The same, later."""
        return replace(
            self,
            time=self.time + seconds,
            begins=self.begins + seconds,
            ends=self.ends + seconds,
            freed=self.freed + seconds,
        )


@dataclass(frozen=True, eq=False)
class PartialSchedule:
    """Actors placed so far, and what happens among them."""

    actors: Mapping[str, ScheduledAgent] = field(default_factory=dict)
    events: tuple[ScheduledEvent, ...] = ()

    def busy_until(self, name: str) -> float:
        """Until when [s] the agent is busy with events so far; -inf if with none."""
        first = [each.ends for each in self.events if name == each.clause.first]
        second = [each.freed for each in self.events if name == each.clause.second]
        return max([*first, *second], default=-float("inf"))

    def too_soon(self, time: float, clause: PairClause) -> bool:
        """Whether the clause would happen before what its agents do earlier has ended."""
        return any(time < self.busy_until(name) + 0.5 for name in get_pair(clause))

    def binds(self, clause: PairClause) -> bool:
        """Whether something happens already between the clause's two agents."""
        pair = set(get_pair(clause))
        return any(set(get_pair(each.clause)) == pair for each in self.events)

    def with_event(
        self, event: ScheduledEvent, a: ScheduledAgent, b: ScheduledAgent
    ) -> PartialSchedule:
        """One event more, and its two actors as they are now."""
        first, second = get_pair(event.clause)
        return PartialSchedule({**self.actors, first: a, second: b}, (*self.events, event))

    def placed(
        self, clause: PairClause, a: ScheduledAgent, b: ScheduledAgent, delta: float
    ) -> tuple[ScheduledAgent, ScheduledAgent]:
        """Both actors with o_b - o_a = delta (to the step); who is on stage already stays put."""
        delta = round(delta, 1)
        first, second = get_pair(clause)
        if second in self.actors:
            return (a if first in self.actors else a.shifted(b.enters - delta - a.enters)), b
        return a, b.shifted(a.enters + delta - b.enters)

    def shifted(self, seconds: float) -> PartialSchedule:
        """Everything later by a multiple of the step."""
        actors = {name: actor.shifted(seconds) for name, actor in self.actors.items()}
        events = tuple(each.shifted(seconds) for each in self.events)
        return PartialSchedule(actors, events)


def get_pair(clause: PairClause) -> Pairing:
    """The clause's two agents."""
    return clause.first, str(clause.second)


def get_point(actor: ScheduledAgent, time: float) -> Point:
    """Where the actor is at a scene time [s]."""
    x, y, _ = actor.at(np.array([time]))[0]
    return float(x), float(y)
