"""Vehicles at a place without a map: which lanes they share, and how they keep to them."""

import os
from pathlib import Path

import numpy as np
import pytest

from scenewright.errors import InputError
from scenewright.tools.fitting.lane_keeping import find_lane_offsets, measure_scale
from scenewright.tools.track_io.track_files import read_track_files

VTP = os.environ.get("SCENEWRIGHT_VTP_TL")
"""A copy of the VTP-TL tracks (docs/own-intersection.md); not part of the project."""
_ACROSS = np.arange(0.0, 80.0, 0.7)


def straight(aside):
    return np.stack([_ACROSS, np.full(len(_ACROSS), aside)], axis=1)


def turning(aside, sign):
    """A quarter circle of 40 m to the left (sign 1) or right (-1)."""
    angle = np.linspace(0.0, np.pi / 2, 120)
    radius = 40.0 - sign * aside
    return np.stack([radius * np.sin(angle), sign * (40.0 - radius * np.cos(angle))], axis=1)


def test_tracks_abreast_are_lanes_and_their_mean_is_the_middle():
    offsets = [-0.3, 0.0, 0.1, 0.2]
    tracks = [straight(lane + offset) for lane in (0.0, 3.3) for offset in offsets]
    found = find_lane_offsets(
        [*tracks, *(turning(o, 1) for o in offsets), *(turning(o, -1) for o in offsets)]
    )
    assert {turn: [len(x) for x in lanes] for turn, lanes in found.items()} == {
        "straight": [4, 4], "left": [4], "right": [4],
    }  # fmt: skip
    for lane in (*found["straight"], *found["left"], *found["right"]):
        assert np.nanmean(lane) == pytest.approx(0.0, abs=0.02)
        assert np.std(lane[:, 4]) == pytest.approx(np.std(offsets, ddof=1), abs=0.03)


def test_a_lane_of_two_and_short_pieces_say_nothing():
    assert find_lane_offsets([straight(0.0), straight(0.2), straight(9.0)[:20]]) == {}


@pytest.mark.parametrize("guess", [0.06, 0.07])
def test_the_width_of_lanes_tells_the_scale_of_pixels(guess):
    pixels = [
        straight(y) / 0.065 for lane in (0.0, 3.25, 6.5) for y in (lane - 0.1, lane, lane + 0.1)
    ]
    assert measure_scale([guess * each for each in pixels], guess) == pytest.approx(0.065, rel=0.02)
    assert measure_scale([guess * each for each in pixels[:3]], guess) is None


def vtp(file, rows):
    file.write_text("".join(f"{f}.0\t{n}.0\t{x:.2f}\t{y:.2f}\t2.0\t0.0\t0.0\t0.0\t22.0\n"
                            for f, n, x, y in rows))  # fmt: skip
    return file


def test_pixels_become_metres_with_y_upwards(tmp_path):
    rows = [(f, 1, 100 + 4.0 * f, 500 - 2.0 * f) for f in range(150)]
    file = vtp(tmp_path / "DJI_1.txt", rows)
    [found] = read_track_files([tmp_path], scale=0.05)
    [(subtype, track)] = found.tracks
    assert subtype == "car"
    assert track.xy[0] == pytest.approx((5.0, -25.0), abs=0.3)
    speed = np.hypot(*(track.xy[20] - track.xy[10]))
    assert speed == pytest.approx(0.05 * 30 * np.hypot(4.0, 2.0), rel=0.02)
    for scale, reason in ((None, "pixels"), (0.0, "scale"), (50.0, "scale")):
        with pytest.raises(InputError, match=reason):
            read_track_files([file], scale=scale)


def test_a_torn_row_is_named(tmp_path):
    file = vtp(tmp_path / "DJI_1.txt", [(f, 1, f, f) for f in range(3)])
    file.write_text(file.read_text() + "3.0\t1.0\tnan\n")
    with pytest.raises(InputError, match="line 4"):
        read_track_files([file], scale=0.05)


@pytest.mark.skipif(VTP is None, reason="SCENEWRIGHT_VTP_TL names no copy of the data set")
def test_real_tracks_in_pixels_are_lanes_a_lane_apart():
    for file in read_track_files([Path(str(VTP))], scale=0.065):
        tracks = [track.xy for _, track in file.tracks]
        assert sum(len(lane) for lanes in find_lane_offsets(tracks).values() for lane in lanes) > 30
        assert measure_scale(tracks, 0.065) == pytest.approx(0.075, abs=0.012)
