"""The agentic pipeline of Section 5 as a graph of its own over the tools that make scenes.

    observe -> intend -> predict -> describe -> judge -> report

Every method runs through it; they differ in who intends and who judges. Where a language model
judges, an answer that does not fit goes back to it with the reason; when its attempts are spent,
the statistical model and the rule checker speak for it.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from time import perf_counter
from typing import Annotated, Any, Literal, TypedDict

import numpy as np
from langgraph.graph import END, START, StateGraph
from langgraph.runtime import Runtime
from langgraph.types import RetryPolicy

from scenewright.backends import Backend
from scenewright.errors import BackendFault, Rejected
from scenewright.evals.understanding.asking import ask_about
from scenewright.evals.understanding.calibration import Calibration
from scenewright.evals.understanding.futures import Outlook, outlook
from scenewright.evals.understanding.intent import (
    Fit,
    fits_of,
    nearest_mean,
    nearest_waypoints,
)
from scenewright.evals.understanding.labels import Relation
from scenewright.evals.understanding.observing import Observation, ObservationRow, as_arrays
from scenewright.evals.understanding.predictions import Prediction
from scenewright.evals.understanding.reasoner import relations_of, suspicions
from scenewright.evals.understanding.rules import Predictor, as_relations, findings
from scenewright.evals.understanding.ways import sides_of
from scenewright.evals.understanding.words import Description, describe
from scenewright.intersections import load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event

ATTEMPTS = 3
"""How often a language model is asked about one scene."""

Intending = Literal["nearest", "waypoints", "posterior", "asked", "none"]
Judging = Literal["rules", "futures", "asked", "none"]


@dataclass(frozen=True)
class Settings:
    """Who does what.

    Attributes:
        intending: who says where everybody leaves; judging: who says what relates them.
        predict, predictor: tracks to come for the rule checker, and its name.
        backend: the language model; calibration: of the futures, if not the shipped one.
    """

    intending: Intending
    judging: Judging
    predict: Predictor | None = None
    predictor: str = ""
    backend: Backend | None = None
    calibration: Calibration | None = None


class State(TypedDict, total=False):
    """Channels of a run; each is written by one node."""

    row: ObservationRow
    observation: Observation
    sides: tuple[str, ...]
    fits: Mapping[str, Fit]
    chances: Mapping[str, FloatArray]
    exits: Mapping[str, str]
    outlook: Outlook
    events: tuple[Event, ...]
    told: Description
    relations: tuple[Relation, ...]
    asked_exits: Mapping[str, str]
    refused: bool
    rejections: Annotated[list[str], operator.add]
    prediction: Prediction


def observe(state: State) -> State:
    """The row as arrays, and the sides of its map."""
    observation = as_arrays(state["row"])
    return {"observation": observation, "sides": sides_of(load_map(observation.intersection))}


def intend(state: State, *, runtime: Runtime[Settings]) -> State:
    """Where everybody leaves, by the statistical model."""
    seen, how = state["observation"], runtime.context.intending
    if how == "none":
        return {}
    if how in ("nearest", "waypoints"):
        rule = nearest_mean if how == "nearest" else nearest_waypoints
        return {"exits": {a.id: rule(a, intersection=seen.intersection) for a in seen.agents}}
    fits = fits_of(seen)
    chances = {agent: fit.exits(state["sides"]) for agent, fit in fits.items()}
    return {
        "fits": fits,
        "chances": chances,
        "exits": {a: state["sides"][int(np.argmax(c))] for a, c in chances.items()},
    }


def predict(state: State, *, runtime: Runtime[Settings]) -> State:
    """Tracks to come: sampled futures, or one track each and what the rule checker says to it."""
    if runtime.context.judging == "futures":
        return {"outlook": outlook(state["observation"], known=state["fits"])}
    if runtime.context.predict is not None:
        return {"events": findings(state["observation"], runtime.context.predict)}
    return {"events": ()}


def tell(state: State, *, runtime: Runtime[Settings]) -> State:
    """The scene in words, for those who read."""
    if runtime.context.judging != "asked":
        return {}
    return {
        "told": describe(
            state["observation"],
            state["chances"],
            state["sides"],
            state["events"],
            runtime.context.predictor,
        )
    }


def judge(state: State, *, runtime: Runtime[Settings]) -> State:
    """What relates whom."""
    settings, seen = runtime.context, state["observation"]
    if settings.judging == "none":
        return {"refused": False}
    if settings.judging == "rules":
        return {"relations": as_relations(state["events"], seen), "refused": False}
    if settings.judging == "futures":
        found = suspicions(state["outlook"], window=seen.now, calibration=settings.calibration)
        relations = relations_of(found, window=seen.now, calibration=settings.calibration)
        return {"relations": relations, "refused": False}
    return _asked(state, settings)


def _asked(state: State, settings: Settings) -> State:
    if settings.backend is None:
        raise TypeError("somebody must be asked")
    rejections = tuple(state.get("rejections", ()))
    if not state["told"].names:
        return {"asked_exits": {}, "relations": (), "refused": False}
    try:
        exits, relations = ask_about(
            state["told"], state["sides"], settings.backend, rejections=rejections
        )
    except Rejected as error:
        rules = as_relations(state["events"], state["observation"])
        return {"refused": True, "relations": rules, "rejections": [error.rejection.detail]}
    return {"asked_exits": exits, "relations": relations, "refused": False}


def after_judge(state: State) -> Literal["judge", "report"]:
    """Back to whoever judges, told why, while there are attempts left."""
    again = state["refused"] and len(state.get("rejections", ())) < ATTEMPTS
    return "judge" if again else "report"


def report(state: State) -> State:
    """What is believed of the scene."""
    exits = state.get("asked_exits", state.get("exits"))
    return {"prediction": Prediction(exits, state.get("relations"))}


def build_graph() -> StateGraph[State, Settings, Any, Any]:
    """The graph, not yet compiled."""
    graph: StateGraph[State, Settings, Any, Any] = StateGraph(State, context_schema=Settings)
    nodes: tuple[tuple[str, Any], ...] = (
        ("observe", observe), ("intend", intend), ("predict", predict), ("describe", tell),
        ("judge", judge), ("report", report),
    )  # fmt: skip
    transport = RetryPolicy(max_attempts=3, retry_on=BackendFault)
    for name, node in nodes:
        graph.add_node(name, node, retry_policy=transport if name == "judge" else None)
    graph.add_edge(START, "observe")
    for (one, _), (two, _) in pairwise(nodes[:5]):
        graph.add_edge(one, two)
    graph.add_conditional_edges("judge", after_judge)
    graph.add_edge("report", END)
    return graph


@cache
def _compiled() -> Any:
    return build_graph().compile()


def understand(row: ObservationRow, settings: Settings) -> Prediction:
    """One scene through the graph; the prediction carries what it took [s].

    Raises:
        BackendFault: a language model failed for good.
    """
    before = perf_counter()
    state = _compiled().invoke({"row": row, "rejections": []}, context=settings)
    found: Prediction = state["prediction"]
    return Prediction(found.exits, found.relations, perf_counter() - before)
