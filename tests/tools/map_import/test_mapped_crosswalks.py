"""Crosswalks lie where the file draws them, in every format."""

import importlib.util
import math
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import map_files
from scenewright.errors import InputError
from scenewright.geometry.geographic import project_ellipsoid, unproject_ellipsoid
from scenewright.tools.map_import import import_map
from scenewright.tools.map_import.opendrive_features import (
    list_opendrive_crossings,
    read_opendrive_file,
)
from scenewright.tools.map_import.osm_features import list_osm_crossings
from scenewright.tools.map_import.osm_file import read_osm_file
from scenewright.tools.map_import.read_lanelet2 import FileElements, read_crossings

needs_sumo = pytest.mark.skipif(
    importlib.util.find_spec("sumo") is None, reason="SUMO is not installed"
)
METRE = 1 / 111_195.0


def add_to_osm(file, nodes, ways=()):
    """Nodes (id, x, y, tags) and ways (id, node ids, tags) in an OpenStreetMap file."""
    tree = ElementTree.parse(file)
    lat, lon = map_files.ORIGIN
    for name, x, y, tags in nodes:
        place = {
            "lat": f"{lat + y * METRE:.9f}",
            "lon": f"{lon + x * METRE / math.cos(math.radians(lat)):.9f}",
        }
        node = ElementTree.SubElement(tree.getroot(), "node", {"id": str(name), **place})
        for k, v in tags.items():
            ElementTree.SubElement(node, "tag", {"k": k, "v": v})
    for name, refs, tags in ways:
        way = ElementTree.SubElement(tree.getroot(), "way", {"id": str(name)})
        for ref in refs:
            ElementTree.SubElement(way, "nd", {"ref": str(ref)})
        for k, v in tags.items():
            ElementTree.SubElement(way, "tag", {"k": k, "v": v})
    tree.write(file)
    return file


def put_on_way(file, way, node):
    """A node as the second one of a way."""
    tree = ElementTree.parse(file)
    element = next(w for w in tree.getroot().iter("way") if w.get("id") == str(way))
    element.insert(1, ElementTree.Element("nd", {"ref": str(node)}))
    tree.write(file)


@needs_sumo
def test_crossing_nodes_and_ways_of_openstreetmap_are_where_the_file_has_them(tmp_path):
    file = map_files.osm(tmp_path / "four.osm", (0, 90, 180, 270))
    crossing = {"highway": "crossing", "crossing": "traffic_signals"}
    add_to_osm(
        file,
        [(901, 17.0, 0.0, crossing), (902, -8.0, 21.0, {}), (903, 8.0, 21.0, {})],
        [(990, (902, 903), {"highway": "footway", "footway": "crossing"})],
    )
    put_on_way(file, 1000, 901)
    made = import_map(file, name="four")
    facts = {fact.leg: fact for fact in made.crosswalks}
    assert facts["east"].sources == ("node 901",)
    assert facts["north"].sources == ("way 990",)
    for leg, there in (("east", (17.0, 0.0)), ("north", (0.0, 21.0))):
        middle = np.array(facts[leg].middle) + made.survey.offset - _shift(made)
        assert middle == pytest.approx(there, abs=0.6)
    assert facts["west"].origin == facts["south"].origin == "derived"
    assert facts["west"].nearest > 20.0
    assert not any("no crosswalk" in note for note in made.notes)


def _shift(made):
    """Where the hand-written junction lies in the coordinates of the file [m]."""
    return project_ellipsoid(made.survey.file_origin, map_files.ORIGIN)


@pytest.mark.parametrize(
    ("length", "heading", "given"),
    [
        ("1e999", "0", "whose length is '1e999'"),
        ("60", "nan", "whose hdg is 'nan'"),
        ("60", "east", "whose hdg is 'east'"),
        ("5e8", "0", "a road of 5e.08 m"),
    ],
)
def test_an_opendrive_number_that_no_road_has(tmp_path, length, heading, given):
    file = tmp_path / "odd.xodr"
    file.write_text(
        f"""<OpenDRIVE><road id="7" length="60" junction="-1"><planView>
        <geometry s="0" x="0" y="0" hdg="{heading}" length="{length}"><line/></geometry>
        </planView><lanes/></road></OpenDRIVE>"""
    )
    with pytest.raises(InputError, match=given):
        read_opendrive_file(file)


def test_an_opendrive_crosswalk_on_a_curved_road_is_where_its_corners_say(tmp_path):
    radius = 40.0
    file = tmp_path / "arc.xodr"
    file.write_text(
        f"""<OpenDRIVE><header/><road id="7" length="60" junction="-1" rule="LHT"><planView>
        <geometry s="0" x="0" y="0" hdg="0" length="60"><arc curvature="{1 / radius}"/></geometry>
        </planView><lanes/><objects>
        <object id="3" type="crosswalk" s="20" t="1" hdg="{math.pi / 2}"><outline>
        <cornerLocal u="-4" v="1.5"/><cornerLocal u="4" v="1.5"/>
        <cornerLocal u="4" v="-1.5"/><cornerLocal u="-4" v="-1.5"/></outline></object>
        </objects></road></OpenDRIVE>"""
    )
    drive = read_opendrive_file(file)
    [crossing] = list_opendrive_crossings(drive, np.zeros(2))
    turn = 20.0 / radius
    there = (radius - 1.0) * np.array([math.sin(turn), -math.cos(turn)]) + [0.0, radius]
    assert crossing.line.mean(axis=0) == pytest.approx(there, abs=0.01)
    across = crossing.line[1] - crossing.line[0]
    assert np.hypot(*across) == pytest.approx(8.0, abs=0.01)
    assert abs(across @ [math.cos(turn), math.sin(turn)]) < 0.02
    assert crossing.width == pytest.approx(3.0, abs=0.01)
    assert drive.rules == {"LHT": 1}


def test_two_zebra_lines_are_one_crossing_and_a_lanelets_bounds_are_not_read_twice():
    places = {"a": (-6, 0), "b": (6, 0), "c": (6, 4), "d": (-6, 4), "e": (-6, 40), "f": (6, 40)}
    elements = FileElements(
        origin=(0.0, 0.0),
        nodes={name: np.array(xy, dtype=float) for name, xy in places.items()},
        ways={name: ({"type": "zebra_marking"}, ends) for name, *ends in ("1ab", "2cd", "3ef")},
        relations={},
    )
    pair, single = read_crossings(elements, ())
    assert pair.line.mean(axis=0) == pytest.approx([0.0, 2.0], abs=0.02)
    assert pair.width == pytest.approx(4.0, abs=0.02)
    assert single.source == "zebra line 3"
    crosswalk = {"type": "lanelet", "subtype": "crosswalk"}, [("left", "1"), ("right", "2")]
    drawn = replace(elements, relations={"9": crosswalk})
    assert [x.source for x in read_crossings(drawn, ())] == ["zebra line 3"]


def test_one_crossing_drawn_as_node_and_way_counts_once(tmp_path):
    file = map_files.osm(tmp_path / "three.osm", (0, 90, 180))
    add_to_osm(
        file,
        [
            (901, 17.0, 0.0, {"highway": "crossing", "crossing:island": "yes"}),
            (902, 17.0, -9.0, {}),
            (903, 17.0, 9.0, {}),
        ],
        [(990, (902, 901, 903), {"highway": "footway", "footway": "crossing", "width": "5"})],
    )
    put_on_way(file, 1000, 901)
    osm = read_osm_file(file, map_files.ORIGIN)
    [crossing] = list_osm_crossings(osm, np.zeros(2))
    assert (crossing.source, crossing.width, crossing.has_island) == ("node 901", 5.0, True)
    assert sorted(crossing.limits[:, 1]) == pytest.approx([-9.0, 9.0], abs=0.05)


def test_places_on_the_ellipsoid_go_there_and_back():
    origin, xy = (51.5, -0.1), np.array([1234.5, -2345.6])
    place = unproject_ellipsoid(origin, xy)
    assert project_ellipsoid(origin, place) == pytest.approx(xy, abs=0.02)
    north = project_ellipsoid((45.0, 7.0), (45.01, 7.0))
    assert north == pytest.approx(
        [0.0, 1111.32], abs=0.02
    )  # a minute of arc at 45 degrees: 1852.22 m


def test_a_crossing_node_where_roads_meet_lies_across_the_road_that_goes_on(tmp_path):
    file = tmp_path / "tee.osm"
    file.write_text("<osm version='0.6'></osm>")
    places = [(1, -40, 0), (2, 0, 0), (3, 40, 0), (4, 0, 40)]
    nodes = [(n, x, y, {"highway": "crossing"} if n == 2 else {}) for n, x, y in places]
    road = {"highway": "residential"}
    add_to_osm(file, nodes, [(11, (4, 2), road), (12, (1, 2, 3), road)])
    [crossing] = list_osm_crossings(read_osm_file(file, map_files.ORIGIN), np.zeros(2))
    assert crossing.source == "node 2"
    assert crossing.line[0] == pytest.approx((0.0, -crossing.line[1][1]), abs=0.1)
