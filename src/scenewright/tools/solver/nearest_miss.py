"""How near a clause came to being served where it was not, in words a person can act on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

from scenewright.scene.constraints import PairClause


class FailureStage(IntEnum):
    """What a clause failed on, in the order in which it is served; later is nearer.

    The paths or the way the two move; the kind of contact; who strikes; where; a figure asked for;
    what the two do besides.
    """

    PATHS = 0
    KIND = 1
    ROLES = 2
    PLACE = 3
    MEASURE = 4
    COMPANY = 5


@dataclass(frozen=True)
class NearestMiss:
    """The nearest miss of one clause.

    Attributes:
        reached: what it failed on.
        words: the quantity at fault, what was asked for and what is possible.
        off: how far what is possible lies from what was asked, in the unit of the quantity.
    """

    clause: PairClause
    reached: FailureStage
    words: str
    off: float = 0.0

    def nearer(self, other: NearestMiss | None) -> bool:
        """Whether it came nearer to its clause than another one did to the same clause."""
        return other is None or (-self.reached, self.off) < (-other.reached, other.off)


class NearestMisses:
    """The nearest miss of every clause that was tried, and which clauses were served."""

    def __init__(self) -> None:
        self._nearest: dict[PairClause, NearestMiss] = {}
        self._served: set[PairClause] = set()

    def note(self, shortfall: NearestMiss) -> None:
        """Keeps it if it is the nearest of its clause so far."""
        if shortfall.nearer(self._nearest.get(shortfall.clause)):
            self._nearest[shortfall.clause] = shortfall

    def served(self, clause: PairClause) -> None:
        """The clause held at least once."""
        self._served.add(clause)

    def culprit(self, clauses: Iterable[PairClause]) -> NearestMiss | None:
        """The nearest miss of the first of the clauses, in playing order, that never held."""
        for clause in clauses:
            if clause not in self._served:
                return self._nearest.get(clause)
        return None
