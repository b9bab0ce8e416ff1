"""The order of passing of a scene at every place where two paths meet, as tables.

The recorded scene has no contact, so that at every pair of places at which two road users would
touch, one is there before the other. An agent that keeps that order and never enters such a place
before the other has left it touches no other, however late all are; and as the order is
one of times, there is no deadlock.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scenewright.driving.footprints import find_overlaps
from scenewright.driving.scenario import BoolArray, Scenario
from scenewright.scene.base import FloatArray

LONGER, WIDER = 0.8, 0.2
"""By which a vehicle is taken to be longer and wider than it is [m]."""
PEDESTRIANS_APART = 0.05


@dataclass(frozen=True, eq=False)
class PassingOrderTables:
    """Tables of N agents with up to P points on their ways.

    Attributes:
        limits: [N, P, N] distance [m] along the way of the last agent that it may not pass while
            the first, which goes before it, is at that point; inf where nothing is in the way.
        regardless: the same in either order.
        standing: [N, P, N] whether the first, at that point, stands somewhere on the way of the
            last.
        cells: by index of an agent [Pe, P] points at which the ego, at a point of its route, and
            the agent would touch; only of agents whose way meets the route.
    """

    limits: FloatArray
    regardless: FloatArray
    standing: BoolArray
    cells: dict[int, BoolArray]


@lru_cache(maxsize=16)
def find_passing_order(scenario: Scenario) -> PassingOrderTables:
    """The order of a scene; the ego has none, as it may do what it likes."""
    n = len(scenario.names)
    points = max(len(path.xy) for path in scenario.paths)
    limits = np.full((n, points, n), np.inf)
    regardless = np.full((n, points, n), np.inf)
    standing = np.zeros((n, points, n), dtype=bool)
    cells: dict[int, BoolArray] = {}
    moving = np.flatnonzero(scenario.moves)
    for j in moving:
        met = _find_touching(scenario, scenario.ego, int(j))
        if met is not None:
            cells[int(j)] = met
            _write(regardless, standing, scenario, scenario.ego, int(j), met)
    for at, i in enumerate(moving):
        for j in moving[at + 1 :]:
            met = _find_touching(scenario, int(i), int(j))
            if met is None:
                continue
            first = scenario.paths[i].arrival[:, None] <= scenario.paths[j].arrival[None, :]
            for a, b, cell, before in ((i, j, met, first), (j, i, met.T, ~first.T)):
                _write(regardless, standing, scenario, int(a), int(b), cell)
                limits[a, : len(cell), b] = _find_limits(scenario, int(b), cell & before)
    return PassingOrderTables(limits, regardless, standing, cells)


def _write(
    regardless: FloatArray, standing: BoolArray, scenario: Scenario, a: int, b: int, cell: BoolArray
) -> None:
    regardless[a, : len(cell), b] = _find_limits(scenario, b, cell)
    standing[a, : len(cell), b] = cell.any(axis=1)


def _find_limits(scenario: Scenario, agent: int, cell: BoolArray) -> FloatArray:
    """[P] how far the agent may go while the other is at each point or has yet to reach it [m]."""
    first = np.where(cell.any(axis=1), np.argmax(cell, axis=1), np.inf)
    ahead = np.minimum.accumulate(first[::-1])[::-1]
    return np.asarray((ahead - 1.0) * scenario.paths[agent].spacing)


def _find_touching(scenario: Scenario, i: int, j: int) -> BoolArray | None:
    """[Pi, Pj] whether i at a point of its way and j at one of its own touch; None if never."""
    one, two = scenario.paths[i], scenario.paths[j]
    reach = scenario.reach[i] + scenario.reach[j] + LONGER
    if _is_pair_apart(one.xy, two.xy, reach):
        return None
    apart = np.hypot(*(one.xy[:, None] - two.xy[None]).transpose(2, 0, 1))
    met = apart < reach
    rows, columns = np.nonzero(met)
    if not len(rows):
        return None
    if scenario.is_disc[i] and scenario.is_disc[j]:
        near = scenario.sizes[[i, j], 0].sum() / 2 + PEDESTRIANS_APART
        met[rows, columns] = apart[rows, columns] < near
    elif scenario.is_disc[i]:
        met[rows, columns] = _touch(scenario, (j, columns), (i, rows))
    else:
        met[rows, columns] = _touch(scenario, (i, rows), (j, columns))
    return met if met.any() else None


def _touch(
    scenario: Scenario, one: tuple[int, np.ndarray], two: tuple[int, np.ndarray]
) -> BoolArray:
    """Whether a rectangle at points of its way touches another agent at points of its own."""
    (i, at), (j, other_at) = one, two
    return find_overlaps(
        scenario.paths[i].xy[at],
        scenario.paths[i].heading[at],
        scenario.sizes[i] + (LONGER, WIDER),
        scenario.paths[j].xy[other_at],
        scenario.paths[j].heading[other_at],
        scenario.sizes[j] + ((0.0, 0.0) if scenario.is_disc[j] else (LONGER, WIDER)),
        np.full(len(at), scenario.is_disc[j]),
    )


def _is_pair_apart(one: FloatArray, two: FloatArray, reach: float) -> bool:
    low = np.maximum(one.min(axis=0), two.min(axis=0))
    high = np.minimum(one.max(axis=0), two.max(axis=0))
    return bool((low - high > reach).any())
