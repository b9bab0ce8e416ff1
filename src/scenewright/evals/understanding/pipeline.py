"""The agentic pipeline of Section 5, of the tools that make scenes, and the methods by name.

    observe -> intend -> predict -> describe -> judge -> report

Every method but `oracle_seen` runs through it; `MethodSettings` choose what predicts exits and
relations. Where a language model does, an answer that does not fit goes back to it with the reason;
when its attempts are spent, the statistical model and the rule checker answer instead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from tenacity import Retrying, retry_if_exception, stop_after_attempt, wait_random_exponential

from scenewright.backends import Backend
from scenewright.errors import BackendFault, InputError, Rejected
from scenewright.evals.understanding.calibration import predict_relations
from scenewright.evals.understanding.cases import SceneCase
from scenewright.evals.understanding.exit_model import weigh_exits
from scenewright.evals.understanding.forecast import forecast_scene
from scenewright.evals.understanding.intent import (
    find_nearest_mean,
    find_nearest_waypoints,
    infer_routes,
)
from scenewright.evals.understanding.language_model import (
    ask_about_scene,
    describe_scene,
    require_language_model,
)
from scenewright.evals.understanding.observation import ObservationRow, to_arrays
from scenewright.evals.understanding.predictions import ScenePrediction
from scenewright.evals.understanding.route_components import list_sides
from scenewright.evals.understanding.rule_baseline import (
    TrackPredictor,
    check_predicted_tracks,
    load_trajnet,
    predict_constant_velocity,
    to_relations,
)
from scenewright.intersections import load_map, ships_refiner

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


_STATISTICAL = {
    "gmm": MethodSettings("nearest", "none"),
    "gmm_waypoints": MethodSettings("waypoints", "none"),
    "reasoner": MethodSettings("posterior", "futures"),
}


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


def predict_with_events(row: ObservationRow, case: SceneCase) -> ScenePrediction:
    """Predict as `oracle_seen`: every event among the observed agents, none of those to come."""
    ids, labels = {agent.id for agent in row.agents}, case.labels
    relations = {r.key: r for r in labels.relations if {r.from_, r.to} <= ids}
    exits = {agent.id: labels.exits[agent.id] for agent in row.agents}
    return ScenePrediction(exits, tuple(relations.values()))


METHODS = (
    "gmm", "gmm_waypoints", "trajnet", "constant_velocity", "reasoner", "agent", "oracle_seen"
)  # fmt: skip

Predict = Callable[[ObservationRow, SceneCase], ScenePrediction]
"""Only `oracle_seen` looks at the case."""


@dataclass(frozen=True, eq=False)
class Method:
    """A prediction method.

    Attributes:
        name: for tables; predictor: whose tracks the rule checker sees, if it does.
    """

    name: str
    predict: Predict
    predictor: str | None = None


def find_method(name: str, *, intersection: str, backend: Backend | None = None) -> Method:
    """Find a method by name.

    Raises:
        InputError: no such method, or it lacks its refiner or its backend.
    """
    if name not in METHODS:
        raise InputError(
            f"there is no method {name!r}; name a file of predictions (.jsonl) or one of: "
            f"{', '.join(METHODS)}"
        )
    if name == "oracle_seen":
        return Method(name, predict_with_events)
    if name == "agent" and backend is None:
        raise InputError("the method agent needs --backend: the language model to ask")
    if name in _STATISTICAL:
        settings = _STATISTICAL[name]
    else:
        if name == "trajnet" or (name == "agent" and ships_refiner(intersection)):
            predictor = (load_trajnet(intersection), "TrajNet++")
        else:
            predictor = (predict_constant_velocity, "constant velocity")
        settings = MethodSettings("none", "rules", *predictor)
        if name == "agent" and backend is not None:
            model = require_language_model(backend)
            settings = MethodSettings("posterior", "language_model", *predictor, model)
            name = f"agent ({model.name})"
    return Method(name, lambda row, _: understand(row, settings), settings.predictor or None)
