"""The roll-out's measure: what is told of a track, what is held out, and the rivals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from lab.rollouts.rollout_tasks import RolloutTask, build_tasks
from lab.rollouts.rollouts import (
    BEFORE_END,
    build_methods,
    compare_methods,
    compute_errors,
    fit_splines,
    interpolate_evenly,
    main,
    run_refiner,
)
from refiner_networks import build_zero_network, convert_network
from scenewright.scene.track import Track, get_vehicle_shape
from scenewright.tools.track_io import RecordedAgent, Recording
from scenewright.tools.trajnet_refiner.config import RefinerConfig

torch.set_num_threads(1)


def recording(seconds: float = 30.0) -> Recording:
    """One vehicle at even speed and one that brakes, on two lanes."""
    t = 0.1 * np.arange(round(seconds / 0.1))
    tracks = [
        np.column_stack([8.0 * t, np.zeros_like(t)]),
        np.column_stack([10.0 * t - 0.15 * t**2, np.full_like(t, 50.0)]),
    ]
    agents = tuple(
        RecordedAgent(Track(xy, np.zeros(len(xy)), 0.0), get_vehicle_shape("car")) for xy in tracks
    )
    return Recording("here", 0.0, seconds, agents, split="test")


@pytest.mark.parametrize("before_end", BEFORE_END)
def test_the_end_is_never_told(before_end):
    (task,) = build_tasks([recording()], before_end=before_end, most=5)
    for facts, places in zip(task.given, task.goals, strict=True):
        goals = np.isfinite(places[:, 0])
        assert not (facts | goals)[-before_end:].any()
        assert goals[-1 - before_end]
        assert facts.sum() == 9


def test_even_motion_and_the_spline_are_right_where_they_must_be():
    (task,) = build_tasks([recording()], before_end=4, most=5)
    straight = compute_errors(task, interpolate_evenly(task))
    assert straight[0] == pytest.approx((0.0, 0.0), abs=1e-9)
    assert straight[1, 1] > 0.3
    assert compute_errors(task, fit_splines(task)) == pytest.approx(
        0.0, abs=1e-6
    )  # a parabola is a cubic


def test_a_network_that_has_learned_nothing_keeps_even_motion_even():
    net = convert_network(build_zero_network(RefinerConfig(hidden=8, embedding=8, pooled=8)))
    (task,) = build_tasks([recording()], before_end=4, most=5)
    (first, second) = compute_errors(task, run_refiner(net, task))
    assert first[1] < 0.01
    assert second[1] < 5.0
    rows = list(compare_methods(build_methods(net), [recording()], most=5))
    assert [row.before_end for row in rows] == list(BEFORE_END)
    lines = [line for row in rows for line in row.format_lines("here")]
    assert len(lines) == 3 * len(BEFORE_END)
    assert all(line.count("|") == 9 for line in lines)


def test_who_is_too_short_is_seen_and_not_asked_for():
    (task,) = build_tasks([recording()], before_end=4, most=5)
    short = np.full((1, task.xy.shape[1], 2), np.nan)
    short[0, :10] = 0.0
    more = RolloutTask(
        np.concatenate([task.xy, short]),
        np.concatenate([task.given, np.isfinite(short[..., 0])]),
        np.concatenate([task.goals, np.full_like(short, np.nan)]),
        (*task.kinds, "pedestrian"),
    )
    assert len(compute_errors(more, interpolate_evenly(more))) == 2


def test_a_recording_that_ends_within_a_scene_is_rolled_out_to_its_end():
    cut = list(build_tasks([recording(42.0)], before_end=2, most=5))
    assert [int(task.there[0].sum()) for task in cut] == [75, 30]
    (short,) = build_tasks([recording(8.0)], before_end=2, most=5)
    assert int(short.there[0].sum()) == 20
    assert compute_errors(short, fit_splines(short)) == pytest.approx(0.0, abs=1e-6)


def test_no_source_is_said_in_one_line(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path))
    assert main(["--intersection", "nowhere"]) == 2
    assert "nowhere" in capsys.readouterr().err


def test_a_scene_of_bicycles_alone_holds_nothing_to_roll_out():
    ridden = recording()
    riders = tuple(replace(agent, subtype="bicycle") for agent in ridden.agents)
    assert not list(build_tasks([replace(ridden, agents=riders)], before_end=2, most=5))


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--weights", "nowhere.safetensors"], "cannot read nowhere.safetensors"),
        (["--prior-goals", "--split", "fit"], "leave out --split"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(words, reason, capsys):
    assert main(words) == 2
    assert reason in capsys.readouterr().err


@pytest.mark.parametrize("word", ["--most", "--keep"])
def test_counts_begin_at_one(word, capsys):
    with pytest.raises(SystemExit):
        main([word, "0"])
    assert "a whole number from 1" in capsys.readouterr().err
