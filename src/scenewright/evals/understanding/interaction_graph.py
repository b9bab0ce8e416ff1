"""The interaction graph of a scene: which agents' futures conflict, and beliefs by message passing.

Most agents do not interact: a maneuver that would bring an agent close to crossing traffic is less
likely than its own motion says. So every agent's futures are reweighted by how well they avoid all
others, in a few rounds of loopy belief propagation. For a pair, each is weighed without the message
of the other, as their interaction is the question.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from scenewright.evals.understanding.boosted_trees import IntArray
from scenewright.evals.understanding.forecast import AgentForecast, SceneForecast
from scenewright.evals.understanding.time_gaps import TimeGaps, compute_time_gaps
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
    gaps: dict[AgentPair, TimeGaps] = {}
    late: dict[AgentPair, TimeGaps] = {}
    for i, j in permutations(range(len(agents)), 2):
        if not (agents[i].is_vehicle or agents[j].is_vehicle):
            continue
        for found, own, wanted in (
            (gaps, futures[i], i < j), (late, unslowed[i], unslowed[i] is not futures[i])
        ):  # fmt: skip
            each = compute_time_gaps((agents[i], own), (agents[j], futures[j])) if wanted else None
            if each is not None:
                found[i, j] = each
    maneuvers = []
    for posterior, future in zip(forecast.posteriors, futures, strict=True):
        exits = [route.exit for route in posterior.components.routes]
        _, codes = np.unique(exits, return_inverse=True)
        maneuvers.append(np.asarray(2 * codes[future.component] + future.runs))
    beliefs = _propagate_beliefs(futures, gaps, tuple(maneuvers))
    return InteractionGraph(gaps, late, tuple(maneuvers), beliefs)


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
                # The share, by weight, of the futures of the same maneuver that are close.
                part, whole = (np.bincount(maneuvers[n], x) for x in (weight * close, weight))
                risk = (part / np.maximum(whole, 1e-12))[maneuvers[n]]
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
