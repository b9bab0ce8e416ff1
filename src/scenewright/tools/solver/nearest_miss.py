"""The nearest miss of a clause that was not met, described so that a user can act on it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

from scenewright.scene.constraints import PairClause


class FailureStage(IntEnum):
    """What a clause failed on, in the order in which it is scheduled; later is nearer.

    The paths or the motions of the two; the kind of contact; the striking agent; the place; a
    figure asked for; what the two do besides.
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


class NearestMisses:
    """The nearest miss of every clause that was tried, and which clauses were met."""

    def __init__(self) -> None:
        self._nearest: dict[PairClause, NearestMiss] = {}
        self._served: set[PairClause] = set()

    def note(self, shortfall: NearestMiss) -> None:
        """Keep it if it is the nearest of its clause so far."""
        known = self._nearest.get(shortfall.clause, shortfall)
        self._nearest[shortfall.clause] = min(
            known, shortfall, key=lambda each: (-each.reached, each.off)
        )

    def note_met(self, clause: PairClause) -> None:
        """Note that the clause was met at least once."""
        self._served.add(clause)

    def find_culprit(self, clauses: Iterable[PairClause]) -> NearestMiss | None:
        """Find the nearest miss of the first clause, in order of scheduling, that was never met."""
        for clause in clauses:
            if clause not in self._served:
                return self._nearest.get(clause)
        return None
