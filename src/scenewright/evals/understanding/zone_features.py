"""The conflict zone of two agents, and when each of them would be in it.

The share of a few dozen futures that touch says little of the probability that two agents would, as
only a handful of them has the same two maneuvers. So for these the stretch that the two swept paths
share is found (SEMANTICS section 4, conflict zone), and the two stays in it are compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.compiled import compiled
from scenewright.evals.understanding.boosted_trees import IntArray
from scenewright.evals.understanding.cases import ObservedAgent
from scenewright.evals.understanding.forecast import DT, TICKS, AgentForecast, BoolArray
from scenewright.evals.understanding.route_components import interpolate_points, interpolate_rows
from scenewright.scene.base import FloatArray

OF_ZONE = ("offset", "both_there", "wait", "at_odds", "offset_spread")
"""Median distance of the stays, middle to middle, in units of half of both together (below 1 they
overlap); share of futures where they overlap; how long either would have to wait for the other to
clear the zone [s]; the first again, as a soft overlap; standard deviation of the time from middle
to middle [s]."""
IN_ZONE = ("lead", "zone", "zone_in", "zone_for", "zone_needs", "decides")
"""By how much earlier than the other it is there, middle to middle [s]; distance until it enters
[m], when that is, and for how long it stays [s]; the braking that stops it before [m/s^2]; time
left until it would have to begin to brake comfortably [s]."""

_STEP = 0.75
_GRID = np.arange(0.0, 75.0, _STEP)
"""Points along a path that are compared [m from the agent]."""
_LONGEST = int(5.0 / _STEP)
"""Of a shared lane only the first 5 m belong to the zone, in steps of the grid."""
_ROWS = 16
"""Futures of a pair that are compared, at most."""
_TOUCH, _SOFT = 0.95, 0.36
"""Stays overlap below this offset; width of the soft overlap."""
_ROOM, _BRAKING = 0.8, 2.2
"""Distance to the zone at which agents stop [m], and comfortable braking [m/s^2]."""
_NOWHERE, _LATE, _HARD = 60.0, 20.0, 12.0
NONE = ((9.0, 0.0, 9.0, 0.0, 9.0), (0.0, _NOWHERE, _LATE, _LATE, 0.0, _LATE))
"""Of both, and of each, where their paths do not overlap."""


@dataclass(frozen=True, eq=False)
class _ZoneStay:
    """One of the two in N futures: distance to the zone [m]; entry and exit [s from now]."""

    ahead: FloatArray
    in_: FloatArray
    out: FloatArray

    @property
    def middle(self) -> FloatArray:
        """Halfway between entry and exit [s from now]."""
        return (self.in_ + self.out) / 2


def compute_zone_features(
    one: tuple[ObservedAgent, AgentForecast],
    two: tuple[ObservedAgent, AgentForecast],
    mine: BoolArray,
) -> tuple[list[float], list[float], list[float]]:
    """Compute `OF_ZONE`, and `IN_ZONE` of either agent, from futures `mine` [K]."""
    rows, nothing = np.flatnonzero(mine), (list(NONE[0]), list(NONE[1]), list(NONE[1]))
    if not len(rows):
        return nothing
    rows = rows[:: -(-len(rows) // _ROWS)]
    (s_a, at_a), (s_b, at_b) = _sample_path(one[1], rows), _sample_path(two[1], rows)
    on_map_a, on_map_b = ((s[:, -1:] >= _GRID).sum(axis=1) for s in (s_a, s_b))
    wide = ((one[0].width + two[0].width) / 2 + 0.05) ** 2
    in_a, in_b = _find_overlap(at_a, at_b, on_map_a, on_map_b, wide)
    found = in_a.any(axis=1)
    if not found.any():
        return nothing
    a, b = (
        _find_stay(agent, s[found], near[found])
        for agent, s, near in ((one[0], s_a, in_a), (two[0], s_b, in_b))
    )
    lead = b.middle - a.middle
    half = np.maximum((a.out - a.in_) / 2 + (b.out - b.in_) / 2, 0.05)
    offset = np.abs(lead) / half
    both = [
        compute_median(offset), float((offset < _TOUCH).mean()),
        compute_median(np.maximum(np.abs(lead) - half, 0.0)),
        float(np.exp(-(offset**2) / (2 * _SOFT)).mean()), float(lead.std()),
    ]  # fmt: skip
    first = compute_median(lead)
    return both, _describe_stay(one[0], a, first), _describe_stay(two[0], b, -first)


def compute_median(values: FloatArray) -> float:
    """The median of a few values, for which `numpy.median` takes long."""
    order, half = np.sort(values), len(values) // 2
    return float(order[half] if len(order) % 2 else (order[half - 1] + order[half]) / 2)


def _describe_stay(agent: ObservedAgent, stay: _ZoneStay, lead: float) -> list[float]:
    v, ahead = float(agent.speed[-1]), compute_median(stay.ahead)
    room = max(ahead - _ROOM, 0.3)
    left = (room - v * v / (2.0 * _BRAKING)) / max(v, 0.5)
    return [
        lead, ahead, compute_median(stay.in_), compute_median(stay.out - stay.in_),
        min(v * v / (2.0 * room), _HARD), float(np.clip(left, -5.0, _LATE)),
    ]  # fmt: skip


@compiled
def _find_overlap(
    one: FloatArray, two: FloatArray, length_one: IntArray, length_two: IntArray, wide: float
) -> tuple[BoolArray, BoolArray]:
    """[N, G] which points of either path lie near one of the other's.

    Args:
        one, two: [N, G, 2] points [m]; length_one, length_two: [N] how many of them count.
        wide: squared distance below which points are near [m^2].
    """
    in_one, in_two = np.zeros(one.shape[:2], np.bool_), np.zeros(two.shape[:2], np.bool_)
    for n in range(len(one)):
        for p in range(length_one[n]):
            for q in range(length_two[n]):
                dx, dy = one[n, p, 0] - two[n, q, 0], one[n, p, 1] - two[n, q, 1]
                if dx * dx + dy * dy < wide:
                    in_one[n, p] = in_two[n, q] = True
    return in_one, in_two


def _sample_path(future: AgentForecast, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """[N, T] distance by tick [m], rising; [N, G, 2] points of the grid."""
    xy = future.xy[rows]
    step, s = np.diff(xy, axis=1), np.zeros(xy.shape[:2])
    np.cumsum(np.hypot(step[..., 0], step[..., 1]) + 1e-6, axis=1, out=s[:, 1:])
    return s, interpolate_points(np.broadcast_to(_GRID, (len(rows), len(_GRID))), s, xy)


def _find_stay(agent: ObservedAgent, s: FloatArray, near: BoolArray) -> _ZoneStay:
    """The stay between the first point of the zone and the last one connected to it."""
    first = near.argmax(axis=1)
    broken = ~near & (np.arange(near.shape[1]) > first[:, None])
    last = np.where(broken.any(axis=1), broken.argmax(axis=1) - 1, near.shape[1] - 1)
    last = np.minimum(last, first + _LONGEST)
    # A row of discs, as wide as the path that it sweeps; the zone ends between two points.
    reach = (agent.length - agent.width + _STEP) / 2
    begins, ends = _GRID[first] - reach, _GRID[last] + reach
    ticks = np.broadcast_to(DT * np.arange(TICKS), s.shape)
    speed = max(float(agent.speed[-1]), 0.5)
    in_, out = (interpolate_rows(at[:, None], s, ticks)[:, 0] for at in (begins, ends))
    # An agent inside the zone is taken to have entered it at its present speed.
    return _ZoneStay(begins, np.where(begins < 0.0, begins / speed, in_), out)
