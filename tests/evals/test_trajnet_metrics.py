"""The benchmark's measures on paths whose answers are known by hand."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright.evals.trajnet.score import compute_displacement, find_collisions

STEPS = np.arange(12)[:, None]
NAN = np.full((12, 2), np.nan)


def walk(start: tuple[float, float], velocity: tuple[float, float]) -> np.ndarray:
    return np.array(start) + STEPS * np.array(velocity)


def test_displacement_of_a_path_that_drifts_evenly() -> None:
    truth = walk((0, 0), (1, 0))
    ade, fde = compute_displacement(truth + 0.1 * STEPS * np.array([0.6, 0.8]), truth)
    assert ade == pytest.approx(0.1 * 5.5)
    assert fde == pytest.approx(1.1)


def test_two_who_meet_head_on_collide_between_the_steps() -> None:
    """At no step closer than 0.4 m, but in the same place halfway between steps 5 and 6."""
    east, west = walk((-2.2, 0), (0.4, 0)), walk((2.2, 0), (-0.4, 0))
    at_steps = np.linalg.norm(east - west, axis=1)
    assert at_steps.min() == pytest.approx(0.4)
    assert find_collisions(east, west[None]).tolist() == [True]


def test_what_happens_at_a_third_of_a_step_is_not_seen() -> None:
    """Halves alone are looked at, as the benchmark does with its two sub-intervals."""
    east = walk((-6.0, 0), (1.2, 0))
    meeting = np.array([-6.0 + 1.2 * 5 + 0.4, 0.0])
    north = meeting + (STEPS - (5 + 1 / 3)) * np.array([0, 1.2])
    assert find_collisions(east, north[None]).tolist() == [False]


@pytest.mark.parametrize(("gap", "hit"), [(0.19, True), (0.2, True), (0.21, False)])
def test_two_side_by_side_touch_at_a_fifth_of_a_metre(gap: float, hit: bool) -> None:
    one = walk((0, 0), (0.5, 0))
    assert find_collisions(one, (one + np.array((0.0, gap)))[None]).tolist() == [hit]


def test_the_unseen_never_collide() -> None:
    one = walk((0, 0), (0.5, 0))
    once = NAN.copy()
    once[4] = one[4]
    assert find_collisions(one, np.stack([NAN, once])).tolist() == [False, False]


def test_steps_on_either_side_of_a_gap_follow_each_other() -> None:
    """Seen only at steps 2 and 8, three metres left and right: halfway between is a collision."""
    one = np.zeros((12, 2))
    other = NAN.copy()
    other[2], other[8] = (-3, 0), (3, 0)
    assert find_collisions(one, other[None]).tolist() == [True]
    other[8] = (-3, 1)
    assert find_collisions(one, other[None]).tolist() == [False]


def test_no_agent_around() -> None:
    assert find_collisions(walk((0, 0), (1, 0)), np.empty((0, 12, 2))).shape == (0,)
