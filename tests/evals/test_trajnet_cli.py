"""`scenewright evals trajnet` and the training of its weights as people meet them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from lab.trajnet import training
from lab.trajnet.training import check_split
from lab.trajnet.windows import BENDING, Weights, cut_training_windows
from scenewright.cli.main import main
from scenewright.errors import InputError
from scenewright.evals.bootstrap import Figure, compute_mean
from scenewright.evals.trajnet.recording import read_recording
from scenewright.intersections import REFINER_WEIGHTS, find_bundle_folder

SHIPPED_WEIGHTS = str(find_bundle_folder("amsterdam_120") / REFINER_WEIGHTS)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Twelve who walk bends past each other, 40 steps long; each is a primary twice."""
    rng = np.random.default_rng(0)
    rows: list[dict[str, object]] = []
    for p in range(12):
        turn, start = rng.normal(0, 0.03), rng.uniform(-5, 5, 2)
        angle = rng.uniform(0, 6) + turn * np.arange(40)
        xy = start + 0.5 * np.cumsum(np.stack((np.cos(angle), np.sin(angle)), -1), axis=0)
        rows += [
            {"track": {"f": 6 * k, "p": p, "x": float(x), "y": float(y)}}
            for k, (x, y) in enumerate(xy)
        ]
    scenes: list[dict[str, object]] = [
        {"scene": {"id": i, "p": i % 12, "s": 6 * s, "e": 6 * (s + 20), "fps": 2.5, "tag": tag}}
        for i, (s, tag) in enumerate([(0, [3, [2]])] * 12 + [(15, [4, []])] * 12)
    ]
    path = tmp_path / "walks.ndjson"
    path.write_text("".join(json.dumps(row) + "\n" for row in scenes + rows))
    return path


def test_constant_velocity_is_scored(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evals", "trajnet", str(recording), "--json", "-q"]) == 0
    (result,) = json.loads(capsys.readouterr().out)["results"]
    rows = {row["name"]: row for row in result["rows"]}
    assert {name: row["ade"]["n"] for name, row in rows.items()} == {
        "all": 24, "3 interacting": 12, "4 other": 12, "3.2 avoidance": 12,
    }  # fmt: skip
    assert rows["all"]["people"] == 12
    ade = rows["all"]["ade"]
    assert ade["low"] < ade["value"] < ade["high"]
    assert main(["evals", "trajnet", str(recording), "-q"]) == 0
    page = capsys.readouterr().out
    assert "ADE [m]" in page
    assert "3 interacting" in page


def test_what_is_trained_can_be_scored_and_writes_the_benchmarks_format(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    weights, out = tmp_path / "w.safetensors", tmp_path / "out"
    assert training.main([str(recording), "--out", str(weights), "--epochs", "1"]) == 0
    given = capsys.readouterr()
    assert given.out == f"{weights}\n"
    assert "epoch 1: loss" in given.err
    assert "epoch 2: loss" in given.err, "the second part goes on counting"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["w.safetensors", "walks.ndjson"]

    words = ["evals", "trajnet", str(recording), "--weights", str(weights), "--out", str(out)]
    assert main([*words, "--json", "-q"]) == 0
    results = json.loads(capsys.readouterr().out)["results"]
    assert [(each["predictor"], each["goals"]) for each in results] == [
        ("constant velocity", "none"), ("refiner", "none"),
        ("refiner", "destination"), ("refiner", "horizon"),
    ]  # fmt: skip
    written = out / "refiner_told_horizon" / "walks.ndjson"
    rows = [json.loads(line) for line in written.read_text().splitlines()]
    assert sum("scene" in row for row in rows) == 24
    tracks = [row["track"] for row in rows if "track" in row]
    assert len(tracks) == 24 * 12 * 12
    assert {t["scene_id"] for t in tracks} == set(range(24))
    mine = [t for t in tracks if t["scene_id"] == 12 and t["p"] == 0]
    assert [t["f"] for t in mine] == [6 * (15 + 9 + k) for k in range(12)]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["none.ndjson"], "No such file"),
        (["walks.ndjson", "--weights", "none"], "No such file"),
        (["walks.ndjson", "--weights", "walks.ndjson"], "not a safetensors file"),
        (["walks.ndjson", "--weights", SHIPPED_WEIGHTS], "refine the scenes of an intersection"),
        (["walks.ndjson", "walks.ndjson"], "two files"),
        (["bad.ndjson"], "bad.ndjson, line 1"),
        (["walks.ndjson", "--out", "bad.ndjson"], "--out must name a folder"),
    ],
)
def test_bad_input_is_one_line(
    recording: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    reason: str,
) -> None:
    monkeypatch.chdir(recording.parent)
    Path("bad.ndjson").write_text("{\n")
    assert main(["evals", "trajnet", *words, "-q"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("scenewright: ")
    assert reason in line


def test_test_recordings_are_never_trained_on(recording: Path, tmp_path: Path) -> None:
    forbidden = recording.rename(tmp_path / "crowds_zara02.ndjson")
    out = str(tmp_path / "w.safetensors")
    assert training.main([str(forbidden), "--out", out]) == 2
    with pytest.raises(InputError, match="at once"):
        check_split(["a", "b"], ["b"])


def test_windows_hold_all_agents_that_are_there_and_weigh_by_type(recording: Path) -> None:
    """40 steps: a window begins at each of the first 31, at whose ninth step all are there."""
    windows = cut_training_windows([read_recording(recording)], weights=Weights({3: 2.0, 4: 3.0}))
    assert len(windows) == 31
    assert all(w.xy.shape == (12, 21, 2) for w in windows)
    assert [w.weight[0] for w in windows[:16]] == [2.0] + 14 * [0.6] + [3.0]
    assert np.isnan(windows[-1].xy[:, 10:]).all()
    assert (windows[0].destination == windows[30].xy[:, 9]).all()


def test_backwards_all_agents_go_to_where_they_came_from(recording: Path) -> None:
    read = read_recording(recording)
    ahead, both = cut_training_windows([read]), cut_training_windows([read], both_ways=True)
    back = both[len(ahead) :]
    assert all(
        np.array_equal(a.xy, b.xy, equal_nan=True) for a, b in zip(ahead, both, strict=False)
    )
    assert np.array_equal(back[19].xy[:, ::-1], ahead[19].xy)
    assert np.array_equal(back[19].destination, ahead[0].xy[:, 0])
    assert set(np.concatenate([w.weight for w in back]).tolist()) == {0.6}


def test_who_bends_can_count_more_than_who_keeps_going(tmp_path: Path) -> None:
    """One stands, one goes straight on, one walks a bend, one leaves early; none is a primary."""
    k = np.arange(22)
    bend = 0.1 * k
    paths = {
        0: np.stack((0.01 * k, 0.0 * k), -1),
        1: np.stack((0.5 * k, 5 + 0.0 * k), -1),
        2: 20 + 0.5 * np.cumsum(np.stack((np.cos(bend), np.sin(bend)), -1), axis=0),
        3: np.stack((0.5 * k[:15], -5 + 0.0 * k[:15]), -1),
        4: np.stack((0.5 * k, 40 + 0.0 * k), -1),
    }
    rows: list[dict[str, object]] = [
        {"track": {"f": int(f), "p": p, "x": float(x), "y": float(y)}}
        for p, path in paths.items()
        for f, (x, y) in enumerate(path)
    ]
    scene = {"id": 0, "p": 4, "s": 0, "e": 20, "fps": 2.5, "tag": [3, [1]]}
    file = tmp_path / "four.ndjson"
    file.write_text("".join(json.dumps(row) + "\n" for row in [{"scene": scene}, *rows]))
    windows = cut_training_windows([read_recording(file)], weights=BENDING)
    assert windows[0].weight.tolist() == [0.1, 0.1, 1.0, 0.4, 1.0]


def test_intervals_are_over_people_not_scenes() -> None:
    """Ten people with ten equal scenes each know no more than with one scene each."""
    x = np.arange(10.0)
    once = compute_mean(x, np.arange(10), draws=4000)
    often = compute_mean(np.repeat(x, 10), np.repeat(np.arange(10), 10), draws=4000)
    assert (once.value, once.low, once.high) == pytest.approx((often.value, often.low, often.high))
    assert once.low is not None
    assert once.high is not None
    expected = 1.96 * np.std(x) / np.sqrt(10)
    assert (once.high - once.low) / 2 == pytest.approx(expected, rel=0.1)
    assert compute_mean(np.full(10, np.nan), np.arange(10)) == Figure(None, None, None, 0)
