"""Train the learned ego: it imitates a rule-based driver, then is corrected where it went itself.

    python -m lab.driving.train_policy --scenes DIR [--out FILE]

DIR holds folders of scenes, such as `scenewright batch` writes.
"""

from __future__ import annotations

import argparse
import random
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
from sklearn.neural_network import MLPRegressor

from scenewright.driving.api import load_scenario
from scenewright.driving.observation import Observer
from scenewright.driving.policies import (
    NORMAL,
    WEIGHTS,
    RuleBasedPolicy,
    apply_layers,
    build_features,
)
from scenewright.driving.scenario import Scenario
from scenewright.driving.traffic import make_traffic
from scenewright.driving.world import start_world
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray

ROUNDS = 2
Layers = tuple[tuple[FloatArray, FloatArray], ...]
"""Weights and biases of a network."""


def drive_and_label(
    scenario: Scenario, student: Layers | None, others: Literal["replay", "reactive"]
) -> tuple[list[FloatArray], list[float]]:
    """Features and the expert's actions along a drive of the student, or of the expert."""
    expert = RuleBasedPolicy(NORMAL)
    world = start_world(scenario, make_traffic(others), "route", rng=np.random.default_rng(0))
    observer = Observer(scenario)
    rows: list[FloatArray] = []
    labels: list[float] = []
    while world.end is None:
        seen = observer.observe(world)
        rows.append(build_features(seen))
        labels.append(float(expert.act(seen)[0]))
        action = labels[-1] if student is None else apply_layers(student, rows[-1])[0]
        world.advance(np.array([action]))
    return rows, labels


def main() -> None:
    """Train on the scenes of a folder and write the weights."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=Path, required=True)
    parser.add_argument("--n", type=int, default=60)
    parser.add_argument("--out", type=Path, default=Path("src/scenewright/driving") / WEIGHTS)
    given = parser.parse_args()
    found = sorted(given.scenes.glob("*/scene.json"))
    random.Random(0).shuffle(found)
    scenarios = []
    for file in found[: given.n]:
        try:
            scenarios.append(load_scenario(file))
        except InputError as error:
            print(f"{file}: {error}", file=sys.stderr)
    features: list[FloatArray] = []
    actions: list[float] = []
    layers: Layers = ()
    network = MLPRegressor(
        hidden_layer_sizes=(48, 24), activation="tanh", max_iter=60, random_state=0, tol=1e-5
    )
    for turn in range(ROUNDS):
        for k, scenario in enumerate(scenarios):
            others: Literal["replay", "reactive"] = "reactive" if k % 2 else "replay"
            rows, labels = drive_and_label(scenario, layers or None, others)
            features += rows
            actions += labels
        network.fit(np.array(features), np.clip(actions, -8.0, 3.0))
        layers = tuple(zip(network.coefs_, network.intercepts_, strict=True))
        print(f"round {turn + 1}: {len(actions)} samples, loss {network.loss_:.4f}", flush=True)
    arrays: dict[str, Any] = {
        f"weights_{k}": w.astype(np.float32) for k, (w, _) in enumerate(layers)
    }
    arrays |= {f"bias_{k}": b.astype(np.float32) for k, (_, b) in enumerate(layers)}
    np.savez_compressed(given.out, **arrays)
    print(given.out)


if __name__ == "__main__":
    main()
