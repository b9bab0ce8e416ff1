"""Trees over the posterior of routes: what they say of exits, and that they are the fitted ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lab.understanding.exit_tuning import ExitRows, fit_exit_model
from lab.understanding.tuning import save_trees
from scenewright.errors import InputError
from scenewright.evals.understanding.cases import ObservedAgent, ObservedScene
from scenewright.evals.understanding.exit_model import (
    NAMES,
    describe_exits,
    load_exit_model,
    weigh_all_exits,
)
from scenewright.evals.understanding.intent import infer_routes
from scenewright.evals.understanding.route_components import list_sides, load_components
from scenewright.intersections import load_map

PLACE = "amsterdam_120"
SIDES = list_sides(load_map(PLACE))


def drive_left(way: float) -> ObservedAgent:
    """A vehicle that has come so far [m] on its way from north to east."""
    ways = load_components(PLACE, "vehicle")
    c = [each.id for each in ways.routes].index("vehicle:north>east:left")
    s = np.arange(0.0, way, 0.7)
    xy = np.stack([np.interp(s, ways.s[c], ways.curve[c, :, d]) for d in (0, 1)], axis=-1)
    heading = np.interp(s, ways.s[c], ways.heading[c])
    speed = np.full(len(s), 7.0)
    return ObservedAgent("0a", "vehicle", 0.0, xy, heading, speed, s, 4.6, 1.85, False)


def weigh(agent: ObservedAgent) -> dict[str, float]:
    scene = ObservedScene("00ff00ff00ff00ff", PLACE, 4.0, 12, (agent,), ())
    found = weigh_all_exits(scene, infer_routes(scene))["0a"]
    return dict(zip(SIDES, found.tolist(), strict=True))


def test_an_exit_is_open_before_a_turn_and_certain_in_it() -> None:
    before, within = weigh(drive_left(15.0)), weigh(drive_left(58.0))
    assert sum(before.values()) == pytest.approx(1.0)
    assert before["east"] < 0.9
    assert within["east"] > 0.95


def test_features_have_their_names() -> None:
    agent = drive_left(15.0)
    scene = ObservedScene("00ff00ff00ff00ff", PLACE, 4.0, 12, (agent,), ())
    sides, values = describe_exits(agent, infer_routes(scene)["0a"], SIDES, 4.0)
    assert values.shape == (len(sides), len(NAMES))
    row = dict(zip(NAMES, values[sides.index("east")].tolist(), strict=True))
    assert (row["left"], row["speed"], row["length"]) == (1.0, 7.0, 4.6)
    assert row["log_chance"] <= 0.0 >= row["behind"]
    assert row["window"] == 4.0


def test_trees_are_those_that_were_fitted_and_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    rows = []
    for _ in range(400):
        values = rng.standard_normal((3, len(NAMES)))
        rows.append(ExitRows(0, "vehicle", 4.0, values, values[:, 0] == values[:, 0].max()))
    fitted = fit_exit_model(rows)
    save_trees(tmp_path / "exits.npz", fitted, NAMES)
    kept = load_exit_model(tmp_path / "exits.npz")
    apart = [np.abs(kept.weigh(e.values) - fitted.weigh(e.values)).max() for e in rows[:50]]
    assert np.median(apart) < 1e-3  # written at half the width, a limit may lie beside a value
    assert np.mean([each.is_right(fitted.weigh(each.values)) for each in rows]) > 0.9


def test_a_model_of_other_features_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", names=np.array(["speed"]))
    with pytest.raises(InputError, match="other features"):
        load_exit_model(tmp_path / "other.npz")
