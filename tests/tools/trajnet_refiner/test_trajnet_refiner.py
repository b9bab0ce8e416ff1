"""The refiner's network: geometry, missing values, keeping apart, training, storage, roll-out."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from refiner_networks import build_random_network, build_zero_network, convert_network
from scenewright.errors import InputError
from scenewright.tools.trajnet_refiner.config import GOAL_FEATURES, RefinerConfig
from scenewright.tools.trajnet_refiner.model import (
    Prediction,
    Refiner,
    Scenes,
    _build_present,
    _Now,
    compute_goal_features,
    compute_heading,
    find_nearest,
    pair_features,
    predict,
    turn,
    turn_back,
)
from scenewright.tools.trajnet_refiner.network import Observed
from scenewright.tools.trajnet_refiner.rollout import (
    Waypoints,
    _select_next_waypoints,
    run_rollout,
)
from scenewright.tools.trajnet_refiner.separation import separate
from scenewright.tools.trajnet_refiner.store import load_refiner, read_refiner, save_refiner
from scenewright.tools.trajnet_refiner.train import (
    APART,
    Epoch,
    Recipe,
    compute_crowding,
    compute_negative_log_density,
    train,
)
from scenewright.tools.trajnet_refiner.windows import Variation, Window, build_batches, vary_window

torch.set_num_threads(1)  # networks this small only wait for each other
SMALL = RefinerConfig(hidden=16, embedding=8, pooled=8, neighbours=4, apart=None)


def crowd(agents: int = 5, scenes: int = 2, seed: int = 0) -> Scenes:
    rng = np.random.default_rng(seed)
    start = rng.uniform(-3, 3, (scenes, agents, 1, 2))
    pace = rng.normal(0, 0.4, (scenes, agents, 1, 2))
    bend = rng.normal(0, 0.02, (scenes, agents, 1, 2))
    k = np.arange(9)[:, None]
    xy = torch.tensor(start + pace * k + bend * k**2, dtype=torch.float32)
    classes = torch.tensor(rng.integers(0, 2, (scenes, agents)))
    goal = torch.tensor(rng.uniform(-9, 9, (scenes, agents, 2)), dtype=torch.float32)
    goal[:, ::2] = torch.nan
    due = torch.full((scenes, agents), torch.nan)
    due[:, 1] = 12.0
    return Scenes(xy, classes, goal, due)


def moved(scenes: Scenes, angle: float, shift: tuple[float, float]) -> Scenes:
    along = torch.tensor([math.cos(angle), math.sin(angle)])

    def move(xy: Tensor) -> Tensor:
        return turn(xy, along.expand_as(xy)) + torch.tensor(shift)

    assert scenes.goal is not None
    return scenes._replace(xy=move(scenes.xy), goal=move(scenes.goal))


def close(a: Tensor, b: Tensor, within: float = 1e-4) -> bool:
    return torch.allclose(a, b, atol=within, rtol=0, equal_nan=True)


# ---- geometry -----------------------------------------------------------------------------------


def test_without_anything_learned_everybody_keeps_going() -> None:
    scenes = crowd()._replace(goal=None)
    last = scenes.xy[:, :, -1:]
    straight = last + (last - scenes.xy[:, :, -2:-1]) * torch.arange(1, 13)[:, None]
    assert close(build_zero_network(SMALL)(scenes).xy, straight)


def test_without_anything_learned_goals_are_met_in_time() -> None:
    """At even acceleration, wherever the time lies within the strides of the decoder."""
    scenes = crowd(agents=4, scenes=1)
    goal = scenes.xy[:, :, -1] + torch.tensor([[[3.0, 4.0], [-2.0, 1.0], [5.0, 0.0], [1.0, 1.0]]])
    due = torch.tensor([[12.0, 7.0, 2.0, torch.nan]])
    path = build_zero_network(SMALL)(scenes._replace(goal=goal, due=due)).xy
    for agent, steps in ((0, 12), (1, 7), (2, 2)):
        assert close(path[0, agent, steps - 1], goal[0, agent], 1e-3)
    whole = torch.cat((scenes.xy[:, :, -2:], path), dim=2)
    added = whole[0, 0].diff(dim=0).diff(dim=0)
    assert close(added, added[:1].expand_as(added), 1e-3)
    assert close(path[0, 3], build_zero_network(SMALL)(scenes._replace(goal=None)).xy[0, 3])


def test_pedestrians_only_slow_down_by_a_share_and_vehicles_do_all_that_was_learned() -> None:
    """Without any share pedestrians keep going; while a network learns, all of it counts."""
    scenes = crowd()._replace(goal=None)
    last = scenes.xy[:, :, -1:]
    straight = last + (last - scenes.xy[:, :, -2:-1]) * torch.arange(1, 13)[:, None]
    net = build_random_network(SMALL)
    whole = net(scenes).xy
    net.config = SMALL.model_copy(update={"walking": 0.0})
    on_foot = scenes.classes == 0
    assert close(net(scenes).xy[on_foot], straight[on_foot])
    assert not close(whole[on_foot], straight[on_foot], 1e-2)
    alone = scenes._replace(classes=torch.ones_like(scenes.classes))
    assert not close(net(alone).xy, straight, 1e-2)
    net.config = SMALL.model_copy(update={"walking": 0.5})
    ahead = torch.zeros_like(scenes.classes)
    change = torch.tensor([[0.4, 0.2], [-0.4, 0.2]])[None, None].expand(*ahead.shape, 2, 2)
    slowed = net._limit_walking(change, ahead)
    assert close(slowed[0, 0], torch.tensor([[0.0, 0.0], [-0.2, 0.0]]))
    assert net.train()._limit_walking(change, ahead) is change


def test_turning_and_shifting_the_scene_turns_and_shifts_the_prediction() -> None:
    net, scenes = build_random_network(SMALL), crowd()
    plain = net(scenes)
    angle, shift = 2.1, (30.0, -12.0)
    other = net(moved(scenes, angle, shift))
    assert close(other.xy, moved(scenes._replace(xy=plain.xy), angle, shift).xy, 1e-3)
    assert close(other.spread, plain.spread, 1e-3)


def test_left_and_right_are_alike_where_mirrored() -> None:
    net, scenes = build_random_network(SMALL), crowd()
    assert scenes.goal is not None
    swap = torch.tensor([1.0, -1.0])
    other = scenes._replace(xy=scenes.xy * swap, goal=scenes.goal * swap)
    assert close(predict(net, other).xy, predict(net, scenes).xy * swap)
    assert not close(net(other).xy, net(scenes).xy * swap)


def test_more_steps_begin_like_fewer() -> None:
    net, scenes = build_random_network(SMALL), crowd()
    many = net(scenes, 16)
    assert many.xy.shape[2] == many.spread.shape[2] == 16
    assert close(many.xy[:, :, :12], net(scenes).xy)
    assert close(net(scenes, 2).xy, net(scenes).xy[:, :, :2])


def test_the_order_of_agents_is_of_no_account() -> None:
    net, scenes = build_random_network(SMALL), crowd()
    order = torch.tensor([3, 0, 4, 1, 2])
    mixed = Scenes(*(None if each is None else each[:, order] for each in scenes))
    assert close(net(mixed).xy, net(scenes).xy[:, order])


def test_scenes_of_a_batch_and_padding_do_not_touch_each_other() -> None:
    net, scenes = build_random_network(SMALL), crowd()
    alone = Scenes(*(None if each is None else each[:1] for each in scenes))
    assert close(net(alone).xy, net(scenes).xy[:1])
    padded = Scenes(
        torch.cat((alone.xy, torch.full((1, 3, 9, 2), torch.nan)), 1),
        torch.cat((alone.classes, torch.zeros(1, 3, dtype=torch.long)), 1),
        torch.cat((alone.goal, torch.full((1, 3, 2), torch.nan)), 1),
        torch.cat((alone.due, torch.full((1, 3), torch.nan)), 1),
    )
    result = net(padded).xy
    assert close(result[:, :5], net(alone).xy)
    assert result[:, 5:].isnan().all()


def test_neighbours_matter_only_if_they_are_pooled_and_near() -> None:
    scenes = crowd(agents=2, scenes=1)
    scenes = scenes._replace(classes=torch.zeros_like(scenes.classes))
    beside, far = scenes.xy.clone(), scenes.xy.clone()
    beside[:, 1], far[:, 1] = beside[:, 0] + 0.5, far[:, 0] + 50.0
    for pooling in (True, False):
        net = build_random_network(SMALL.model_copy(update={"pooling": pooling}))
        one, other = (net(scenes._replace(xy=xy)).xy[:, 0] for xy in (beside, far))
        assert close(one, other) is not pooling


def test_goals_matter_only_to_a_network_that_has_them() -> None:
    scenes = crowd()
    for goals in (True, False):
        net = build_random_network(SMALL.model_copy(update={"goals": goals}))
        assert close(net(scenes).xy, net(scenes._replace(goal=None)).xy) is not goals


def test_missing_values_stay_where_they_are() -> None:
    """Whoever is not there now is not predicted, and what was missed is told from standing."""
    net, scenes = build_random_network(SMALL), crowd()
    xy = scenes.xy.clone()
    xy[0, 0, -1] = torch.nan
    xy[0, 1, 3:6] = torch.nan
    xy[0, 2, :8] = torch.nan
    result = net(scenes._replace(xy=xy)).xy
    assert result[0, 0].isnan().all()
    assert not result[0, 1:].isnan().any()
    assert not close(result[0, 1], net(scenes).xy[0, 1])
    assert close(result[1], net(scenes).xy[1])


def test_a_short_past_is_a_past_with_its_beginning_unseen() -> None:
    net, scenes = build_random_network(SMALL), crowd()
    short = scenes._replace(xy=scenes.xy[:, :, -4:])
    blank = scenes.xy.clone()
    blank[:, :, :5] = torch.nan
    long = scenes._replace(xy=torch.cat((torch.rand(2, 5, 3, 2), scenes.xy), dim=2))
    assert close(net(short).xy, net(scenes._replace(xy=blank)).xy)
    assert close(net(long).xy, net(scenes).xy)


def test_heading_and_turning_by_hand() -> None:
    xy = torch.tensor([[[0.0, 0.0], [9.0, 9.0], [0.0, 3.0]]])[None]
    north = compute_heading(xy, torch.ones(1, 1, 3, dtype=torch.bool))
    assert close(north, torch.tensor([[[0.0, 1.0]]]))
    assert close(turn(torch.tensor([[[2.0, 1.0]]]), north), torch.tensor([[[-1.0, 2.0]]]))
    assert close(turn_back(torch.tensor([[[-1.0, 2.0]]]), north), torch.tensor([[[2.0, 1.0]]]))
    nobody = compute_heading(xy, torch.tensor([[[False, False, True]]]))
    assert close(nobody, torch.tensor([[[1.0, 0.0]]]))


def test_the_goal_lies_ahead_not_behind() -> None:
    """One who came along north and stands at (1, 1); its goal is 4 m east and 3 m north of it."""
    north, unit = torch.tensor([[[0.0, 1.0]]]), torch.tensor([[[0.5]]])
    scenes = Scenes(
        torch.zeros(1, 1, 9, 2), torch.zeros(1, 1, dtype=torch.long),
        torch.tensor([[[5.0, 4.0]]]), torch.tensor([[12.0]]),
    )  # fmt: skip
    told = compute_goal_features(torch.tensor([[[1.0, 1.0]]]), scenes, 2, north, unit)
    expected = [0.6, -0.8, math.log1p(5 / 6), 1.0, 3 / 10 / 0.5, -4 / 10 / 0.5, 1.0]
    assert told.shape[-1] == GOAL_FEATURES
    assert told.flatten().tolist() == pytest.approx(expected, abs=1e-4)
    late = compute_goal_features(torch.tensor([[[1.0, 1.0]]]), scenes, 12, north, unit)
    assert late.flatten()[4:].tolist() == [0.0, 0.0, 0.0]
    none = scenes._replace(goal=torch.full((1, 1, 2), torch.nan))
    assert not compute_goal_features(torch.zeros(1, 1, 2), none, 0, north, unit).any()


def test_what_is_noticed_of_a_neighbour_by_hand() -> None:
    """I walk north at 0.5 m a step; 3 m ahead and 4 m to the right another walks west at 1 m.

    It slows down by 0.1 m a step each step; four steps ago it was 5 m ahead and 8 m to the right.
    """
    here = torch.ones(1, 2, dtype=torch.bool)
    now = _Now(
        xy=torch.tensor([[[0.0, 0.0], [4.0, 3.0]]]),
        move=torch.tensor([[[0.0, 0.5], [-1.0, 0.0]]]),
        change=torch.tensor([[[0.0, 0.0], [0.1, 0.0]]]),
        before=torch.tensor([[[0.0, -2.0], [8.0, 3.0]]]),
        here=here, moved=here, known=here,
    )  # fmt: skip
    along = torch.tensor([[[0.0, 1.0], [-1.0, 0.0]]])
    classes, unit = torch.tensor([[0, 1]]), torch.full((1, 2, 1), 0.5)
    near, who = find_nearest(now.xy, here, torch.tensor([[8.0, 4.0]]), 3)
    assert near.tolist() == [[[True], [False]]]
    assert who.tolist() == [[[1], [0]]]
    told = pair_features(now, who, classes, along, unit)[0, 0, 0].tolist()
    steps = 5.5 / 1.251  # offset (3, -4), relative motion (-0.5, 1.0) in my frame
    closest = (3 - 0.5 * steps, -4 + steps)
    gap, then = math.hypot(*closest), math.hypot(5, 8)
    expected = [3 / 6, -4 / 6, math.exp(-5), math.exp(-5 / 4), -1.0, 2.0, steps / 12]
    expected += [math.exp(-2 * gap), closest[0] / (0.5 + gap), closest[1] / (0.5 + gap), 1.0, 1.0]
    expected += [0.0, -1.0, 5 / (1 + then), -8 / (1 + then), 1.0]
    assert told == pytest.approx(expected, abs=1e-4)
    unseen = now._replace(known=torch.tensor([[True, False]]))
    assert pair_features(unseen, who, classes, along, unit)[0, 0, 0, -3:].tolist() == [0.0] * 3


def test_the_present_by_hand() -> None:
    """Moves of 1, 2, 3, 4 m north grow by 1 m a step; four steps ago is the start."""
    y = torch.tensor([0.0, 1.0, 3.0, 6.0, 10.0])
    xy = torch.stack((torch.zeros(5), y), -1)[None, None]
    seen = torch.ones(1, 1, 5, dtype=torch.bool)
    now = _build_present(xy, seen, xy.diff(dim=2), seen[:, :, 1:])
    assert [each.flatten().tolist() for each in now[:4]] == [[0, 10], [0, 4], [0, 1], [0, 0]]
    seen[0, 0, 2] = False
    now = _build_present(xy, seen, xy.diff(dim=2), seen[:, :, 1:] & seen[:, :, :-1])
    assert now.change.flatten().tolist() == [0, 0]
    assert [bool(each) for each in now[4:]] == [True, True, True]


def test_the_density_is_that_of_the_normal_distribution() -> None:
    from scenewright.tools.trajnet_refiner.model import Prediction

    cov = torch.tensor([[0.25, 0.06], [0.06, 0.16]])
    spread = torch.tensor([math.log(0.5), math.log(0.4), 0.06 / 0.2])
    along = torch.tensor([[[0.0, 1.0]]])
    predicted = Prediction(torch.tensor([[[[1.0, 2.0]]]]), spread[None, None, None], along)
    truth = torch.tensor([[[[1.3, 1.9]]]])
    normal = torch.distributions.MultivariateNormal(torch.zeros(2), cov)
    expected = -normal.log_prob(turn_back(torch.tensor([0.3, -0.1]), along[0, 0]))
    assert close(compute_negative_log_density(predicted, truth).flatten(), expected[None])


def test_crowding_is_what_the_distance_of_two_who_meet_lacks() -> None:
    """They cross at the third of five steps, there and halfway before and after it."""
    k = torch.arange(5.0)
    one, other = torch.stack((k - 2.0, 0.1 + 0 * k), -1), torch.stack((2.0 - k, 0 * k), -1)
    xy = torch.stack((one, other))[None]
    predicted = Prediction(xy, torch.zeros(1, 2, 5, 3), torch.zeros(1, 2, 2))
    far = xy + torch.tensor((0.0, 50.0))
    both = torch.ones(1, 2)
    lacking = compute_crowding(predicted, far, both, both.bool())
    assert lacking.item() == pytest.approx((APART - 0.1) / 9, abs=1e-4)
    assert compute_crowding(predicted, far, both, ~both.bool()).item() == 0.0
    known = compute_crowding(predicted, xy, both, both.bool())
    assert known > lacking


# ---- keeping apart ------------------------------------------------------------------------------


def head_on() -> Tensor:
    k = torch.arange(12.0)[:, None]
    east = torch.tensor([-2.2, 0.0]) + k * torch.tensor([0.4, 0.0])
    west = torch.tensor([2.2, 0.05]) - k * torch.tensor([0.4, 0.0])
    alone = torch.tensor([0.0, 5.0]) + 0 * k
    return torch.stack((east, west, alone))[None]


def least_distance(one: Tensor, other: Tensor) -> float:
    offset = one - other
    halves = 0.5 * (offset[1:] + offset[:-1])
    return float(torch.cat((offset, halves)).norm(dim=-1).min())


def test_two_who_would_collide_are_moved_apart_and_nobody_else() -> None:
    xy = head_on()
    result = separate(xy, among=torch.ones(1, 3, dtype=torch.bool), apart=0.3)
    assert least_distance(xy[0, 0], xy[0, 1]) < 0.06
    assert least_distance(result[0, 0], result[0, 1]) >= 0.3
    assert torch.equal(result[0, 2], xy[0, 2])
    assert close(result[0, 0] + result[0, 1], xy[0, 0] + xy[0, 1])  # both by the same amount
    assert float((result - xy).norm(dim=-1).max()) < 0.2
    assert float((result - xy).diff(dim=2).norm(dim=-1).max()) < 0.06  # without a jerk


def test_who_is_not_among_them_is_left_alone() -> None:
    xy = head_on()
    among = torch.tensor([[True, False, True]])
    assert torch.equal(separate(xy, among=among, apart=0.3), xy)


def test_two_in_the_same_place_part_and_the_absent_stay_absent() -> None:
    xy = head_on()
    xy[0, 1] = xy[0, 0]
    xy[0, 2] = torch.nan
    result = separate(xy, among=torch.ones(1, 3, dtype=torch.bool), apart=0.25)
    assert least_distance(result[0, 0], result[0, 1]) >= 0.25
    assert result[0, 2].isnan().all()


def test_vehicles_are_not_moved_by_a_prediction() -> None:
    scenes = crowd(agents=6)
    tight = scenes._replace(xy=scenes.xy * 0.1, goal=None)
    config = SMALL.model_copy(update={"apart": 0.5})
    net, raw = build_random_network(config), build_random_network(SMALL)
    assert not torch.equal(predict(net, tight).xy, predict(raw, tight).xy)
    cars = tight._replace(classes=torch.ones_like(tight.classes))
    assert torch.equal(predict(net, cars).xy, predict(raw, cars).xy)


# ---- training -----------------------------------------------------------------------------------


def bending_windows(count: int = 24, agents: int = 4) -> list[Window]:
    """Everybody walks a circle of its own pace; a straight line is always wrong."""
    rng = np.random.default_rng(1)
    k = np.arange(21)
    result = []
    for _ in range(count):
        pace, start = rng.uniform(0.3, 0.6, agents), rng.uniform(-8, 8, (agents, 1, 2))
        angle = rng.uniform(0, 6.28, agents)[:, None] + 0.08 * k
        moves = pace[:, None, None] * np.stack((np.cos(angle), np.sin(angle)), -1)
        xy = start + moves.cumsum(axis=1)
        classes = np.zeros(agents, np.int64)
        result.append(Window(xy, classes, xy[:, -1], np.ones(agents)))
    return result


PLAIN = Recipe(epochs=3, agents=16, rate=5e-3, average=0.5)


def weights(net: Refiner) -> list[Tensor]:
    return [p.detach().clone() for p in net.parameters()]


def test_training_learns_to_bend() -> None:
    """Mirrored circles bend both ways, so that the way to bend must be read from the past."""
    told: list[Epoch] = []
    windows = bending_windows(12)
    recipe = PLAIN.model_copy(update={"epochs": 16, "goals": 0.0, "rate": 1e-2})
    train(windows, config=SMALL, recipe=recipe, held_out=bending_windows(6),
          after_epoch=told.append, device="cpu")  # fmt: skip
    assert [e.number for e in told] == list(range(1, 17))
    assert told[0].ade is not None
    assert told[-1].ade is not None
    assert told[-1].ade < 0.5 * told[0].ade


def test_the_same_seed_trains_the_same_network() -> None:
    windows = bending_windows(8)
    one, same, other = (
        train(windows, config=SMALL, recipe=PLAIN.model_copy(update={"seed": s}), device="cpu")
        for s in (3, 3, 4)
    )
    assert all(map(torch.equal, weights(one), weights(same)))
    assert not all(map(torch.equal, weights(one), weights(other)))


def test_a_killed_training_ends_as_if_it_had_not_been(tmp_path: Path) -> None:
    windows, file = bending_windows(8), tmp_path / "run.safetensors"
    whole = train(windows, config=SMALL, recipe=PLAIN, device="cpu")

    class Killed(Exception):
        pass

    def kill(epoch: Epoch) -> None:
        if epoch.number == 2:
            raise Killed

    with pytest.raises(Killed):
        train(windows, config=SMALL, recipe=PLAIN, checkpoint=file, after_epoch=kill, device="cpu")
    seen: list[int] = []
    resumed = train(
        windows, config=SMALL, recipe=PLAIN, checkpoint=file, device="cpu",
        after_epoch=lambda epoch: seen.append(epoch.number),
    )  # fmt: skip
    assert seen == [3]
    assert all(map(torch.equal, weights(whole), weights(resumed)))
    with pytest.raises(InputError, match="another training"):
        train(windows, config=SMALL, recipe=PLAIN.model_copy(update={"seed": 9}), checkpoint=file)


def test_training_can_begin_from_a_network() -> None:
    windows, still = bending_windows(8), PLAIN.model_copy(update={"epochs": 1, "rate": 1e-12})
    first = train(windows, config=SMALL, recipe=PLAIN, device="cpu")
    before = weights(first)
    same = train(windows, config=SMALL, recipe=still, start=first, device="cpu")
    for one, other in zip(weights(same), before, strict=True):
        torch.testing.assert_close(one, other, atol=1e-8, rtol=1e-6)
    further = train(windows, config=SMALL, recipe=PLAIN, start=first, device="cpu")
    assert not all(map(torch.equal, weights(further), before))
    assert all(map(torch.equal, weights(first), before)), "what it began from stays as it was"


def test_nothing_to_train_on_is_said() -> None:
    with pytest.raises(InputError, match="nothing to train on"):
        train([], config=SMALL, recipe=PLAIN)


def test_variations_keep_the_present_and_the_shape() -> None:
    window = bending_windows(1)[0]
    by = Variation(stretch=0.1, noise=0.0, unseen=1.0, goals=0.0)
    for seed in range(20):
        other = vary_window(window, observed=9, by=by, rng=np.random.default_rng(seed))
        assert np.isnan(other.xy[:, :8, 0]).any(axis=1).all()
        assert not np.isnan(other.xy[:, 8:]).any()
        factor = np.abs(other.xy[:, 8:] / window.xy[:, 8:])
        assert np.ptp(factor) == pytest.approx(0.0, abs=1e-9)
        assert 0.9 <= factor.mean() <= 1.1


def test_batches_hold_every_window_once_and_goals_that_are_true() -> None:
    windows = []
    for i, n in enumerate((4, 1, 3, 2, 4, 1, 2, 3, 4)):
        w, weight = bending_windows(9)[i], np.full(n, float(i))
        windows.append(Window(w.xy[:n], w.classes[:n], w.destination[:n], weight))
    none = Variation(stretch=0.0, noise=0.0, unseen=0.0, goals=1.0)
    seen, due = [], []
    for scenes, future, weight in build_batches(
        windows, observed=9, agents=8, variation=none, rng=np.random.default_rng(0)
    ):
        seen += weight.amax(dim=1).tolist()
        assert scenes.goal is not None
        assert scenes.due is not None
        timed = ~scenes.due.isnan()
        due += scenes.due[timed].tolist()
        reached = future[timed][torch.arange(int(timed.sum())), scenes.due[timed].long() - 1]
        assert close(scenes.goal[timed], reached)
        aimed = ~scenes.goal[..., 0].isnan() & ~timed
        assert close(scenes.goal[aimed], future[aimed][:, -1])
    assert sorted(seen) == list(range(9))
    assert due


# ---- storage and roll-out -----------------------------------------------------------------------


def test_a_network_comes_back_as_it_was_stored(tmp_path: Path) -> None:
    net, file = build_random_network(SMALL), tmp_path / "w.safetensors"
    save_refiner(SMALL, net.list_weights(), file, about={"note": "for a test"})
    again = Refiner.from_weights(*read_refiner(file))
    assert again.config == net.config
    assert torch.equal(again(crowd()).xy, net(crowd()).xy)
    assert not list(tmp_path.glob("*.part"))


def test_what_are_no_weights_is_refused(tmp_path: Path) -> None:
    import pickle

    from safetensors.torch import save_file

    file = tmp_path / "w.safetensors"
    file.write_bytes(pickle.dumps({"a": 1}))
    with pytest.raises(InputError, match="not a safetensors file"):
        load_refiner(file)
    save_file({"a": torch.zeros(2)}, str(file))
    with pytest.raises(InputError, match="not weights of the refiner"):
        load_refiner(file)
    save_refiner(SMALL, build_random_network(SMALL).list_weights(), file)
    data = file.read_bytes().replace(b'"version":"1"', b'"version":"9"')
    file.write_bytes(data)
    with pytest.raises(InputError, match="version 9"):
        load_refiner(file)
    with pytest.raises(FileNotFoundError):
        load_refiner(tmp_path / "none")


def test_weights_of_another_shape_are_refused(tmp_path: Path) -> None:
    net, file = build_random_network(SMALL), tmp_path / "w.safetensors"
    config = SMALL.model_copy(update={"hidden": 32})
    save_refiner(config, net.list_weights(), file)
    with pytest.raises(InputError, match="do not fit"):
        load_refiner(file)


def test_weights_of_another_kind_than_the_task_are_refused(tmp_path: Path) -> None:
    kinds = {"scenes": {"intersection": "mill"}, "benchmark": {"trained_on": ["zara"]}}
    for kind, about in kinds.items():
        weights = build_random_network(SMALL).list_weights()
        save_refiner(SMALL, weights, tmp_path / kind, about=about)
    assert read_refiner(tmp_path / "benchmark", task="benchmark")[0] == SMALL
    with pytest.raises(InputError, match="that predict pedestrians"):
        load_refiner(tmp_path / "benchmark")
    with pytest.raises(InputError, match="that refine the scenes"):
        read_refiner(tmp_path / "scenes", task="benchmark")
    with pytest.raises(InputError, match="predict mirrored"):
        load_refiner(tmp_path / "scenes")


@pytest.mark.parametrize("agents", [1, 2, 7, 20])
@pytest.mark.parametrize(
    "changes", [{}, {"pooling": False}, {"goals": False}, {"walking": 0.5}], ids=str
)
def test_inference_without_torch_says_what_the_trained_network_says(
    agents: int, changes: dict[str, object]
) -> None:
    net = build_random_network(SMALL.model_copy(update={"mirrored": False, **changes}))
    scenes = crowd(agents=agents, scenes=1) if agents > 1 else crowd(agents=2, scenes=1)
    xy = scenes.xy.clone()
    xy[0, 0, 2:4] = torch.nan
    xy[0, 1, -1] = torch.nan if agents == 1 else xy[0, 1, -1]
    assert scenes.goal is not None
    assert scenes.due is not None
    goal, due = (each[:, :, None].repeat_interleave(12, 2) for each in (scenes.goal, scenes.due))
    expected = net(Scenes(xy, scenes.classes, goal, due))
    ours = convert_network(net).predict(
        Observed(*(each[0].numpy() for each in (xy, scenes.classes, goal, due)))
    )
    here = ~xy[0, :, -1, 0].isnan()
    assert close(torch.from_numpy(ours.xy), expected.xy[0])
    assert close(torch.from_numpy(ours.spread)[here], expected.spread[0][here])
    assert close(torch.from_numpy(ours.along)[here], expected.along[0][here])


def test_everybody_rolls_straight_on_and_known_positions_stay() -> None:
    """Agent 0 walks 0.5 m a step; agent 1 comes in at column 20 and leaves at 30."""
    net = convert_network(build_zero_network(SMALL))
    known = np.full((3, 40, 2), np.nan)
    known[0, :9, 0] = 0.5 * np.arange(9)
    known[0, :9, 1] = 0.0
    known[1, 20:22] = [[5.0, 5.0], [5.0, 6.0]]
    result = run_rollout(
        net, known, classes=np.zeros(3, dtype=np.int64), until=np.array([40, 30, 40]), keep=5
    )
    assert result[0, :, 0] == pytest.approx(0.5 * np.arange(40.0), abs=1e-3)
    assert np.isnan(result[1, :20]).all()
    assert result[1, 20:30, 1] == pytest.approx(np.arange(5.0, 15.0), abs=1e-3)
    assert np.isnan(result[1, 30:]).all()
    assert np.isnan(result[2]).all()


def test_the_next_waypoint_is_the_goal() -> None:
    waypoints = Waypoints(np.array([[[1.0, 0.0], [2.0, 0.0]]]), np.array([[12.0, 14.0]]))
    goal, due = _select_next_waypoints(*waypoints, 11, 6, np.zeros(1, dtype=np.int64))
    assert goal[0, :, 0].tolist()[:4] == [1.0, 1.0, 2.0, 2.0]
    assert np.isnan(goal[0, 4:]).all()
    assert due[0].tolist()[:4] == [2.0, 2.0, 4.0, 4.0]


def test_each_agent_can_look_further_ahead_than_the_others() -> None:
    """Whoever leads by two heads for the second waypoint from two steps before the first is due."""
    places = np.broadcast_to(np.array([[1.0, 0.0], [2.0, 0.0]]), (2, 2, 2))
    waypoints = Waypoints(places, np.broadcast_to(np.array([12.0, 16.0]), (2, 2)))
    goal, due = _select_next_waypoints(*waypoints, 10, 4, np.array([0, 2]))
    assert goal[:, :, 0].tolist() == [[1.0, 1.0, 1.0, 2.0], [1.0, 2.0, 2.0, 2.0]]
    assert due.tolist() == [[3.0, 3.0, 3.0, 7.0], [3.0, 7.0, 7.0, 7.0]]
