"""Table 2: how often an instruction becomes a scene that the checker confirms."""

from __future__ import annotations

from collections.abc import Iterator
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
    return tuple(rate for backend in dataset.backends for rate in _compute_rates(dataset, backend))


def _compute_rates(dataset: Dataset, backend: str) -> Iterator[RobustnessRate]:
    given = [row for row in dataset.rows if row.backend == backend]
    mine = [row for row in given if row.scope]
    events = dict.fromkeys(row.event or "unknown" for row in mine)
    for event in events:
        rows = [row for row in mine if (row.event or "unknown") == event]
        yield RobustnessRate(
            backend, event, PlanningShare(sum(row.verified for row in rows), len(rows))
        )
    rare = [row for row in mine if row.event in RARE]
    if rare:
        yield RobustnessRate(
            backend, "overall", PlanningShare(sum(row.verified for row in rare), len(rare))
        )
    if mine:
        yield RobustnessRate(
            backend, "all", PlanningShare(sum(row.verified for row in mine), len(mine))
        )
    if len(given) > len(mine):
        yield RobustnessRate(
            backend, "given", PlanningShare(sum(row.verified for row in given), len(given))
        )


def count_out_of_scope(dataset: Dataset) -> int:
    """Instructions that were refused as no request for a scene; they count under `given` alone."""
    return sum(not row.scope for row in dataset.rows)
