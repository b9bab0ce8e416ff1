"""The tables of the paper: likelihoods by hand, rates by hand, one page over a small dataset."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from inline_jobs import run_jobs_inline
from scenewright.cli.main import main
from scenewright.dataset.batch.worker import Options
from scenewright.dataset.orders.agent import Order
from scenewright.dataset.orders.order_spec import read_order
from scenewright.dataset.orders.run import fill
from scenewright.evals.bootstrap import Figure
from scenewright.evals.tables.diversity import compare_lateral_positions, load_held_out
from scenewright.evals.tables.likelihood import (
    AgentScore,
    compute_cell,
    find_nearest_on,
    find_passed_waypoints,
    resample_nll,
    resample_waypoints,
    score_scene,
)
from scenewright.evals.tables.reading import Dataset, InstructionRow, compute_robustness
from scenewright.graph.scene_files import load_scene
from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.tools.gmm_sampler import compute_waypoint_nll, load_priors, sample_waypoints

PRIORS = load_priors("amsterdam_120")
ROUTE = "vehicle:north>south:straight"


def agent(track: Any, waypoints: Any, *, role: str = "foreground") -> AgentRecord:
    points = [tuple(map(float, point)) for point in track]
    return AgentRecord(
        id=1, type="vehicle", spawn_time=0.0, goal=points[-1], trajectory=tuple(points),
        role=role, name="vehicle-1", entry="north", exit="south", movement="straight",
        route=ROUTE, heading=(0.0,) * len(points), length=4.6, width=1.85,
        waypoints=tuple(tuple(map(float, point)) for point in waypoints),
    )  # fmt: skip


def scene_of(*agents: AgentRecord) -> SceneRecord:
    meta = {
        "scene_id": "x", "map_id": 1, "timestamp": 0.0, "user_prompt": "x", "step": 0.1,
        "intersection": "amsterdam_120", "duration": 30.0, "time_of_day": "08:00", "seed": 0,
    }  # fmt: skip
    return SceneRecord.model_validate({"meta": meta, "agents": agents, "events": ()})


def drawn() -> np.ndarray:
    return sample_waypoints(PRIORS.waypoints[ROUTE], np.random.default_rng(0), size=1)[0]


def between(points: np.ndarray, count: int = 2000) -> np.ndarray:
    """The polyline through points, densely and evenly."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.linspace(0, along[-1], count)
    return np.stack([np.interp(at, along, points[:, k]) for k in (0, 1)], axis=1)


def test_who_drives_its_route_to_the_end_has_the_likelihood_of_what_was_drawn() -> None:
    points = drawn()
    (score,), _ = score_scene(scene_of(agent(between(points), points)), PRIORS, number=0, group="x")
    wanted = float(compute_waypoint_nll(PRIORS.waypoints[ROUTE], points[None])[0])
    assert score.nll["path"] == pytest.approx(wanted, abs=0.05)


def test_a_track_cut_short_is_unlikely_as_a_track_and_likely_as_a_path() -> None:
    points = drawn()
    whole, half = between(points), between(points)[:1000]
    (full,), _ = score_scene(scene_of(agent(whole, points)), PRIORS, number=0, group="x")
    (cut,), _ = score_scene(scene_of(agent(half, points)), PRIORS, number=0, group="x")
    assert cut.nll["path"] == pytest.approx(full.nll["path"], abs=0.05)
    assert cut.nll["track"] > full.nll["track"] + 100


def test_a_metre_aside_shows_where_it_was_driven_alone() -> None:
    points = drawn()
    aside = between(points)[:1000] + np.array([1.0, 0.0])
    passed = find_passed_waypoints(agent(aside, points))
    off = np.hypot(*(passed - points).T)
    assert off[1:4] == pytest.approx(1.0, abs=0.05)
    assert off[6:] == pytest.approx(0.0)


def test_who_stands_at_the_end_has_not_passed_what_lies_beyond() -> None:
    track = np.array([[0.0, 0.0], [5.0, 0.0], *[[10.0, 0.0]] * 20])
    _, passed = find_nearest_on(
        track, np.array([[-1.0, 0.0], [4.0, 1.0], [12.0, 0.0], [10.0, 9.0]])
    )
    assert passed.tolist() == [False, True, False, False]


def test_waypoints_lie_at_equal_arc_length_and_standing_has_none() -> None:
    corner = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]])
    found = resample_waypoints(corner)
    assert found is not None
    assert np.hypot(*np.diff(found, axis=0).T) == pytest.approx(
        [2.0] * 4 + [np.sqrt(2)] + [2.0] * 4
    )
    assert resample_waypoints(np.zeros((50, 2))) is None


def scores(group: str, *values: float) -> list[AgentScore]:
    return [
        AgentScore(k, group, "foreground", "vehicle", {"track": v, "path": v})
        for k, v in enumerate(values)
    ]


def test_gap_is_equation_8_with_its_sign() -> None:
    rng = np.random.default_rng(0)
    normal = resample_nll(scores("normal", 20.0, 20.0), "path", draws=50, rng=rng)
    assert normal[0] == 20.0
    found = compute_cell(scores("x", 30.0, 50.0), normal, rng, kind="vehicle", reading="path")
    assert (found.nll.value, found.nll.n, found.scenes) == (40.0, 2, 2)
    assert found.s2r.value == pytest.approx(-1.0)
    assert found.delta.value == pytest.approx(2.0)
    assert found.delta.low <= found.delta.value <= found.delta.high
    unknown = np.full(6, np.nan)
    for agents, reference in (([], normal), (scores("x", 1.0), unknown)):
        cell = compute_cell(agents, reference, rng, kind="vehicle", reading="path")
        assert cell.s2r == cell.delta == Figure(None, None, None, 0)


def test_rates_count_refusals_and_wrong_scenes_as_failures() -> None:
    rows = [
        InstructionRow("a", "builtin", "collision", True, True),
        InstructionRow(None, "builtin", "collision", False, True),
        InstructionRow("b", "builtin", "yielding", False, True),
        InstructionRow(None, "builtin", None, False, False),
        InstructionRow("c", "other", "yielding", True, True),
    ]
    found = {
        (rate.backend, rate.event): rate.share
        for rate in compute_robustness(Dataset(Path(), {}, tuple(rows)))
    }
    assert found["builtin", "collision"] == Figure.of_count(1, 2)
    assert found["builtin", "overall"] == found["builtin", "all"] == Figure.of_count(1, 3)
    assert found["other", "overall"] == Figure.of_count(1, 1)


def test_tracks_of_the_prior_spread_as_the_corpus_does_and_modes_do_not() -> None:
    prior, rng = PRIORS.waypoints[ROUTE], np.random.default_rng(0)
    many = sample_waypoints(prior, rng, size=60)
    alike = np.repeat(many[:1], 60, axis=0)
    ratios = []
    for points in (many, alike):
        scenes = [scene_of(agent(between(each, 200), each)) for each in points]
        (spread,) = compare_lateral_positions(scenes, bundle="amsterdam_120", draws=20, seed=0)
        assert spread.ratio.low <= spread.ratio.high
        ratios.append(spread.ratio.value)
    assert ratios[0] == pytest.approx(1.0, abs=0.2)
    assert ratios[1] == pytest.approx(0.0, abs=0.01)
    assert len(load_held_out("amsterdam_120")) > 30


def test_one_page_and_one_object_for_a_dataset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_jobs_inline(monkeypatch)
    text = "2 yields, 1 collision and 2 normal scenes at 5 am in light traffic"
    out = tmp_path / "out"
    fill(Order(text=text, wish=read_order(text), out=out, options=Options("amsterdam_120")))
    assert main(["evals", "tables", str(out), "--draws", "20", "--no-understanding", "-q"]) == 0
    page = capsys.readouterr().out
    for heading in ("Tables 1, 4 and 5", "Table 2", "Table 3", "Diversity"):
        assert f"## {heading}" in page
    assert "| builtin | overall | 3 / 3 | 100.00 % [" in page
    assert "84.44" in page
    assert (out / "evaluation" / "tables.md").read_text("utf-8") == page
    values = json.loads((out / "evaluation" / "tables.json").read_bytes())
    assert values["robustness"][0]["share"]["n"] == 2
    assert values["about"]["rows"]["made"] == 5
    assert load_scene(out / "yielding-01").relations
    # What was measured lies beside the dataset, and the dataset is still in order.
    assert main(["dataset", "check", str(out), "--workers", "1", "-q"]) == 0


def test_no_dataset_is_reported_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for words in (["evals", "tables"], ["dataset", "check"]):
        assert main([*words, str(tmp_path), "-q"]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
