"""Refining a scene: the roll-out under guidance, and the layer that keeps it feasible."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refiner_networks import build_random_network, build_zero_network, convert_network
from scenewright.intersections import REFINER_WEIGHTS, find_bundle_folder
from scenewright.scene.candidates import Path
from scenewright.scene.track import STEP, Track
from scenewright.tools.trajnet_refiner.config import RefinerConfig
from scenewright.tools.trajnet_refiner.guided import (
    Guide,
    compute_deviation,
    compute_deviations,
    draw_ripple,
)
from scenewright.tools.trajnet_refiner.kinematic_layer import (
    LIMITS,
    SMOOTHING,
    find_free_parts,
    limit_deviation,
    smooth_proposal,
)
from scenewright.tools.trajnet_refiner.store import load_refiner

SMALL = RefinerConfig(
    hidden=16, embedding=8, pooled=8, neighbours=4, apart=None, mirrored=False, stride=2
)
ZERO = convert_network(build_zero_network(SMALL))
RANDOM = convert_network(build_random_network(SMALL))


def straight(length: float = 200.0, *, y: float = 0.0, x: float = 0.0) -> Path:
    s = np.arange(0.0, length + 1e-9, 0.5)
    xy = np.column_stack([x + s, np.full_like(s, y)])
    return Path(xy, s, np.zeros_like(s), np.zeros_like(s))


def corner(radius: float = 10.0) -> Path:
    """40 m straight, a quarter circle to the left, 40 m straight."""
    bend = radius * np.pi / 2
    s = np.arange(0.0, 80.0 + bend, 0.5)
    heading = np.clip((s - 40.0) / radius, 0.0, np.pi / 2)
    step = np.column_stack([np.cos(heading), np.sin(heading)]) * 0.5
    xy = np.concatenate([[[0.0, 0.0]], np.cumsum(step[:-1], axis=0)])
    inside = (s > 40.0) & (s < 40.0 + bend)
    return Path(xy, s, heading, np.where(inside, 1.0 / radius, 0.0))


def stop_and_go(seconds: float = 20.0, speed: float = 8.0, rate: float = 2.0) -> np.ndarray:
    """Even speed, braking at `rate` [m/s^2] to a standstill of 4 s, starting at the same."""
    ramp = speed / rate
    times = np.array([0.0, 5.0, 5.0 + ramp, 9.0 + ramp, 9.0 + 2 * ramp, 99.0])
    v = np.interp(
        STEP * np.arange(round(seconds / STEP)), times, [speed, speed, 0, 0, speed, speed]
    )
    return np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * STEP)])


def rates(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    v = np.gradient(s, STEP)
    wide = np.pad(v, 2, mode="edge")
    return v, (wide[4:] + wide[3:-1] - wide[1:-3] - wide[:-4]) / (6 * STEP)


def waves(n: int, heights: list[float], periods: list[float]) -> np.ndarray:
    t = STEP * np.arange(n)
    return np.sum(
        [h * np.sin(2 * np.pi * t / p) for h, p in zip(heights, periods, strict=True)], axis=0
    )


@given(
    heights=st.lists(st.floats(-5, 5), min_size=3, max_size=3),
    periods=st.lists(st.floats(0.8, 20), min_size=3, max_size=3),
)
def test_whatever_is_proposed_the_result_keeps_the_limits_and_the_standstill(heights, periods):
    prior = stop_and_go()
    kept = rates(prior)[0] <= 0.3
    s, share = limit_deviation(
        prior, waves(len(prior), heights, periods), kept=kept, path=straight(), kind="vehicle"
    )
    v, a = rates(s)
    limits = LIMITS["vehicle"]
    assert np.diff(s).min() >= -1e-9
    assert v.max() <= limits.speed + 1e-6
    assert a.max() <= limits.acceleration + 1e-6
    assert -a.min() <= limits.braking + 1e-6
    assert np.array_equal(s[kept], prior[kept])
    assert not share[kept].any()


@given(height=st.floats(-3, 3), period=st.floats(2, 10))
def test_a_curve_is_not_taken_faster_than_its_lateral_limit(height, period):
    path, speed = corner(), 5.0
    prior = speed * STEP * np.arange(round(path.length / speed / STEP))
    kept = np.zeros(len(prior), dtype=bool)
    kept[:8] = True
    s, _ = limit_deviation(
        prior, waves(len(prior), [height], [period]), kept=kept, path=path, kind="vehicle"
    )
    curvature = np.interp(s, path.s, path.curvature)
    assert (rates(s)[0] ** 2 * curvature).max() <= LIMITS["vehicle"].lateral + 1e-6


def test_one_stretch_that_asks_too_much_costs_no_other_its_share():
    prior = stop_and_go(rate=1.6)
    kept = rates(prior)[0] <= 0.3
    before, after = find_free_parts(kept)
    wish = np.zeros(len(prior))
    wish[before] = 20.0 * np.sin(np.linspace(0, np.pi, before.stop - before.start)) ** 2
    wish[after] = 0.3 * np.sin(np.linspace(0, np.pi, after.stop - after.start)) ** 2
    _, share = limit_deviation(prior, wish, kept=kept, path=straight(), kind="vehicle")
    assert share[before].max() < 1.0
    assert (share[after] == 1.0).all()


def test_even_motion_stays_as_it_is_and_jitter_goes():
    prior = 1.3 * STEP * np.arange(200)
    kept = np.zeros(200, dtype=bool)
    same = smooth_proposal(prior, prior, kept=kept, over=SMOOTHING["pedestrian"])
    assert same == pytest.approx(prior, abs=1e-6)
    jitter = 0.05 * np.cos(np.pi * np.arange(200))
    calm = smooth_proposal(prior + jitter, prior, kept=kept, over=SMOOTHING["pedestrian"])
    assert np.abs(calm - prior)[20:-20].max() < 0.001


def test_people_stop_and_start_more_softly_than_they_walk():
    prior = stop_and_go(rate=1.6)
    kept = rates(prior)[0] <= 0.3
    stands = np.flatnonzero(kept)
    wave = 0.1 * np.sin(2.0 * np.pi * STEP * np.arange(len(prior)) / 2.0)
    alike, soft = (
        smooth_proposal(prior + wave, prior, kept=kept, over=(1.5, near)) for near in (1.5, 3.5)
    )
    assert soft[kept] == pytest.approx(prior[kept], abs=1e-6)
    rough, calm = (np.abs(np.diff(each - prior, 3)) for each in (alike, soft))
    for near in (slice(stands[0] - 25, stands[0] - 3), slice(stands[-1] + 1, stands[-1] + 23)):
        assert calm[near].max() < 0.6 * rough[near].max()
    assert calm[: stands[0] - 60].max() == pytest.approx(rough[: stands[0] - 60].max(), rel=0.1)


def test_who_gets_to_the_end_of_its_path_sooner_leaves_sooner():
    path = straight(50.0)
    prior = np.linspace(0.0, 50.0, 64)
    kept = np.zeros(64, dtype=bool)
    kept[:8] = True
    ahead = np.linspace(0.0, 2.0, 64)
    s, _ = limit_deviation(prior, ahead, kept=kept, path=path, kind="vehicle")
    assert len(s) < 64
    assert s[-1] <= path.length


def test_who_is_not_at_the_end_of_its_path_when_its_prior_leaves_goes_on_to_it():
    path = straight(50.0)
    prior = np.linspace(0.0, 50.0, 64)
    kept = np.zeros(64, dtype=bool)
    kept[:8] = True
    behind = np.linspace(0.0, -3.0, 64)
    s, share = limit_deviation(prior, behind, kept=kept, path=path, kind="vehicle")
    assert share.any()
    assert len(s) > 64
    pace = s[63] - s[62]
    assert np.diff(s[62:]) == pytest.approx(np.full(len(s) - 63, pace))
    assert path.length - pace < s[-1] <= path.length
    # Whose prior ends on its way, in a wreck, say, is not carried on.
    short, _ = limit_deviation(0.8 * prior, behind, kept=kept, path=path, kind="vehicle")
    assert len(short) == 64


def test_no_share_leaves_the_prior_untouched():
    prior = stop_and_go()
    kept = np.zeros(len(prior), dtype=bool)
    s, share = limit_deviation(
        prior, np.ones(len(prior)), kept=kept, path=straight(), kind="vehicle", most=0.0
    )
    assert np.array_equal(s, prior)
    assert not share.any()


@given(st.integers(0, 99), st.sampled_from([0.25, 0.5]))
def test_who_is_supervised_more_strongly_moves_less(seed, most):
    """Everywhere, even where a smaller proposal would have passed the limits."""
    prior = stop_and_go(rate=1.6)
    kept = rates(prior)[0] <= 0.3
    knots = np.random.default_rng(seed).uniform(-6.0, 6.0, 9)
    wish = np.interp(np.arange(len(prior)), np.linspace(0, len(prior), 9), knots)
    whole, share = limit_deviation(prior, wish, kept=kept, path=straight(), kind="vehicle")
    less, smaller = limit_deviation(
        prior, wish, kept=kept, path=straight(), kind="vehicle", most=most
    )
    assert (smaller <= most * share + 1e-9).all()
    n = min(len(whole), len(less), len(prior))
    assert (np.abs(less - prior[:n])[:n] <= np.abs(whole - prior[:n])[:n] + 1e-6).all()


def test_only_whom_a_relation_is_about_is_told_where_to_be_just_before_it_stands():
    """Who has learned nothing goes evenly from waypoint to waypoint: at 4 s, 8 s, standing."""
    s = stop_and_go()
    kept = rates(s)[0] <= 0.3
    kept[:8] = True
    off = {}
    for bound in (True, False):
        one = Guide("vehicle", straight(), s, 0.0, kept, bound=bound)
        off[bound] = compute_deviations(ZERO, {"a": one}, duration=20.0)["a"][80]
    assert abs(off[True]) < 1.0
    assert off[False] < -2.0


def guide(path: Path, speed: float, *, enters: float = 0.0, kind: str = "vehicle") -> Guide:
    s = speed * STEP * np.arange(int(path.length / speed / STEP))
    kept = np.zeros(len(s), dtype=bool)
    kept[:8] = True
    return Guide(kind, path, s, enters, kept)  # type: ignore[arg-type]


@pytest.mark.parametrize("path", [straight(), corner()], ids=["straight", "corner"])
def test_who_has_learned_nothing_follows_an_even_prior(path):
    found = compute_deviations(
        ZERO,
        {"a": guide(path, 5.0, enters=1.3)},
        duration=20.0,
    )
    bound = 0.01 if path.curvature.max() == 0 else 3.0  # without a map a curve is cut
    assert np.abs(found["a"]).max() < bound


def test_the_same_draws_give_the_same_motion():
    scene = {"a": guide(straight(), 6.0), "b": guide(straight(y=3.5), 8.0, enters=2.0)}
    first = compute_deviations(
        RANDOM,
        scene,
        duration=15.0,
        rng=np.random.default_rng(1),
    )
    second = compute_deviations(
        RANDOM,
        scene,
        duration=15.0,
        rng=np.random.default_rng(1),
    )
    other = compute_deviations(
        RANDOM,
        scene,
        duration=15.0,
        rng=np.random.default_rng(2),
    )
    for name in scene:
        assert np.array_equal(first[name], second[name])
        assert not np.array_equal(first[name], other[name])


def test_who_is_fixed_stays_so():
    scene = {"a": guide(straight(), 6.0), "b": guide(straight(y=3.5), 8.0)}
    given = 0.2 * np.sin(np.linspace(0, 6, len(scene["a"].s)))
    found = compute_deviations(RANDOM, scene, duration=15.0, fixed={"a": given})
    inside = STEP * np.arange(len(given)) <= 15.0
    assert found["a"][inside] == pytest.approx(given[inside], abs=0.01)


def test_a_track_says_how_far_it_is_ahead():
    one = guide(corner(), 5.0, enters=2.0)
    ahead = np.linspace(0.0, 1.5, len(one.s))
    s = np.minimum(one.s + ahead, one.path.length)
    xy = np.column_stack([np.interp(s, one.path.s, one.path.xy[:, k]) for k in (0, 1)])
    found = compute_deviation(one, Track(xy, np.zeros(len(xy)), 2.0))
    assert found == pytest.approx(s - one.s, abs=0.02)


shipped = pytest.mark.skipif(
    not (find_bundle_folder("amsterdam_120") / REFINER_WEIGHTS).is_file(),
    reason="no weights shipped",
)


@shipped
def test_who_is_ahead_of_its_prior_is_past_the_end_of_its_path_and_does_not_wait_there() -> None:
    one = guide(straight(50.0), 10.0)
    times = np.arange(0.0, 4.8, 0.1)
    xy = np.column_stack([10.0 * times + 4.0, np.zeros_like(times)])
    found = compute_deviation(one, Track(xy, np.zeros(len(xy)), 0.0))
    assert found[: len(times)] == pytest.approx(np.full(len(times), 4.0))


def test_take_the_leader_away_and_its_follower_moves_otherwise_and_nobody_far_away():
    """A slow leader ahead; somebody else 120 m away; the network as shipped."""
    net = load_refiner(find_bundle_folder("amsterdam_120") / REFINER_WEIGHTS)
    everybody = {
        "follower": guide(straight(), 8.0),
        "leader": guide(straight(x=14.0), 5.0),
        "stranger": guide(straight(y=120.0), 8.0),
    }
    together = compute_deviations(net, everybody, duration=12.0)
    alone = compute_deviations(
        net, {n: g for n, g in everybody.items() if n != "leader"}, duration=12.0
    )
    changed = {name: np.abs(together[name] - alone[name]).max() for name in alone}
    assert changed["follower"] > 0.1
    assert changed["stranger"] < 1e-3
    # While the leader is near, the follower is held back.
    assert together["follower"][30:60].mean() < alone["follower"][30:60].mean()


def test_a_ripple_is_as_strong_as_fitted_and_leaves_what_is_kept() -> None:
    prior = 1.0 + 0.8 * np.arange(400.0)
    ripples = [draw_ripple(prior, np.random.default_rng(seed)) for seed in range(40)]
    speed = np.gradient(np.array(ripples), 0.1, axis=1)
    assert np.median(speed.std(axis=1)) == pytest.approx(0.15, rel=0.25)
    assert np.median(np.gradient(speed, 0.1, axis=1).std(axis=1)) == pytest.approx(0.2, rel=0.25)
    kept = np.zeros(400, dtype=np.bool_)
    kept[150:200] = True

    more = {"path": straight(400.0), "kind": "vehicle", "ripple": ripples[0]}
    s, share = limit_deviation(prior, np.zeros(400), kept=kept, **more)

    assert (s[150:200] == prior[150:200]).all()
    assert np.abs(s[:130] - prior[:130]).max() > 0.05
    assert share[:150].min() > 0.0
    every = np.ones(400, dtype=np.bool_)
    s, share = limit_deviation(prior, np.zeros(400), kept=every, steady=kept, **more)
    assert (s[150:200] == prior[150:200]).all()
    assert np.abs(s[:130] - prior[:130]).max() > 0.05
    assert share.max() == 0.0


def test_who_stands_does_not_ripple() -> None:
    assert np.abs(draw_ripple(np.zeros(100), np.random.default_rng(0))).max() == 0.0
