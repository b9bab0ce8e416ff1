"""Table 2: how often an instruction becomes a scene that the checker confirms."""

from __future__ import annotations

from dataclasses import dataclass

from scenewright.evals.planning import PlanningShare
from scenewright.evals.tables.reading import Dataset

RARE = ("collision", "yielding")
"""What the paper's overall rate is over."""


@dataclass(frozen=True)
class RobustnessRate:
    """ISR of one backend: verified scenes / instructions given (SEMANTICS section 6).

    Attributes:
        event: `overall` is collisions and yields, `all` every instruction in scope, `given` those
            out of scope, or not understood, as well.
    """

    backend: str
    event: str
    share: PlanningShare


def compute_robustness(dataset: Dataset) -> tuple[RobustnessRate, ...]:
    """A rate for each backend and event; retries of an order count too."""
    found = []
    for backend in dataset.backends:
        given = [row for row in dataset.rows if row.backend == backend]
        mine = [row for row in given if row.scope]
        groups = {
            event: [row for row in mine if (row.event or "unknown") == event]
            for event in dict.fromkeys(row.event or "unknown" for row in mine)
        }
        groups["overall"] = [row for row in mine if row.event in RARE]
        groups["all"] = mine
        groups["given"] = given if len(given) > len(mine) else []
        found += [
            RobustnessRate(backend, event, PlanningShare(sum(r.verified for r in rows), len(rows)))
            for event, rows in groups.items()
            if rows
        ]
    return tuple(found)


def count_out_of_scope(dataset: Dataset) -> int:
    """Instructions that were refused as no request for a scene; they count under `given` alone."""
    return sum(not row.scope for row in dataset.rows)
