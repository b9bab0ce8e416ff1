"""The drive as a gymnasium environment."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np
import pytest

from exported_scenes import make_record
from scenewright import drive, drive_many
from scenewright.driving.ego_motion import ActionMode
from scenewright.errors import InputError

pytest.importorskip("gymnasium")


@pytest.mark.parametrize("actions", get_args(ActionMode))
@pytest.mark.filterwarnings("ignore:.*symmetric and normalized")
def test_the_environment_is_one(actions: ActionMode) -> None:
    from gymnasium.utils.env_checker import check_env

    check_env(drive(make_record(), actions=actions, raster=True), skip_render_check=True)


def test_a_collision_terminates_and_costs() -> None:
    env = drive(make_record(), actions="route")
    env.reset()
    rewards, done = [], False
    while not done:
        _, reward, terminated, truncated, info = env.step(np.zeros(1))
        rewards.append(reward)
        done = terminated or truncated
    assert terminated
    assert info["hit"] == "pedestrian-1"
    assert rewards[-1] < -0.9 < 0.0 < rewards[0]
    with pytest.raises(InputError, match="reset"):
        env.step(np.zeros(1))


@pytest.mark.parametrize(
    ("actions", "action", "said"),
    [
        ("bicycle", [math.nan, 0.0], "finite"),
        ("bicycle", [math.inf, 0.0], "finite"),
        ("bicycle", [1.0], r"shape \(2,\), not \(1,\)"),
        ("route", 1.0, r"shape \(1,\), not \(\)"),
        ("waypoints", np.zeros((2, 6)), r"shape \(6, 2\), not \(2, 6\)"),
        ("route", "faster", "no str"),
        ("route", [10**400], "no list"),
    ],
)
def test_what_is_no_action_is_refused(actions: ActionMode, action: Any, said: str) -> None:
    env = drive(make_record(), actions=actions)
    with pytest.raises(InputError, match="reset"):
        env.step(action)
    env.reset()
    with pytest.raises(InputError, match=said) as caught:
        env.step(action)
    assert "\n" not in str(caught.value)
    assert env.world.step == env.scenario.start


def test_several_are_stepped_together() -> None:
    env = drive_many([make_record()] * 3, actions="route", others="replay")
    seen, _ = env.reset(seed=1)
    assert seen["agents"].shape == (3, 32, 11)
    assert env.step(np.zeros((3, 1)))[1].shape == (3,)
