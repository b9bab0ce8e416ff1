"""Features of a pair of agents, computed from their futures for the calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenewright.evals.understanding.cases import ObservedAgent
from scenewright.evals.understanding.forecast import (
    DT,
    TICKS,
    AgentForecast,
    BoolArray,
    SceneForecast,
    find_weighted_quantile,
)
from scenewright.evals.understanding.interaction_graph import (
    CLOSE,
    NEVER,
    AgentPair,
    InteractionGraph,
    TimeGaps,
    build_interaction_graph,
)
from scenewright.evals.understanding.zone_features import (
    IN_ZONE,
    OF_ZONE,
    compute_median,
    compute_zone_features,
)
from scenewright.scene.base import FloatArray

OF_BOTH = ("at_once", "close", "within_1", "within_2", "within_3", "alone_1", "best", "best_share",
           "touch", "wide", "wide_share", "soon", "angle", "rank", "window", *OF_ZONE)  # fmt: skip
"""Shares of futures in which the two touch if one of them came 0.3, 0.6, 1.1, 2.1 or 3.1 s earlier
or later, by beliefs; 1.1 s by posteriors alone; of the pair of maneuvers that conflicts most: how
often, the probability of that pair, the share of contacts as it is, when [s] and at which angle
[rad]; by how much more this pair conflicts than any other of the scene; the window [s]; and of the
zone of those maneuvers, as in `zone_features`."""
OF_EACH = ("first", "undelayed_0", "undelayed_1", "undelayed_2", "delay", "delay_least", "speed",
           "lost", "gain", "gain_2", "stood", "walks", "held", "runs", "own", "own_alone",
           "straight", "jaywalks", "slowed", "known", "reach", "needs", "busy",
           "cause", "left", "right", "length", "line_needs", "line_late",
           *IN_ZONE)  # fmt: skip
"""Whether it passes first within 3 s; whether it would have come within 0.3, 1 or 2 s of the other
had it not slowed down; by how much it is slower than its route demands, median and least [m/s];
speed, loss of speed since its maximum [m/s], acceleration over 0.7 and 2 s [m/s^2]; how long it has
been stationary [s]; whether a pedestrian; held at red; ignoring a stop; the probability of its
maneuver, by beliefs and by the posterior alone; straight on; off a crosswalk; has slowed down;
observed for [s]; distance to the conflict [m] and the braking that stops it before [m/s^2]; how
much it conflicts with any other agent; how much it would have, had it not slowed down; probability
of a left or right turn; length [m]; the braking that stops it at its line [m/s^2], and the
probability that this is more than usual; its stay in the zone, as in `zone_features`."""
NAMES = (*OF_BOTH, *(f"{name}_a" for name in OF_EACH), *(f"{name}_b" for name in OF_EACH))
"""Names of the features; a calibration is for these."""
_TRUST = 0.3
"""A pair of maneuvers counts by its share of conflicts times its own probability to this power, as
accidents happen on rare maneuvers."""
_FAR = 60.0
_SLACK, _BRAKES = 0.3, 2.5
"""Accuracy of the position of stops [m]; braking for a light is usually softer [m/s^2]."""


@dataclass(frozen=True, eq=False)
class _Conflict:
    """The pair of maneuvers in which two agents conflict most, and when and where."""

    score: float = 0.0
    share_of_conflicts: float = 0.0
    probability: float = 0.0
    touch: float = 0.0
    soon: float = 20.0
    angle: float = 0.0
    maneuvers: tuple[int, int] = (-1, -1)
    reach: tuple[float, float] = (_FAR, _FAR)


@dataclass(frozen=True, eq=False)
class _AgentFeatures:
    """What has to do with no other agent.

    Attributes:
        values: `delay` to `walks` of `OF_EACH`; turns: by movement, which futures make it.
        line: `line_needs` and `line_late` of `OF_EACH`.
    """

    values: Sequence[float]
    turns: Mapping[str, BoolArray]
    line: Sequence[float]


@dataclass(frozen=True, eq=False)
class _SceneFeatures:
    """What is known of all pairs before any of them is described.

    Attributes:
        worst: the conflict of each pair; busy: how much each pair conflicts; cause: how much the
            first would have conflicted with the second, had it not slowed down; agents: of each
            agent, what has to do with no other.
    """

    forecast: SceneForecast
    graph: InteractionGraph
    window: float
    worst: Mapping[AgentPair, _Conflict]
    busy: Mapping[AgentPair, float]
    cause: Mapping[AgentPair, float]
    agents: Sequence[_AgentFeatures]


def compute_pair_features(
    forecast: SceneForecast, window: float
) -> tuple[list[tuple[str, str]], FloatArray]:
    """Describe every pair with a vehicle in it whose futures come near: ids, and [N, F] `NAMES`."""
    graph = build_interaction_graph(forecast)
    pairs = sorted({(min(pair), max(pair)) for pair in (*graph.gaps, *graph.unslowed_gaps)})
    worst = {pair: _find_conflict(forecast, graph, pair, within=0.3) for pair in pairs}
    busy = {
        pair: _weigh_jointly(graph, pair)[np.abs(graph.gaps[pair].gap) <= CLOSE].sum()
        for pair in pairs
        if pair in graph.gaps
    }
    cause = {
        pair: _share_within(gaps, graph.beliefs[pair] * graph.beliefs[pair[::-1]], 2.1)
        for pair, gaps in graph.unslowed_gaps.items()
    }
    agents = [_describe_alone(forecast, n) for n in range(len(forecast.agents))]
    scene = _SceneFeatures(forecast, graph, window, worst, busy, cause, agents)
    values = np.array([_describe_pair(scene, pair) for pair in pairs]).reshape(-1, len(NAMES))
    return [(forecast.agents[i].id, forecast.agents[j].id) for i, j in pairs], values


def mirror_features(values: FloatArray) -> FloatArray:
    """[..., F] the same pairs with a and b swapped."""
    n, m = len(OF_BOTH), len(OF_EACH)
    return np.concatenate([values[..., :n], values[..., n + m :], values[..., n : n + m]], axis=-1)


def _describe_pair(scene: _SceneFeatures, pair: AgentPair) -> list[float]:
    forecast, graph, (i, j) = scene.forecast, scene.graph, pair
    weight, worst = _weigh_jointly(graph, pair), scene.worst[pair]
    wide = _find_conflict(forecast, graph, pair, within=CLOSE)
    alone = forecast.futures[i].weight * forecast.futures[j].weight
    gap = graph.gaps[pair].gap if pair in graph.gaps else np.full(len(weight), NEVER)
    others = max((each.score for p, each in scene.worst.items() if p != pair), default=0.0)
    both = [
        *(float(weight[np.abs(gap) <= limit].sum()) for limit in (0.3, 0.6, CLOSE, 2.1, 3.1)),
        float(alone[np.abs(gap) <= CLOSE].sum() / alone.sum()),
        worst.share_of_conflicts, worst.probability, worst.touch, wide.share_of_conflicts,
        wide.probability, min(wide.soon, 20.0), wide.angle, worst.score - others, scene.window,
    ]  # fmt: skip
    most = (wide if wide.score else worst).maneuvers
    mine = (graph.maneuvers[i] == most[0]) & (graph.maneuvers[j] == most[1])
    one, two = ((forecast.agents[n], forecast.futures[n]) for n in pair)
    shared, *in_zone = compute_zone_features(one, two, mine)
    a, b = (
        _describe_agent(scene, pair, which, sign * gap, weight, worst, wide)
        for which, sign in ((0, 1), (1, -1))
    )
    return [*both, *shared, *a, *in_zone[0], *b, *in_zone[1]]


def _describe_alone(forecast: SceneForecast, n: int) -> _AgentFeatures:
    future, agent = forecast.futures[n], forecast.agents[n]
    routes, v = forecast.posteriors[n].components.routes, float(agent.speed[-1])
    movement = np.array([route.movement for route in routes])[future.component]
    least_delay = find_weighted_quantile(future.free, future.weight, 0.1) - v
    values = (
        float(forecast.delay[n]), least_delay, v, float(agent.speed.max()) - v,
        agent.measure_acceleration(8), agent.measure_acceleration(20), agent.standstill,
        float(not agent.is_vehicle),
    )  # fmt: skip
    turns = {turn: movement == turn for turn in ("straight", "jaywalking", "left", "right")}
    needs = np.where(np.isfinite(future.stop), v**2 / (2.0 * (future.stop + _SLACK)), 0.0)
    line = (
        float(np.minimum(needs, 12.0) @ future.weight),
        float((needs > _BRAKES) @ future.weight),
    )
    return _AgentFeatures(values, turns, line)


def _describe_agent(
    scene: _SceneFeatures,
    pair: AgentPair,
    which: int,
    gap: FloatArray,
    weight: FloatArray,
    worst: _Conflict,
    wide: _Conflict,
) -> list[float]:
    """`OF_EACH` of one of the two; `gap` is negative where this one comes first."""
    n, m = pair if which == 0 else pair[::-1]
    forecast, graph = scene.forecast, scene.graph
    future, agent = forecast.futures[n], forecast.agents[n]
    late, belief = graph.unslowed_gaps.get((n, m)), graph.beliefs[n, m]
    slowed = forecast.unslowed[n] is not future
    part, own = (
        graph.maneuvers[n] == (worst if worst.score else wide).maneuvers[which],
        scene.agents[n],
    )
    reach = wide.reach[which]
    if slowed and late is not None:
        reach = _measure_reach(forecast.unslowed[n], late, agent, np.abs(late.gap) <= 2.1, reach)
    v, taken = float(agent.speed[-1]), future.weight * part
    return [
        float(weight[(gap < -0.3) & (gap >= -3.1)].sum()),
        *(_share_within(late, weight, limit) for limit in (0.3, 1.0, 2.1)),
        *own.values, float(belief[future.held].sum()),
        float(belief[future.runs].sum()), float(belief[part].sum()),
        float(future.weight[part].sum()),
        float(belief[own.turns["straight"]].sum()),
        float(belief[own.turns["jaywalking"]].sum()), float(slowed),
        scene.window - agent.start, reach,
        min(v * v / (2.0 * max(reach - agent.length / 2 - 0.5, 0.5)), 12.0),
        max((x for p, x in scene.busy.items() if n in p and p != pair), default=0.0),
        max((x for (p, q), x in scene.cause.items() if p == n and q != m), default=0.0),
        *(float(taken[own.turns[turn]].sum() / max(float(taken.sum()), 1e-9))
          for turn in ("left", "right")),
        agent.length, *own.line,
    ]  # fmt: skip


def _weigh_jointly(graph: InteractionGraph, pair: AgentPair) -> FloatArray:
    """[K] probability of the futures of the two together."""
    weight = graph.beliefs[pair] * graph.beliefs[pair[::-1]]
    return np.asarray(weight / weight.sum())


def _share_within(gaps: TimeGaps | None, weight: FloatArray, limit: float) -> float:
    if gaps is None:
        return 0.0
    return float(weight[np.abs(gaps.gap) <= limit].sum() / weight.sum())


def _find_conflict(
    forecast: SceneForecast, graph: InteractionGraph, pair: AgentPair, *, within: float
) -> _Conflict:
    """The pair of maneuvers with the highest score among futures with gaps `within` [s]."""
    gaps, (i, j) = graph.gaps.get(pair), pair
    if gaps is None:
        return _Conflict()
    hit = np.abs(gaps.gap) <= within
    if not hit.any():
        return _Conflict()
    one, two = graph.maneuvers[i], graph.maneuvers[j]
    wide = int(two.max()) + 1
    both = one * wide + two
    count = np.bincount(both)
    conflicts = np.bincount(both, hit) / np.maximum(count, 1)
    codes = np.arange(len(count))
    share_a = np.bincount(one, graph.beliefs[i, j])
    share_b = np.bincount(two, graph.beliefs[j, i])
    probability = share_a[codes // wide] * share_b[codes % wide]
    score = np.where(count >= 2, conflicts * probability**_TRUST, 0.0)
    top = int(score.argmax())
    if score[top] <= 0.0:
        return _Conflict()
    mine = (both == top) & hit
    a, b = (_measure_reach(forecast.futures[n], gaps, forecast.agents[n], mine, _FAR) for n in pair)
    return _Conflict(
        float(score[top]), float(conflicts[top]), float(probability[top]),
        float((gaps.gap[both == top] == 0.0).mean()), compute_median(gaps.time[mine]),
        compute_median(gaps.angle[mine]), (top // wide, top % wide), (a, b),
    )  # fmt: skip


def _measure_reach(
    future: AgentForecast, gaps: TimeGaps, agent: ObservedAgent, mine: BoolArray, default: float
) -> float:
    """Median distance from the agent to the conflict [m]."""
    rows = np.flatnonzero(mine)
    if not len(rows):
        return default
    ticks = np.clip(np.round(gaps.time[rows] / DT).astype(np.intp), 0, TICKS - 1)
    away = future.xy[rows, ticks] - agent.xy[-1]
    return compute_median(np.hypot(away[:, 0], away[:, 1]))
