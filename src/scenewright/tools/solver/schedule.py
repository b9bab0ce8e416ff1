"""The foreground as far as it is placed: actors in time, and what happens among them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from scenewright.scene.base import Point
from scenewright.scene.constraints import PairClause
from scenewright.tools.solver.scheduled_agent import Actor

Pairing = tuple[str, str]


@dataclass(frozen=True)
class Happening:
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

    def shifted(self, seconds: float) -> Happening:
        """The same, later."""
        return replace(
            self,
            time=self.time + seconds,
            begins=self.begins + seconds,
            ends=self.ends + seconds,
            freed=self.freed + seconds,
        )


@dataclass(frozen=True, eq=False)
class Staging:
    """Actors placed so far, and what happens among them."""

    actors: Mapping[str, Actor] = field(default_factory=dict)
    happenings: tuple[Happening, ...] = ()

    def busy_until(self, name: str) -> float:
        """Until when [s] the agent is busy with events so far; -inf if with none."""
        first = [each.ends for each in self.happenings if name == each.clause.first]
        second = [each.freed for each in self.happenings if name == each.clause.second]
        return max([*first, *second], default=-float("inf"))

    def too_soon(self, time: float, clause: PairClause) -> bool:
        """Whether the clause would happen before what its agents do earlier has ended."""
        return any(time < self.busy_until(name) + 0.5 for name in pair_of(clause))

    def binds(self, clause: PairClause) -> bool:
        """Whether something happens already between the clause's two agents."""
        pair = set(pair_of(clause))
        return any(set(pair_of(each.clause)) == pair for each in self.happenings)

    def with_event(self, happening: Happening, a: Actor, b: Actor) -> Staging:
        """One event more, and its two actors as they are now."""
        first, second = pair_of(happening.clause)
        return Staging({**self.actors, first: a, second: b}, (*self.happenings, happening))

    def placed(self, clause: PairClause, a: Actor, b: Actor, delta: float) -> tuple[Actor, Actor]:
        """Both actors with o_b - o_a = delta (to the step); who is on stage already stays put."""
        delta = round(delta, 1)
        first, second = pair_of(clause)
        if second in self.actors:
            return (a if first in self.actors else a.shifted(b.enters - delta - a.enters)), b
        return a, b.shifted(a.enters + delta - b.enters)

    def shifted(self, seconds: float) -> Staging:
        """Everything later by a multiple of the step."""
        actors = {name: actor.shifted(seconds) for name, actor in self.actors.items()}
        happenings = tuple(each.shifted(seconds) for each in self.happenings)
        return Staging(actors, happenings)


def pair_of(clause: PairClause) -> Pairing:
    """The clause's two agents."""
    return clause.first, str(clause.second)


def point_of(actor: Actor, time: float) -> Point:
    """Where the actor is at a scene time [s]."""
    x, y, _ = actor.at(np.array([time]))[0]
    return float(x), float(y)
