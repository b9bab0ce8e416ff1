"""Lights and the side of the road are the file's where it has them, and said to be assumed else."""

import importlib.util
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
import pytest
from test_mapped_crosswalks import add_to_osm, put_on_way

import map_files
from scenewright.tools.map_import import driving_side, import_map
from scenewright.tools.map_import.osm_file import read_osm_file

needs_sumo = pytest.mark.skipif(
    importlib.util.find_spec("sumo") is None, reason="SUMO is not installed"
)


@pytest.fixture(autouse=True)
def no_towns(monkeypatch):
    """What the file says, not the list of towns, decides."""
    monkeypatch.setattr(driving_side, "find_side_of_place", lambda _place: None)


def find_side(file):
    return driving_side.find_osm_side(read_osm_file(file, map_files.ORIGIN), map_files.ORIGIN)


def test_a_file_without_evidence_is_said_to_be_assumed(tmp_path):
    side = find_side(map_files.osm(tmp_path / "plain.osm", (0, 90, 180)))
    assert (side.left_hand, side.is_known) == (False, False)
    assert "assumed" in side.describe()
    assert "--left-hand" in side.describe()


@pytest.mark.parametrize(
    ("tags", "left"),
    [({"addr:country": "GB"}, True), ({"addr:country": "DE"}, False),
     ({"driving_side": "left", "addr:country": "DE"}, True)],
)  # fmt: skip
def test_tags_of_an_openstreetmap_file_say_the_side(tmp_path, tags, left):
    file = map_files.osm(tmp_path / "tagged.osm", (0, 90, 180))
    side = find_side(add_to_osm(file, [(901, 30.0, 30.0, tags)]))
    assert (side.left_hand, side.is_known) == (left, True)


@pytest.mark.parametrize("clockwise", [True, False])
def test_a_roundabout_shows_the_side_by_its_direction(tmp_path, clockwise):
    angles = np.linspace(0.0, 2 * np.pi, 9)[: -1 if clockwise else None]
    turn = -1.0 if clockwise else 1.0
    nodes = [
        (910 + i, 80.0 + 15.0 * np.cos(a), turn * 15.0 * np.sin(a), {})
        for i, a in enumerate(angles)
    ]
    way = (990, [n[0] for n in nodes], {"highway": "primary", "junction": "roundabout"})
    file = map_files.osm(tmp_path / "ring.osm", (90, 180, 270))
    side = find_side(add_to_osm(file, nodes, [way]))
    assert (side.left_hand, side.is_known) == (clockwise, False)


def test_lanelets_show_the_side_and_an_option_overrules(tmp_path):
    file = map_files.lanelet2(tmp_path / "four.osm")
    made = import_map(file, name="four")
    assert not made.intersection_map.left_hand_traffic
    assert any("drives on the right: " in note and "assumed" not in note for note in made.notes)
    assert import_map(file, name="four", left_hand=True).intersection_map.left_hand_traffic


def test_traffic_lights_of_lanelets_give_a_checked_programme(tmp_path):
    file = map_files.lanelet2(tmp_path / "lit.osm")
    tree = ElementTree.parse(file)
    root = tree.getroot()
    lanelets = [r for r in root.iter("relation") if r.find("tag[@v='lanelet']") is not None]
    for approach in lanelets[0:20:5]:
        ElementTree.SubElement(
            approach, "member", {"type": "relation", "ref": "77", "role": "regulatory_element"}
        )
    rule = ElementTree.SubElement(root, "relation", {"id": "77"})
    for k, v in (("type", "regulatory_element"), ("subtype", "traffic_light")):
        ElementTree.SubElement(rule, "tag", {"k": k, "v": v})
    tree.write(file)
    made = import_map(file, name="lit")
    [signals] = [item for item in made.items if item.item == "signals"]
    assert signals.state == "partly read"
    assert "assumed" in signals.detail
    check_no_clash(made.intersection_map)
    assert import_map(file, name="lit", signals="none").intersection_map.signals is None


def check_no_clash(place):
    """No two ways straight on that cross have green together."""
    straight = {m.entry: m.id for m in place.movements if m.turn == "straight"}
    assert place.signals is not None
    assert len(straight) >= 2
    for a, b in combinations(straight, 2):
        if frozenset((straight[a], straight[b])) in place.zone_pairs:
            for phase in place.signals.phases:
                assert (phase.colours[a], phase.colours[b]) != ("green", "green")


@needs_sumo
def test_openstreetmap_lights_at_stop_lines_make_a_signalised_junction(tmp_path):
    file = map_files.osm(tmp_path / "off.osm", (0, 90, 180, 270), signals=False)
    light = {"highway": "traffic_signals"}
    add_to_osm(file, [(901, 24.0, 0.0, light), (902, -24.0, 0.0, light)])
    for way, node in ((1000, 901), (1002, 902)):
        put_on_way(file, way, node)
    made = import_map(file, name="off")
    assert any("the file has lights on" in note for note in made.notes)
    check_no_clash(made.intersection_map)


@needs_sumo
def test_the_programme_of_a_network_is_kept(tmp_path):
    net = map_files.sumo_net(tmp_path / "lit.net.xml", (0, 90, 180, 270), kind="traffic_light")
    made = import_map(net, name="lit")
    durations = [
        float(each.attrib["duration"]) for each in ElementTree.parse(net).getroot().iter("phase")
    ]
    assert made.intersection_map.signals.cycle == pytest.approx(sum(durations))
    [signals] = [item for item in made.items if item.item == "signals"]
    assert signals.state == "read"
    check_no_clash(made.intersection_map)


@needs_sumo
def test_crossings_of_a_network_are_where_it_has_them_and_obey_its_programme(tmp_path):
    net = map_files.sumo_net(
        tmp_path / "walk.net.xml", (0, 90, 180, 270), kind="traffic_light", crossings=True
    )
    made = import_map(net, name="walk")
    root = ElementTree.parse(net).getroot()
    shapes = [
        [tuple(map(float, point.split(","))) for point in edge.find("lane").attrib["shape"].split()]
        for edge in root.iter("edge")
        if edge.get("function") == "crossing"
    ]
    middles = [np.mean([shape[0], shape[-1]], axis=0) for shape in shapes]
    place = made.intersection_map
    assert [fact.origin for fact in made.crosswalks] == ["file"] * 4
    for walk in place.crosswalks:
        own = np.mean(walk.centreline, axis=0) + made.survey.offset
        assert min(np.hypot(*(own - middle)) for middle in middles) < 1.5
    assert place.signals.cycle == pytest.approx(
        sum(float(each.attrib["duration"]) for each in root.iter("phase"))
    )
    assert {walk for group in place.signals.groups for walk in group.crosswalks} == {
        walk.id for walk in place.crosswalks
    }
