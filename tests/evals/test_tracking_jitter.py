"""The jitter of a recording's tracking, measured on tracks that jitter by a known amount."""

import numpy as np
import pytest

from scenewright.evals.realism.assessment import (
    TrackingJitter,
    add_jitter,
    measure_tracking_jitter,
)
from scenewright.evals.realism.sources import Stretch, TrackSource
from scenewright.scene.track import PEDESTRIAN, Track, get_vehicle_shape
from scenewright.tools.relation_checker import RoadUser


def build_source(shape, *, speed: float = 0.0) -> TrackSource:
    way = speed * 0.1 * np.arange(200)
    users = tuple(
        RoadUser(k, Track(np.stack((way + 8.0 * k, 0.0 * way), axis=1), 0.0 * way, 0.0), shape)
        for k in range(40)
    )
    return TrackSource("still", (Stretch(users, dict.fromkeys(range(40), "a")),))


def test_the_jitter_that_was_added_is_measured() -> None:
    added = TrackingJitter(0.02, 0.2)
    jittering = add_jitter(build_source(get_vehicle_shape("car")), added, seed=1)

    found = measure_tracking_jitter(jittering)

    assert found is not None
    # What it does over seconds goes with the smoothed place.
    assert found.spread == pytest.approx(0.02, rel=0.25)
    assert found.lasts == pytest.approx(0.2, rel=0.4)


def test_without_standing_vehicles_or_without_jitter_none_is_found() -> None:
    car = get_vehicle_shape("car")
    assert measure_tracking_jitter(build_source(car)) is None
    moving = add_jitter(build_source(car, speed=5.0), TrackingJitter(0.02, 0.2), seed=1)
    assert measure_tracking_jitter(moving) is None


def test_pedestrians_stay_where_they_are() -> None:
    still = build_source(PEDESTRIAN)
    same = add_jitter(still, TrackingJitter(0.1, 0.2), seed=1)
    assert all(
        (one.track.xy == other.track.xy).all()
        for one, other in zip(still.stretches[0].users, same.stretches[0].users, strict=True)
    )
