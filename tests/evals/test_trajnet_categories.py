"""The four types and four subtypes on scenes that are plainly one of them."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright.evals.trajnet.score import (
    AVOIDANCE,
    GROUP,
    INTERACTING,
    LEADER_FOLLOWER,
    LINEAR,
    OTHER,
    OTHER_INTERACTION,
    STATIC,
    categorise,
    filter_path,
)

T = np.arange(21)[:, None] - 8.0
NOBODY = np.empty((0, 21, 2))


def straight(speed: float = 0.5) -> np.ndarray:
    return T * np.array([speed, 0.0])


def stopping() -> np.ndarray:
    """Walks as above while observed, then takes steps half as long."""
    return np.where(T > 0, 0.5, 1.0) * straight()


def turned(path: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return path @ np.array([[c, s], [-s, c]])


def test_static_and_linear() -> None:
    assert categorise(straight(0.045), NOBODY) == (STATIC, ())
    assert categorise(straight(), NOBODY) == (LINEAR, ())


def test_no_agent_explains_it() -> None:
    far_behind = straight() - np.array((9.0, 0.0))
    assert categorise(stopping(), NOBODY) == (OTHER, ())
    assert categorise(stopping(), far_behind[None]) == (OTHER, ())


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5, -3.0])
def test_interactions(angle: float) -> None:
    me = stopping()
    leader = me + np.array((1.5, 0.0))
    oncoming = np.array([5.0, 0.1]) - straight()
    partner = me + np.array((0.0, 0.6))
    crossing = T * np.array([0.0, 0.5]) + (4.0, -3.0)
    expected = {
        (LEADER_FOLLOWER,): [leader],
        (AVOIDANCE,): [oncoming],
        (GROUP,): [partner],
        (OTHER_INTERACTION,): [crossing],
        (LEADER_FOLLOWER, GROUP): [leader, partner],
    }
    for subtypes, others in expected.items():
        there = np.stack([turned(path, angle) for path in others])
        assert categorise(turned(me, angle), there) == (INTERACTING, subtypes)


def test_a_partner_seen_only_for_a_while_makes_no_group() -> None:
    partner = stopping() + np.array((0.0, 0.6))
    partner[:3] = np.nan
    assert categorise(stopping(), partner[None]) == (OTHER, ())


def test_the_filter_goes_on_as_before() -> None:
    """After nine steps of even motion it knows the speed to a few per cent."""
    ahead = filter_path(straight()[:9], steps=12)
    assert ahead[:, 1] == pytest.approx(0.0)
    assert ahead[-1, 0] == pytest.approx(6.0, abs=0.15)
    assert np.diff(ahead[:, 0], n=2) == pytest.approx(0.0)
