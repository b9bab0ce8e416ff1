"""Tuples of candidates by ascending summed cost, lazily; never the whole product."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence

import numpy as np

from scenewright.scene.base import FloatArray


def enumerate_best_first(costs: Sequence[FloatArray]) -> Iterator[tuple[int, ...]]:
    """Enumerate choices of one index per array by ascending sum of their costs.

    Args:
        costs: one array per agent: the cost of each of its candidates [nats].
    """
    orders = [np.argsort(each, kind="stable") for each in costs]
    ranked = [each[order] for each, order in zip(costs, orders, strict=True)]
    start = (0,) * len(costs)
    heap, seen = [(_sum_costs(ranked, start), start)], {start}
    while heap:
        _, ranks = heapq.heappop(heap)
        yield tuple(int(order[rank]) for order, rank in zip(orders, ranks, strict=True))
        for axis, rank in enumerate(ranks):
            step = (*ranks[:axis], rank + 1, *ranks[axis + 1 :])
            if rank + 1 < len(ranked[axis]) and step not in seen:
                seen.add(step)
                heapq.heappush(heap, (_sum_costs(ranked, step), step))


def _sum_costs(costs: Sequence[FloatArray], ranks: tuple[int, ...]) -> float:
    return float(sum(cost[rank] for cost, rank in zip(costs, ranks, strict=True)))
