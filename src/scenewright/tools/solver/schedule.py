"""The foreground as far as it is scheduled: agents in time, and the events between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from scenewright.scene.base import Point
from scenewright.scene.constraints import PairClause
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

Pairing = tuple[str, str]

_ENDED = 1.5
"""How long the scene is visible after an event at least [s]."""


@dataclass(frozen=True)
class ScheduledEvent:
    """A scheduled event: when [s] and where.

    Attributes:
        begins, ends: [s] the span that must be visible, and until which `first` is busy with it.
        freed: [s] until when `second` is busy with it.
    """

    clause: PairClause
    time: float
    begins: float
    ends: float
    freed: float
    location: Point

    def shift(self, seconds: float) -> ScheduledEvent:
        """Shift the event in time."""
        return replace(
            self,
            time=self.time + seconds,
            begins=self.begins + seconds,
            ends=self.ends + seconds,
            freed=self.freed + seconds,
        )


@dataclass(frozen=True, eq=False)
class PartialSchedule:
    """Agents placed so far, and the events between them."""

    actors: Mapping[str, ScheduledAgent] = field(default_factory=dict)
    events: tuple[ScheduledEvent, ...] = ()

    def find_busy_end(self, name: str) -> float:
        """Find until when [s] the agent is busy with events so far; -inf if with none."""
        first = [each.ends for each in self.events if name == each.clause.first]
        second = [each.freed for each in self.events if name == each.clause.second]
        return max([*first, *second], default=-float("inf"))

    def is_too_soon(self, time: float, clause: PairClause) -> bool:
        """Return whether the clause would happen before earlier events of its agents have ended."""
        return any(time < self.find_busy_end(name) + 0.5 for name in get_pair(clause))

    def has_event(self, clause: PairClause) -> bool:
        """Return whether an event is scheduled already between the clause's two agents."""
        pair = set(get_pair(clause))
        return any(set(get_pair(each.clause)) == pair for each in self.events)

    def add_event(
        self, event: ScheduledEvent, a: ScheduledAgent, b: ScheduledAgent
    ) -> PartialSchedule:
        """Add an event, and its two agents as they are now."""
        first, second = get_pair(event.clause)
        return PartialSchedule({**self.actors, first: a, second: b}, (*self.events, event))

    def place(
        self, clause: PairClause, a: ScheduledAgent, b: ScheduledAgent, delta: float
    ) -> tuple[ScheduledAgent, ScheduledAgent]:
        """Place both agents with o_b - o_a = delta (to the step); an agent placed already stays."""
        delta = round(delta, 1)
        first, second = get_pair(clause)
        if second in self.actors:
            return (a if first in self.actors else a.shift(b.enters - delta - a.enters)), b
        return a, b.shift(a.enters + delta - b.enters)

    def shift(self, seconds: float) -> PartialSchedule:
        """Shift the schedule by a multiple of the step."""
        actors = {name: actor.shift(seconds) for name, actor in self.actors.items()}
        events = tuple(each.shift(seconds) for each in self.events)
        return PartialSchedule(actors, events)


def find_needed_end(schedule: PartialSchedule) -> float:
    """Find the scene time [s] by which every event has visibly ended."""
    ends = [max(each.time, each.ends) + _ENDED for each in schedule.events]
    for actor in schedule.actors.values():
        ends += [stop.until + _ENDED for stop in actor.stops if stop.reason == "gives_way"]
    return max(ends)


def get_pair(clause: PairClause) -> Pairing:
    """Return the clause's two agents."""
    return clause.first, str(clause.second)


def get_point(actor: ScheduledAgent, time: float) -> Point:
    """Return where the agent is at a scene time [s]."""
    x, y, _ = actor.get_poses(np.array([time]))[0]
    return float(x), float(y)
