"""Recordings: whole tracks on one clock, kept, cut into scenes, differentiated, cleaned."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.errors import InputError
from scenewright.geometry.kinematics import compute_kinematics
from scenewright.scene.track import PEDESTRIAN, STEP, Track, get_vehicle_shape
from scenewright.tools.relation_checker import RoadUser, build_trajectory
from scenewright.tools.track_io import (
    RecordedAgent,
    Recording,
    cut_windows,
    load_recordings,
    save_recordings,
)
from scenewright.tools.track_io.cleaning import (
    CleaningReport,
    RawTrack,
    clean_track,
    compute_course,
)
from scenewright.tools.track_io.taf_bw import read_taf_bw

TAF_BW = os.environ.get("SCENEWRIGHT_TAF_BW", "")
HEADER = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width\n"


def straight(start, count, *, speed=5.0, y=0.0):
    """Along x at constant speed; x is speed times the time of the recording."""
    times = start + STEP * np.arange(count)
    return Track(np.column_stack([speed * times, np.full(count, y)]), np.zeros(count), start)


def agent(track, *, shape=None, **labels):
    return RecordedAgent(track, shape or get_vehicle_shape(), **labels)


@pytest.fixture
def recording():
    """One there all the time, one that comes at 2.0 s and goes at 5.0 s, one after the end."""
    return Recording(
        "here",
        0.0,
        20.0,
        (
            agent(straight(0.0, 201), subtype="car", entry="north", exit="south", route="r"),
            agent(straight(2.0, 31, y=3.0), shape=PEDESTRIAN, crosswalk="west", complete=False),
            agent(straight(30.0, 10, y=9.0), subtype="bus"),
        ),
        split="test",
        unseen=2,
        signal_time=1.5,
    )


def test_a_file_gives_back_what_was_kept(recording, tmp_path):
    other = Recording("empty", 5.0, 6.0, ())
    save_recordings(tmp_path / "deep" / "r.npz", [recording, other])
    first, second = load_recordings(tmp_path / "deep" / "r.npz")
    assert (first.name, first.begin, first.end, first.split) == ("here", 0.0, 20.0, "test")
    assert (first.unseen, first.signal_time) == (2, 1.5)
    assert (second.split, second.signal_time, second.agents) == (None, None, ())
    for kept, was in zip(first.agents, recording.agents, strict=True):
        assert np.abs(kept.track.xy - was.track.xy).max() <= 0.5e-4 + 1e-9
        assert np.abs(kept.track.heading - was.track.heading).max() <= 0.5e-4 + 1e-9
        assert kept.track.start == was.track.start
        assert kept.shape == was.shape
        for label in ("subtype", "entry", "exit", "crosswalk", "route", "complete"):
            assert getattr(kept, label) == getattr(was, label)


def test_one_split_can_be_read_alone(recording, tmp_path):
    save_recordings(tmp_path / "r.npz", [recording, Recording("fitted", 0.0, 1.0, (), "fit")])
    assert [r.name for r in load_recordings(tmp_path / "r.npz", split="fit")] == ["fitted"]


def test_a_file_that_holds_no_recordings_is_one_clear_line(tmp_path):
    (tmp_path / "text.npz").write_text("no arrays")
    np.savez(tmp_path / "other.npz", a=np.zeros(1))
    for name in ("text.npz", "other.npz", "missing.npz"):
        with pytest.raises(InputError, match=name):
            load_recordings(tmp_path / name)


def test_a_track_off_the_grid_of_times_is_refused():
    with pytest.raises(ValueError, match=r"0\.1 s"):
        agent(straight(0.05, 5))


def test_a_window_holds_everybody_with_the_right_positions(recording):
    first, second = cut_windows(recording, steps=21, every=4)
    assert (first.start, second.start) == (0.0, 8.4)
    assert first.members.tolist() == [0, 1]
    assert second.members.tolist() == [0]
    times = first.start + first.step * np.arange(21)
    assert first.whole.tolist() == [True, False]
    assert first.present[1].tolist() == [bool(2.0 <= t <= 5.0 + 1e-9) for t in times]
    assert first.xy[0, :, 0] == pytest.approx(5.0 * times)
    assert first.xy[1][first.present[1]][:, 0] == pytest.approx(5.0 * times[first.present[1]])
    assert not first.xy[1][~first.present[1]].any()


def test_fine_and_coarse_windows_agree(recording):
    fine = next(cut_windows(recording, steps=81, every=1))
    coarse = next(cut_windows(recording, steps=21, every=4))
    seen = fine.present[:, ::4].any(axis=1)
    assert fine.members[seen].tolist() == coarse.members.tolist()
    assert coarse.step == pytest.approx(4 * fine.step)
    for name in ("xy", "heading", "present"):
        assert np.array_equal(getattr(fine, name)[seen, ::4], getattr(coarse, name))


@given(
    steps=st.integers(1, 40),
    every=st.integers(1, 5),
    stride=st.integers(1, 60),
)
def test_windows_stay_within_the_recording_and_repeat(steps, every, stride):
    tracks = [straight(a / 10, n, y=a) for a, n in ((0, 90), (35, 12), (60, 90))]
    recording = Recording("here", 1.0, 12.0, tuple(agent(t) for t in tracks))
    options = {"steps": steps, "every": every, "stride": stride}
    cut = list(cut_windows(recording, **options))
    for window, again in zip(cut, cut_windows(recording, **options), strict=True):
        assert np.array_equal(window.xy, again.xy)
        assert window.start >= 1.0 - 1e-9
        assert window.start + window.step * (steps - 1) <= 12.0 + 1e-9
        assert window.present.any(axis=1).all()
        assert window.whole.any()
        times = window.start + window.step * np.arange(steps)
        for k, member in enumerate(window.members):
            track = tracks[member]
            there = (times >= track.start - 1e-9) & (times <= track.end + 1e-9)
            assert window.present[k].tolist() == there.tolist()
            assert window.xy[k][there][:, 0] == pytest.approx(5.0 * times[there])


def test_windows_without_enough_agents_are_left_out(recording):
    assert len(list(cut_windows(recording, steps=11, every=1, least_whole=2))) == 2
    with pytest.raises(ValueError, match="counted from 1"):
        list(cut_windows(recording, steps=0))


def test_constant_acceleration_is_found_with_no_jerk():
    t = STEP * np.arange(60)
    done = compute_kinematics(np.column_stack([2.0 * t + 0.75 * t**2, np.zeros(60)]))
    assert len(done) == 50
    assert done.speed == pytest.approx(2.0 + 1.5 * t[done.first : done.first + 50])
    assert done.acceleration == pytest.approx(1.5)
    assert done.jerk == pytest.approx(0.0, abs=1e-9)


def test_constant_jerk_is_found():
    t = STEP * np.arange(60)
    done = compute_kinematics(np.column_stack([t**3 / 2 + 9.0 * t, np.zeros(60)]))
    assert done.jerk == pytest.approx(3.0)


@given(seed=st.integers(0, 1000), count=st.integers(1, 60))
def test_derivatives_are_those_of_the_checker(seed, count):
    xy = np.cumsum(np.random.default_rng(seed).normal(0.3, 0.2, (count, 2)), axis=0)
    done = compute_kinematics(xy)
    mover = build_trajectory(RoadUser(1, Track(xy, np.zeros(count), 0.0), get_vehicle_shape()))
    here = slice(done.first, done.first + len(done))
    assert len(done) == max(count - 10, 0)
    assert done.speed == pytest.approx(mover.speed[here])
    assert done.acceleration == pytest.approx(mover.acceleration[here])


def test_smoothing_leaves_straight_motion_and_takes_noise_away():
    rng = np.random.default_rng(0)
    even = straight(0.0, 300).xy
    noisy = even + rng.normal(0.0, 0.05, even.shape)
    assert compute_kinematics(even, smoothing=0.4).acceleration == pytest.approx(0.0, abs=1e-9)
    rough, calm = (compute_kinematics(noisy, smoothing=s).acceleration.std() for s in (0.0, 0.4))
    # White noise through a Gaussian: var = p^2 dt 3 / (8 sqrt(pi) s^5) per coordinate.
    expected = 0.05 * math.sqrt(STEP * 3 / (8 * math.sqrt(math.pi) * 0.4**5))
    assert calm == pytest.approx(expected, rel=0.25)
    assert rough > 10 * calm


def one_cleaned(kind, time, xy, *, settling=0.0):
    removed = CleaningReport()
    tracks = list(clean_track(RawTrack(kind, time, xy, settling), smoothing=0.0, removed=removed))
    return tracks, removed


def test_a_good_track_passes_whole():
    track = straight(1.0, 60)
    kept, removed = one_cleaned("vehicle", track.times, track.xy)
    assert kept[0].start == 1.0
    assert np.array_equal(kept[0].xy, track.xy)
    assert (removed.tracks, removed.kept, not removed.pieces) == (1, 1, True)
    assert removed.seconds == removed.seconds_kept == pytest.approx(6.0)


def test_the_settling_of_the_filter_is_cut_off():
    track = straight(0.0, 60)
    kept, removed = one_cleaned("vehicle", track.times, track.xy, settling=1.5)
    assert kept[0].start == pytest.approx(1.5)
    assert len(kept[0].xy) == 45
    assert removed.cut["the tracker's filter settles"] == pytest.approx(1.5)


def test_gaps_and_jumps_cut_a_track_in_pieces():
    track = straight(0.0, 100)
    time, xy = track.times.copy(), track.xy.copy()
    time[50:] += 2.0
    xy[75:] += (0.0, 30.0)
    kept, _ = one_cleaned("vehicle", time, xy)
    assert [(t.start, len(t.xy)) for t in kept] == [(0.0, 50), (7.0, 25), (9.5, 25)]


@pytest.mark.parametrize(
    ("kind", "speed", "count", "reason"),
    [
        ("vehicle", 5.0, 15, "shorter"),
        ("vehicle", 0.1, 100, "hardly moves"),
        ("vehicle", 25.0, 60, "vehicle faster"),
        ("pedestrian", 4.0, 60, "pedestrian faster"),
    ],
)
def test_what_cannot_be_is_removed_with_its_reason(kind, speed, count, reason):
    track = straight(0.0, count, speed=speed)
    kept, removed = one_cleaned(kind, track.times, track.xy)
    assert not kept
    assert [reason in word for word in removed.pieces] == [True]
    assert any(reason in line for line in removed.format_lines())


def test_a_course_is_held_while_nobody_moves():
    track = np.concatenate([straight(0.0, 20).xy, np.tile(straight(0.0, 20).xy[-1], (20, 1))])
    turned = np.column_stack([-track[:, 1], track[:, 0]])
    assert compute_course(turned) == pytest.approx(math.pi / 2)
    assert compute_course(np.zeros((5, 2))) == pytest.approx(0.0)


def rows(word, number, *, speed, count, noise=0.0):
    rng = np.random.default_rng(number)
    for k in range(count):
        x = speed * k * STEP + float(rng.normal(0.0, noise))
        yield f"{number},{k},{100 * k},{word},{x},{number},9,9,0,4,2\n"


@pytest.fixture
def files(tmp_path):
    """A fine site with a car, a walker, a rider and a ghost; a site whose positions jitter."""
    fine, rough = tmp_path / "tracks" / "k729_2022-03-16", tmp_path / "tracks" / "k733_2018-05-02"
    for folder in (fine, rough):
        folder.mkdir(parents=True)
    lines = [
        *rows("Car", 1, speed=8.0, count=100),
        *rows("Pedestrian", 2, speed=1.5, count=100),
        *rows("Bike", 3, speed=4.0, count=100),
        *rows("Pedestrian", 4, speed=5.0, count=100),
    ]
    lines.insert(5, lines[4])
    (fine / "vehicle_tracks_000.csv").write_text(HEADER + "".join(lines))
    noisy = "".join(rows("Car", 1, speed=8.0, count=200, noise=0.1))
    (rough / "vehicle_tracks_000.csv").write_text(HEADER + noisy)
    return tmp_path


def test_real_tracks_are_read_and_cleaned(files):
    real = read_taf_bw(files)
    assert [r.name for r in real.recordings] == ["k729_2022-03-16/000", "k733_2018-05-02/000"]
    kept = {a.subtype: a for a in real.recordings[0].agents}
    assert set(kept) == {"car", "bicycle", None}
    assert kept[None].shape.type == "pedestrian"
    assert real.removed["k729_2022-03-16"].pieces == {"pedestrian faster than 3 m/s": 1}
    assert kept["car"].track.start == pytest.approx(3.0)
    assert compute_kinematics(kept["car"].track.xy).speed == pytest.approx(8.0)


def test_a_site_without_tracks_is_an_empty_recording(files):
    empty = files / "tracks" / "k731_2020-01-01"
    empty.mkdir()
    (empty / "vehicle_tracks_000.csv").write_text(HEADER)
    real = read_taf_bw(files)
    assert [len(r.agents) for r in real.recordings if "k731" in r.name] == [0]


def test_what_is_no_real_track_is_one_clear_line(files, tmp_path):
    with pytest.raises(InputError, match="no vehicle_tracks"):
        read_taf_bw(tmp_path / "nowhere")
    (files / "tracks" / "k729_2022-03-16" / "vehicle_tracks_000.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="vehicle_tracks_000"):
        read_taf_bw(files)


@pytest.mark.skipif(not TAF_BW, reason="SCENEWRIGHT_TAF_BW names no folder of TAF-BW")
def test_the_real_data_set_reads_with_little_left_to_doubt():
    real = read_taf_bw(Path(TAF_BW))
    assert sum(removed.tracks for removed in real.removed.values()) == 424
    agents = [a for r in real.recordings for a in r.agents if a.shape.type == "vehicle"]
    assert len(agents) > 150
    speeds = [compute_kinematics(a.track.xy, smoothing=0.4).speed for a in agents]
    assert 5.0 < np.median(np.concatenate([s[s > 1.0] for s in speeds])) < 9.0
