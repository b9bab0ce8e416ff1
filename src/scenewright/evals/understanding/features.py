"""What two agents' futures say about each other, as numbers that a calibration can weigh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.evals.understanding.conflicts import NEVER, Meeting, meeting
from scenewright.evals.understanding.futures import Future, Outlook
from scenewright.evals.understanding.observing import Seen
from scenewright.scene.base import FloatArray

OF_BOTH = ("at_once", "close", "within_1", "within_2", "within_3", "best", "best_share", "wide",
           "wide_share", "soon", "angle", "window")  # fmt: skip
"""Shares of futures in which the two touch if one of them came 0.3, 0.6, 1.1, 2.1 or 3.1 s earlier
or later; the pair of exits that brings them together most, how likely that pair is, when they
would touch then [s] and at which angle [rad]; how long was observed [s]."""
OF_EACH = ("first", "undelayed_1", "undelayed_2", "delay", "speed", "gain", "walks", "held", "runs",
           "straight", "jaywalks", "slowed")  # fmt: skip
"""Whether it passes first within 3 s; whether it would have come within 1 or 2 s of the other had
it not slowed down; by how much it is slower than its way demands [m/s]; how fast [m/s], how much it
gains [m/s^2]; on foot; held at red; goes on where it should stop; straight on; off a crosswalk;
has slowed down."""
NAMES = (*OF_BOTH, *(f"{name}_a" for name in OF_EACH), *(f"{name}_b" for name in OF_EACH))
_TRUST = 0.3
"""A pair of exits counts by how surely it brings the two together, times its own likelihood to this
power: accidents happen to those who do what is rare."""


@dataclass(frozen=True, eq=False)
class Pair:
    """Two agents who may have to do with one another.

    Attributes:
        a, b: their ids; values: [F] as in `NAMES`.
        soon: when they would touch [s from now].
    """

    a: str
    b: str
    values: FloatArray
    soon: float


def pairs_of(outlook: Outlook, *, window: float) -> list[Pair]:
    """Every pair with a vehicle in it whose ways come near one another in any future."""
    found = []
    for i, a in enumerate(outlook.agents):
        for j in range(i + 1, len(outlook.agents)):
            if a.vehicle or outlook.agents[j].vehicle:
                pair = _pair(outlook, i, j, window)
                found += [pair] if pair is not None else []
    return found


def mirrored(values: FloatArray) -> FloatArray:
    """[..., F] the same pairs the other way round."""
    n, m = len(OF_BOTH), len(OF_EACH)
    return np.concatenate([values[..., :n], values[..., n + m :], values[..., n : n + m]], axis=-1)


def _pair(outlook: Outlook, i: int, j: int, window: float) -> Pair | None:
    a, b = outlook.agents[i], outlook.agents[j]
    one, two = outlook.futures[i], outlook.futures[j]
    free = meeting((a, one), (b, two))
    late_a = late_b = None
    if outlook.undelayed[i] is not one:
        late_a = meeting((a, outlook.undelayed[i]), (b, two))
    if outlook.undelayed[j] is not two:
        late_b = meeting((a, one), (b, outlook.undelayed[j]))
    if free is None and late_a is None and late_b is None:
        return None
    weight = one.weight * two.weight
    weight = weight / weight.sum()
    gap = np.full(len(weight), NEVER) if free is None else free.gap
    best = _best(outlook, i, j, free, within=0.3)
    wide = _best(outlook, i, j, free, within=1.1)
    both = [
        *(float(weight[np.abs(gap) <= limit].sum()) for limit in (0.3, 0.6, 1.1, 2.1, 3.1)),
        best[0], best[1], wide[0], wide[1], min(wide[2], 20.0), wide[3], window,
    ]  # fmt: skip
    each = [
        _own(outlook, n, agent, weight, sign * gap, late, slowed)
        for n, agent, sign, late, slowed in (
            (i, a, 1.0, late_a, outlook.undelayed[i] is not one),
            (j, b, -1.0, late_b, outlook.undelayed[j] is not two),
        )
    ]
    return Pair(a.id, b.id, np.array([*both, *each[0], *each[1]]), wide[2])


def _own(
    outlook: Outlook,
    n: int,
    agent: Seen,
    weight: FloatArray,
    gap: FloatArray,
    late: Meeting | None,
    slowed: bool,
) -> list[float]:
    """`OF_EACH` of one of the two; `gap` is negative where this one comes first."""
    future = outlook.futures[n]
    ways = outlook.fits[n].ways
    movements = np.array([ways.routes[c].movement for c in future.component])
    return [
        float(weight[(gap < -0.3) & (gap >= -3.1)].sum()),
        *(_share(late, weight, limit) for limit in (1.0, 2.1)),
        float(outlook.delay[n]), float(agent.speed[-1]), _gain(agent),
        float(not agent.vehicle), float(future.weight[future.held].sum()),
        float(future.weight[future.runs].sum()),
        float(future.weight[movements == "straight"].sum()),
        float(future.weight[movements == "jaywalking"].sum()), float(slowed),
    ]  # fmt: skip


def _share(late: Meeting | None, weight: FloatArray, limit: float) -> float:
    return 0.0 if late is None else float(weight[np.abs(late.gap) <= limit].sum())


def _gain(agent: Seen) -> float:
    """Acceleration over the last 0.7 s [m/s^2]."""
    last = agent.speed[-8:]
    return float(last[-1] - last[0]) / (0.1 * max(len(last) - 1, 1))


def _best(
    outlook: Outlook, i: int, j: int, free: Meeting | None, *, within: float
) -> tuple[float, float, float, float]:
    """Of all pairs of exits the one that brings the two together: how surely, how likely it is,
    when [s from now] and at which angle [rad]."""
    if free is None:
        return 0.0, 0.0, 20.0, 0.0
    one, two = outlook.futures[i], outlook.futures[j]
    kinds_a, kinds_b = _kinds(outlook, i, one), _kinds(outlook, j, two)
    hit = np.abs(free.gap) <= within
    found, score = (0.0, 0.0, 20.0, 0.0), 0.0
    for x in np.unique(kinds_a[hit]).tolist():
        for y in np.unique(kinds_b[hit & (kinds_a == x)]).tolist():
            mine = (kinds_a == x) & (kinds_b == y)
            if mine.sum() < 2:
                continue
            surely = float(hit[mine].mean())
            share = float(one.weight[kinds_a == x].sum() * two.weight[kinds_b == y].sum())
            if surely * share**_TRUST > score:
                both = mine & hit
                score = surely * share**_TRUST
                found = (surely, share, float(np.median(free.time[both])),
                         float(np.median(free.angle[both])))  # fmt: skip
    return found


def _kinds(outlook: Outlook, n: int, future: Future) -> FloatArray:
    """[K] a number per exit and whether it goes on where it should stop."""
    exits = [route.exit for route in outlook.fits[n].ways.routes]
    number = {side: k for k, side in enumerate(sorted(set(exits)))}
    codes = np.array([number[side] for side in exits], dtype=np.float64)
    return np.asarray(2.0 * codes[future.component] + future.runs)
