"""The paper's relation baseline: predicted tracks, and the rule checker on all of them.

TrajNet++ is the refiner that the intersection's bundle ships, rolled out without goals. Constant
velocity is what everything else is measured against.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from scenewright.errors import InputError
from scenewright.evals.understanding.labels import RELATIONS, Relation
from scenewright.evals.understanding.observing import Observation, Seen
from scenewright.intersections import load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event
from scenewright.scene.record import SignalRecord
from scenewright.scene.track import STEP, Shape, Track
from scenewright.tools.relation_checker import RoadUser, find_events
from scenewright.tools.track_io.external_tracks import compute_headings

if TYPE_CHECKING:
    from scenewright.tools.trajnet_refiner.model import Refiner

AHEAD = 8.0
"""How far ahead tracks are predicted [s]."""
TRACE = {"vehicle": 0.5, "pedestrian": 0.2}
"""Motion from which a heading is told [m]."""

Predictor = Callable[[Observation], list[FloatArray]]
"""Of everybody seen, in order: [T, 2] positions [m] every 0.1 s from now + 0.1 s on."""


def constant_velocity(observation: Observation) -> list[FloatArray]:
    """Everybody goes on as in the last step."""
    ahead = np.arange(1, round(AHEAD / STEP) + 1)[:, None]
    return [
        agent.xy[-1] + ahead * (agent.xy[-1] - agent.xy[-2])
        if len(agent.xy) > 1
        else np.repeat(agent.xy[-1:], len(ahead), axis=0)
        for agent in observation.agents
    ]


def trajnet(intersection: str) -> Predictor:
    """The bundle's refiner as a predictor.

    Raises:
        InputError: the bundle ships none.
    """
    from scenewright.tools.trajnet_refiner.bundled import bundled_refiner

    learned = bundled_refiner(intersection)
    if learned is None:
        raise InputError(
            f"intersection {intersection!r} ships no refiner, so there is no TrajNet++ to predict "
            "with; use the method constant_velocity"
        )
    net = learned.net
    return lambda observation: rolled_out(net, observation)


def rolled_out(net: Refiner, observation: Observation) -> list[FloatArray]:
    """The refiner's prediction, resampled; constant velocity for whoever it cannot predict."""
    import torch

    from scenewright.tools.trajnet_refiner.model import CLASSES
    from scenewright.tools.trajnet_refiner.rollout import roll_out

    step, fallback = net.config.step, constant_velocity(observation)
    if not observation.agents:
        return []
    steps = int(np.ceil(AHEAD / step))
    past = min(net.config.observed, int(observation.now / step) + 1)
    known = np.full((len(fallback), past + steps, 2), np.nan)
    for n, agent in enumerate(observation.agents):
        known[n, :past] = _at_steps(agent, observation.now, past, step)
    classes = torch.tensor([[CLASSES.index(agent.type) for agent in observation.agents]])
    with torch.no_grad():
        filled = roll_out(net, torch.tensor(known[None], dtype=torch.float32), classes=classes)
    drawn = filled[0, :, past - 1 :].double().numpy()
    wanted = STEP * np.arange(1, round(AHEAD / STEP) + 1)
    times = step * np.arange(steps + 1)
    return [
        np.stack([np.interp(wanted, times, drawn[n, :, d]) for d in (0, 1)], axis=-1)
        if np.isfinite(drawn[n]).all()
        else fallback[n]
        for n in range(len(fallback))
    ]


def _at_steps(agent: Seen, now: float, count: int, step: float) -> FloatArray:
    """[count, 2] positions at the last `count` steps up to now; NaN where it was not there."""
    times = now - step * np.arange(count - 1, -1, -1)
    seen = agent.start + STEP * np.arange(len(agent.xy))
    inside = (times >= seen[0] - 1e-6) & (times <= seen[-1] + 1e-6)
    xy = np.stack([np.interp(times, seen, agent.xy[:, d]) for d in (0, 1)], axis=-1)
    return np.where(inside[:, None], xy, np.nan)


def findings(observation: Observation, predict: Predictor) -> tuple[Event, ...]:
    """What the rule checker sees in observed and predicted tracks; ids are places in `agents`."""
    intersection_map = load_map(observation.intersection)
    ahead = predict(observation)
    users = [
        user
        for n, (agent, xy) in enumerate(zip(observation.agents, ahead, strict=True))
        if (user := _user(n, agent, xy, intersection_map.extent)) is not None
    ]
    signals = [SignalRecord.model_validate(each.model_dump()) for each in observation.lights]
    seen = find_events(
        users, intersection_map=intersection_map, signals=signals, until=observation.now + AHEAD
    )
    return tuple(event for event in seen if event.type in RELATIONS)


def _user(n: int, agent: Seen, ahead: FloatArray, extent: float) -> RoadUser | None:
    """Observed and predicted, up to the edge of the map."""
    if not agent.left:
        outside = np.flatnonzero(np.abs(ahead).max(axis=1) > extent)
        ahead = ahead[: outside[0]] if len(outside) else ahead
        xy = np.concatenate([agent.xy, ahead])
    else:
        xy, ahead = agent.xy, ahead[:0]
    if len(xy) < 2:
        return None
    told = compute_headings(xy, step=STEP, least=TRACE[agent.type])[len(agent.xy) :]
    turn = np.round((agent.heading[-1] - told[:1]) / (2 * np.pi)) * 2 * np.pi
    moves = len(told) > 0 and float(np.hypot(*(xy[-1] - agent.xy[-1]))) > TRACE[agent.type]
    later = told + turn if moves else np.full(len(told), agent.heading[-1])
    heading = np.concatenate([agent.heading, later])
    shape = Shape(agent.type, agent.length, agent.width)
    return RoadUser(n, Track(xy, heading, agent.start), shape)


def as_relations(events: Sequence[Event], observation: Observation) -> tuple[Relation, ...]:
    """Events as relations between agents, once per pair: the gravest."""
    ids = observation.ids
    found: dict[frozenset[int], Relation] = {}
    for event in sorted(events, key=lambda each: RELATIONS.index(each.type)):
        pair = frozenset((event.from_, event.to))
        found.setdefault(pair, Relation(event.type, ids[event.from_], ids[event.to], event.time))
    return tuple(found.values())
