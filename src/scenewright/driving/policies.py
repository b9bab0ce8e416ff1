"""The Policy protocol, and the egos that come with the package."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import as_file, files
from typing import Protocol

import numpy as np

from scenewright.arrays import read_arrays
from scenewright.driving.ego_motion import ActionMode
from scenewright.driving.observation import ROUTE_SPACING, Observation
from scenewright.driving.scenario import Scenario
from scenewright.scene.base import FloatArray

AGENTS_SEEN = 8
WEIGHTS = "learned_policy.npz"


def build_features(observation: Observation) -> FloatArray:
    """[82] what the network sees of an observation, each about 1 in size."""
    ego = np.asarray(observation["ego"], dtype=np.float64)
    agents = np.asarray(observation["agents"][:AGENTS_SEEN], dtype=np.float64)
    route = np.asarray(observation["route"], dtype=np.float64)
    light = np.asarray(observation["lights"][0], dtype=np.float64)
    near = np.exp(-np.hypot(agents[:, 0], agents[:, 1]) / 15.0) * agents[:, 10]
    seen = np.column_stack([
        agents[:, 0] / 30, agents[:, 1] / 10, agents[:, 4] / 10, agents[:, 5] / 10,
        agents[:, 6] / 5, agents[:, 9], near, agents[:, 10],
    ]) * agents[:, 10:]  # fmt: skip
    own = (ego[0] / 10, ego[1] / 4, min(ego[7], 60.0) / 60, ego[8] / 15)
    ahead = (*(route[[2, 5, 8, 12], 3]), route[[2, 5, 8, 12], 4].mean(), 1.0)
    stop = (min(abs(light[0]), 60.0) / 60, float(light[0] > -0.5), light[2], light[3])
    return np.concatenate([own, ahead, np.array(stop) * light[4], seen.ravel()])


class LearnedPolicy:
    """Gives the acceleration along the route that the network says.

    Raises:
        InputError: its weights cannot be read.
    """

    mode: ActionMode = "route"

    def reset(self, scenario: Scenario, seed: int) -> None:  # noqa: ARG002
        """Nothing to prepare but the weights."""
        self._layers = _load_layers()

    def act(self, observation: Observation) -> FloatArray:
        """The acceleration along the route [1] [m/s^2]."""
        return np.clip(apply_layers(self._layers, build_features(observation)), -8.0, 3.0)


def apply_layers(
    layers: tuple[tuple[FloatArray, FloatArray], ...], values: FloatArray
) -> FloatArray:
    """What a network with tanh between its layers makes of values [n]."""
    for weights, bias in layers[:-1]:
        values = np.tanh(values @ weights + bias)
    weights, bias = layers[-1]
    return np.asarray(values @ weights + bias)


@cache
def _load_layers() -> tuple[tuple[FloatArray, FloatArray], ...]:
    with as_file(files("scenewright.driving").joinpath(WEIGHTS)) as file:
        held = read_arrays(file, what="the learned policy", most_bytes=10_000_000)
    count = len(held) // 2
    return tuple(
        (held[f"weights_{k}"].astype(np.float64), held[f"bias_{k}"].astype(np.float64))
        for k in range(count)
    )


class Policy(Protocol):
    """What drives the ego.

    Attributes:
        mode: the actions that it gives (`ego_motion.find_action_bounds`).
    """

    mode: ActionMode

    def reset(self, scenario: Scenario, seed: int) -> None:
        """Called once before a drive begins."""
        ...

    def act(self, observation: Observation) -> FloatArray:
        """The action for one step of 0.1 s; see `observation.SHAPES`."""
        ...


class ReplayPolicy:
    """Does what the recorded ego did."""

    mode: ActionMode = "route"

    def reset(self, scenario: Scenario, seed: int) -> None:  # noqa: ARG002
        """Remember the recorded drive."""
        path = scenario.paths[scenario.ego]
        self._progress, self._step = path.progress, scenario.step
        self._length, self._at = path.length, scenario.start

    def act(self, observation: Observation) -> FloatArray:
        """The acceleration after which the ego is where it was recorded; then its last speed."""
        speed, left = float(observation["ego"][0]), float(observation["ego"][7])
        self._at += 1
        if self._at >= len(self._progress) or self._progress[self._at] == self._progress[-1]:
            return np.zeros(1)
        wanted = (self._progress[self._at] - (self._length - left)) / self._step
        return np.array([(wanted - speed) / self._step])


class ConstantSpeedPolicy:
    """Keeps the speed at which it came, along its route, whatever happens."""

    mode: ActionMode = "route"

    def reset(self, scenario: Scenario, seed: int) -> None:
        """Nothing to prepare."""

    def act(self, observation: Observation) -> FloatArray:  # noqa: ARG002
        """No acceleration."""
        return np.zeros(1)


@dataclass(frozen=True)
class DriverParameters:
    """Of the rule-based driver.

    Attributes:
        speed: desired, as a share of the limit; acceleration, braking: comfortable [m/s^2].
        headway: desired time gap to a leader [s]; gap: desired at rest [m].
        lateral: acceleration in curves [m/s^2].
        margin: time between leaving and entering a conflict place that it wants [s].
        horizon: how far it looks ahead [s].
        wider: by which it takes its way to be wider on each side [m].
        respects_priority: whether it lets those go first that have the right of way.
        yields_always: whether it gives way to every agent that it would meet.
    """

    speed: float = 0.9
    acceleration: float = 1.5
    braking: float = 2.0
    headway: float = 1.5
    gap: float = 2.0
    lateral: float = 2.0
    margin: float = 1.0
    horizon: float = 4.0
    wider: float = 0.4
    respects_priority: bool = True
    yields_always: bool = False


PREDICTION_STEP = 0.25
HARDEST = 8.0


class RuleBasedPolicy:
    """Intelligent driver model (Treiber et al. 2000) that stops for lights and the right of way.

    It predicts all agents straight on at their present velocity. To an agent that would be on its
    path within `margin` it gives way if the parameters say so, by braking as for an obstacle that
    stands there.
    """

    mode: ActionMode = "route"

    def __init__(self, parameters: DriverParameters | None = None) -> None:
        self.parameters = parameters or DriverParameters()

    def reset(self, scenario: Scenario, seed: int) -> None:
        """Nothing to prepare."""

    def act(self, observation: Observation) -> FloatArray:
        """The acceleration along the route [1]."""
        ego = np.asarray(observation["ego"], dtype=np.float64)
        route = np.asarray(observation["route"], dtype=np.float64)
        agents = np.asarray(observation["agents"], dtype=np.float64)
        agents = agents[agents[:, 10] > 0]
        gaps = [*self._meet_lights(observation, ego), *self._meet_agents(agents, route, ego)]
        free = self._accelerate_freely(ego, route)
        hold = max((self._slow_for(ego[0], gap, speed) for gap, speed in gaps), default=0.0)
        return np.array([max(free - self.parameters.acceleration * hold, -HARDEST)])

    def _accelerate_freely(self, ego: FloatArray, route: FloatArray) -> float:
        parameters = self.parameters
        there = route[:, 4] > 0
        turn = np.abs(np.diff(np.unwrap(np.arctan2(route[there, 3], route[there, 2]))))
        away = ROUTE_SPACING * (np.arange(len(turn)) + 0.5)
        allowed = parameters.speed * ego[8]
        curve = np.sqrt(parameters.lateral * ROUTE_SPACING / np.maximum(turn, 1e-3))
        reachable = np.sqrt(
            curve**2 + 2 * parameters.braking * np.maximum(away - ROUTE_SPACING, 0.0)
        )
        desired_speed = max(min([allowed, *reachable.tolist()]), 0.5)
        if ego[0] > desired_speed:
            return float(max(-parameters.braking, (desired_speed - ego[0]) / 0.5))
        return float(parameters.acceleration * (1 - (ego[0] / desired_speed) ** 4))

    def _slow_for(self, speed: float, gap: float, ahead: float) -> float:
        """The squared ratio of desired and actual gap of the model."""
        parameters = self.parameters
        closing = (
            speed * (speed - ahead) / (2 * np.sqrt(parameters.acceleration * parameters.braking))
        )
        desired_gap = parameters.gap + max(0.0, speed * parameters.headway + closing)
        return float((desired_gap / max(gap, 0.1)) ** 2)

    def _meet_lights(self, observation: Observation, ego: FloatArray) -> list[tuple[float, float]]:
        """Gap [m] and speed [m/s] of what stands at red lights, and at yellow ones if it can."""
        lights = np.asarray(observation["lights"], dtype=np.float64)
        comfortable = ego[0] ** 2 / (2 * 3.0)
        return [
            (row[0] + self.parameters.gap, 0.0) for row in lights
            if row[4] > 0 and row[0] > -0.5
            and (row[3] > 0 or (row[2] > 0 and row[0] > comfortable))
        ]  # fmt: skip

    def _meet_agents(
        self, agents: FloatArray, route: FloatArray, ego: FloatArray
    ) -> list[tuple[float, float]]:
        """Gaps and speeds of leaders, and of those that must be given way to."""
        if not len(agents):
            return []
        one = self.parameters
        times = np.arange(0.0, one.horizon + 1e-9, PREDICTION_STEP)
        there = route[route[:, 4] > 0]
        s, on_way = _find_on_route(agents, there, ego, times, wider=one.wider)
        found = []
        arrive = _predict_arrivals(ego[0], s - ego[3] / 2, one.acceleration, ego[8] * one.speed)
        leave = _predict_arrivals(ego[0], s + ego[3], one.acceleration, ego[8] * one.speed)
        for agent, at, on, begin, end in zip(agents, s, on_way, arrive, leave, strict=True):
            if not on.any():
                continue
            extent, along = _measure_along(agent, there, at[int(np.argmax(on))])
            reach = ego[3] / 2 + extent
            if on[0] and at[0] > 0:
                found.append((max(at[0] - reach, 0.1), max(along, 0.0)))
                continue
            meets = on & (times >= begin - one.margin) & (times <= end + one.margin) & (at > 0)
            if not meets.any():
                continue
            k = int(np.argmax(meets))
            first = float(times[int(np.argmax(on))])
            must = one.yields_always or (one.respects_priority and agent[9] > 0)
            if must or first < float(begin[k]) - (0.0 if one.respects_priority else 0.5):
                found.append((max(at[meets].min() - reach - 0.5, 0.1), 0.0))
        return found


def _find_on_route(
    agents: FloatArray, route: FloatArray, ego: FloatArray, times: FloatArray, *, wider: float
) -> tuple[FloatArray, FloatArray]:
    """[n, m] distance along the route [m] at times ahead, and whether it is on the ego's way."""
    at = agents[:, None, :2] + times[None, :, None] * agents[:, None, 4:6]
    if len(route) < 2:
        return at[..., 0], np.zeros(at.shape[:2], dtype=bool)
    legs = np.diff(route[:, :2], axis=0)
    square = np.maximum((legs**2).sum(axis=1), 1e-9)
    off = at[:, :, None] - route[None, None, :-1, :2]
    share = np.clip((off * legs).sum(axis=-1) / square, 0.0, 1.0)
    rest = np.hypot(*np.moveaxis(off - share[..., None] * legs, -1, 0))
    k = np.argmin(rest, axis=-1)
    picked = np.take_along_axis(share, k[..., None], axis=-1)[..., 0]
    apart = np.take_along_axis(rest, k[..., None], axis=-1)[..., 0]
    turn = np.abs(agents[:, 2, None] * route[k, 3] - agents[:, 3, None] * route[k, 2])
    half = (agents[:, 7, None] + turn * (agents[:, 6, None] - agents[:, 7, None])) / 2
    return ROUTE_SPACING * (k + picked), apart < half + ego[4] / 2 + wider


def _measure_along(agent: FloatArray, route: FloatArray, s: float) -> tuple[float, float]:
    """Half of an agent's extent along the route [m], and its speed along it [m/s]."""
    ahead = route[min(int(s / ROUTE_SPACING), len(route) - 1), 2:4]
    along = abs(agent[2] * ahead[0] + agent[3] * ahead[1])
    extent = float(agent[7] + along * (agent[6] - agent[7])) / 2
    return extent, float(agent[4] * ahead[0] + agent[5] * ahead[1])


def _predict_arrivals(
    speed: float, s: FloatArray, acceleration: float, wanted: float
) -> FloatArray:
    """[...] seconds until the ego is at distances [m], speeding up to what it wants."""
    s = np.maximum(s, 0.0)
    top = max(wanted, speed, 1.0)
    gain = (top**2 - speed**2) / (2 * acceleration)
    speeding = (np.sqrt(speed**2 + 2 * acceleration * s) - speed) / acceleration
    cruising = (top - speed) / acceleration + (s - gain) / top
    return np.asarray(np.where(s < gain, speeding, cruising))


NORMAL = DriverParameters()
CAUTIOUS = replace(
    NORMAL, speed=0.75, acceleration=1.0, headway=2.5, gap=3.0, margin=2.0, horizon=5.0,
    yields_always=True,
)  # fmt: skip
AGGRESSIVE = replace(
    NORMAL, speed=1.2, acceleration=2.5, braking=4.0, headway=0.8, gap=1.5, lateral=3.5,
    margin=0.2, horizon=3.0, respects_priority=False,
)  # fmt: skip
LANE_FOLLOWER = replace(NORMAL, horizon=0.0)
"""Foresees nothing: brakes for lights and for who is on its way now, gives way to nobody."""


BUILT_IN: dict[str, Callable[[], Policy]] = {
    "replay": ReplayPolicy,
    "constant": ConstantSpeedPolicy,
    "idm": RuleBasedPolicy,
    "cautious": lambda: RuleBasedPolicy(CAUTIOUS),
    "aggressive": lambda: RuleBasedPolicy(AGGRESSIVE),
    "learned": LearnedPolicy,
    "lane-follower": lambda: RuleBasedPolicy(LANE_FOLLOWER),
}
"""Egos by the name that `--policy` takes."""
