"""The agentic pipeline of Section 5, of the tools that make scenes.

    observe -> intend -> predict -> describe -> judge -> report

Every method but the oracles runs through it; `MethodSettings` choose what predicts exits and
relations. Where a language model does, an answer that does not fit goes back to it with the reason;
when its attempts are spent, the statistical model and the rule checker answer instead.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from tenacity import Retrying, retry_if_exception, stop_after_attempt, wait_random_exponential

from scenewright.backends import Backend
from scenewright.errors import BackendFault, Rejected
from scenewright.evals.understanding.calibration import predict_relations
from scenewright.evals.understanding.exit_model import weigh_exits
from scenewright.evals.understanding.forecast import forecast_scene
from scenewright.evals.understanding.intent import (
    find_nearest_mean,
    find_nearest_waypoints,
    infer_routes,
)
from scenewright.evals.understanding.language_model import ask_about_scene
from scenewright.evals.understanding.observation import ObservationRow, to_arrays
from scenewright.evals.understanding.predictions import ScenePrediction
from scenewright.evals.understanding.route_components import list_sides
from scenewright.evals.understanding.rule_baseline import (
    TrackPredictor,
    check_predicted_tracks,
    to_relations,
)
from scenewright.evals.understanding.scene_description import describe_scene
from scenewright.intersections import load_map

ATTEMPTS = 3
"""How often a language model is asked about one scene."""


@dataclass(frozen=True)
class MethodSettings:
    """Which model predicts what.

    Attributes:
        exits, relations: the model of each.
        predict, predictor: track predictor for the rule checker, and its name.
        backend: the language model.
    """

    exits: Literal["nearest", "waypoints", "posterior", "none"]
    relations: Literal["rules", "futures", "language_model", "none"]
    predict: TrackPredictor | None = None
    predictor: str = ""
    backend: Backend | None = None


def understand(row: ObservationRow, settings: MethodSettings) -> ScenePrediction:
    """Predict one scene.

    Raises:
        BackendFault: a language model failed for good.
    """
    observed = to_arrays(row)
    sides = list_sides(load_map(observed.intersection))
    exits: dict[str, str] | None = None
    chances, posteriors = {}, {}
    if settings.exits == "posterior":
        posteriors = infer_routes(observed)
        chances = {
            agent.id: weigh_exits(agent, posteriors[agent.id], sides, window=observed.now)
            for agent in observed.agents
        }
        exits = {agent: sides[int(np.argmax(each))] for agent, each in chances.items()}
    elif settings.exits != "none":
        find = find_nearest_mean if settings.exits == "nearest" else find_nearest_waypoints
        exits = {a.id: find(a, intersection=observed.intersection) for a in observed.agents}
    if settings.relations == "none":
        return ScenePrediction(exits, None)
    if settings.relations == "futures":
        forecast = forecast_scene(observed, posteriors)
        return ScenePrediction(exits, predict_relations(forecast, window=observed.now))
    events = check_predicted_tracks(observed, settings.predict) if settings.predict else ()
    by_rules = ScenePrediction(exits, to_relations(events, observed))
    if settings.relations == "rules":
        return by_rules
    if settings.backend is None:
        raise TypeError("a language model needs a backend")
    description = describe_scene(observed, chances, sides, events, settings.predictor)
    if not description.names:
        return ScenePrediction({}, ())
    again = Retrying(
        stop=stop_after_attempt(3), wait=wait_random_exponential(0.5), reraise=True,
        retry=retry_if_exception(lambda e: isinstance(e, BackendFault) and not e.final),
    )  # fmt: skip
    rejections: list[str] = []
    while len(rejections) < ATTEMPTS:
        try:
            said = again(
                ask_about_scene, description, sides, settings.backend, rejections=tuple(rejections)
            )
            return ScenePrediction(*said)
        except Rejected as error:
            rejections.append(error.rejection.detail)
    return by_rules
