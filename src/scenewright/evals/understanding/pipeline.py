"""The agentic pipeline of Section 5, of the tools that make scenes, and the methods by name.

    observe -> intend -> predict -> describe -> judge -> report

Every method but `oracle_seen` takes some of these steps. An answer of a language model that does
not fit goes back to it with the reason; when its attempts are spent, the statistical model and the
rule checker answer instead. The paper's relation baseline is the rule checker on predicted tracks:
of TrajNet++, the refiner that the bundle ships, without goals, or of constant velocity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from tenacity import Retrying, retry_if_exception, stop_after_attempt, wait_random_exponential

from scenewright.backends import Backend
from scenewright.errors import BackendFault, InputError, Rejected
from scenewright.evals.understanding.calibration import predict_relations
from scenewright.evals.understanding.cases import RELATIONS, ObservedScene, PairRelation, SceneCase
from scenewright.evals.understanding.exit_model import weigh_all_exits
from scenewright.evals.understanding.forecast import forecast_scene
from scenewright.evals.understanding.intent import (
    find_nearest_mean,
    find_nearest_waypoints,
    infer_routes,
)
from scenewright.evals.understanding.language_model import ask_about_scene, describe_scene
from scenewright.evals.understanding.route_components import list_sides
from scenewright.evals.understanding.scoring import ScenePrediction
from scenewright.geometry.polyline import interpolate_points
from scenewright.intersections import load_map, ships_refiner
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event
from scenewright.scene.track import STEP, Shape, Track
from scenewright.tools.relation_checker import RoadUser, find_events
from scenewright.tools.track_io.external_tracks import compute_headings

if TYPE_CHECKING:
    from scenewright.tools.trajnet_refiner.network import RefinerNetwork

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
            {agent.id: find(agent, intersection=intersection) for agent in seen.agents}, None
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


HORIZON = 8.0
"""How far ahead tracks are predicted [s]."""
LEAST_MOTION = {"vehicle": 0.5, "pedestrian": 0.2, "cyclist": 0.3, "scooter": 0.3}
"""Motion from which a heading is computed [m]."""

TrackPredictor = Callable[[ObservedScene], list[FloatArray]]
"""Of all agents, in order: [T, 2] positions [m] every 0.1 s from now + 0.1 s on."""


def predict_constant_velocity(observation: ObservedScene) -> list[FloatArray]:
    """Continue every agent's last step."""
    ahead = np.arange(1, round(HORIZON / STEP) + 1)[:, None]
    return [
        agent.xy[-1] + ahead * (agent.xy[-1] - agent.xy[max(len(agent.xy) - 2, 0)])
        for agent in observation.agents
    ]


def load_trajnet(intersection: str) -> TrackPredictor:
    """Load the bundle's refiner as a predictor.

    Raises:
        InputError: the bundle ships none.
    """
    from scenewright.tools.trajnet_refiner.bundled import load_bundled_refiner

    learned = load_bundled_refiner(intersection)
    if learned is None:
        raise InputError(
            f"intersection {intersection!r} ships no refiner, so there is no TrajNet++ to predict "
            "with; use the method constant_velocity"
        )
    net = learned.net
    return lambda observation: predict_with_refiner(net, observation)


def predict_with_refiner(net: RefinerNetwork, observation: ObservedScene) -> list[FloatArray]:
    """Roll out the refiner, resampled; constant velocity for agents that it cannot predict."""
    from scenewright.tools.trajnet_refiner.config import CLASSES
    from scenewright.tools.trajnet_refiner.rollout import run_rollout

    step, fallback = net.config.step, predict_constant_velocity(observation)
    if not observation.agents:
        return []
    steps = int(np.ceil(HORIZON / step))
    past = min(net.config.observed, int(observation.now / step) + 1)
    known = np.full((len(fallback), past + steps, 2), np.nan)
    for n, agent in enumerate(observation.agents):
        times = observation.now - step * np.arange(past - 1.0, -1.0, -1.0)
        seen = agent.start + STEP * np.arange(len(agent.xy), dtype=np.float64)
        inside = (times >= seen[0] - 1e-6) & (times <= seen[-1] + 1e-6)
        there = interpolate_points(times, seen, agent.xy)
        known[n, :past] = np.where(inside[:, None], there, np.nan)
    kinds = ["vehicle" if agent.is_vehicle else "pedestrian" for agent in observation.agents]
    classes = np.array([CLASSES.index(kind) for kind in kinds])
    rolled = run_rollout(net, known, classes=classes)[:, past - 1 :]
    wanted = STEP * np.arange(1.0, round(HORIZON / STEP) + 1)
    times = step * np.arange(steps + 1.0)
    return [
        interpolate_points(wanted, times, xy) if np.isfinite(xy).all() else straight
        for xy, straight in zip(rolled, fallback, strict=True)
    ]


def check_predicted_tracks(
    observation: ObservedScene, predict: TrackPredictor
) -> tuple[Event, ...]:
    """Run the rule checker on observed and predicted tracks; ids are places in `agents`."""
    intersection_map = load_map(observation.intersection)
    users = []
    for n, (agent, ahead) in enumerate(
        zip(observation.agents, predict(observation), strict=True)
    ):  # to the edge of the map; a single position is no road user
        outside = np.flatnonzero(np.abs(ahead).max(axis=1) > intersection_map.extent)
        until = 0 if agent.left else outside[0] if len(outside) else len(ahead)
        xy = np.concatenate([agent.xy, ahead[:until]])
        if len(xy) < 2:
            continue
        least = LEAST_MOTION[agent.type]
        later = compute_headings(xy, step=STEP, least=least)[len(agent.xy) :]
        turns = np.round((agent.heading[-1] - later[:1]) / (2 * np.pi)) * 2 * np.pi
        moves = len(later) > 0 and float(np.hypot(*(xy[-1] - agent.xy[-1]))) > least
        later = later + turns if moves else np.full(len(later), agent.heading[-1])
        track = Track(xy, np.concatenate([agent.heading, later]), agent.start)
        users.append(RoadUser(n, track, Shape(agent.type, agent.length, agent.width)))
    events = find_events(
        users,
        intersection_map=intersection_map,
        signals=observation.lights,
        until=observation.now + HORIZON,
    )
    return tuple(event for event in events if event.type in RELATIONS)


def to_relations(events: Sequence[Event], observation: ObservedScene) -> tuple[PairRelation, ...]:
    """Convert events to relations, the gravest of each pair."""
    ids = observation.ids
    found: dict[frozenset[int], PairRelation] = {}
    for event in sorted(events, key=lambda each: RELATIONS.index(each.type)):
        pair = frozenset((event.from_, event.to))
        found.setdefault(
            pair, PairRelation(event.type, ids[event.from_], ids[event.to], event.time)
        )
    return tuple(found.values())
