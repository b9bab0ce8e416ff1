"""The judge of realism on motion whose answers are known by hand."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from scenewright.cli.main import main
from scenewright.evals.realism.likelihood import measure_features, score_likelihood
from scenewright.evals.realism.sources import Stretch, TrackSource
from scenewright.evals.realism.street_measures import (
    compute_count_ranks,
    compute_share,
    find_accompanied,
    find_close_followers,
    find_common_starts,
    find_reactions,
)
from scenewright.evals.realism.two_sample import (
    compare_windows,
    compute_auc,
    cut_windows,
    find_constant_speed,
    split_halves,
)
from scenewright.scene.track import PEDESTRIAN, Track, get_vehicle_shape
from scenewright.tools.relation_checker import RoadUser

CAR = get_vehicle_shape("car")
TIMES = 0.1 * np.arange(120)


def along(s: np.ndarray, *, y: float = 0.0, start: float = 0.0) -> Track:
    """Eastwards, at arc lengths [T] [m]."""
    return Track(np.stack([s, np.full(len(s), y)], axis=1), np.zeros(len(s)), start)


def stretch(*tracks: Track, shape=CAR, name: str = "s", **more) -> Stretch:
    users = tuple(RoadUser(k, track, shape) for k, track in enumerate(tracks))
    return Stretch(users, {user.id: name for user in users}, **more)


def source(name: str, spread: float, count: int, *, seed: int) -> TrackSource:
    """Cars at 8 m/s whose speed wavers over some seconds with an amplitude of `spread` m/s."""
    rng = np.random.default_rng(seed)
    made = []
    for k in range(count):
        phase, period = rng.uniform(0, 6.28), rng.uniform(3.0, 6.0)
        speed = rng.uniform(6, 7.5) + spread * np.sin(6.28 * TIMES / period + phase)
        made.append(stretch(along(np.cumsum(speed) * 0.1), name=f"{name} {k}"))
    return TrackSource(name, tuple(made))


def test_an_area_under_the_curve_counts_ties_half() -> None:
    label, ones = np.array([0, 0, 1, 1]), np.ones(4)
    assert compute_auc(np.array([0.1, 0.2, 0.3, 0.4]), label, ones) == 1.0
    assert compute_auc(np.array([0.5, 0.5, 0.5, 0.5]), label, ones) == 0.5
    assert compute_auc(np.array([0.1, 0.3, 0.2, 0.4]), label, ones) == 0.75


def test_who_wavers_is_distinguished_from_who_does_not_and_halves_are_not() -> None:
    even, wavering = (
        cut_windows(source(name, spread, 40, seed=k), "vehicle")
        for k, (name, spread) in enumerate((("a", 0.02), ("b", 0.4)))
    )
    assert compare_windows(even, wavering)["all"].auc.value > 0.95
    assert compare_windows(*split_halves(wavering))["all"].auc.low < 0.6


def test_too_few_windows_say_nothing() -> None:
    few = cut_windows(source("a", 0.1, 3, seed=0), "vehicle")
    assert compare_windows(few, few) == {}


def test_one_speed_is_within_a_twentieth_of_a_metre_per_second() -> None:
    even = cut_windows(TrackSource("e", (stretch(along(8.0 * TIMES)),)), "vehicle")
    rising = cut_windows(
        TrackSource("r", (stretch(along(5.0 * TIMES + 0.1 * TIMES**2)),)), "vehicle"
    )
    assert set(find_constant_speed(even)) == {True}
    assert set(find_constant_speed(rising)) == {False}


@pytest.mark.parametrize(("later", "found"), [(1.5, [False, True]), (2.5, [False, False])])
def test_a_headway_is_the_time_after_who_passed_the_same_place(later: float, found) -> None:
    s = 8.0 * TIMES[:100]
    assert find_close_followers(stretch(along(s), along(s, start=later))) == found
    assert find_close_followers(stretch(along(s), along(s, y=3.5, start=later))) == [False, False]


def test_companions_keep_within_a_metre_and_a_half() -> None:
    s = 1.3 * TIMES
    three = stretch(along(s), along(s, y=1.0), along(s, y=4.0), shape=PEDESTRIAN)
    assert find_accompanied(three) == [True, True, False]


def test_people_set_off_together_within_a_second_and_a_half() -> None:
    def waits(until: float, y: float) -> Track:
        return along(1.3 * np.maximum(TIMES - until, 0.0), y=y)

    crowd = stretch(waits(4.0, 0.0), waits(5.0, 1.0), waits(8.0, 2.0), shape=PEDESTRIAN)
    assert find_common_starts(crowd) == [True, True, False]
    assert find_common_starts(stretch(along(TIMES[:6]), shape=PEDESTRIAN)) == []


def test_a_number_of_people_is_placed_in_its_hour() -> None:
    """Even chances of 0 to 9 vehicles: three of them lie between 0.3 and 0.4."""
    mass = np.full((10, 1), 0.1)
    scene = stretch(*(along(8.0 * TIMES, y=4.0 * k) for k in range(3)), place="x", hour=8)
    found = compute_count_ranks([scene], lambda *_: mass)
    assert 0.3 <= found["vehicle"][0][0] <= 0.4
    assert 0.0 <= found["pedestrian"][0][0] <= 1.0
    assert compute_count_ranks([stretch(along(TIMES))], lambda *_: mass)["vehicle"] == []


def test_who_keeps_its_speed_before_a_collision_does_not_react() -> None:
    brakes = along(8.0 * TIMES - 1.0 * np.maximum(TIMES - 8.0, 0.0) ** 2)
    event = SimpleNamespace(type="collision", from_=0, to=1, time=10.0)
    ((one, other),) = find_reactions(stretch(brakes, along(8.0 * TIMES, y=2.0), events=(event,)))
    assert (one.reacts, other.reacts) == (True, False)
    early = SimpleNamespace(type="collision", from_=0, to=1, time=0.5)
    assert find_reactions(stretch(brakes, brakes, events=(early,))) == []


def test_a_share_has_the_interval_of_its_stretches() -> None:
    share = compute_share([[True, False], [True, True], []])
    assert (share.value, share.n) == (0.75, 4)
    assert share.low <= 0.75 <= share.high
    assert compute_share([[], []]).value is None


def test_motion_is_likelier_under_its_own_kind() -> None:
    slow, fast = (
        measure_features(source(name, spread, 12, seed=3).stretches, "vehicle")
        for name, spread in (("a", 0.05), ("b", 1.5))
    )
    own = score_likelihood(slow[::2], slow[1::2], "vehicle")
    other = score_likelihood(fast, slow[1::2], "vehicle")
    assert 0.0 < other["kinematic"] < own["kinematic"] <= 1.0
    assert "map" not in own


def test_tracks_of_any_origin_are_judged(tmp_path, capsys) -> None:
    rows = ["t,id,class,x,y"]
    rows += [
        f"{t:.1f},{k},car,{8.0 * (t - 3.0 * k) + 0.3 * np.sin(t):.3f},0"
        for k in range(8)
        for t in 3.0 * k + TIMES
    ]
    for name in ("one", "two"):
        (tmp_path / f"{name}.csv").write_text("\n".join(rows), "utf-8")
    one, two, out = (str(tmp_path / each) for each in ("one.csv", "two.csv", "out"))
    words = ["evals", "realism", one, "--real", two, "--out", out, "--json", "-q"]
    assert main(words) == 0
    report = json.loads(capsys.readouterr().out)
    followers = [m for m in report["measures"] if m["name"].startswith("vehicles less than 2 s")]
    assert [m["share"]["value"] for m in followers] == [0.0, 0.0]
    assert {each["source"] for each in report["likelihoods"]} >= {"one", "log replay"}
    assert sorted(f.name for f in (tmp_path / "out").iterdir()) == [
        "realism.json", "realism.md", "realism.png",
    ]  # fmt: skip
    assert main(["evals", "realism", one, "--real", one, "-q"]) == 2
    assert "two data sets are called 'one'" in capsys.readouterr().err
