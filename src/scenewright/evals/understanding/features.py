"""What two agents' futures say about each other, as numbers that a calibration can weigh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.understanding.company import CLOSE, Company, Two, company_of
from scenewright.evals.understanding.conflicts import NEVER, Meeting
from scenewright.evals.understanding.futures import DT, TICKS, Future, Outlook
from scenewright.evals.understanding.observing import Seen
from scenewright.evals.understanding.zones import IN_ZONE, OF_ZONE, zone_values
from scenewright.scene.base import FloatArray

OF_BOTH = ("at_once", "close", "within_1", "within_2", "within_3", "alone_1", "best", "best_share",
           "touch", "wide", "wide_share", "soon", "angle", "rank", "window", *OF_ZONE)  # fmt: skip
"""Shares of futures in which the two touch if one of them came 0.3, 0.6, 1.1, 2.1 or 3.1 s earlier
or later, others taken into account; 1.1 s without regard to others; the pair of exits that brings
them together most: how surely, how likely that pair is, in how many they touch as it is, when [s]
and at which angle [rad]; by how much more this pair is brought together than any other of the
scene; how long was observed [s]; and of the zone that those exits share, as in `zones`."""
OF_EACH = ("first", "undelayed_0", "undelayed_1", "undelayed_2", "delay", "delay_least", "speed",
           "lost", "gain", "gain_2", "stood", "walks", "held", "runs", "own", "own_alone",
           "straight", "jaywalks", "slowed", "known", "reach", "needs", "busy",
           "cause", "left", "right", "length", "line_needs", "line_late",
           *IN_ZONE)  # fmt: skip
"""Whether it passes first within 3 s; whether it would have come within 0.3, 1 or 2 s of the other
had it not slowed down; by how much it is slower than its way demands, in the middle and at least
[m/s]; how fast, how much slower than it was [m/s], what it gains over 0.7 and 2 s [m/s^2]; how
long it has stood [s]; on foot; held at red; goes on where it should stop; how likely its part in
the pair of exits is, with and without regard to others; straight on; off a crosswalk; has slowed
down; for how long it has been seen [s]; how far it is from where they meet [m] and the braking
that stops it before [m/s^2]; how surely it meets somebody else; how surely it would have, had it
not slowed down; how likely its part is a left or right turn; its length [m]; the braking that stops
it where it should [m/s^2], and how likely that is more than people brake; its stay in the zone, as
in `zones`."""
NAMES = (*OF_BOTH, *(f"{name}_a" for name in OF_EACH), *(f"{name}_b" for name in OF_EACH))
_TRUST = 0.3
"""A pair of exits counts by how surely it brings the two together, times its own likelihood to this
power: accidents happen to those who do what is rare."""
_FAR = 60.0
_SLACK, _BRAKES = 0.3, 2.5
"""How exactly it is known where to stop [m]; harder than this people brake for no light [m/s^2]."""


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


@dataclass(frozen=True, eq=False)
class _Best:
    """The pair of exits that brings two agents together most, and when and where."""

    score: float = 0.0
    surely: float = 0.0
    share: float = 0.0
    touch: float = 0.0
    soon: float = 20.0
    angle: float = 0.0
    kinds: tuple[int, int] = (-1, -1)
    reach: tuple[float, float] = (_FAR, _FAR)


def pairs_of(outlook: Outlook, *, window: float) -> list[Pair]:
    """Every pair with a vehicle in it whose ways come near one another in any future."""
    company = company_of(outlook)
    names = sorted({(min(pair), max(pair)) for pair in (*company.free, *company.late)})
    best = {pair: _best(outlook, company, pair, within=0.3) for pair in names}
    busy = {pair: _weight(company, pair)[_near(company.free.get(pair), CLOSE)].sum()
            for pair in names}  # fmt: skip
    cause = {pair: _share(met, company.clear[pair] * company.clear[pair[::-1]], 2.1)
             for pair, met in company.late.items()}  # fmt: skip
    scene = _Scene(outlook, company, window, best, busy, cause)
    return [scene.pair(i, j) for i, j in names]


def mirrored(values: FloatArray) -> FloatArray:
    """[..., F] the same pairs the other way round."""
    n, m = len(OF_BOTH), len(OF_EACH)
    return np.concatenate([values[..., :n], values[..., n + m :], values[..., n : n + m]], axis=-1)


@dataclass(frozen=True, eq=False)
class _Scene:
    """What is known of all pairs before any of them is described.

    Attributes:
        busy: how surely the two meet; cause: how surely the first would have met the second, had
            it not slowed down.
    """

    outlook: Outlook
    company: Company
    window: float
    best: Mapping[Two, _Best]
    busy: Mapping[Two, float]
    cause: Mapping[Two, float]

    def pair(self, i: int, j: int) -> Pair:
        """One pair."""
        free = self.company.free.get((i, j))
        one, two = self.outlook.futures[i], self.outlook.futures[j]
        weight, best = _weight(self.company, (i, j)), self.best[i, j]
        wide = _best(self.outlook, self.company, (i, j), within=CLOSE)
        alone = one.weight * two.weight
        gap = np.full(len(weight), NEVER) if free is None else free.gap
        others = max((b.score for pair, b in self.best.items() if pair != (i, j)), default=0.0)
        both = [
            *(float(weight[np.abs(gap) <= limit].sum()) for limit in (0.3, 0.6, CLOSE, 2.1, 3.1)),
            float(alone[np.abs(gap) <= CLOSE].sum() / alone.sum()),
            best.surely, best.share, best.touch, wide.surely, wide.share, min(wide.soon, 20.0),
            wide.angle, best.score - others, self.window,
        ]  # fmt: skip
        shared, zone_a, zone_b = self._zone((i, j), wide if wide.score else best)
        ours = (self._own((i, j), 0, gap, weight, best, wide),
                self._own((i, j), 1, -gap, weight, best, wide))  # fmt: skip
        values = np.array([*both, *shared, *ours[0], *zone_a, *ours[1], *zone_b])
        agents = self.outlook.agents
        return Pair(agents[i].id, agents[j].id, values, wide.soon)

    def _zone(self, pair: Two, best: _Best) -> tuple[list[float], list[float], list[float]]:
        """The zone that the two share if they leave as `best` has it."""
        (i, j), kinds = pair, self.company.kinds
        mine = (kinds[i] == best.kinds[0]) & (kinds[j] == best.kinds[1])
        agents, futures = self.outlook.agents, self.outlook.futures
        return zone_values((agents[i], futures[i]), (agents[j], futures[j]), mine)

    def _own(
        self, pair: Two, which: int, gap: FloatArray, weight: FloatArray, best: _Best, wide: _Best
    ) -> list[float]:
        """`OF_EACH` of one of the two; `gap` is negative where this one comes first."""
        n, m = pair if which == 0 else pair[::-1]
        outlook, company = self.outlook, self.company
        future, agent = outlook.futures[n], outlook.agents[n]
        late = company.late.get((n, m))
        slowed = outlook.undelayed[n] is not future
        clear = company.clear[n, m]
        part = company.kinds[n] == (best if best.score else wide).kinds[which]
        movement = _movements(outlook, n)
        reach = wide.reach[which]
        if slowed and late is not None:
            reach = _reach(outlook.undelayed[n], late, agent, np.abs(late.gap) <= 2.1, reach)
        v = float(agent.speed[-1])
        return [
            float(weight[(gap < -0.3) & (gap >= -3.1)].sum()),
            *(_share(late, weight, limit) for limit in (0.3, 1.0, 2.1)),
            float(outlook.delay[n]), _least_delay(future, v), v,
            float(agent.speed.max()) - v, _gain(agent, 8), _gain(agent, 20), _stood(agent),
            float(not agent.vehicle), float(clear[future.held].sum()),
            float(clear[future.runs].sum()), float(clear[part].sum()),
            float(future.weight[part].sum()),
            float(clear[movement == "straight"].sum()),
            float(clear[movement == "jaywalking"].sum()), float(slowed),
            self.window - agent.start, reach,
            min(v * v / (2.0 * max(reach - agent.length / 2 - 0.5, 0.5)), 12.0),
            max((x for p, x in self.busy.items() if n in p and p != pair), default=0.0),
            max((x for (p, q), x in self.cause.items() if p == n and q != m), default=0.0),
            *(_part(future.weight * part, movement == turn) for turn in ("left", "right")),
            agent.length, *_at_line(future, v),
        ]  # fmt: skip


def _weight(company: Company, pair: Two) -> FloatArray:
    """[K] of the two together, others taken into account."""
    weight = company.clear[pair] * company.clear[pair[::-1]]
    return np.asarray(weight / weight.sum())


def _near(met: Meeting | None, limit: float) -> NDArray[np.bool_] | slice:
    return slice(0) if met is None else np.abs(met.gap) <= limit


def _share(late: Meeting | None, weight: FloatArray, limit: float) -> float:
    if late is None:
        return 0.0
    return float(weight[np.abs(late.gap) <= limit].sum() / weight.sum())


def _movements(outlook: Outlook, n: int) -> NDArray[np.str_]:
    routes = outlook.fits[n].ways.routes
    return np.array([routes[c].movement for c in outlook.futures[n].component.tolist()])


def _part(weight: FloatArray, of: NDArray[np.bool_]) -> float:
    return float(weight[of].sum() / max(float(weight.sum()), 1e-9))


def _at_line(future: Future, speed: float) -> tuple[float, float]:
    """The braking that stops it where it should, and how likely that is more than people brake."""
    needs = np.where(np.isfinite(future.stop), speed**2 / (2.0 * (future.stop + _SLACK)), 0.0)
    return float(np.minimum(needs, 12.0) @ future.weight), float((needs > _BRAKES) @ future.weight)


def _gain(agent: Seen, count: int) -> float:
    """Acceleration over the last samples [m/s^2]."""
    last = agent.speed[-count:]
    return float(last[-1] - last[0]) / (0.1 * max(len(last) - 1, 1))


def _stood(agent: Seen) -> float:
    moving = np.flatnonzero(agent.speed > 0.3)
    return 0.1 * (len(agent.speed) - 1 - (int(moving[-1]) if len(moving) else -1))


def _least_delay(future: Future, speed: float) -> float:
    """By how much slower it is than even the slowest way left to it would let it be [m/s]."""
    order = np.argsort(future.free)
    at = int(np.searchsorted(np.cumsum(future.weight[order]), 0.1))
    return float(future.free[order[min(at, len(order) - 1)]]) - speed


def _best(outlook: Outlook, company: Company, pair: Two, *, within: float) -> _Best:
    """Of all pairs of exits the one that brings the two together."""
    free = company.free.get(pair)
    if free is None:
        return _Best()
    hit = np.abs(free.gap) <= within
    if not hit.any():
        return _Best()
    i, j = pair
    kinds_a, kinds_b = company.kinds[i], company.kinds[j]
    wide = int(kinds_b.max()) + 1
    both = kinds_a * wide + kinds_b
    count = np.bincount(both)
    surely = np.bincount(both, hit) / np.maximum(count, 1)
    share_a = np.bincount(kinds_a, company.clear[i, j])
    share_b = np.bincount(kinds_b, company.clear[j, i])
    codes = np.arange(len(count))
    share = share_a[codes // wide] * share_b[codes % wide]
    score = np.where(count >= 2, surely * share**_TRUST, 0.0)
    top = int(score.argmax())
    if score[top] <= 0.0:
        return _Best()
    mine = (both == top) & hit
    reach = tuple(_reach(outlook.futures[n], free, outlook.agents[n], mine, _FAR) for n in pair)
    return _Best(
        float(score[top]), float(surely[top]), float(share[top]),
        float((free.gap[both == top] == 0.0).mean()), float(np.median(free.time[mine])),
        float(np.median(free.angle[mine])), (top // wide, top % wide), (reach[0], reach[1]),
    )  # fmt: skip


def _reach(
    future: Future, met: Meeting, agent: Seen, mine: NDArray[np.bool_], else_: float
) -> float:
    """How far the place where they meet is from where the agent is now [m]."""
    rows = np.flatnonzero(mine)
    if not len(rows):
        return else_
    ticks = np.clip(np.round(met.time[rows] / DT).astype(np.intp), 0, TICKS - 1)
    away = future.xy[rows, ticks] - agent.xy[-1]
    return float(np.median(np.hypot(away[:, 0], away[:, 1])))
