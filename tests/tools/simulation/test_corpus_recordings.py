"""Simulated traffic as recordings: where agents are, and until when it flows."""

import numpy as np
import pytest

from scenewright.scene.track import STEP, Track, get_vehicle_shape
from scenewright.tools.simulation.corpus import Trip, build_track, find_jam_time
from scenewright.tools.simulation.sumo_run import HOUR
from scenewright.tools.track_io import RecordedAgent


def test_a_trip_is_where_its_progress_says():
    path = np.column_stack([np.zeros(41), np.arange(41) * 0.5])
    trip = Trip("vehicle:r", "car", path, np.array([0.0, 1.0, 1.0, 20.0]), 7.3)
    track = build_track(trip)
    assert track.start == 7.3
    assert track.xy[:, 1].tolist() == [0.0, 1.0, 1.0, 20.0]
    assert track.heading == pytest.approx(np.pi / 2)


def standing(seconds, *, start=100.0):
    """Drives 5 s, stands, drives 5 s."""
    still = round(seconds / STEP)
    s = np.concatenate([np.linspace(0, 40, 50), np.full(still, 40.0), np.linspace(40, 80, 50)])
    xy = np.column_stack([s, np.zeros_like(s)])
    return RecordedAgent(Track(xy, np.zeros(len(s)), start), get_vehicle_shape())


def test_traffic_flows_until_somebody_is_stuck():
    assert find_jam_time([standing(100.0), standing(30.0)]) == HOUR
    assert find_jam_time([standing(100.0), standing(400.0)]) == pytest.approx(105.0, abs=0.3)
    assert find_jam_time([]) == HOUR
