"""The methods by name, and what each needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from scenewright.backends import Backend
from scenewright.errors import InputError
from scenewright.evals.understanding.cases import SceneCase
from scenewright.evals.understanding.language_model import require_language_model
from scenewright.evals.understanding.observation import ObservationRow
from scenewright.evals.understanding.oracle import predict_with_events, predict_with_routes
from scenewright.evals.understanding.pipeline import MethodSettings, understand
from scenewright.evals.understanding.predictions import ScenePrediction
from scenewright.evals.understanding.rule_baseline import load_trajnet, predict_constant_velocity
from scenewright.intersections import ships_refiner

METHODS = (
    "gmm", "gmm_waypoints", "trajnet", "constant_velocity", "reasoner", "agent", "oracle",
    "oracle_seen",
)  # fmt: skip

Predict = Callable[[ObservationRow, SceneCase], ScenePrediction]
"""Only oracles look at the case."""


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
    if name == "oracle":
        return Method(name, predict_with_routes)
    if name == "oracle_seen":
        return Method(name, predict_with_events)
    settings = _choose_settings(name, intersection, backend)
    shown = f"agent ({settings.backend.name})" if settings.backend is not None else name
    return Method(shown, lambda row, _: understand(row, settings), settings.predictor or None)


def _choose_settings(name: str, intersection: str, backend: Backend | None) -> MethodSettings:
    if name == "gmm":
        return MethodSettings("nearest", "none")
    if name == "gmm_waypoints":
        return MethodSettings("waypoints", "none")
    if name == "reasoner":
        return MethodSettings("posterior", "futures")
    if name == "agent" and backend is None:
        raise InputError("the method agent needs --backend: the language model to ask")
    if name == "trajnet" or (name == "agent" and ships_refiner(intersection)):
        predictor = (load_trajnet(intersection), "TrajNet++")
    else:
        predictor = (predict_constant_velocity, "constant velocity")
    if name != "agent" or backend is None:
        return MethodSettings("none", "rules", *predictor)
    return MethodSettings(
        "posterior", "language_model", *predictor, require_language_model(backend)
    )  # fmt: skip
