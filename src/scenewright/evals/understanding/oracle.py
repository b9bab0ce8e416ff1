"""Oracles: how much can be known at all, by methods that look at the scene's plan.

`oracle` knows what the generator drew, the route of every observed agent, but not what it decided,
and reads motion like the reasoner. `oracle_seen` knows every event among the observed agents; it
misses only those of agents still to come.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from scenewright.evals.understanding.calibration import load_calibration, predict_relations
from scenewright.evals.understanding.cases import SceneCase
from scenewright.evals.understanding.forecast import SceneForecast, forecast_scene
from scenewright.evals.understanding.intent import infer_routes
from scenewright.evals.understanding.observation import (
    ObservationRow,
    ObservedScene,
    hash_agents,
    to_arrays,
)
from scenewright.evals.understanding.predictions import ScenePrediction

_SHIPPED = Path(__file__).with_name("calibration_oracle.npz")
_ELSEWHERE = -60.0


def predict_with_routes(row: ObservationRow, case: SceneCase) -> ScenePrediction:
    """Predict as `oracle`: exits and relations with all routes known."""
    observation = to_arrays(row)
    relations = predict_relations(
        forecast_with_routes(observation, case), window=observation.now,
        calibration=load_calibration(_SHIPPED),
    )  # fmt: skip
    return ScenePrediction(
        {agent: case.labels.exits[agent] for agent in observation.ids}, relations
    )


def forecast_with_routes(observation: ObservedScene, case: SceneCase) -> SceneForecast:
    """Sample futures along the true routes."""
    codes = hash_agents(case.id, (agent.id for agent in case.record.agents))
    routes = {codes[agent.id]: agent.route for agent in case.record.agents}
    posteriors = infer_routes(observation)
    for agent, each in posteriors.items():
        known = each.components.routes
        mine = np.array([known[c].id == routes[agent] for c in each.kept])
        log = np.where(mine, each.log, each.log + _ELSEWHERE)
        posteriors[agent] = replace(each, log=log - np.logaddexp.reduce(log))
    return forecast_scene(observation, posteriors)


def predict_with_events(row: ObservationRow, case: SceneCase) -> ScenePrediction:
    """Predict as `oracle_seen`: every event among the observed agents."""
    ids = {agent.id for agent in row.agents}
    relations = {r.key: r for r in case.labels.relations if {r.from_, r.to} <= ids}
    return ScenePrediction(
        {agent.id: case.labels.exits[agent.id] for agent in row.agents}, tuple(relations.values())
    )
