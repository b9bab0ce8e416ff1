"""What the waypoint filter chose: one candidate, entry time and standstills per agent (Eq. 4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from scenewright.scene.base import Point
from scenewright.scene.candidates import Candidate
from scenewright.scene.objects import ObjectRecord

AgentRole = Literal["foreground", "background"]


@dataclass(frozen=True)
class Stop:
    """A standstill in scene time, or slowing down to a low speed instead of one.

    Attributes:
        anchor: the map entity it stands at; s: arc length of the centre [m].
        start, until: [s] since scene start.
        reason: `gives_way` or `red_light`.
        braking: deceleration towards it [m/s^2]; None = as comfortable as the time law says.
        ahead: from the centre to where the other's way begins [m]; None for lights and queues.
        speed: who rolls passes `s` this fast [m/s] and does not stand: `until` is `start` then.
    """

    anchor: str
    s: float
    start: float
    until: float
    reason: str
    braking: float | None = None
    ahead: float | None = None
    speed: float = 0.0

    @property
    def rolls(self) -> bool:
        """Whether the agent slows there without standing."""
        return self.speed > 0.0

    @property
    def at_red(self) -> bool:
        """Whether it stands at a red light, or in the queue of one."""
        return self.reason == "red_light"


@dataclass(frozen=True)
class Slowing:
    """A speed [m/s] to have come down to at arc length `s` [m], braking at `braking` [m/s^2].

    Attributes:
        kept: for how long it is not exceeded after that [m].
    """

    s: float
    speed: float
    braking: float
    kept: float = 0.0


@dataclass(frozen=True)
class Push:
    """What a collision from behind does to a standing vehicle: a speed, then braking.

    Attributes:
        time: of the impact [s].
        speed: just after it [m/s]; braking: from then on [m/s^2].
    """

    time: float
    speed: float
    braking: float

    def shift(self, seconds: float) -> Push:
        """The same push, later."""
        return replace(self, time=self.time + seconds)


@dataclass(frozen=True, eq=False)
class SelectedAgent:
    """One agent of the selection.

    Attributes:
        enters: scene time [s] at which it enters the map, negative if it is mid-route at 0.
        stops, slowings: edits of its free time law under which every clause holds.
        contact: scene time [s] of the collision that ends it; None if it is in none.
        violates: it is the one that runs its red light.
        push: a collision that it stood in the way of before the one that ends it.
        group: leader of its group of pedestrians; None without a group and for a leader.
        exact: figures of its motion are asked for, so that it is not refined.
    """

    name: str
    role: AgentRole
    candidate: Candidate
    index: int
    enters: float
    stops: tuple[Stop, ...] = ()
    slowings: tuple[Slowing, ...] = ()
    contact: float | None = None
    violates: bool = False
    push: Push | None = None
    group: str | None = None
    exact: bool = False

    @property
    def stands(self) -> tuple[Stop, ...]:
        """Its standstills; of a foreground agent, those elsewhere than at a red light."""
        takes_part = self.role == "foreground"
        return tuple(
            stop for stop in self.stops if not (stop.rolls or (takes_part and stop.at_red))
        )


@dataclass(frozen=True)
class PlannedEvent:
    """An event that the selection brings about: its clause as text, when [s] and where."""

    clause: str
    agents: tuple[str, str]
    time: float
    location: Point


@dataclass(frozen=True, eq=False)
class Selection:
    """The surviving combination.

    Attributes:
        duration: of the scene [s].
        signal_offset: scene time 0 in the signal programme [s]; None where unsignalised.
        nll: summed -log p_wp of the chosen candidates [nats] (Eq. 4).
        cost: the same plus -log density of the time laws [nats]; what `map` minimises.
        optimal: whether no surviving combination of the pool costs less.
        objects: what stands in the scene.
        figures: how the search went (counts).
    """

    agents: Mapping[str, SelectedAgent]
    events: tuple[PlannedEvent, ...]
    duration: float
    signal_offset: float | None
    nll: float
    cost: float
    optimal: bool
    objects: tuple[ObjectRecord, ...] = ()
    figures: Mapping[str, float] = field(default_factory=dict)
