"""A refiner adapted to recorded tracks: what is learned from, and when it is kept."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright.cli.refiners import GOES_ON, adapt_refiner, compare_errors
from scenewright.intersections import REFINER_WEIGHTS
from scenewright.scene.track import Track
from scenewright.tools.track_io.cleaning import CleaningReport
from scenewright.tools.track_io.track_files import FileTracks


def figures(vehicle: float, *, n: int = 100) -> dict[str, float]:
    return {"vehicle_n": n, "vehicle_ade_waypoints": vehicle, "pedestrian_n": 0}


def recorded(count: int) -> FileTracks:
    """Cars that come one after the other, a second apart, their speed wavering."""
    t = 0.1 * np.arange(150)
    xy = np.stack([7.0 * t + 0.5 * np.sin(t), 0.0 * t], axis=1)
    tracks = tuple(("car", Track(xy, np.zeros(len(t)), 1.0 * k)) for k in range(count))
    return FileTracks("site/a.csv", tracks, CleaningReport(), None, None, 60.0)


def test_weights_are_kept_only_if_no_class_is_worse_for_them() -> None:
    assert compare_errors(figures(0.4), figures(0.3))[1]
    assert not compare_errors(figures(0.4), figures(0.5))[1]
    assert not compare_errors(figures(0.4), figures(0.3, n=3))[1], "three decide nothing"


def test_too_few_tracks_leave_the_weights_that_serve() -> None:
    assert adapt_refiner("amsterdam_120", [recorded(1)], lambda *_: None)[0] == {}


def test_tracks_are_learned_from_and_those_who_come_late_are_held_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(GOES_ON, "epochs", 1)
    made, note = adapt_refiner("amsterdam_120", [recorded(80)], lambda *_: None)
    assert "vehicles held out are off by" in note
    assert bool(made) == note.startswith("the refiner is adapted")
    assert set(made) <= {REFINER_WEIGHTS, "refiner.md"}
