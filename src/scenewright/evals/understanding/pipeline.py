"""The agentic pipeline of Section 5, a graph of its own over the tools that make scenes.

    observe -> intend -> predict -> describe -> judge -> report

Every method but the oracles runs through it; `MethodSettings` choose what predicts exits and
relations. Where a language model does, an answer that does not fit goes back to it with the reason;
when its attempts are spent, the statistical model and the rule checker answer instead.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, Literal, TypedDict

import numpy as np
from langgraph.graph import END, START, StateGraph
from langgraph.runtime import Runtime
from langgraph.types import RetryPolicy

from scenewright.backends import Backend
from scenewright.errors import BackendFault, Rejected
from scenewright.evals.understanding.exit_model import weigh_exits
from scenewright.evals.understanding.forecast import SceneForecast, forecast_scene
from scenewright.evals.understanding.intent import (
    RoutePosterior,
    find_nearest_mean,
    find_nearest_waypoints,
    infer_routes,
)
from scenewright.evals.understanding.labels import PairRelation
from scenewright.evals.understanding.language_model import ask_about_scene
from scenewright.evals.understanding.observation import (
    ObservationRow,
    ObservedScene,
    to_arrays,
)
from scenewright.evals.understanding.predictions import ScenePrediction
from scenewright.evals.understanding.reasoner import predict_relations
from scenewright.evals.understanding.route_components import list_sides
from scenewright.evals.understanding.rule_baseline import (
    TrackPredictor,
    check_predicted_tracks,
    to_relations,
)
from scenewright.evals.understanding.scene_description import SceneDescription, describe_scene
from scenewright.intersections import load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event

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


class UnderstandingState(TypedDict, total=False):
    """Channels of a run; each is written by one node."""

    row: ObservationRow
    observation: ObservedScene
    sides: tuple[str, ...]
    posteriors: Mapping[str, RoutePosterior]
    chances: Mapping[str, FloatArray]
    exits: Mapping[str, str]
    forecast: SceneForecast
    events: tuple[Event, ...]
    description: SceneDescription
    relations: tuple[PairRelation, ...]
    answered_exits: Mapping[str, str]
    refused: bool
    rejections: Annotated[list[str], operator.add]
    prediction: ScenePrediction


def observe_scene(state: UnderstandingState) -> UnderstandingState:
    """Convert the row to arrays and list the sides of its map."""
    observation = to_arrays(state["row"])
    return {"observation": observation, "sides": list_sides(load_map(observation.intersection))}


def predict_exits(
    state: UnderstandingState, *, runtime: Runtime[MethodSettings]
) -> UnderstandingState:
    """Predict where all agents leave, by the statistical model."""
    observed, model = state["observation"], runtime.context.exits
    if model == "none":
        return {}
    if model != "posterior":
        find = find_nearest_mean if model == "nearest" else find_nearest_waypoints
        return {"exits": {a.id: find(a, intersection=observed.intersection)
                          for a in observed.agents}}  # fmt: skip
    posteriors, sides = infer_routes(observed), state["sides"]
    chances = {
        agent.id: weigh_exits(agent, posteriors[agent.id], sides, window=observed.now)
        for agent in observed.agents
    }
    exits = {agent: sides[int(np.argmax(each))] for agent, each in chances.items()}
    return {"posteriors": posteriors, "chances": chances, "exits": exits}


def predict_tracks(
    state: UnderstandingState, *, runtime: Runtime[MethodSettings]
) -> UnderstandingState:
    """Sample futures, or predict one track each and run the rule checker on them."""
    if runtime.context.relations == "futures":
        return {"forecast": forecast_scene(state["observation"], state["posteriors"])}
    if runtime.context.predict is None:
        return {"events": ()}
    return {"events": check_predicted_tracks(state["observation"], runtime.context.predict)}


def describe(state: UnderstandingState, *, runtime: Runtime[MethodSettings]) -> UnderstandingState:
    """Describe the scene in words where a language model reads it."""
    if runtime.context.relations != "language_model":
        return {}
    description = describe_scene(
        state["observation"], state["chances"], state["sides"], state["events"],
        runtime.context.predictor,
    )  # fmt: skip
    return {"description": description}


def judge(state: UnderstandingState, *, runtime: Runtime[MethodSettings]) -> UnderstandingState:
    """Predict the relations."""
    model, observed = runtime.context.relations, state["observation"]
    if model == "rules":
        return {"relations": to_relations(state["events"], observed), "refused": False}
    if model == "futures":
        relations = predict_relations(state["forecast"], window=observed.now)
        return {"relations": relations, "refused": False}
    if model == "none":
        return {"refused": False}
    if runtime.context.backend is None:
        raise TypeError("a language model needs a backend")
    return _ask(state, runtime.context.backend)


def _ask(state: UnderstandingState, backend: Backend) -> UnderstandingState:
    if not state["description"].names:
        return {"answered_exits": {}, "relations": (), "refused": False}
    try:
        exits, relations = ask_about_scene(
            state["description"], state["sides"], backend, rejections=tuple(state["rejections"])
        )
    except Rejected as error:
        rules = to_relations(state["events"], state["observation"])
        return {"refused": True, "relations": rules, "rejections": [error.rejection.detail]}
    return {"answered_exits": exits, "relations": relations, "refused": False}


def route_after_judge(state: UnderstandingState) -> Literal["judge", "report"]:
    """Return to the language model with the reason while there are attempts left."""
    again = state["refused"] and len(state["rejections"]) < ATTEMPTS
    return "judge" if again else "report"


def report(state: UnderstandingState) -> UnderstandingState:
    """Collect the prediction."""
    exits = state.get("answered_exits", state.get("exits"))
    return {"prediction": ScenePrediction(exits, state.get("relations"))}


def _is_transient(error: Exception) -> bool:
    """Whether a question is worth asking again."""
    return isinstance(error, BackendFault) and not error.final


@cache
def _compile_graph() -> Any:
    graph: StateGraph[UnderstandingState, MethodSettings, Any, Any] = StateGraph(
        UnderstandingState, context_schema=MethodSettings
    )
    nodes: tuple[tuple[str, Any], ...] = (
        ("observe", observe_scene), ("intend", predict_exits), ("predict", predict_tracks),
        ("describe", describe), ("judge", judge), ("report", report),
    )  # fmt: skip
    retry = RetryPolicy(max_attempts=3, retry_on=_is_transient)
    for name, node in nodes:
        graph.add_node(name, node, retry_policy=retry if name == "judge" else None)
    graph.add_edge(START, "observe")
    for (one, _), (two, _) in pairwise(nodes[:5]):
        graph.add_edge(one, two)
    graph.add_conditional_edges("judge", route_after_judge)
    graph.add_edge("report", END)
    return graph.compile()


def understand(row: ObservationRow, settings: MethodSettings) -> ScenePrediction:
    """Run one scene through the graph.

    Raises:
        BackendFault: a language model failed for good.
    """
    state = _compile_graph().invoke({"row": row, "rejections": []}, context=settings)
    prediction: ScenePrediction = state["prediction"]
    return prediction
