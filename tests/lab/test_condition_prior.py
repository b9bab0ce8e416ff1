"""p_wp of the rest of a way: what a part of it that was seen tells, and what it does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab.rollouts.condition_prior import NOISE, condition_prior
from scenewright.geometry.spline import DENSE, PER_INTERVAL
from scenewright.scene.candidates import K
from scenewright.tools.gmm_sampler.priors import DIMENSIONS, WaypointPrior

SPREAD = 0.8
LENGTH = 2.0


def straight(*beside: float) -> WaypointPrior:
    """Lanes eastwards, 90 m, so far to the left; neighbouring waypoints deviate alike."""
    k = np.arange(K)
    alike = np.exp(-0.5 * (np.subtract.outer(k, k) / LENGTH) ** 2)
    spread = np.kron(SPREAD**2 * alike + 1e-6 * np.eye(K), np.eye(2))
    base = np.array([np.column_stack([np.linspace(0, 90, DENSE), np.full(DENSE, y)])
                     for y in beside])  # fmt: skip
    count = len(beside)
    return WaypointPrior(
        "way",
        np.full(count, 1.0 / count),
        base[:, ::PER_INTERVAL].reshape(count, DIMENSIONS),
        np.tile(np.linalg.cholesky(spread), (count, 1, 1)),
        base,
        100,
    )


def spread_of(prior: WaypointPrior) -> np.ndarray:
    """[K] standard deviation to the left at the waypoints of the first component [m]."""
    return np.sqrt(np.diag(prior.cholesky[0] @ prior.cholesky[0].T)[1::2])


def test_a_waypoint_that_was_seen_moves_the_others_as_far_as_they_go_alike():
    rest = condition_prior(straight(0.0), np.array([[30.0, 1.0]]))
    share = SPREAD**2 / (SPREAD**2 + NOISE**2)
    alike = np.exp(-0.5 * ((np.arange(K) - 3) / LENGTH) ** 2)
    assert rest.means[0, 1::2] == pytest.approx(share * alike, abs=1e-4)
    assert rest.means[0, 0::2] == pytest.approx(np.arange(K) * 10.0)
    left = SPREAD**2 * (1 - share * alike**2)
    assert spread_of(rest) ** 2 == pytest.approx(left, abs=1e-4)
    assert rest.base[0, ::PER_INTERVAL].ravel() == pytest.approx(rest.means[0])


def test_nothing_seen_and_what_lies_beyond_the_ends_say_nothing():
    prior = straight(0.0, 3.5)
    for seen in (np.zeros((0, 2)), np.array([[-20.0, 1.0], [120.0, 1.0]])):
        rest = condition_prior(prior, seen)
        assert rest.weights == pytest.approx(prior.weights)
        assert rest.means == pytest.approx(prior.means)
        assert rest.cholesky == pytest.approx(prior.cholesky, abs=1e-9)


def test_a_lane_that_was_seen_to_be_driven_is_the_likely_one():
    seen = np.column_stack([np.linspace(5.0, 25.0, 9), np.full(9, 3.4)])
    rest = condition_prior(straight(0.0, 3.5), seen)
    assert rest.weights[1] > 0.99


@given(
    begin=st.floats(1.0, 50.0),
    way=st.floats(1.0, 38.0),
    beside=st.floats(-2.0, 2.0),
    count=st.integers(1, 20),
)
def test_whatever_is_seen_doubt_shrinks_and_weights_stay_a_mixture(begin, way, beside, count):
    prior = straight(0.0, 1.0)
    seen = np.column_stack([np.linspace(begin, begin + way, count), np.full(count, beside)])
    rest = condition_prior(prior, seen)
    assert rest.weights.sum() == pytest.approx(1.0)
    assert np.isfinite(rest.means).all()
    assert (spread_of(rest) <= spread_of(prior) + 1e-9).all()


def test_who_stands_tells_no_more_than_its_place():
    prior, place = straight(0.0), np.array([[30.0, 1.0]])
    rng = np.random.default_rng(2)
    still = place + rng.normal(0.0, 0.05, (40, 2))
    still[0] = place[0]
    assert spread_of(condition_prior(prior, still)) == pytest.approx(
        spread_of(condition_prior(prior, place))
    )


def test_lanes_that_begin_later_are_not_likelier_for_having_been_seen_less():
    """A component whose curve begins beyond what was seen must not win for want of evidence."""
    both = straight(0.0, 3.5)
    base = both.base.copy()
    base[1, :, 0] = np.linspace(30.0, 90.0, DENSE)
    late = replace(both, base=base, means=base[:, ::PER_INTERVAL].reshape(2, DIMENSIONS))
    seen = np.column_stack([np.linspace(5.0, 45.0, 9), np.full(9, 2.0)])
    beyond = seen[seen[:, 0] > 30.0]
    assert condition_prior(late, seen).weights == pytest.approx(
        condition_prior(late, beyond).weights
    )
    assert condition_prior(late, seen).weights[1] > 0.5
