"""TrajNet++ files: what is read, what is refused, what is written."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenewright.errors import InputError
from scenewright.evals.trajnet.predictors import predict_constant_velocity
from scenewright.evals.trajnet.recording import read_recording
from scenewright.evals.trajnet.score import (
    Goals,
    build_table,
    format_predictions,
    predict_scenes,
    score_scenes,
)

Row = dict[str, object]


def scene(**changes: object) -> Row:
    return {"scene": {"id": 7, "p": 3, "s": 100, "e": 300, "fps": 2.5, "tag": [3, [2]], **changes}}


def walk(p: int, x: float, y: float, vx: float, frames: range = range(100, 301, 10)) -> list[Row]:
    return [{"track": {"f": f, "p": p, "x": x + vx * (f - 100) / 10, "y": y}} for f in frames]


def written(path: Path, rows: list[Row]) -> Path:
    path.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    return path


def test_round_trip_of_a_straight_walk(tmp_path: Path) -> None:
    """Constant velocity is right about it; the file it writes is read back as it was."""
    rows = [scene(), *walk(3, 0, 0, 0.5), *walk(9, 0, 2, 0.25)]
    recording = read_recording(written(tmp_path / "a.ndjson", rows))
    predicted = predict_scenes(recording, predict_constant_velocity)
    (score,) = score_scenes(recording, predicted)
    assert (score.type, score.subtypes, score.person) == (3, (2,), ("a", 3))
    assert score.ade == pytest.approx(0.0, abs=0.004)  # written in centimetres
    assert (score.col1, score.col2) == (False, False)
    text = list(format_predictions(recording, predicted))
    assert len(text) == 1 + 2 * 12
    assert json.loads(text[1])["track"] == {
        "f": 190, "p": 3, "x": 4.5, "y": 0.0, "prediction_number": 0, "scene_id": 7,
    }  # fmt: skip
    (tmp_path / "b.ndjson").write_text("\n".join(text))
    again = read_recording(tmp_path / "b.ndjson")
    assert again.stretch(100)[0, 9:] == pytest.approx(predicted[0].xy[0])


def test_the_benchmarks_own_collision_file(tmp_path: Path) -> None:
    """Two who walk towards each other at 0.4 m a step and would meet between two steps.

    It is laid out like the benchmark's sanity file: observed steps alone, no type.
    """
    rows: list[Row] = [scene(id=0, p=1, s=1, e=21, tag=0)]
    for k in range(9):
        rows.append({"track": {"f": 1 + k, "p": 1, "x": 0.1, "y": 6.2 - 0.4 * k}})
        rows.append({"track": {"f": 1 + k, "p": 2, "x": 0.0, "y": -6.2 + 0.4 * k}})
    recording = read_recording(written(tmp_path / "collision_test.ndjson", rows))
    predicted = predict_scenes(recording, predict_constant_velocity)
    assert score_scenes(recording, predicted) == []  # the future is not in the file
    from scenewright.evals.trajnet.score import find_collisions

    assert find_collisions(predicted[0].xy[0], predicted[0].xy[1:]).tolist() == [True]


@pytest.mark.parametrize("goals", ["destination", "horizon"])
def test_goals_are_ends_of_tracks_or_of_the_scene(tmp_path: Path, goals: Goals) -> None:
    rows = [scene(), *walk(3, 0, 0, 0.5, range(100, 401, 10))]
    recording = read_recording(written(tmp_path / "a.ndjson", rows))
    given: list[Any] = []

    def listener(
        pasts: Sequence[np.ndarray],
        goals: Sequence[np.ndarray] | None = None,
        *,
        due: float | None = None,
        step: float = 0.4,
    ) -> list[np.ndarray]:
        assert goals is not None
        given.extend([*goals, due, step])
        return predict_constant_velocity(pasts)

    predict_scenes(recording, listener, goals=goals)
    assert given[0].tolist() == [[15.0, 0.0] if goals == "destination" else [10.0, 0.0]]
    assert given[1:] == [None if goals == "destination" else 12, 0.4]


def test_longer_steps_are_predicted_at_the_networks_own_pace(tmp_path: Path) -> None:
    """At 2 steps a second, a network that goes straight on goes straight on."""
    import torch

    from lab.trajnet.windows import cut_training_windows
    from scenewright.evals.trajnet.predictors import Refining
    from scenewright.tools.trajnet_refiner.config import RefinerConfig
    from scenewright.tools.trajnet_refiner.model import Refiner

    net = Refiner(RefinerConfig(hidden=8, embedding=8, pooled=8)).eval()
    torch.nn.init.zeros_(net.output.weight)
    rows = [scene(fps=2), *walk(3, 0, 0, 0.5)]
    recording = read_recording(written(tmp_path / "a.ndjson", rows))
    for goals in ("none", "horizon"):
        (predicted,) = predict_scenes(recording, Refining(net), goals=goals)
        assert predicted.xy[0] == pytest.approx(recording.stretch(100)[0, 9:], abs=0.011)
    window = cut_training_windows([recording])[0]
    assert window.xy[0, :, 0] == pytest.approx(4.0 + 0.4 * np.arange(-8, 13))


def test_types_are_worked_out_where_they_are_missing(tmp_path: Path) -> None:
    rows = [scene(tag=0), *walk(3, 0, 0, 0.5)]
    recording = read_recording(written(tmp_path / "a.ndjson", rows))
    scores = score_scenes(recording, predict_scenes(recording, predict_constant_velocity))
    assert [row.name for row in build_table(scores)] == ["all", "2 linear"]
    assert scores[0].col1 is False  # nobody else is there, which the official evaluator counts


@pytest.mark.parametrize(
    ("rows", "word"),
    [
        ([scene()], "0 rows"),
        (walk(3, 0, 0, 0.5), "0 scenes"),
        ([scene(e=305), *walk(3, 0, 0, 0.5)], "line 1"),
        ([scene(), {"track": {"f": 100, "p": 3, "x": 1.0}}], "'y' is missing"),
        ([scene(), {"track": {"f": 100, "p": 3, "x": float("nan"), "y": 0.0}}], "finite"),
        ([scene(), {"other": 1}], "line 2"),
        ([scene(), 3], "line 2"),
        ([scene(), scene(e=120), *walk(3, 0, 0, 0.5)], "different steps"),
        ([scene(), scene(fps=2), *walk(3, 0, 0, 0.5)], "different steps"),
        ([scene(fps=0), *walk(3, 0, 0, 0.5)], "line 1"),
        ([scene(), *walk(3, 0, 0, 0.5, range(100, 171, 10))], "ninth"),
        ([scene(), *walk(4, 0, 0, 0.5)], "ninth"),
    ],
)
def test_bad_files_are_refused_by_line(tmp_path: Path, rows: list[Row], word: str) -> None:
    path = written(tmp_path / "a.ndjson", rows)
    with pytest.raises(InputError, match=r"a\.ndjson") as caught:
        predict_scenes(read_recording(path), predict_constant_velocity)
    assert word in str(caught.value)


def test_what_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.ndjson").write_bytes(b"\x80\x04\x95\xff")
    with pytest.raises(InputError, match="not a text file"):
        read_recording(tmp_path / "a.ndjson")


def test_who_left_before_the_ninth_step_is_written_and_goes_on_evenly(tmp_path: Path) -> None:
    """The official evaluator refuses Col-I of a file without everybody seen in the first nine."""
    early, once = range(100, 161, 10), range(100, 101)
    rows = [scene(), *walk(3, 0, 0, 0.5), *walk(9, 0, 2, 0.25, early), *walk(4, 8, 8, 1.0, once)]
    recording = read_recording(written(tmp_path / "a.ndjson", rows))
    (predicted,) = predict_scenes(recording, predict_constant_velocity)
    places = {
        int(p): xy for p, xy in zip(recording.ids[predicted.places], predicted.xy, strict=True)
    }
    assert list(places) == [3, 4, 9]
    assert places[9] == pytest.approx(
        np.stack([0.25 * np.arange(9, 21), np.full(12, 2.0)], -1), abs=0.01
    )
    assert places[4] == pytest.approx(np.full((12, 2), 8.0))


def test_who_comes_after_the_ninth_step_is_no_agent_to_collide_with(tmp_path: Path) -> None:
    rows = [scene(), *walk(3, 0, 0, 0.5), *walk(9, 0, 0.1, 0.5, range(200, 301, 10))]
    recording = read_recording(written(tmp_path / "a.ndjson", rows))
    (score,) = score_scenes(recording, predict_scenes(recording, predict_constant_velocity))
    assert (score.col1, score.col2) == (False, False)
