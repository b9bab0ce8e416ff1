"""The interaction graph of a scene: which agents' futures conflict, and beliefs by message passing.

Most agents do not interact: a maneuver that would bring an agent close to crossing traffic is less
likely than its own motion says. So every agent's futures are reweighted by how well they avoid all
others, in a few rounds of loopy belief propagation. For a pair, each is weighed without the message
of the other, as their interaction is the question.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenewright.evals.understanding.forecast import AgentForecast, BoolArray, SceneForecast
from scenewright.evals.understanding.time_gaps import IntArray, TimeGaps, compute_time_gaps
from scenewright.scene.base import FloatArray

AgentPair = tuple[int, int]

CLOSE, CROSSING = 1.1, 0.5
"""Agents that cross (at an angle of at least so much [rad]) avoid time gaps this small [s]."""
_AVOIDANCE = 0.85
"""Probability that they do."""
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class InteractionGraph:
    """All conflicts of a scene; agents by their place in the forecast.

    Attributes:
        gaps: of i and j, i < j; unslowed_gaps: of i, had it not slowed down, and j. Pairs that
            never come near one another are left out.
        maneuvers: [A, K] a number for the exit of each and for whether it ignores a stop.
        beliefs: of i and j, [K] probability of the futures of i without the message of j.
    """

    gaps: Mapping[AgentPair, TimeGaps]
    unslowed_gaps: Mapping[AgentPair, TimeGaps]
    maneuvers: tuple[IntArray, ...]
    beliefs: Mapping[AgentPair, FloatArray]


def build_interaction_graph(forecast: SceneForecast) -> InteractionGraph:
    """Build the graph of a scene; two pedestrians do not interact."""
    agents, futures, unslowed = forecast.agents, forecast.futures, forecast.unslowed
    order = range(len(agents))
    pairs = [
        (i, j)
        for i in order
        for j in order
        if i != j and (agents[i].is_vehicle or agents[j].is_vehicle)
    ]
    gaps = {
        (i, j): compute_time_gaps((agents[i], futures[i]), (agents[j], futures[j]))
        for i, j in pairs
        if i < j
    }
    late = {
        (i, j): compute_time_gaps((agents[i], unslowed[i]), (agents[j], futures[j]))
        for i, j in pairs
        if unslowed[i] is not futures[i]
    }
    known, late_known = ({p: g for p, g in each.items() if g is not None} for each in (gaps, late))
    maneuvers = tuple(_number_maneuvers(forecast, n) for n in order)
    return InteractionGraph(
        known, late_known, maneuvers, _propagate_beliefs(futures, known, maneuvers)
    )


def _number_maneuvers(forecast: SceneForecast, n: int) -> IntArray:
    future = forecast.futures[n]
    exits = [route.exit for route in forecast.posteriors[n].components.routes]
    _, codes = np.unique(exits, return_inverse=True)
    return np.asarray(2 * codes[future.component] + future.runs)


def _propagate_beliefs(
    futures: tuple[AgentForecast, ...],
    gaps: Mapping[AgentPair, TimeGaps],
    maneuvers: tuple[IntArray, ...],
) -> dict[AgentPair, FloatArray]:
    near = {
        pair: (np.abs(each.gap) <= CLOSE) & (each.angle >= CROSSING) for pair, each in gaps.items()
    }
    messages: dict[AgentPair, FloatArray] = {}
    for _ in range(_ROUNDS):
        beliefs = [_collect(n, messages, future.weight) for n, future in enumerate(futures)]
        before, messages = messages, {}
        for (i, j), close in near.items():
            for n, m in ((i, j), (j, i)):
                weight = beliefs[m] / before.get((m, n), 1.0)
                risk = _share_by_maneuver(maneuvers[n], weight, close)
                messages[n, m] = 1.0 - _AVOIDANCE * risk
    beliefs = [_collect(n, messages, future.weight) for n, future in enumerate(futures)]
    order = range(len(futures))
    without = {(n, m): beliefs[n] / messages.get((n, m), 1.0) for n in order for m in order}
    return {pair: np.asarray(weight / weight.sum()) for pair, weight in without.items()}


def _collect(n: int, messages: Mapping[AgentPair, FloatArray], weight: FloatArray) -> FloatArray:
    """[K] the weight of an agent's futures times all messages to it."""
    for (to, _), message in messages.items():
        if to == n:
            weight = weight * message
    return weight


def _share_by_maneuver(maneuvers: IntArray, weight: FloatArray, inside: BoolArray) -> FloatArray:
    """[K] share, by weight, of the futures of the same maneuver that are inside."""
    part, whole = np.bincount(maneuvers, weight * inside), np.bincount(maneuvers, weight)
    return np.asarray((part / np.maximum(whole, 1e-12))[maneuvers])
