"""The features of a pair, of futures whose conflicts are known."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright.evals.understanding.cases import ObservedAgent
from scenewright.evals.understanding.forecast import DT, TICKS, AgentForecast
from scenewright.evals.understanding.pair_features import (
    NAMES,
    compute_pair_features,
    mirror_features,
)
from scenewright.evals.understanding.route_components import load_components

PLACE = "amsterdam_120"
SIZE = 8


def driver(id_: str) -> ObservedAgent:
    """A vehicle that has driven up the north leg."""
    ways = load_components(PLACE, "vehicle")
    c = [each.id for each in ways.routes].index("vehicle:north>south:straight")
    s = np.arange(0.0, 12.0, 0.9)
    xy = np.stack([np.interp(s, ways.s[c], ways.curve[c, :, d]) for d in (0, 1)], axis=-1)
    heading = np.interp(s, ways.s[c], ways.heading[c])
    return ObservedAgent(
        id_, "vehicle", 0.0, xy, heading, np.full(len(s), 9.0), s, 4.6, 1.85, False
    )  # fmt: skip


def future(agent: ObservedAgent, ways: list[tuple[str, np.ndarray, float]]) -> AgentForecast:
    """Futures that take the ways named, each (movement, [T, 2], heading), in turn."""
    components = load_components(PLACE, "vehicle")
    movements = [route.movement for route in components.routes]
    turn = [ways[k % len(ways)] for k in range(SIZE)]
    return AgentForecast(
        agent, components, np.stack([xy for _, xy, _ in turn]),
        np.stack([np.full(TICKS, heading) for _, _, heading in turn]),
        np.ones((SIZE, TICKS), dtype=np.bool_), np.full(SIZE, 9.0),
        np.zeros(SIZE, dtype=np.bool_), np.full(SIZE, np.inf),
        np.array([movements.index(name) for name, _, _ in turn]), np.full(SIZE, 1 / SIZE),
    )  # fmt: skip


T = DT * np.arange(TICKS)
SOUTH = np.stack([0 * T, 30.0 - 5.0 * T], axis=-1)
EAST = np.stack([-30.0 + 5.0 * T, 0 * T], axis=-1)
AWAY = np.stack([300.0 + 5.0 * T, 0 * T], axis=-1)


@pytest.fixture(scope="module")
def futures() -> tuple[AgentForecast, ...]:
    """`a` goes straight on or left; on its way straight it meets `b`, who surely goes east.

    `c` is far from everybody.
    """
    return (
        future(driver("a"), [("straight", SOUTH, -np.pi / 2), ("left", AWAY, 0.0)]),
        future(driver("b"), [("straight", EAST, 0.0)]),
        future(driver("c"), [("straight", AWAY + 500.0, 0.0)]),
    )


def test_features_describe_the_likeliest_conflict_of_a_pair(
    futures: tuple[AgentForecast, ...],
) -> None:
    pairs, (values,) = compute_pair_features(futures, window=4.0)
    features = dict(zip(NAMES, values.tolist(), strict=True))
    assert pairs == [("a", "b")]
    assert features["share"] == 1.0
    assert features["likely"] == pytest.approx(0.5)
    assert features["within_1"] == pytest.approx(0.5)
    assert features["soon"] == pytest.approx(6.0, abs=1.0)
    assert features["angle"] == pytest.approx(np.pi / 2)
    assert features["own_a"] == pytest.approx(0.5)
    assert features["own_b"] == pytest.approx(1.0)
    assert features["zone_a"] == pytest.approx(30.0 - (4.6 + 1.85) / 2, abs=1.0)
    assert features["offset"] < 0.2
    back = dict(zip(NAMES, mirror_features(values).tolist(), strict=True))
    assert back["own_b"] == features["own_a"]
    assert back["share"] == features["share"]
