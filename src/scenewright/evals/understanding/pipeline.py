"""The agentic pipeline of Section 5, of the tools that make scenes, and the methods by name.

    observe -> intend -> predict -> describe -> judge -> report

Every method but `oracle_seen` takes some of these steps. An answer of a language model that does
not fit goes back to it with the reason; when its attempts are spent, the statistical model and the
rule checker answer instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from tenacity import Retrying, retry_if_exception, stop_after_attempt, wait_random_exponential

from scenewright.backends import Backend
from scenewright.errors import BackendFault, InputError, Rejected
from scenewright.evals.understanding.calibration import predict_relations
from scenewright.evals.understanding.cases import SceneCase
from scenewright.evals.understanding.exit_model import weigh_all_exits
from scenewright.evals.understanding.forecast import forecast_scene
from scenewright.evals.understanding.intent import (
    find_nearest_mean,
    find_nearest_waypoints,
    infer_routes,
)
from scenewright.evals.understanding.language_model import (
    ask_about_scene,
    describe_scene,
)
from scenewright.evals.understanding.observation import ObservedScene
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
from scenewright.scene.base import FloatArray

ATTEMPTS = 3
"""How often a language model is asked about one scene."""


METHODS = (
    "gmm", "gmm_waypoints", "trajnet", "constant_velocity", "reasoner", "agent", "oracle_seen"
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Method:
    """A prediction method.

    Attributes:
        name: for tables; predictor: whose tracks the rule checker sees, if it does.
        predict: one scene; only `oracle_seen` looks at the case.
    """

    name: str
    predict: Callable[[ObservedScene, SceneCase], ScenePrediction]
    predictor: str | None = None


def find_method(name: str, *, intersection: str, backend: Backend | None = None) -> Method:
    """Find a method by name.

    Raises:
        InputError: no such method, or it lacks its refiner or its language model.
    """
    if name not in METHODS:
        raise InputError(
            f"there is no method {name!r}; name a file of predictions (.jsonl) or one of: "
            f"{', '.join(METHODS)}"
        )
    if name == "oracle_seen":
        return Method(name, predict_with_events)
    if name == "reasoner":
        return Method(name, lambda seen, _: reason(seen))
    if name in ("gmm", "gmm_waypoints"):
        find = find_nearest_mean if name == "gmm" else find_nearest_waypoints
        return Method(name, lambda seen, _: ScenePrediction(
            {each.id: find(each, intersection=intersection) for each in seen.agents}, None
        ))  # fmt: skip
    if name == "agent" and backend is None:
        raise InputError("the method agent needs --backend: the language model to ask")
    predict: TrackPredictor = predict_constant_velocity
    predictor = "constant velocity"
    if name == "trajnet" or (name == "agent" and ships_refiner(intersection)):
        predict, predictor = load_trajnet(intersection), "TrajNet++"
    if backend is None or name != "agent":
        return Method(name, lambda seen, _: apply_rules(seen, predict), predictor)
    if backend.name == "builtin":
        raise InputError(
            "the method agent asks a language model, which builtin is not; name one with "
            "--backend, such as openai:MODEL"
        )
    return Method(
        f"agent ({backend.name})",
        lambda seen, _: ask_agent(seen, backend, predict, predictor),
        predictor,
    )


def predict_with_events(seen: ObservedScene, case: SceneCase) -> ScenePrediction:
    """Predict as `oracle_seen`: every event among the observed agents, none of those to come."""
    labels = case.labels
    relations = {r.key: r for r in labels.relations if {r.from_, r.to} <= {*seen.ids}}
    exits = {agent: labels.exits[agent] for agent in seen.ids}
    return ScenePrediction(exits, tuple(relations.values()))


def reason(seen: ObservedScene) -> ScenePrediction:
    """Predict exits from the posterior of routes, and relations from sampled futures."""
    posteriors = infer_routes(seen)
    forecast = forecast_scene(seen, posteriors)
    return ScenePrediction(
        _choose_exits(weigh_all_exits(seen, posteriors), seen),
        predict_relations(forecast, window=seen.now),
    )


def apply_rules(seen: ObservedScene, predict: TrackPredictor) -> ScenePrediction:
    """Predict relations alone: what the rule checker finds in predicted tracks."""
    return ScenePrediction(None, to_relations(check_predicted_tracks(seen, predict), seen))


def ask_agent(
    seen: ObservedScene, backend: Backend, predict: TrackPredictor, predictor: str
) -> ScenePrediction:
    """Ask a language model for exits and relations.

    Args:
        predict, predictor: whose tracks the rule checker sees, and its name.

    Raises:
        BackendFault: it failed for good.
    """
    if not seen.agents:
        return ScenePrediction({}, ())
    chances = weigh_all_exits(seen, infer_routes(seen))
    events = check_predicted_tracks(seen, predict)
    sides = list_sides(load_map(seen.intersection))
    description = describe_scene(seen, chances, sides, events, predictor)
    again = Retrying(
        stop=stop_after_attempt(3), wait=wait_random_exponential(0.5), reraise=True,
        retry=retry_if_exception(lambda e: isinstance(e, BackendFault) and not e.final),
    )  # fmt: skip
    rejections: list[str] = []
    while len(rejections) < ATTEMPTS:
        try:
            said = again(ask_about_scene, description, sides, backend, rejections=tuple(rejections))
            return ScenePrediction(*said)
        except Rejected as error:
            rejections.append(error.rejection.detail)
    return ScenePrediction(_choose_exits(chances, seen), to_relations(events, seen))


def _choose_exits(chances: Mapping[str, FloatArray], seen: ObservedScene) -> dict[str, str]:
    """The likeliest exit of every agent."""
    sides = list_sides(load_map(seen.intersection))
    return {agent: sides[int(np.argmax(each))] for agent, each in chances.items()}
