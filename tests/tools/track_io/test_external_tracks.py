"""Tracks from elsewhere: what is read, what is refused and why, and the events that are found."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from checker_tracks import (
    EAST,
    NORTH,
    crossing_walker,
    distance,
    line,
    moved,
    plus_map,
    resampled,
    yielding_car,
)
from scenewright.errors import InputError
from scenewright.graph.verify import load_tracks, verify_tracks
from scenewright.scene.events import Event
from scenewright.scene.track import VEHICLE_SIZES
from scenewright.tools.formats import sample_table
from scenewright.tools.relation_checker import RoadUser, external_events, find_events
from scenewright.tools.relation_checker.external_events import examine_recording, find_off_map
from scenewright.tools.track_io.external_tracks import (
    ExternalTracks,
    compute_headings,
    read_external_recordings,
    read_tracks,
)

TRAJNET = os.environ.get("SCENEWRIGHT_TRAJNET_FILE", "")
"""A TrajNet++ training file, such as biwi_hotel.ndjson."""


def find_recorded_events(tracks: ExternalTracks, **options: Any) -> tuple[Event, ...]:
    return examine_recording(tracks, **options).events


HEADER = "t,id,class,x,y"
CAR_ROWS = [f"{0.1 * k:.1f},7,car,{k},0" for k in range(5)]


def as_csv(users: list[RoadUser], *, names: Callable[[int], str] = str) -> bytes:
    """Rows in order of time, without headings and sizes."""
    rows = [
        (time, f"{time:.3f},{names(user.id)},{user.shape.type},{x:.4f},{y:.4f}")
        for user in users
        for time, (x, y) in zip(user.track.times, user.track.xy, strict=True)
    ]
    return "\n".join([HEADER, *(row for _, row in sorted(rows))]).encode()


def crossing(lag: float) -> list[RoadUser]:
    """Two cars at 10 m/s on crossing lines; centres pass the origin `lag` seconds apart."""
    s = distance(10.0, (0.0, 10.0))
    return [line(1, (-50.0, 0.0), EAST, s), line(2, (0.0, -50.0 - 10 * lag), NORTH, s)]


def csv_of(*rows: str, header: str = HEADER) -> ExternalTracks:
    return read_tracks("\n".join((header, *rows)).encode(), name="a.csv")


def ndjson(*rows: object) -> ExternalTracks:
    text = "\n".join(row if isinstance(row, str) else json.dumps(row) for row in rows)
    return read_tracks(text.encode(), name="a.ndjson")


def spot(frame: int, who: int | str, x: object, y: object = 0.0, **more: object) -> object:
    return {"track": {"f": frame, "p": who, "x": x, "y": y, **more}}


# Events


@pytest.mark.parametrize("step", [0.04, 0.1, 0.25, 0.4])
def test_two_cars_collide_at_the_time_on_paper(step: float) -> None:
    users = [resampled(user, step) for user in crossing(0.0)]
    (event,) = find_recorded_events(read_tracks(as_csv(users), name="a.csv"))
    assert (event.type, event.kind) == ("collision", "angle")
    assert event.time == pytest.approx(4.6775, abs=0.01)
    assert event.evidence["relative_speed"] == pytest.approx(10 * np.sqrt(2), abs=0.05)


def test_two_cars_pass_with_the_pet_on_paper() -> None:
    (event,) = find_recorded_events(read_tracks(as_csv(crossing(1.0)), name="a.csv"))
    assert event.type == "near_miss"
    assert event.evidence["pet"] == pytest.approx(0.355, abs=0.03)


def test_a_car_yields_to_a_pedestrian_with_and_without_a_map() -> None:
    tracks = read_tracks(as_csv([yielding_car(), crossing_walker()]), name="a.csv")
    for ground in (None, plus_map()):
        (event,) = find_recorded_events(tracks, intersection_map=ground)
        assert (event.type, event.from_, event.to) == ("yielding", 1, 2)
        assert event.time == pytest.approx(5.3, abs=0.11)


def test_headings_from_motion_change_no_event() -> None:
    users = [moved(user, turn=0.7) for user in (yielding_car(), crossing_walker(), *crossing(1.0))]
    users = [RoadUser(n, user.track, user.shape) for n, user in enumerate(users)]
    told = find_events(users)
    read = find_recorded_events(read_tracks(as_csv(users), name="a.csv"))
    assert [(e.type, e.from_, e.to) for e in read] == [(e.type, e.from_, e.to) for e in told]
    assert [e.time for e in read] == pytest.approx([e.time for e in told], abs=0.1)


def test_clock_times_are_counted_from_the_first_row() -> None:
    rows = [row.split(",", 1) for row in as_csv(crossing(0.0)).decode().splitlines()[1:]]
    tracks = csv_of(*(f"{1_700_000_000 + float(t):.3f},{rest}" for t, rest in rows))
    assert tracks.origin == 1_700_000_000
    assert "1700000000" in tracks.notes[0]
    assert find_recorded_events(tracks)[0].time == pytest.approx(4.6775, abs=0.01)


def test_a_contact_too_slow_for_a_collision_is_told() -> None:
    # The front is 5.4 m off and comes on at 0.9 m/s; in 0.5 s more it is 0.45 m inside.
    bump = distance(0.9, (0.0, 6.5))
    users = [line(1, (-10.0, 0.0), EAST, bump), line(2, (0.0, 0.0), EAST, np.zeros(66))]
    found = examine_recording(read_tracks(as_csv(users), name="a.csv"))
    assert "collision" not in {event.type for event in found.events}
    (contact,) = found.contacts
    assert (contact.rule, contact.agents) == ("contact", (1, 2))
    assert contact.time == pytest.approx(6.0, abs=0.01)
    assert "touch at 6.0 s at 0.9 m/s" in contact.detail
    assert "overlap by up to 0.45 m" in contact.detail


def test_a_collision_that_the_tracks_deny_is_told_as_such() -> None:
    crash = distance(10.0, (0.0, 4.7), (-8.0, 1.25), (0.0, 3.0))
    stopping = [line(1, (-50.0, 0.0), EAST, crash), line(2, (0.0, -50.0), NORTH, crash)]
    found = examine_recording(read_tracks(as_csv(stopping), name="a.csv"))
    assert [each.type for each in found.events] == ["collision"]
    assert found.implausible == ()
    found = examine_recording(read_tracks(as_csv(crossing(0.0)), name="a.csv"))
    (event,), (doubt,) = found.events, found.implausible
    assert (doubt.rule, doubt.agents) == ("implausible_collision", (event.from_, event.to))
    assert doubt.detail.endswith("(both go on as if there had been none)")
    rng = np.random.default_rng(0)
    noisy = []
    for user in stopping:
        xy = user.track.xy + rng.normal(0.0, 0.2, user.track.xy.shape)
        noisy.append(RoadUser(user.id, replace(user.track, xy=xy), user.shape))
    (doubt,) = examine_recording(read_tracks(as_csv(noisy), name="a.csv")).implausible
    assert "one moves with " in doubt.detail


def test_footprints_that_overlap_from_the_beginning_are_told() -> None:
    users = [line(1, (0.0, 0.0), EAST, np.zeros(20)), line(2, (4.0, 0.0), EAST, np.zeros(20))]
    (contact,) = examine_recording(read_tracks(as_csv(users), name="a.csv")).contacts
    assert "overlap from the start" in contact.detail
    assert "0.60 m" in contact.detail


def test_events_of_foreign_tracks_say_what_would_have_avoided_them() -> None:
    found = examine_recording(read_tracks(as_csv(crossing(0.0)), name="a.csv"))
    assert [(row["agent"], row["avoidable"]) for row in found.avoidability] == [
        (1, True),
        (2, True),
    ]
    assert found.avoidability[0]["needed_braking"] == pytest.approx(0.98, abs=0.02)


def test_windows_find_what_is_found_at_one_look(monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = [yielding_car(), crossing_walker(), *crossing(1.0), *crossing(0.0)]
    users = [
        RoadUser(
            n, type(u.track)(u.track.xy, u.track.heading, u.track.start + 70 * (n // 2)), u.shape
        )
        for n, u in enumerate(pairs)
    ]
    tracks = read_tracks(as_csv(users), name="a.csv")
    whole = examine_recording(tracks)
    assert [e.type for e in whole.events] == ["yielding", "near_miss", "collision"]
    monkeypatch.setattr(external_events, "MOST_PAIR_SAMPLES", 500)
    monkeypatch.setattr(external_events, "CONTEXT", 15.0)
    parts = examine_recording(tracks)
    assert (parts.events, parts.avoidability) == (whole.events, whole.avoidability)


def test_too_many_at_once_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(external_events, "MOST_PAIR_SAMPLES", 2)
    monkeypatch.setattr(external_events, "MOST_FORCED", 20)
    with pytest.raises(InputError, match="too many at once"):
        find_recorded_events(read_tracks(as_csv(crossing(0.0)), name="a.csv"))


def test_who_is_off_the_map_is_named() -> None:
    tracks = csv_of("0,1,car,-20,-1.7", "0.1,1,car,-19,-1.7", "0,2,car,50,50", "0.1,2,car,51,50")
    (finding,) = find_off_map(tracks, plus_map())
    assert (finding.rule, finding.agents) == ("off_road", (2,))


# What is read


def test_classes_sizes_and_ids() -> None:
    tracks = csv_of(
        "0,b-1,Truck,0,0,,,", "0,b-2,ped,5,5,,,", "0,b-3,passenger car,9,9,0.5,5.1,2.0",
        "0,b-4,BUS,30,30,,,", "0,b-5,cyclist,40,40,,,",
        header=" T ,id,class,x,y,heading,length,width",
    )  # fmt: skip
    shapes = [(u.shape.type, u.shape.length, u.shape.width) for u in tracks.users]
    assert shapes == [
        ("vehicle", *VEHICLE_SIZES["truck"]),
        ("pedestrian", 0.6, 0.6),
        ("vehicle", 5.1, 2.0),
        ("vehicle", *VEHICLE_SIZES["bus"]),
        ("cyclist", 1.8, 0.65),
    ]
    assert tracks.names == {1: "b-1", 2: "b-2", 3: "b-3", 4: "b-4", 5: "b-5"}
    assert tracks.renamed == {1, 2, 3, 4, 5}
    assert tracks.users[2].track.heading[0] == 0.5
    assert "b-1, b-4, b-5 without heading" in tracks.notes[0]


def test_ids_that_are_numbers_are_kept() -> None:
    tracks = csv_of("0,12,car,0,0", "0,3,car,9,9")
    assert [user.id for user in tracks.users] == [12, 3]
    assert not tracks.renamed
    assert csv_of("0,03,car,0,0", "0,3,car,9,9").names == {1: "03", 2: "3"}


@pytest.mark.parametrize("separator", [";", "\t"])
def test_other_separators_marks_and_line_ends(separator: str) -> None:
    text = "\r\n".join((HEADER, *CAR_ROWS, "")).replace(",", separator)
    tracks = read_tracks(b"\xef\xbb\xbf" + text.encode(), name="A.CSV")
    assert tracks.users[0].track.xy[:, 0].tolist() == [0, 1, 2, 3, 4]


def test_a_gap_makes_two_agents_that_do_not_meet() -> None:
    rows = [f"{0.1 * k:.1f},7,car,{0.5 * k},0" for k in range(60) if not 20 < k < 30]
    tracks = csv_of(*rows)
    assert [(u.id, round(u.track.start, 3), len(u.track.xy)) for u in tracks.users] == [
        (7, 0.0, 21),
        (8, 3.0, 30),
    ]
    assert tracks.names == {7: "7", 8: "7"}
    assert "gaps" in tracks.notes[0]
    assert find_recorded_events(tracks) == ()


def drive(x: float, *, who: str = "a", at: float = 0.0, steps: int = 50) -> list[str]:
    """Rows of a car that goes east at 10 m/s."""
    return [f"{at + 0.1 * k:.1f},{who},car,{x + k:.3f},0" for k in range(steps)]


def test_a_switched_id_is_told_and_never_a_collision() -> None:
    stands = [f"{0.1 * k:.1f},b,car,5,0" for k in range(100)]
    tracks = csv_of(*drive(-50.0), *drive(11.0, at=5.0), *stands)
    starts = [(tracks.names[u.id], round(u.track.start, 3), len(u.track.xy)) for u in tracks.users]
    assert starts == [("a", 0.0, 50), ("a", 5.0, 50), ("b", 0.0, 100)]
    assert "tracks are cut where id a jumps 12 m at 5.0 s (120 m/s)" in tracks.notes
    found = examine_recording(tracks)
    assert {event.type for event in found.events} <= {"follow"}
    assert found.contacts == ()


def test_a_sample_elsewhere_is_left_out() -> None:
    rows = drive(0.0)
    rows[20] = "2.0,a,car,20,9"
    tracks = csv_of(*rows)
    assert [len(user.track.xy) for user in tracks.users] == [20, 29]
    assert "id a jumps 9.06 m at 2.0 s" in tracks.notes[0]


@pytest.mark.parametrize(
    ("kind", "x", "jumps"),
    [
        ("car", [2.0 * k for k in range(9)] + [16.0] * 9, False),  # it crashes into a wall
        ("pedestrian", [0.14 * k for k in range(9)] + [1.12 + 0.9 * k for k in range(1, 9)], False),
        ("car", [0.05 * k * k for k in range(30)], False),  # 10 m/s^2
        ("pedestrian", [0.14 * k for k in range(9)] + [3.0 + 0.14 * k for k in range(9)], True),
        ("car", [1.0 * k for k in range(9)] + [12.0 + k for k in range(9)], True),
        ("car", [1.0 * k for k in range(9)] + [16.0], True),  # the last sample
    ],
)
def test_jumps_are_told_from_motion(kind: str, x: list[float], jumps: bool) -> None:
    tracks = csv_of(*(f"{0.1 * k:.1f},1,{kind},{each:.3f},0" for k, each in enumerate(x)))
    assert any("jumps" in note for note in tracks.notes) == jumps
    assert len(tracks.users) == 1 + (jumps and x[-1] != 16.0)


def ride(*, walks: int = 0) -> list[tuple[float, str, str, float, float]]:
    """A bus that goes east, one who walked to it and rides in it, and one who walks beside it."""
    rows = []
    for k in range(80):
        x = max(k - 20, 0)
        rows += [(0.1 * k, "bus0", "bus", x, 0.0), (0.1 * k, "on foot", "person", 0.3 * k, 3.0)]
        on_foot = (20 - k) * 0.14
        place = (4.0, 1.0 + on_foot) if k < walks else (4.0 + x, 1.0)
        rows.append((0.1 * k, "rider", "person", *place))
    return rows


def test_a_passenger_is_no_pedestrian() -> None:
    tracks = csv_of(*(f"{t:.1f},{who},{kind},{x:.3f},{y:.3f}" for t, who, kind, x, y in ride()))
    assert sorted(tracks.names.values()) == ["bus0", "on foot"]
    assert "passengers, left out: rider in bus0" in tracks.notes
    assert examine_recording(tracks).contacts == ()


def test_who_walked_to_a_vehicle_is_a_pedestrian_until_then() -> None:
    rows = ride(walks=20)
    tracks = csv_of(*(f"{t:.1f},{who},{kind},{x:.3f},{y:.3f}" for t, who, kind, x, y in rows))
    (rider,) = (user for user in tracks.users if tracks.names[user.id] == "rider")
    assert rider.track.end < 2.1
    assert "passengers, left out: rider in bus0" in tracks.notes


@pytest.mark.parametrize("names_vehicle", [True, False])
def test_a_person_in_a_sumo_vehicle_is_no_pedestrian(names_vehicle: bool) -> None:
    inside = ' vehicle="bus0"' if names_vehicle else ""
    steps = "".join(
        f'<timestep time="{k / 10}">'
        f'<vehicle id="bus0" x="{k}" y="0" angle="90" type="bus"/>'
        f'<person id="rider" x="{k}" y="0" angle="90"{inside}/>'
        f'<vehicle id="car1" x="30" y="{k - 49}" angle="0" type="passenger"/></timestep>'
        for k in range(80)
    )
    data = f"<fcd-export>{steps}</fcd-export>".encode()
    tracks = read_external_recordings(data, name="fcd.xml")[""]
    assert sorted(tracks.names.values()) == ["vehicle bus0", "vehicle car1"]
    assert "passengers, left out: person rider in vehicle bus0" in tracks.notes
    (event,) = find_recorded_events(tracks)
    assert event.type == "near_miss"


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read(separator: str) -> None:
    rows = [separator.join((f"{k / 10}", "7", "car", f"{k / 2}", "-1.25")) for k in range(5)]
    text = "\n".join((HEADER.replace(",", separator), *rows)).replace(".", ",")
    track = read_tracks(text.encode(), name="a.csv").users[0].track
    assert track.xy.tolist() == [[k / 2, -1.25] for k in range(5)]
    assert csv_of('0,7,car,"3,5",0').users[0].track.xy.tolist() == [[3.5, 0.0]]


def test_times_rounded_to_milliseconds_are_even() -> None:
    tracks = csv_of(*(f"{k / 30:.3f},1,car,{k},0" for k in range(60)))
    assert tracks.step == pytest.approx(1 / 30, abs=1e-5)
    assert len(tracks.users) == 1


def test_the_heading_is_held_at_standstill() -> None:
    rng = np.random.default_rng(0)
    x = np.concatenate((np.arange(0.0, 10.0, 0.5), np.full(40, 10.0), np.arange(10.0, 15.0, 0.5)))
    xy = np.stack((np.zeros(len(x)), x), axis=1)
    xy[20:60] += rng.normal(0.0, 0.02, (40, 2))
    found = compute_headings(xy, step=0.1, least=0.5)
    assert found == pytest.approx(np.pi / 2, abs=0.15)
    assert np.ptp(found[26:54]) == 0.0


def test_headings_follow_a_bend() -> None:
    angle = np.linspace(0.0, 2 * np.pi, 100)
    found = compute_headings(
        10 * np.stack((np.cos(angle), np.sin(angle)), axis=1), step=0.1, least=0.5
    )
    assert found[1:-1] == pytest.approx(angle[1:-1] + np.pi / 2, abs=0.01)


def test_who_never_moves_faces_somewhere() -> None:
    assert compute_headings(np.ones((1, 2)), step=0.1, least=0.5).tolist() == [0.0]
    assert compute_headings(np.ones((9, 2)), step=0.1, least=0.5).tolist() == [0.0] * 9


def test_trajnet_frames_become_seconds() -> None:
    tracks = ndjson(
        {"scene": {"id": 0, "p": 4, "s": 500, "e": 700, "fps": 2.5, "tag": [1, []]}},
        spot(500, 4, 0.0), spot(510, 4, 0.5), spot(520, 4, 1.0), spot(510, 5, 3.0), "",
    )  # fmt: skip
    assert [(u.id, u.track.start, u.track.step) for u in tracks.users] == [
        (4, 20.0, 0.4),
        (5, pytest.approx(20.4), 0.4),
    ]
    assert {user.shape.type for user in tracks.users} == {"pedestrian"}


def test_trajnet_scenes_may_set_the_clock() -> None:
    tracks = ndjson({"scene": {"id": 0, "fps": 2}}, spot(0, "a", 0.0), spot(5, "a", 0.5))
    assert tracks.step == 0.5
    assert tracks.names == {1: "a"}


def test_two_pedestrians_run_into_each_other() -> None:
    rows = [spot(k, n, sign * (4.0 - 0.4 * k)) for k in range(15) for n, sign in ((1, 1), (2, -1))]
    (event,) = find_recorded_events(ndjson(*rows))
    # 0.6 m apart after 3.7 m each, at 1 m/s
    assert event.type == "collision"
    assert event.time == pytest.approx(3.7, abs=0.01)


@pytest.mark.skipif(not Path(TRAJNET).is_file(), reason="needs SCENEWRIGHT_TRAJNET_FILE")
def test_a_real_trajnet_file() -> None:
    tracks = load_tracks(TRAJNET)
    assert len(tracks.users) > 100
    events = verify_tracks(tracks)
    assert {event.type for event in events} <= {"collision", "follow"}
    assert len(events) > 10


# What is refused

BAD_CSV = {
    "nan": ([*CAR_ROWS, "0.5,7,car,nan,0"], "line 7: x is nan"),
    "infinite": (["0,7,car,0,inf"], "line 2: y is inf"),
    "no number": (["0,7,car,zero,0"], "line 2: x is 'zero', not a number"),
    "grouped digits": (["0,7,car,1_000,0"], "line 2: x is '1_000'"),
    "empty cell": (["0,7,car,,0"], "line 2: x is empty"),
    "too few cells": (["0,7,car,0"], "line 2: 4 cells under 5 columns"),
    "no id": (["0,,car,0,0"], "line 2: no id"),
    "unknown class": (["0,7,tram,0,0"], "line 2: class 'tram' is unknown; use"),
    "two classes": ([*CAR_ROWS, "0.5,7,bus,5,0"], "line 7: id 7 is a bus here and a car in line 2"),
    "duplicate": ([*CAR_ROWS, CAR_ROWS[-1]], "line 7: a second row of id 7 at t = 0.4.*line 6"),
    "unsorted": ([*CAR_ROWS, CAR_ROWS[1]], "line 7: t = 0.1 of id 7 comes after.*sort"),
    "uneven": ([*CAR_ROWS, "0.55,7,car,5,0"], "line 7: t = 0.55 of id 7 .* resample it evenly"),
    "drifting": (
        [f"{0.1 * k:.1f},1,car,0,0" for k in range(50)]
        + [f"{0.12 * k:.2f},2,car,9,9" for k in range(9)],
        "id 2 do not keep the file's step of 0.1",
    ),
    "milliseconds": (["0,7,car,0,0", "100,7,car,1,0"], "t must be seconds"),
    "jumps": ([f"{k / 10},7,car,{50 * k},0" for k in range(9)], "line 3: id 7 jumps 50 m"),
    "decimal commas between commas": (["0,0,7,car,3,5,0,0"], "8 cells under 5 .* semicolon"),
    "both decimal signs": (['0.5,7,car,"1,5",0'], "x is '1,5', although others have a decimal '.'"),
    "thousands": (['0,7,car,"1,234.5",0'], "x is '1,234.5', not a number"),
    "too far": (["0,7,car,1e300,0"], "line 2: x = 1e"),
    "no rows": ([], "holds no tracks"),
    "open quote": (['0,7,"car,0,0'], "mend the quotes"),
}


@pytest.mark.parametrize(("rows", "reason"), BAD_CSV.values(), ids=BAD_CSV)
def test_bad_rows_are_refused(rows: list[str], reason: str) -> None:
    with pytest.raises(InputError, match=rf"^a\.csv.*{reason}"):
        csv_of(*rows)


@pytest.mark.parametrize(
    ("header", "row", "reason"),
    [
        ("time,id,x,y", "0,7,0,0", "line 1: no column t, class; .* it names time, id, x, y"),
        (",,", ",,", "no column t, id"),
        ("t,id,class,x,y,x", "0,7,car,0,0,0", "column x is there twice"),
        (f"{HEADER},heading", "0,7,car,0,0,270", "line 2: heading = 270 looks like degrees"),
        (f"{HEADER},heading", "0,7,car,0,0,nan", "line 2: heading is nan; leave the cell empty"),
        (f"{HEADER},length", "0,7,car,0,0,-4", "line 2: length = -4 m is no size"),
    ],
)
def test_bad_columns_are_refused(header: str, row: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        csv_of(row, header=header)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "is empty"),
        (b" \n ", "is empty"),
        (f"{HEADER}\n0,caf\xe9,car,0,0".encode("latin-1"), "line 2: this is not UTF-8"),
        (HEADER.encode("utf-16"), "line 1: this is not UTF-8"),
        (HEADER.encode("utf-16-le"), "line 1: this is not text in UTF-8"),
    ],
)
def test_unreadable_bytes_are_refused(data: bytes, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        read_tracks(data, name="a.csv")


BAD_NDJSON = {
    "nan": ('{"track": {"f": 1, "p": 1, "x": NaN, "y": 0}}', "x is nan"),
    "text": (spot(1, 1, "left"), 'x is "left", not a number'),
    "truth": (spot(1, 1, True), "x is true, not a number"),
    "huge": ('{"track": {"f": 1, "p": 1, "x": 1' + "0" * 400 + ', "y": 0}}', "x is too large"),
    "missing": ({"track": {"f": 1, "p": 1, "x": 0}}, "the track has no y"),
    "no agent": (spot(1, "", 0.0), "p must be the number"),
    "part of a frame": ({"track": {"f": 1.5, "p": 1, "x": 0, "y": 0}}, "f = 1.5 must be the whole"),
    "prediction": (spot(1, 1, 0.0, prediction_number=0), "this is a prediction"),
    "no json": ("{track}", "no JSON"),
    "deep": ("[" * 100_000, "no JSON"),
    "no object": ("[1]", "expected one JSON object"),
    "neither": ({}, "expected"),
    "fps": ({"scene": {"fps": 0}}, "fps = 0 must be"),
}


@pytest.mark.parametrize(("row", "reason"), BAD_NDJSON.values(), ids=BAD_NDJSON)
def test_bad_lines_are_refused(row: object, reason: str) -> None:
    with pytest.raises(InputError, match=rf"^a\.ndjson, line 2: {reason}"):
        ndjson(spot(0, 9, 0.0), row)


def test_bad_lines_in_their_context_are_refused() -> None:
    with pytest.raises(InputError, match="line 2: a second row of id 1 at f = 5"):
        ndjson(spot(5, 1, 0.0), spot(5, 1, 0.0))
    with pytest.raises(InputError, match="line 2: fps 2 here and"):
        ndjson({"scene": {}}, {"scene": {"fps": 2}})
    with pytest.raises(InputError, match="holds no tracks"):
        ndjson({"scene": {}})


def test_large_files_are_refused_unread(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "large.csv"
    with file.open("wb") as large:
        large.truncate(sample_table.MOST_BYTES + 1)
    monkeypatch.setattr(Path, "read_bytes", lambda _: pytest.fail("it was read"))
    with pytest.raises(InputError, match="200 MB; at most 200"):
        load_tracks(file)


def test_other_names_and_places_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.csv and \.ndjson"):
        read_tracks(b"x", name="a.txt")
    with pytest.raises(InputError, match="cannot read"):
        load_tracks(tmp_path / "none.csv")
    with pytest.raises(InputError, match="no intersection 'nowhere'"):
        verify_tracks(csv_of(*CAR_ROWS), intersection="nowhere")
