"""A small learned ego: a network of two layers, trained on what the rule-based driver does."""

from __future__ import annotations

from functools import cache
from importlib.resources import as_file, files

import numpy as np

from scenewright.arrays import read_arrays
from scenewright.driving.ego_motion import ActionMode
from scenewright.driving.observation import Observation
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
