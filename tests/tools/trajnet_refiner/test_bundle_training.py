"""Training a bundle's refiner: from recorded hours to weights, card and checksums."""

from __future__ import annotations

import shutil
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import torch

from scenewright.errors import InputError
from scenewright.intersections import REFINER_WEIGHTS, check_bundle, find_bundle_folder
from scenewright.scene.track import PEDESTRIAN, Track, get_vehicle_shape
from scenewright.tools.track_io import RecordedAgent, Recording
from scenewright.tools.trajnet_refiner.bundle_training import CARD, find_out_folder, train_bundle
from scenewright.tools.trajnet_refiner.config import RefinerConfig
from scenewright.tools.trajnet_refiner.store import load_refiner, read_tensors
from scenewright.tools.trajnet_refiner.train import (
    RECIPE,
    build_supervised_batches,
    cut_recorded_windows,
    reverse_windows,
)
from scenewright.tools.trajnet_refiner.windows import Variation

torch.set_num_threads(1)
NAME = "amsterdam_120"
CONFIG = RefinerConfig(
    hidden=8, embedding=8, pooled=8, neighbours=2, stride=2, mirrored=False, apart=None
)
ONCE = RECIPE.model_copy(update={"epochs": 2})


def hour(split: str, seed: int) -> Recording:
    rng = np.random.default_rng(seed)
    agents = []
    for k in range(6):
        t = 0.1 * np.arange(400)
        speed, y = rng.uniform(1, 8), 4.0 * k
        xy = np.column_stack([speed * t + np.sin(t / 3), np.full_like(t, y)])
        shape = PEDESTRIAN if k % 2 else get_vehicle_shape("car")
        agents.append(RecordedAgent(Track(xy, np.zeros(len(t)), 0.0), shape))
    return Recording(f"{NAME} day 0 hour {seed:02d}", 0.0, 40.0, tuple(agents), split=split)  # type: ignore[arg-type]


HOURS = (hour("fit", 1), hour("test", 2))


def test_the_same_hours_give_the_same_weights_with_a_card_beside_them(tmp_path):
    made = [
        train_bundle(NAME, HOURS, out=tmp_path / each, config=CONFIG, recipe=ONCE) for each in "ab"
    ]
    (one, first), (two, second) = (read_tensors(tmp_path / each / REFINER_WEIGHTS) for each in "ab")
    assert first == second
    assert all(np.array_equal(one[name], two[name]) for name in one)
    assert made[0]["hours"]["fit"] == [HOURS[0].name]
    assert len(made[0]["losses"]) == 2
    assert load_refiner(tmp_path / "a" / REFINER_WEIGHTS).config == CONFIG
    card = (tmp_path / "a" / CARD).read_text("utf-8")
    assert "Apache-2.0" in card
    assert "day 0 hour 02" in card
    assert sorted(each.name for each in (tmp_path / "a").iterdir()) == [CARD, REFINER_WEIGHTS]


def test_the_checksums_of_a_bundle_are_brought_up_to_date(tmp_path):
    folder = tmp_path / NAME
    shutil.copytree(find_bundle_folder(NAME), folder)
    train_bundle(NAME, HOURS, out=folder, config=CONFIG, recipe=ONCE)
    train_bundle(NAME, HOURS, out=folder, config=CONFIG, recipe=ONCE)
    check_bundle(folder)
    sums = tomllib.loads((folder / "bundle.toml").read_text("utf-8"))["sha256"]
    assert {REFINER_WEIGHTS, CARD, "map.json"} <= set(sums)


def test_hours_that_cannot_be_used_are_refused(tmp_path):
    with pytest.raises(InputError, match="no hours to fit"):
        train_bundle(NAME, HOURS[1:], out=tmp_path, config=CONFIG)
    with pytest.raises(InputError, match="another intersection"):
        train_bundle("elsewhere", HOURS, out=tmp_path, config=CONFIG)


def test_what_is_shipped_is_not_written_over(tmp_path):
    assert not find_out_folder(NAME, None).is_absolute()
    assert find_out_folder(NAME, str(tmp_path)) == tmp_path


def test_every_goal_is_a_place_on_the_way_at_the_time_it_is_due():
    windows = cut_recorded_windows([HOURS[0]], observed=9, predicted=12)
    assert all(window.xy.shape[1] == 33 for window in windows)
    exactly = Variation(stretch=0.0, noise=0.0, unseen=0.0, goals=1.0)
    rng = np.random.default_rng(0)
    (scenes, future, _), *_ = build_supervised_batches(
        windows, observed=9, agents=1000, variation=exactly, rng=rng
    )
    within = scenes.due <= 12
    assert within.any()
    b, n, step = torch.nonzero(within, as_tuple=True)
    due = scenes.due[within].long() - 1
    assert (due >= step).all()
    assert torch.allclose(scenes.goal[within], future[b, n, due], atol=1e-4)


def test_a_stretch_backwards_ends_where_it_began():
    windows = cut_recorded_windows([HOURS[0]], observed=9, predicted=12)
    turned = reverse_windows(windows, observed=9)
    assert len(turned) == len(windows)
    assert all(
        np.array_equal(two.xy[0, 0], one.xy[0, -1])
        for one, two in zip(windows, turned, strict=True)
        if not np.isnan(one.xy).any()
    )
    assert all(np.isfinite(two.xy[:, 8:10]).all() for two in turned)


def test_other_intersections_are_learned_from_and_the_card_says_which(tmp_path):
    others = tuple(replace(hour(split, 7), name=f"mill piece {split}") for split in ("fit", "test"))
    about = train_bundle(NAME, HOURS, out=tmp_path, config=CONFIG, recipe=ONCE, others=others)
    plain = train_bundle(NAME, HOURS, out=tmp_path / "plain", config=CONFIG, recipe=ONCE)
    assert about["windows"] > plain["windows"]
    assert about["others"]["mill"]["vehicle_n"] > 0
    assert "Other intersections learned from as well: mill (" in (tmp_path / CARD).read_text()
    assert "Other intersections" not in (tmp_path / "plain" / CARD).read_text("utf-8")


def test_a_network_that_goes_on_keeps_its_share_for_pedestrians(tmp_path):
    config = CONFIG.model_copy(update={"walking": 0.4})
    train_bundle(NAME, HOURS, out=tmp_path / "a", config=config, recipe=ONCE)
    start = load_refiner(tmp_path / "a" / REFINER_WEIGHTS)
    train_bundle(NAME, HOURS, out=tmp_path / "b", start=start, recipe=ONCE)
    assert load_refiner(tmp_path / "b" / REFINER_WEIGHTS).config == config


def test_walking_is_learned_from_real_walkers_and_the_card_says_whose(tmp_path):
    """Simulated pedestrians count a tenth then; the figures of those held out stand in the card."""
    walkers = tuple(replace(hour(split, 5), name=f"street/{split}") for split in ("fit", "test"))
    about = train_bundle(NAME, HOURS, out=tmp_path, config=CONFIG, recipe=ONCE, walkers=walkers)
    plain = train_bundle(NAME, HOURS, out=tmp_path / "plain", config=CONFIG, recipe=ONCE)
    assert about["windows"] > plain["windows"]
    assert about["walkers_figures"]["pedestrian_n"] > 0
    text = (tmp_path / CARD).read_text("utf-8")
    assert "learned from real walkers: street/fit" in text
    assert "street/test" in text
    assert "no recorded" in (tmp_path / "plain" / CARD).read_text("utf-8")
