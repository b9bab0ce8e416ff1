"""What a calibration makes of likelihoods, and how one is fitted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.understanding import tuning
from scenewright.errors import InputError
from scenewright.evals.understanding.calibration import (
    PAIR_CLASSES,
    load_calibration,
    select_relations,
)
from scenewright.evals.understanding.cases import Labels, PairRelation, SceneCase
from scenewright.evals.understanding.pair_features import NAMES

LIMITS = np.array([9.0, 0.3, 0.3, 0.3, 0.3])


def test_no_agent_has_two_relations_at_once() -> None:
    likely = np.array([[0.2, 0.8, 0, 0, 0], [0.1, 0.0, 0.9, 0, 0], [0.3, 0, 0, 0.7, 0]])
    pairs = [("a", "b"), ("b", "c"), ("a", "d")]
    assert select_relations(likely, LIMITS, pairs) == [(1, 2), (2, 3)]


def test_relations_below_the_threshold_are_not_reported() -> None:
    assert select_relations(np.array([[0.75, 0.25, 0, 0, 0]]), LIMITS, [("a", "b")]) == []
    assert select_relations(np.zeros((0, 5)), LIMITS, []) == []


def test_thresholds_are_interpolated_between_windows() -> None:
    trees = load_calibration()
    known = replace(trees, windows=np.array([2.0, 4.0]), threshold=np.array([LIMITS, LIMITS + 0.2]))
    assert known.interpolate_thresholds(3.0) == pytest.approx(LIMITS + 0.1)
    assert known.interpolate_thresholds(0.5) == pytest.approx(LIMITS)
    assert known.interpolate_thresholds(9.0) == pytest.approx(LIMITS + 0.2)


def test_a_calibration_is_saved_and_loaded(tmp_path: Path) -> None:
    trees, values = load_calibration(), np.random.default_rng(1).uniform(0, 1, (20, len(NAMES)))
    tuning.save_trees(tmp_path / "mine.npz", trees, NAMES)
    again = load_calibration(tmp_path / "mine.npz")
    assert again.predict_pairs(values) == pytest.approx(trees.predict_pairs(values), abs=1e-5)


def view(n: int, *, hit: bool, window: float = 4.0) -> tuning.TrainingView:
    """A scene of two, who touch if the first feature says so."""
    found = (PairRelation("collision", "a", "b", 7.0),) if hit else ()
    labels = Labels(
        {"a": "north", "b": "east"}, {"a": "vehicle", "b": "vehicle"}, {"a": 0.0, "b": 0.0}, found
    )
    values = np.random.default_rng(n).uniform(0, 1, (1, len(NAMES)))
    values[0, 0] = hit
    name = "collision" if hit else None
    return tuning.TrainingView(f"{n * 2654435761 % 16**8:08x}", name, labels, window, 1.0,
                       (("a", "b"),), values)  # fmt: skip


def test_the_feature_of_a_collision_is_learnt(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sklearn")
    threads = pytest.importorskip("threadpoolctl")
    monkeypatch.setitem(tuning._TREES, "max_iter", 8)
    monkeypatch.setitem(tuning._TREES, "learning_rate", 0.3)
    monkeypatch.setitem(tuning._TREES, "max_features", 1.0)
    monkeypatch.setattr(tuning, "FOLDS", 2)
    table = tuning.build_table(view(n, hit=n % 3 == 0) for n in range(180))
    with threads.threadpool_limits(
        1
    ):  # threads that wait for one another are slow on a busy machine
        unseen = tuning.predict_unseen(table)
        found = tuning.fit_calibration(table, unseen)
        figures = tuning.score_unseen(table, unseen, 4.0)
    assert figures["collision"][0] > 95.0
    assert figures["collision"][1] <= figures["collision"][0] <= figures["collision"][2]
    for n in (900, 901):
        likely = found.predict_pairs(view(n, hit=n % 3 == 0).values)
        selected = select_relations(likely, found.interpolate_thresholds(4.0), [("a", "b")])
        assert [PAIR_CLASSES[c] for _, c in selected] == (["collision"] if n % 3 == 0 else [])


def test_scenes_stand_for_the_composition_of_the_paper() -> None:
    table = tuning.build_table(view(n, hit=n % 2 == 0) for n in range(40))
    weight = {name: sum(v.weight for v in table.views if v.named == name)
              for name in ("collision", None)}  # fmt: skip
    assert weight["collision"] / weight[None] == pytest.approx(40 / 100)
    assert sum(weight.values()) == pytest.approx(40.0)


def test_a_scene_is_viewed_after_every_window(cases: dict[str, SceneCase]) -> None:
    found = tuning.view_scene(cases["struck"], windows=(2.0, 4.0))
    assert [v.window for v in found] == [2.0, 4.0]
    assert all(v.named == "collision" and len(v.pairs) == len(v.values) for v in found)


def test_tuning_without_pairs_is_refused() -> None:
    with pytest.raises(InputError, match="no pair"):
        tuning.build_table([])
