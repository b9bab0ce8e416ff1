"""The order of passing of a scene at every place where two paths meet, as tables.

In the recorded scene one of two road users is before the other at every pair of places where they
would touch. Agents that keep that order, and never enter such a place before the other has left it,
do not collide, whatever their delays. The order is by times of arrival and therefore has no
cycles: no deadlock.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scenewright.driving.scenario import BoolArray, Scenario
from scenewright.driving.world import find_overlaps
from scenewright.scene.base import FloatArray

LENGTH_MARGIN, WIDTH_MARGIN = 0.8, 0.2
"""Added to a vehicle's length and width [m]."""
PEDESTRIAN_GAP = 0.05
"""Added between two pedestrians [m]."""


@dataclass(frozen=True, eq=False)
class PassingOrderTables:
    """Tables of N agents with up to P points on their ways.

    Attributes:
        limits: [i, p, j] distance [m] along the path of agent j that it may not pass while agent i,
            which goes before it, is at point p of its own path; inf without such a limit.
        limits_any_order: the same, whichever of the two goes first.
        blocks_path: [i, p, j] whether agent i, at point p, is on the path of agent j.
        ego_overlap: index of an agent -> [Pe, P] whether the ego at a point of its route and the
            agent at a point of its path would touch; only of agents whose path meets the route.
    """

    limits: FloatArray
    limits_any_order: FloatArray
    blocks_path: BoolArray
    ego_overlap: dict[int, BoolArray]


@lru_cache(maxsize=16)
def find_passing_order(scenario: Scenario) -> PassingOrderTables:
    """The order of passing of a scene; the ego is not bound by it."""
    n = len(scenario.names)
    points = max(len(path.xy) for path in scenario.paths)
    limits = np.full((n, points, n), np.inf)
    limits_any_order = np.full((n, points, n), np.inf)
    blocks_path = np.zeros((n, points, n), dtype=bool)
    ego_overlap: dict[int, BoolArray] = {}
    moving = np.flatnonzero(scenario.moves)
    for j in moving:
        met = _find_touching(scenario, scenario.ego, int(j))
        if met is not None:
            ego_overlap[int(j)] = met
            _store_limits(limits_any_order, blocks_path, scenario, scenario.ego, int(j), met)
    for at, i in enumerate(moving):
        for j in moving[at + 1 :]:
            met = _find_touching(scenario, int(i), int(j))
            if met is None:
                continue
            first = scenario.paths[i].arrival[:, None] <= scenario.paths[j].arrival[None, :]
            for a, b, cell, before in ((i, j, met, first), (j, i, met.T, ~first.T)):
                _store_limits(limits_any_order, blocks_path, scenario, int(a), int(b), cell)
                limits[a, : len(cell), b] = _find_limits(scenario, int(b), cell & before)
    return PassingOrderTables(limits, limits_any_order, blocks_path, ego_overlap)


def _store_limits(
    limits_any_order: FloatArray,
    blocks_path: BoolArray,
    scenario: Scenario,
    a: int,
    b: int,
    cell: BoolArray,
) -> None:
    limits_any_order[a, : len(cell), b] = _find_limits(scenario, b, cell)
    blocks_path[a, : len(cell), b] = cell.any(axis=1)


def _find_limits(scenario: Scenario, agent: int, cell: BoolArray) -> FloatArray:
    """[P] how far the agent may go while the other is at each point or has yet to reach it [m]."""
    first = np.where(cell.any(axis=1), np.argmax(cell, axis=1), np.inf)
    ahead = np.minimum.accumulate(first[::-1])[::-1]
    return np.asarray((ahead - 1.0) * scenario.paths[agent].spacing)


def _find_touching(scenario: Scenario, i: int, j: int) -> BoolArray | None:
    """[Pi, Pj] whether i at a point of its way and j at one of its own touch; None if never."""
    one, two = scenario.paths[i], scenario.paths[j]
    reach = scenario.reach[i] + scenario.reach[j] + LENGTH_MARGIN
    if _is_pair_apart(one.xy, two.xy, reach):
        return None
    apart = np.hypot(*(one.xy[:, None] - two.xy[None]).transpose(2, 0, 1))
    met = apart < reach
    rows, columns = np.nonzero(met)
    if not len(rows):
        return None
    if scenario.is_disc[i] and scenario.is_disc[j]:
        near = scenario.sizes[[i, j], 0].sum() / 2 + PEDESTRIAN_GAP
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
        scenario.sizes[i] + (LENGTH_MARGIN, WIDTH_MARGIN),
        scenario.paths[j].xy[other_at],
        scenario.paths[j].heading[other_at],
        scenario.sizes[j] + ((0.0, 0.0) if scenario.is_disc[j] else (LENGTH_MARGIN, WIDTH_MARGIN)),
        np.full(len(at), scenario.is_disc[j]),
    )


def _is_pair_apart(one: FloatArray, two: FloatArray, reach: float) -> bool:
    low = np.maximum(one.min(axis=0), two.min(axis=0))
    high = np.minimum(one.max(axis=0), two.max(axis=0))
    return bool((low - high > reach).any())
