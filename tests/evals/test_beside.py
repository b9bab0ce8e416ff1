"""What a dataset's diversity is compared with: windows as long and as busy as its scenes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.evals.realism.sources import Stretch
from scenewright.evals.tables.diversity import (
    CorpusWindows,
    compare_speeds,
    match_windows,
    shorten_scene,
)
from scenewright.evals.tables.nearness import ObservedTracks, observe_scenes
from scenewright.scene.track import Track, get_vehicle_shape
from scenewright.tools.relation_checker import RoadUser


def driver(number: int, start: float, until: float, *, speed: float = 5.0) -> RoadUser:
    count = round((until - start) / 0.1) + 1
    xy = np.stack([speed * 0.1 * np.arange(count), np.full(count, 20.0 * number)], axis=1)
    return RoadUser(number, Track(xy, np.zeros(count), start), get_vehicle_shape())


def scene(*starts: float, until: float = 30.0) -> Stretch:
    return Stretch(tuple(driver(k, start, until) for k, start in enumerate(starts)))


def test_a_window_is_as_long_and_as_busy_as_its_scene() -> None:
    windows = [scene(0.0, 1.0, 2.0, 25.0), scene(0.0, 25.0), scene(0.0, 3.0, 21.0)]
    (one,) = match_windows([scene(0.0, 4.0, until=20.0)], windows, least=1)
    assert [user.track.start for user in one.users] == [0.0, 3.0]
    assert max(user.track.end for user in one.users) == pytest.approx(20.0)


def test_windows_that_fit_are_taken_in_turn() -> None:
    windows = [scene(0.0, 1.0), scene(0.0, 2.0), scene(0.0)]
    found = match_windows([scene(0.0, 9.0)], windows, least=4)
    assert [each.users[1].track.start for each in found] == [1.0, 2.0, 1.0, 2.0]


def test_nothing_to_compare_is_nothing() -> None:
    assert match_windows([], [scene(0.0)], least=3) == []
    assert match_windows([scene(0.0)], [], least=3) == []


@given(st.floats(0.0, 12.0), st.floats(0.0, 15.0))
def test_what_is_left_lies_within_the_length(start: float, length: float) -> None:
    cut = shorten_scene(Stretch((driver(0, round(start, 1), 14.0),)), length)
    for user in cut.users:
        assert user.track.end <= length + 1e-6
        assert len(user.track.xy) > 1
    if length - round(start, 1) >= 0.11:
        assert cut.users


def test_a_quiet_dataset_is_as_varied_as_quiet_hours() -> None:
    rng = np.random.default_rng(0)

    def traffic(count: int, low: float) -> Stretch:
        fast = rng.uniform(low, 12.0, count)
        return Stretch(tuple(driver(k, 0.0, 20.0, speed=v) for k, v in enumerate(fast)))

    quiet = [traffic(2, 8.0) for _ in range(30)]
    corpus = [traffic(2, 8.0) for _ in range(30)] + [traffic(9, 1.0) for _ in range(30)]
    watched: list[list[ObservedTracks]] = [
        list(observe_scenes(each, intersection_map=None))
        for each in (quiet, match_windows(quiet, corpus, least=30), corpus)
    ]
    found = compare_speeds(watched[0], CorpusWindows(*watched[1:]), draws=50, seed=0)
    ratio = next(each for each in found if (each.what, each.group) == ("speed", "vehicle"))
    assert ratio.ratio.value == pytest.approx(1.0, abs=0.25)
    assert ratio.ratio_to_whole is not None
    assert ratio.ratio_to_whole < 0.6
