"""Who comes too close to another by being refined: on straight tracks, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright.nodes.trajectory_refiner.spacing import find_crowded
from scenewright.scene.track import PEDESTRIAN, STEP, Track, get_vehicle_shape

CAR = get_vehicle_shape("car")
TIMES = STEP * np.arange(101)


def drive(ahead: float, *, start: float = 0.0, aside: float = 0.0) -> Track:
    """Eastwards at 8 m/s."""
    xy = np.column_stack([ahead + 8.0 * TIMES, np.full(len(TIMES), aside)])
    return Track(xy, np.zeros(len(TIMES)), start)


@pytest.mark.parametrize(
    ("nearer", "crowded"), [(0.0, False), (2.0, False), (5.0, True), (8.0, True)]
)
def test_vehicles_keep_their_headway_in_a_lane(nearer, crowded):
    """Unrefined it is (16 - 4.6) / 8 = 1.4 s."""
    edited = {"a": drive(0.0), "b": drive(16.0), "c": drive(60.0)}
    found = find_crowded(edited | {"a": drive(nearer)}, edited, dict.fromkeys(edited, CAR))
    assert found == (frozenset("ab") if crowded else frozenset())


def test_who_was_as_close_unrefined_is_not_crowded():
    tracks = {"a": drive(0.0), "b": drive(7.0)}
    assert not find_crowded(tracks, tracks, dict.fromkeys(tracks, CAR))


def test_vehicles_in_lanes_beside_one_another_are_no_crowd():
    edited = {"a": drive(0.0), "b": drive(20.0, aside=3.2)}
    refined = edited | {"a": drive(18.0)}
    assert not find_crowded(refined, edited, dict.fromkeys(edited, CAR))


def test_a_pedestrian_beside_a_vehicle_is_crowded_and_beside_another_is_not():
    edited = {"a": drive(0.0), "b": drive(0.0, aside=3.0)}
    refined = edited | {"b": drive(0.0, aside=1.4)}
    assert find_crowded(refined, edited, {"a": CAR, "b": PEDESTRIAN}) == frozenset("ab")
    assert not find_crowded(refined, edited, dict.fromkeys(edited, PEDESTRIAN))


def test_those_who_are_never_there_at_once_are_no_crowd():
    edited = {"a": drive(0.0), "b": drive(16.0)}
    refined = {"a": drive(0.0), "b": drive(-80.0, start=10.1)}
    assert not find_crowded(refined, edited, dict.fromkeys(edited, CAR))
