"""Features of a pair of agents, computed from their futures for the calibration.

The share of a few dozen futures that touch says little of the probability that two agents would, as
only a handful of them has the same two maneuvers. So for these the stretch that the two swept paths
share is found (SEMANTICS section 4, conflict zone), and the two stays in it are compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from scenewright.compiled import compiled
from scenewright.evals.understanding.boosted_trees import IntArray
from scenewright.evals.understanding.cases import ObservedAgent
from scenewright.evals.understanding.forecast import DT, TICKS, AgentForecast, BoolArray
from scenewright.evals.understanding.route_components import interpolate_points, interpolate_rows
from scenewright.evals.understanding.time_gaps import TimeGaps, compute_time_gaps
from scenewright.scene.base import FloatArray

LIMITS, CLOSE = (0.3, 0.6, 1.1, 2.1, 3.1), 1.1
"""Time gaps [s] up to which futures are counted; below `CLOSE` two conflict."""
OF_ZONE = ("offset", "offset_spread")
"""Median distance of the stays, middle to middle, in units of half of both together (below 1 they
overlap); standard deviation of the time from middle to middle [s]."""
IN_ZONE = ("lead", "zone", "zone_in", "zone_for", "zone_needs", "decides")
"""By how much earlier than the other it is there, middle to middle [s]; distance until it enters
[m], when that is, and for how long it stays [s]; the braking that stops it before [m/s^2]; time
left until it would have to begin to brake comfortably [s]."""
OF_BOTH = ("at_once", "close", "within_1", "within_2", "within_3", "likely", "share", "soon",
           "angle", "window", *OF_ZONE)  # fmt: skip
"""Shares of futures in which the two touch if one of them came as much as `LIMITS` earlier or
later; of the pair of maneuvers that conflicts most: how likely it is, how often it conflicts, when
[s] and at which angle [rad]; the window [s]; and of the zone of those maneuvers `OF_ZONE`."""
OF_EACH = ("first", "own", "busy", "delay", "speed", "lost", "gain", "gain_2", "stood", "walks",
           "held", "line", "straight", "left", "right", "jaywalks", "known", "length",
           *IN_ZONE)  # fmt: skip
"""Whether it passes first within 3 s; the probability of its maneuver; how much it conflicts with
any other agent; by how much it is slower than its route demands, median [m/s]; speed, loss of speed
since its maximum [m/s], acceleration over 0.7 and 2 s [m/s^2]; how long it has been stationary [s];
whether a pedestrian; the probability that its light is not green, and the mean distance to that
line [m]; the probability of each movement; observed for [s]; length [m]; and its stay in the zone,
`IN_ZONE`."""
NAMES = (*OF_BOTH, *(f"{name}_a" for name in OF_EACH), *(f"{name}_b" for name in OF_EACH))
"""Names of the features; a calibration is for these."""
_TRUST = 0.3
"""A pair of maneuvers counts by its share of conflicts times its own probability to this power, as
accidents happen on rare maneuvers."""
_STEP = 0.75
_GRID = np.arange(0.0, 75.0, _STEP)
"""Points along a path that are compared [m from the agent]."""
_LONGEST = int(5.0 / _STEP)
"""Of a shared lane only the first 5 m belong to the zone, in steps of the grid."""
_ROWS = 16
"""Futures of a pair that are compared, at most."""
_ROOM, _BRAKING = 0.8, 2.2
"""Distance to the zone at which agents stop [m], and comfortable braking [m/s^2]."""
NONE = ((9.0, 9.0), (0.0, 60.0, 20.0, 20.0, 0.0, 20.0))
"""`OF_ZONE`, and `IN_ZONE` of each, where their paths do not overlap."""


class _Conflict(NamedTuple):
    """The pair of maneuvers in which two agents conflict most; how often, when and how."""

    maneuvers: tuple[int, int] = (-1, -1)
    likely: float = 0.0
    share: float = 0.0
    soon: float = 20.0
    angle: float = 0.0


def compute_pair_features(
    futures: Sequence[AgentForecast], window: float
) -> tuple[list[tuple[str, str]], FloatArray]:
    """Describe every pair with a vehicle in it whose futures come near: ids, and [N, F] `NAMES`."""
    gaps = {
        (i, j): found
        for (i, one), (j, two) in combinations(enumerate(futures), 2)
        if (one.agent.is_vehicle or two.agent.is_vehicle)
        and (found := compute_time_gaps(one, two)) is not None
    }
    joint = {(i, j): futures[i].weight * futures[j].weight for i, j in gaps}
    weights = {pair: weight / weight.sum() for pair, weight in joint.items()}
    busy = {p: float(weights[p][np.abs(gaps[p].gap) <= CLOSE].sum()) for p in gaps}
    maneuvers = []
    for future in futures:
        _, exits = np.unique([r.exit for r in future.components.routes], return_inverse=True)
        maneuvers.append(exits[future.component])
    alone = [_describe_alone(future, window) for future in futures]
    rows = []
    for pair, known in gaps.items():
        gap, weight, both = known.gap, weights[pair], [futures[n] for n in pair]
        most = _find_conflict(known, both, [maneuvers[n] for n in pair])
        taken = [maneuvers[n] == which for n, which in zip(pair, most.maneuvers, strict=True)]
        zone, *stays = compute_zone_features(both[0], both[1], taken[0] & taken[1])
        row = [*(float(weight[np.abs(gap) <= limit].sum()) for limit in LIMITS), *most[1:], window]
        row += zone
        for n, later, own, stay in zip(pair, (gap, -gap), taken, stays, strict=True):
            others = (x for p, x in busy.items() if n in p and p != pair)
            row += [
                float(weight[(later < -0.3) & (later >= -3.1)].sum()),
                float(futures[n].weight[own].sum()), max(others, default=0.0), *alone[n], *stay,
            ]  # fmt: skip
        rows.append(row)
    ids = [(futures[i].agent.id, futures[j].agent.id) for i, j in gaps]
    return ids, np.array(rows, dtype=np.float64).reshape(-1, len(NAMES))


def mirror_features(values: FloatArray) -> FloatArray:
    """[..., F] the same pairs with a and b swapped."""
    n, m = len(OF_BOTH), len(OF_EACH)
    return np.concatenate([values[..., :n], values[..., n + m :], values[..., n : n + m]], axis=-1)


def _describe_alone(future: AgentForecast, window: float) -> list[float]:
    """`delay` to `length` of `OF_EACH`."""
    agent, weight = future.agent, future.weight
    v, free = float(agent.speed[-1]), future.free
    movement = np.array([r.movement for r in future.components.routes])[future.component]
    return [
        float(np.quantile(free - v, 0.5, weights=weight, method="inverted_cdf")), v,
        float(agent.speed.max()) - v, agent.measure_acceleration(8),
        agent.measure_acceleration(20), agent.standstill, float(not agent.is_vehicle),
        float(weight[future.held].sum()), float(weight @ np.minimum(future.line, 60.0)),
        *(float(weight[movement == turn].sum())
          for turn in ("straight", "left", "right", "jaywalking")),
        window - agent.start, agent.length,
    ]  # fmt: skip


def _find_conflict(
    gaps: TimeGaps, futures: Sequence[AgentForecast], maneuvers: Sequence[IntArray]
) -> _Conflict:
    """The pair of maneuvers of two with the highest score among futures that conflict."""
    hit, (one, two) = np.abs(gaps.gap) <= CLOSE, maneuvers
    wide = int(two.max()) + 1
    both = one * wide + two
    count = np.bincount(both)
    share = np.bincount(both, hit) / np.maximum(count, 1)
    of_one, of_two = map(np.bincount, maneuvers, (future.weight for future in futures))
    codes = np.arange(len(count))
    likely = of_one[codes // wide] * of_two[codes % wide]
    score = np.where(count >= 2, share * likely**_TRUST, 0.0)
    top = int(score.argmax())
    if score[top] <= 0.0:
        return _Conflict()
    mine = (both == top) & hit
    when, angle = (float(np.median(x[mine])) for x in (gaps.time, gaps.angle))
    return _Conflict(
        (top // wide, top % wide), float(likely[top]), float(share[top]), min(when, 20.0), angle
    )


def compute_zone_features(
    one: AgentForecast, two: AgentForecast, mine: BoolArray
) -> tuple[list[float], list[float], list[float]]:
    """Compute `OF_ZONE`, and `IN_ZONE` of either agent, from futures `mine` [K]."""
    rows, nothing = np.flatnonzero(mine), (list(NONE[0]), list(NONE[1]), list(NONE[1]))
    if not len(rows):
        return nothing
    rows = rows[:: -(-len(rows) // _ROWS)]
    s, places = [], []
    for future in (one, two):
        # [N, T] distance by tick [m], rising; [N, G, 2] points of the grid.
        xy = future.xy[rows]
        steps = np.hypot(*np.moveaxis(np.diff(xy, axis=1), -1, 0)) + 1e-6
        s.append(np.pad(np.cumsum(steps, axis=1), ((0, 0), (1, 0))))
        grid = np.broadcast_to(_GRID, (len(rows), len(_GRID)))
        places.append(interpolate_points(grid, s[-1], xy))
    wide = ((one.agent.width + two.agent.width) / 2 + 0.05) ** 2
    on_map = [(each[:, -1:] >= _GRID).sum(axis=1) for each in s]
    near = _find_overlap(places[0], places[1], on_map[0], on_map[1], wide)
    found = near[0].any(axis=1)
    if not found.any():
        return nothing
    (ahead_a, in_a, out_a), (ahead_b, in_b, out_b) = (
        _find_stay(future.agent, along[found], inside[found])
        for future, along, inside in zip((one, two), s, near, strict=True)
    )
    lead = (in_b + out_b - in_a - out_a) / 2
    half = np.maximum((out_a - in_a + out_b - in_b) / 2, 0.05)
    first = float(np.median(lead))
    both = [float(np.median(np.abs(lead) / half)), float(lead.std())]
    stays = []
    for agent, earlier, ahead, begins, ends in (
        (one.agent, first, ahead_a, in_a, out_a), (two.agent, -first, ahead_b, in_b, out_b)
    ):  # fmt: skip
        v, way = float(agent.speed[-1]), float(np.median(ahead))
        room = max(way - _ROOM, 0.3)
        left = (room - v * v / (2.0 * _BRAKING)) / max(v, 0.5)
        stays.append([
            earlier, way, float(np.median(begins)), float(np.median(ends - begins)),
            min(v * v / (2.0 * room), 12.0), float(np.clip(left, -5.0, 20.0)),
        ])  # fmt: skip
    return both, stays[0], stays[1]


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


def _find_stay(
    agent: ObservedAgent, s: FloatArray, near: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """[N] distance to the zone [m]; [N] entry and exit [s from now].

    The zone is from the first point near the other path to the last one connected to it.
    """
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
    return begins, np.where(begins < 0.0, begins / speed, in_), out
