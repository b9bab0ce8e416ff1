"""Real junctions in: what anybody who imports a map relies on."""

import importlib.util
import math
import os
import re
from pathlib import Path

import numpy as np
import pytest
import shapely

import map_files
from scenewright.errors import InputError
from scenewright.tools.map_import import import_map
from scenewright.tools.map_import.compass import compute_bearing, name_turn

needs_sumo = pytest.mark.skipif(
    importlib.util.find_spec("sumo") is None, reason="SUMO is not installed"
)
FOUR = (0, 90, 180, 270)
REAL = os.environ.get("SCENEWRIGHT_REAL_MAPS")
"""A folder of maps of real places (docs/own-intersection.md); none comes with the project."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("maps")


@pytest.fixture(scope="module")
def lanelets(folder):
    return import_map(map_files.lanelet2(folder / "four.osm"), name="four", title="Four")


@pytest.fixture(scope="module")
def three(folder):
    file = map_files.osm(folder / "three.osm", (0, 95, 180), signals=False)
    return import_map(file, name="three")


@pytest.fixture(scope="module")
def five(folder):
    net = map_files.sumo_net(
        folder / "five.net.xml", (10, 82, 154, 226, 298), lanes=2, kind="traffic_light"
    )
    return import_map(net, name="five")


def area(polygons):
    return shapely.union_all([shapely.Polygon(p.exterior, p.holes) for p in polygons])


def check_is_whole(made):
    """What every map must have, wherever it comes from."""
    place = made.intersection_map
    names = [leg.name for leg in place.legs]
    assert len(set(names)) == len(names)
    road, walkable = area(place.road), area(place.walkable)
    stops = {line.id for line in place.stop_lines}
    lanelets = {lane.id for lane in place.lanelets}
    for movement in place.movements:
        assert {movement.entry, movement.exit} <= set(names)
        assert movement.stop_line in stops
        assert set(movement.lanelets) <= lanelets
        line = np.array(movement.centreline)
        assert np.abs(line).max() <= place.extent + 1e-6
        assert np.abs(line[[0, -1]]).max(axis=1) == pytest.approx(place.extent, abs=1.0)
        assert shapely.contains_xy(road, line).mean() > 0.99
        assert name_turn(movement.entry, movement.exit) == movement.turn
    for walk in place.crosswalks:
        line = shapely.LineString(walk.centreline)
        assert line.intersection(road).length > 0.9 * line.length
    ground = shapely.union_all([walkable, *(shapely.Polygon(c.polygon) for c in place.crosswalks)])
    for route in place.routes:
        if route.side is not None:
            [line] = made.route_lines[route.id]
            assert shapely.contains_xy(ground.buffer(0.3), line).mean() > 0.98
    if place.signals is not None:
        greens = {g for p in place.signals.phases for g, c in p.colours.items() if c == "green"}
        assert greens == {group.id for group in place.signals.groups}


def test_a_lanelet2_junction_is_whole(lanelets):
    check_is_whole(lanelets)
    place = lanelets.intersection_map
    assert lanelets.map_format == "lanelet2"
    assert {leg.name for leg in place.legs} == {"north", "east", "south", "west"}
    assert len(place.movements) == 12
    assert lanelets.survey.origin == pytest.approx(map_files.ORIGIN, abs=1e-6)


def test_a_mapped_crosswalk_stays_where_it_is_and_derived_ones_are_reported(lanelets):
    north = next(c for c in lanelets.intersection_map.crosswalks if c.leg == "north")
    assert np.array(north.centreline)[:, 1] == pytest.approx([16.5, 16.5], abs=0.3)
    assert any("derived on" in line and "north" not in line for line in lanelets.notes)


def test_a_bound_drawn_backwards_changes_nothing(folder, lanelets):
    file = map_files.lanelet2(folder / "turned.osm", reverse=True)
    turned = import_map(file, name="four", title="Four")
    assert turned.intersection_map == lanelets.intersection_map


def test_importing_twice_gives_the_same_map(folder, lanelets):
    again = import_map(map_files.lanelet2(folder / "four.osm"), name="four", title="Four")
    assert again.intersection_map.model_dump_json() == lanelets.intersection_map.model_dump_json()


@needs_sumo
def test_an_openstreetmap_t_junction_is_whole(three):
    check_is_whole(three)
    place = three.intersection_map
    assert [leg.name for leg in place.legs] == ["east", "north", "west"]
    assert {leg.road for leg in place.legs} == {"Street 1", "Street 2", "Street 3"}
    assert len(place.movements) == 6
    assert place.signals is None


@needs_sumo
def test_a_five_leg_junction_names_every_leg_and_lights_every_group(five):
    check_is_whole(five)
    place = five.intersection_map
    assert len(place.legs) == 5
    assert place.signals is not None
    for leg in place.legs:
        off = abs(math.remainder(leg.bearing - compute_bearing(leg.name), math.tau))
        assert off < math.radians(60)


@needs_sumo
def test_opendrive_gives_the_same_ways_as_the_network_it_was_made_from(folder):
    net = map_files.sumo_net(folder / "four.net.xml", FOUR)
    drive = import_map(map_files.opendrive(folder / "four.xodr", net), name="x")
    direct = import_map(net, name="x")
    check_is_whole(drive)
    assert {m.id for m in drive.intersection_map.movements} == {
        m.id for m in direct.intersection_map.movements
    }


@needs_sumo
def test_left_hand_traffic_drives_in_on_the_left(folder):
    net = map_files.sumo_net(folder / "left.net.xml", FOUR, left_hand=True)
    made = import_map(net, name="left")
    check_is_whole(made)
    assert made.intersection_map.left_hand_traffic
    entering = next(
        x for x in made.intersection_map.lanelets if x.kind == "approach" and x.leg == "south"
    )
    assert np.array(entering.centreline)[:, 0].max() < 0  # northwards, west of the middle


@needs_sumo
def test_of_several_junctions_one_is_chosen_by_id_or_centre_and_else_they_are_listed(folder):
    file = map_files.osm(folder / "two.osm", (0, 90, 180), second=True)
    with pytest.raises(InputError, match=r"2 junctions.*1 \(3 legs.*101 \(3 legs"):
        import_map(file, name="two")
    by_id = import_map(file, name="two", junction="101")
    lat, lon = map_files.ORIGIN
    assert by_id.survey.origin[1] > lon + 0.01
    by_place = import_map(file, name="two", center=by_id.survey.origin)
    assert by_place.intersection_map == by_id.intersection_map
    with pytest.raises(InputError, match="no junction 'nowhere'"):
        import_map(file, name="two", junction="nowhere")
    with pytest.raises(InputError, match="m away"):
        import_map(file, name="two", center=(lat + 1, lon))


def test_a_programme_is_assumed_on_request_and_never_crosses_straight_ways(folder):
    file = map_files.lanelet2(folder / "lit.osm")
    place = import_map(file, name="lit", signals="assume").intersection_map
    assert place.signals is not None
    for phase in place.signals.phases:
        for leg, beside in (("north", "east"), ("south", "west")):
            assert "red" in (phase.colours[leg], phase.colours[beside])
            assert "red" in (phase.colours[leg], phase.colours[f"walk_{leg}"])


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "not well-formed"),
        (b"<osm><node id='1' lat='48' lon='9'>", "not well-formed"),
        (b"<osm version='0.6'></osm>", "no streets"),
        (b"<osm></osm>", "no OpenStreetMap file"),
        (b"<html/>", "none of"),
        (b"\x00\x01binary", "not well-formed"),
        (b"<!DOCTYPE osm [<!ENTITY a 'aaaaaaaaaa'>]><osm>&a;</osm>", "DOCTYPE"),
        ("<!DOCTYPE osm [<!ENTITY a 'aa'>]><osm/>".encode("utf-16"), "DOCTYPE"),
        (b"<osm version='0.6'><node id='1' lat='5431000' lon='3456000'/></osm>", "no degrees"),
        (b"<osm version='0.6'><node id='1' lat='nan' lon='9'/></osm>", "no degrees"),
        (b"<osm>" + b"<a>" * 99 + b"</a>" * 99 + b"</osm>", "deeper"),
        (b"<osm><relation id='1'><tag k='type' v='lanelet'/></relation></osm>", "no lanelets"),
    ],
)
def test_broken_and_hostile_files_end_in_one_line(tmp_path, monkeypatch, content, reason):
    monkeypatch.setattr("scenewright.extras.find_spec", lambda name: name)  # as if SUMO were there
    file = tmp_path / "map.osm"
    file.write_bytes(content)
    with pytest.raises(InputError, match=reason) as caught:
        import_map(file, name="x")
    assert "\n" not in str(caught.value)


def test_a_huge_file_is_refused_unread(tmp_path):
    file = tmp_path / "map.osm"
    with file.open("wb") as stream:
        stream.truncate(601_000_000)
    with pytest.raises(InputError, match="601 MB"):
        import_map(file, name="x")


def test_a_junction_too_wide_for_one_map_is_refused(tmp_path):
    file = map_files.lanelet2(tmp_path / "wide.osm", scale=20.0)
    with pytest.raises(InputError, match="--center"):
        import_map(file, name="wide")


def test_lanelets_without_bounds_are_refused(tmp_path):
    file = map_files.lanelet2(tmp_path / "map.osm", drop=("left",))
    with pytest.raises(InputError, match="bounds of all are missing"):
        import_map(file, name="x")


@needs_sumo
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_truncated_network_is_refused(folder, tmp_path, share):
    whole = map_files.sumo_net(folder / "cut.net.xml", FOUR).read_bytes()
    file = tmp_path / "cut.net.xml"
    file.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match="cut off"):
        import_map(file, name="x")


@needs_sumo
@pytest.mark.skipif(REAL is None, reason="SCENEWRIGHT_REAL_MAPS names no folder of maps")
def test_junctions_of_real_places_are_whole():
    files = sorted(f for f in Path(str(REAL)).iterdir() if f.suffix in (".osm", ".xodr", ".xml"))
    assert files
    for file in files:
        for made in junctions(file):
            check_is_whole(made)


def junctions(file):
    """The junction of a file, or the first three of those that it lists."""
    try:
        return [import_map(file, name="real")]
    except InputError as listed:
        ids = re.findall(r"(?:are|;) (\S+) \(\d legs", str(listed))[:3]
    return [import_map(file, name="real", junction=each) for each in ids]
