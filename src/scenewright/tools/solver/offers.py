"""Offers of background agents: candidates by cost, built only when they are used."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

from scenewright.scene.base import AgentClass
from scenewright.tools.solver.background_assignment import Option

SCALE = 100_000
"""Objective units per nat."""

_SPARE_COST = 5.0
"""Cost of a reserve agent [nats]: those drawn first go first."""

NEVER = 10**12
"""More than any assignment costs [units]."""


@dataclass(frozen=True, eq=False)
class CandidateOffer:
    """A candidate of a background agent.

    Attributes:
        cost: what each of its options costs at least [nats], known before they are built.
        make: builds its options when they are first looked at, in order of preference.
    """

    cost: float
    make: Callable[[], Iterable[Option]]

    @cached_property
    def options(self) -> tuple[Option, ...]:
        """List the options of the agent with this candidate."""
        return tuple(self.make())


@dataclass(frozen=True, eq=False)
class AgentOffers:
    """A background agent by its offers, cheapest first; other attributes as in
    `BackgroundAgent`."""

    name: str
    type: AgentClass
    foreground: bool
    offers: tuple[CandidateOffer, ...]
    reserve: bool = False


@dataclass(frozen=True, eq=False)
class PricedOption:
    """An option, and its cost above its agent's cheapest [units]."""

    option: Option
    cost: int


class OptionWindow:
    """The options of one agent, cheapest candidate first, as far as they were built.

    Attributes:
        width: of its window [units].
    """

    def __init__(self, agent: AgentOffers) -> None:
        self.agent = agent
        self.width = 0
        self.ways: list[PricedOption] = []
        self._unread = list(agent.offers)[::-1]
        self._least = self._find_least_cost()
        self.widen(0)

    @property
    def least(self) -> int:
        """Least cost of the agent [units]."""
        return min((way.cost for way in self.ways), default=NEVER)

    @property
    def complete(self) -> bool:
        """Return whether all options lie within the window."""
        return not self._unread and all(way.cost <= self.width for way in self.ways)

    def widen(self, width: int) -> None:
        """Make the window at least `width` units wide; the cost of a reserve is not counted."""
        self.width = max(self.width, width + self._extra)
        while self._unread and self._convert_to_units(self._unread[-1].cost) <= self.width:
            self._read()

    def list_in_window(self) -> list[int]:
        """List the options within the window, cheapest first."""
        near = [k for k, way in enumerate(self.ways) if way.cost <= self.width]
        return sorted(near, key=lambda k: self.ways[k].cost)

    def _find_least_cost(self) -> float:
        """Find the cost of the cheapest option [nats]; an offer may cost less than its options."""
        least = float("inf")
        for offer in self.agent.offers:
            if offer.cost >= least:
                break
            least = min([least, *(option.cost for option in offer.options)])
        return least if least < float("inf") else 0.0

    def _read(self) -> None:
        options = self._unread.pop().options
        self.ways += [
            PricedOption(option, self._convert_to_units(option.cost)) for option in options
        ]

    @property
    def _extra(self) -> int:
        return round(SCALE * _SPARE_COST) if self.agent.reserve else 0

    def _convert_to_units(self, cost: float) -> int:
        return round(SCALE * (cost - self._least)) + self._extra
