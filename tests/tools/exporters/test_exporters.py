"""What every exporter keeps: the tracks, the clock, the frame, and text as text."""

from __future__ import annotations

import json
import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import scenewright
from exported_scenes import CONTACT, make_record, make_scene
from scenewright.errors import InputError
from scenewright.graph.run import verify_tracks
from scenewright.tools.exporters import FORMATS, prepare_scene, write_scene
from scenewright.tools.exporters.road_users import ROAD_USERS, find_kind


def test_headings_lie_within_pi_and_velocities_are_of_the_positions() -> None:
    car, walker, late = make_scene().agents
    assert car.heading == pytest.approx(math.pi / 2)
    assert late.heading == pytest.approx(-math.pi + 0.01)
    assert car.velocity == pytest.approx(np.tile([0.0, 10.0], (41, 1)))
    assert walker.speed == pytest.approx(1.0)
    assert (late.first, late.times[0], late.last) == (20, 2.0, 80)


def test_the_intended_route_goes_on_past_a_collision() -> None:
    car = make_scene().agents[0]
    assert car.route_ahead[0] == pytest.approx(car.xy[-1])
    assert car.route_ahead[-1] == pytest.approx([4.95, 49.0], abs=0.01)
    longer = car.continue_until(80)
    assert longer.last == 80
    assert longer.xy[41:] == pytest.approx(
        np.stack([np.full(40, 4.95), -9.0 + np.arange(1, 41)], axis=1), abs=1e-6
    )
    assert longer.heading == pytest.approx(math.pi / 2)


def test_lights_have_a_colour_at_every_step() -> None:
    colours = make_scene().colours()["south:stop"]
    assert colours[:60] == ["green"] * 60
    assert colours[60:] == ["red"] * 41


def test_a_csv_shows_the_verifier_the_same_events(tmp_path: Path) -> None:
    (file,) = scenewright.export(make_record(), "csv", tmp_path)
    (event,) = [each for each in verify_tracks(file) if each.type == "collision"]
    assert {event.from_, event.to} == {1, 2}
    assert event.time == pytest.approx(CONTACT, abs=0.1)


def test_trajnet_frames_are_steps_with_a_sample_every_fourth() -> None:
    (text,) = write_scene(make_scene(), "trajnet").values()
    rows = [json.loads(line) for line in text.splitlines()]
    tracks = [row["track"] for row in rows if "track" in row]
    late = [(row["f"], row["x"]) for row in tracks if row["p"] == 3]
    assert late[:2] == [(20, 49.0), (24, pytest.approx(49.0 - 3.2))]


def test_fcd_has_fronts_and_angles_clockwise_from_north() -> None:
    (text,) = write_scene(make_scene(), "fcd").values()
    first = ElementTree.fromstring(text)[0]
    assert [each.tag for each in first] == ["vehicle", "person"]
    assert float(first[0].attrib["y"]) == pytest.approx(-49.0 + 2.3)
    assert float(first[0].attrib["angle"]) == pytest.approx(0.0)
    assert float(first[1].attrib["angle"]) == pytest.approx(270.0)


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_scene_gives_the_same_bytes(name: str) -> None:
    for package in FORMATS[name].packages:
        pytest.importorskip(package)
    assert write_scene(make_scene(), name) == write_scene(make_scene(), name)


def test_every_kind_of_road_user_has_words() -> None:
    assert find_kind("vehicle", None) == "vehicle"
    assert {"car", "truck", "bus", "motorcycle", "pedestrian", "cyclist", "scooter"} <= set(
        ROAD_USERS
    )
    with pytest.raises(InputError, match="hovercraft"):
        find_kind("vehicle", "hovercraft")


@pytest.mark.parametrize(
    ("to", "ego", "words"),
    [("dvd", None, "there are: csv"), ("csv", "vehicle-9", "no agent 'vehicle-9'")],
)
def test_what_cannot_be_exported_leaves_nothing(
    to: str, ego: str | None, words: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=words):
        scenewright.export([make_record()], to, tmp_path / "out", ego=ego)
    assert list(tmp_path.iterdir()) == []


def test_scenes_of_one_id_get_files_of_their_own(tmp_path: Path) -> None:
    files = scenewright.export([make_record(), make_record()], "csv", tmp_path)
    assert [file.name for file in files] == ["hand_made_1.csv", "hand_made_1-2.csv"]


def test_a_scene_without_agents_is_refused() -> None:
    empty = make_record().model_copy(update={"agents": ()})
    with pytest.raises(InputError, match="no agents"):
        prepare_scene(empty, make_scene().intersection_map)
