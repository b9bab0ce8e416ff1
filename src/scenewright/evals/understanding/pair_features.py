"""Features of a pair of agents, computed from their futures for the calibration.

The share of a few dozen futures that touch says little of the probability that two agents would, as
only a handful of them has the same two maneuvers. So for these the stretch that the two swept paths
share is found (SEMANTICS section 4, conflict zone), and the two stays in it are compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from scenewright.compiled import compiled
from scenewright.evals.understanding.boosted_trees import IntArray
from scenewright.evals.understanding.cases import ObservedAgent
from scenewright.evals.understanding.forecast import DT, TICKS, AgentForecast, BoolArray
from scenewright.evals.understanding.route_components import interpolate_points, interpolate_rows
from scenewright.scene.base import FloatArray

SHIFTS = (0, 1, -1, 2, -2, 3, -3, 4, -4, 6, -6, 8, -8, 12, -12)
"""Delays of the second that are tried [multiples of `DT`], least first."""
NEVER = 99.0
_NEAR = 1.0


@dataclass(frozen=True, eq=False)
class TimeGaps:
    """Two agents in K futures.

    Attributes:
        gap: [K] least delay of the second at which they touch [s], positive if the second comes
            first and would have to be later; `NEVER` where they do not touch.
        time: [K] when they touch then [s from now], halfway between their clocks.
        angle: [K] between their headings there [rad], 0 to pi.
    """

    gap: FloatArray
    time: FloatArray
    angle: FloatArray


def compute_time_gaps(first: AgentForecast, second: AgentForecast) -> TimeGaps | None:
    """Compute the gap in each future; None where no futures come near one another."""
    a, b = first.agent, second.agent
    reach = (a.length + b.length) / 2 + _NEAR
    low = np.maximum(first.box[0], second.box[0])  # of the boxes round the tracks of each future
    high = np.minimum(first.box[1], second.box[1])
    all_low = np.maximum(first.box[0].min(axis=0), second.box[0].min(axis=0))
    all_high = np.minimum(first.box[1].max(axis=0), second.box[1].max(axis=0))
    if (all_low - all_high > reach).any():
        return None
    size = len(first.present)
    gap, time, angle = np.full(size, NEVER), np.full(size, NEVER), np.zeros(size)
    near = np.flatnonzero((low - high < reach).all(axis=1))
    one, two = _get_outline(first), _get_outline(second)
    radii = (x.width / 2 * 1.03 if x.is_vehicle else x.width / 2 for x in (a, b))
    touch = sum(radii) ** 2
    shift, tick = _find_first_contacts(near, np.array(SHIFTS), one, two, reach**2, touch)
    found = tick >= 0
    row, shift, tick = near[found], shift[found], tick[found]
    at_a, at_b = tick + np.maximum(shift, 0), tick + np.maximum(-shift, 0)
    gap[row], time[row] = shift * DT, (at_a + at_b) / 2 * DT
    turn = first.heading[row, at_a] - second.heading[row, at_b]
    angle[row] = np.abs((turn + np.pi) % (2 * np.pi) - np.pi)
    return TimeGaps(gap, time, angle)


_Outline = tuple[FloatArray, BoolArray, FloatArray, FloatArray, FloatArray]
"""[K, T, 2] centre; [K, T] presence; [K, T] cosine and sine of the heading; [D] discs along it."""


def _get_outline(future: AgentForecast) -> _Outline:
    """The footprint of an agent in its futures as a row of discs."""
    agent, offsets = future.agent, np.zeros(1)
    if agent.is_vehicle:
        half = agent.length / 2 - agent.width / 2
        offsets = np.linspace(-half, half, int(np.ceil(agent.length / agent.width)) + 1)
    return future.xy, future.present, *future.facing, offsets


@compiled
def _find_first_contacts(
    rows: IntArray, shifts: IntArray, one: _Outline, two: _Outline, reach: float, touch: float
) -> tuple[IntArray, IntArray]:
    """[N] the first of the shifts at which futures `rows` touch; [N] the first tick then, or -1.

    Args:
        reach: squared distance of centres from which no discs can touch [m^2]; touch: of discs.
    """
    xy_a, present_a, xy_b, present_b = one[0], one[1], two[0], two[1]
    shift, tick = np.zeros(len(rows), np.intp), np.full(len(rows), -1)
    for n in range(len(rows)):
        k = rows[n]
        for s in shifts:
            for t in range(present_a.shape[1] - abs(s)):
                i, j = t + max(s, 0), t + max(-s, 0)
                if not (present_a[k, i] and present_b[k, j]):
                    continue
                dx, dy = xy_a[k, i, 0] - xy_b[k, j, 0], xy_a[k, i, 1] - xy_b[k, j, 1]
                if dx * dx + dy * dy < reach and _do_touch(one, two, (k, i, j), touch):
                    shift[n], tick[n] = s, t
                    break
            if tick[n] >= 0:
                break
    return shift, tick


@compiled
def _do_touch(one: _Outline, two: _Outline, at: tuple[int, int, int], touch: float) -> bool:
    """Whether a disc of one at (k, i) and a disc of the other at (k, j) overlap."""
    (xy_a, _, cos_a, sin_a, offsets_a), (xy_b, _, cos_b, sin_b, offsets_b) = one, two
    k, i, j = at
    for a in offsets_a:
        x, y = xy_a[k, i, 0] + a * cos_a[k, i], xy_a[k, i, 1] + a * sin_a[k, i]
        for b in offsets_b:
            dx = x - (xy_b[k, j, 0] + b * cos_b[k, j])
            dy = y - (xy_b[k, j, 1] + b * sin_b[k, j])
            if dx * dx + dy * dy < touch:
                return True
    return False


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
