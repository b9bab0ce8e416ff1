"""The methods by name, and what each needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

from scenewright.backends import Backend
from scenewright.errors import InputError
from scenewright.evals.understanding.agent import Settings, understand
from scenewright.evals.understanding.asking import speaks
from scenewright.evals.understanding.dataset import Case
from scenewright.evals.understanding.observing import ObservationRow
from scenewright.evals.understanding.oracle import oracle, oracle_seen
from scenewright.evals.understanding.predictions import Prediction
from scenewright.evals.understanding.rules import constant_velocity, trajnet
from scenewright.intersections import ships_refiner

METHODS = {
    "gmm": "exits: the nearest mean trajectory of p_wp (the paper's baseline)",
    "gmm_waypoints": "exits: the same, ten waypoints against ten",
    "trajnet": "relations: TrajNet++ and the rule checker (the paper's baseline)",
    "constant_velocity": "relations: constant velocity and the rule checker",
    "reasoner": "both: posteriors, sampled futures and a calibration; no language model",
    "agent": "both: a language model on facts in words; needs --backend",
    "oracle": "both, knowing all routes: how much can be decided",
    "oracle_seen": "both, knowing every event of those seen: the most that can be right",
}

Predict = Callable[[ObservationRow, Case], Prediction]
"""Only oracles look at the case."""


@dataclass(frozen=True, eq=False)
class Method:
    """Somebody who predicts.

    Attributes:
        name: for tables; predictor: whose tracks it has checked, if anybody's.
    """

    name: str
    predict: Predict
    predictor: str | None = None


def method_named(name: str, *, intersection: str, backend: Backend | None = None) -> Method:
    """A method by name.

    Raises:
        InputError: no such method, or it lacks its refiner or its backend.
    """
    if name not in METHODS:
        raise InputError(
            f"there is no method {name!r}; name a file of predictions (.jsonl) or one of: "
            f"{', '.join(METHODS)}"
        )
    if name == "oracle":
        return Method(name, _timed(oracle))
    if name == "oracle_seen":
        return Method(name, _timed(oracle_seen))
    settings = _settings(name, intersection, backend)
    shown = f"agent ({settings.backend.name})" if settings.backend is not None else name
    return Method(shown, lambda row, _: understand(row, settings), settings.predictor or None)


def _settings(name: str, intersection: str, backend: Backend | None) -> Settings:
    if name == "gmm":
        return Settings("nearest", "none")
    if name == "gmm_waypoints":
        return Settings("waypoints", "none")
    if name == "reasoner":
        return Settings("posterior", "futures")
    if name == "trajnet":
        return Settings("none", "rules", trajnet(intersection), "TrajNet++")
    if name == "constant_velocity":
        return Settings("none", "rules", constant_velocity, "constant velocity")
    if backend is None:
        raise InputError("the method agent needs --backend: the language model to ask")
    has = ships_refiner(intersection)
    return Settings(
        "posterior",
        "asked",
        trajnet(intersection) if has else constant_velocity,
        "TrajNet++" if has else "constant velocity",
        backend=speaks(backend),
    )


def _timed(predict: Predict) -> Predict:
    def run(row: ObservationRow, case: Case) -> Prediction:
        before = perf_counter()
        found = predict(row, case)
        return Prediction(found.exits, found.relations, perf_counter() - before)

    return run
