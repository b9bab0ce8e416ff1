"""The paper's relation baseline: predicted tracks, and the rule checker on all of them.

TrajNet++ is the refiner that the intersection's bundle ships, rolled out without goals. Constant
velocity is the reference for everything else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from scenewright.errors import InputError
from scenewright.evals.understanding.cases import RELATIONS, PairRelation
from scenewright.evals.understanding.observation import ObservedScene
from scenewright.geometry.polyline import interpolate_points
from scenewright.intersections import load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event
from scenewright.scene.track import STEP, Shape, Track
from scenewright.tools.relation_checker import RoadUser, find_events
from scenewright.tools.track_io.external_tracks import compute_headings

if TYPE_CHECKING:
    from scenewright.tools.trajnet_refiner.network import RefinerNetwork

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
