"""Files of published data sets, written as those write them, are read by name."""

import json
from pathlib import Path

import numpy as np
import pytest

from scenewright.errors import InputError
from scenewright.tools.track_io.track_files import read_track_files

STEPS = np.arange(0.0, 6.0, 0.1)
SIND = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy"


def table(file, head, rows):
    file.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return file


def timed(kind, name, y, speed):
    return [(name, k, 100 * k, kind, speed * t, y, speed, 0) for k, t in enumerate(STEPS)]


def frames(name, y, speed):
    """Rows of DUT: its clock ticks 23.98 times a second."""
    return [(name, k, "x", speed * k / 23.98, y, speed, 0) for k in range(150)]


def speeds(files):
    found = {}
    for file in files:
        for subtype, track in file.tracks:
            step = np.hypot(*(track.xy[20] - track.xy[10]))
            found.setdefault(subtype, []).append(step / 1.0)
    return found


def sind(folder):
    table(
        folder / "Veh_smoothed_tracks.csv", SIND, timed("car", 1, 0, 8) + timed("tricycle", 2, 5, 5)
    )
    table(folder / "Ped_smoothed_tracks.csv", SIND, timed("pedestrian", "P1", 9, 1.5))


def interaction(folder):
    table(folder / "vehicle_tracks_000.csv", SIND, timed("car", 1, 0, 8))
    table(folder / "pedestrian_tracks_000.csv", SIND, timed("pedestrian/bicycle", "P1", 9, 1.5))


def dut(folder):
    head = "id,frame,label,x_est,y_est,vx_est,vy_est"
    table(folder / "intersection_01_traj_veh_filtered.csv", head, frames(1, 0, 8))
    table(folder / "intersection_01_traj_ped_filtered.csv", head, frames(1, 9, 1.5))


@pytest.mark.parametrize("write", [sind, interaction, dut])
def test_vehicles_and_pedestrians_of_one_recording_are_read_together(tmp_path, write):
    write(tmp_path)
    for named in (None, write.__name__):
        [file] = read_track_files([tmp_path], named=named)
        found = speeds([file])
        assert found["car"] == pytest.approx([8.0], rel=0.02)
        assert found["pedestrian"] == pytest.approx([1.5], rel=0.02)


def test_pedestrians_alone_are_a_recording(tmp_path):
    sind(tmp_path)
    [file] = read_track_files([tmp_path / "Ped_smoothed_tracks.csv"])
    assert [subtype for subtype, _ in file.tracks] == ["pedestrian"]


def test_argoverse_is_read_by_its_name(tmp_path):
    head = "TIMESTAMP,TRACK_ID,OBJECT_TYPE,X,Y,CITY_NAME"
    rows = [(f"{3.15e8 + t:.3f}", "a-1", "AGENT", 7 * t, 3, "PIT") for t in STEPS]
    file = table(tmp_path / "1.csv", head, rows)
    [found] = read_track_files([file], named="argoverse1")
    assert speeds([found])["car"] == pytest.approx([7.0], rel=0.02)


def test_a_format_that_is_not_known_or_does_not_fit_is_refused(tmp_path):
    file = table(tmp_path / "a.csv", "t,id,x,y", [])
    with pytest.raises(InputError, match=r"called 'highd'; there are .*sind"):
        read_track_files([file], named="highd")
    with pytest.raises(InputError, match=r"no file of sind: they are called Veh_"):
        read_track_files([file], named="sind")


def test_tables_of_others_pass_the_checks_of_our_own(tmp_path: Path) -> None:
    columns = {"t": "ms/1000", "id": "who", "class": "kind", "x": "East", "y": "North"}
    rows = [f"{100 * k};7;{'Car' if k else 'Bus'};{k},5;0" for k in range(30)]
    file = tmp_path / "own.csv"
    file.write_text("\n\nms;who;kind;East;North\n" + "\n".join(rows))
    [found] = read_track_files([file], columns=columns)
    [(subtype, track)] = found.tracks  # a tracker changes its mind; the first class stays
    assert subtype == "bus"
    assert track.xy[10, 0] == pytest.approx(10.5, abs=0.01)
    for row, reason in (("3000;7;Car;1", "line 34: 4 cells"), ("3000;;Car;1;0", "line 34: no id"),
                        ("3000;7;Car;1e300;0", "line 34: x = 1e")):  # fmt: skip
        file.write_text("\n\nms;who;kind;East;North\n" + "\n".join([*rows, row]))
        with pytest.raises(InputError, match=reason):
            read_track_files([file], columns=columns)


def test_predictions_are_left_out_of_what_is_fitted(tmp_path: Path) -> None:
    rows = [{"track": {"f": 10 * k, "p": 1, "x": 0.5 * k, "y": 0.0}} for k in range(30)]
    rows += [{"track": {"f": 300, "p": 1, "x": 99.0, "y": 9.0, "prediction_number": 0}}]
    file = tmp_path / "w.ndjson"
    file.write_text("\n".join(json.dumps(row) for row in rows))
    [found] = read_track_files([file])
    [(_, track)] = found.tracks
    assert track.xy[:, 0].max() < 15.0
