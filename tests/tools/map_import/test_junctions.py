"""Which nodes of a street network are one junction, and how one is listed and chosen."""

import gzip
import importlib.util
import math
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import map_files
from scenewright.errors import InputError
from scenewright.geometry.polyline import find_point, measure_distances, measure_length
from scenewright.tools.map_import import import_map, list_junctions
from scenewright.tools.map_import.junction_groups import StreetPiece, group_junctions
from scenewright.tools.map_import.legs import find_legs
from scenewright.tools.map_import.mapped_crosswalks import CrossingChoice
from scenewright.tools.map_import.osm_file import cut_out, is_driven
from scenewright.tools.map_import.signal_programs import find_lit_legs
from scenewright.tools.map_import.survey import SurveyLight

needs_sumo = pytest.mark.skipif(
    importlib.util.find_spec("sumo") is None, reason="SUMO is not installed"
)
needs_osmium = pytest.mark.skipif(
    importlib.util.find_spec("osmium") is None, reason="osmium is not installed"
)


def network(places, streets):
    """Groups of a network of straight pieces: (from, to, name[, flags])."""
    spots = {name: np.array(xy, dtype=float) for name, xy in places.items()}
    pieces = [
        StreetPiece(a, b, np.array([spots[a], spots[b]]), name, **dict.fromkeys(flags, True))
        for a, b, name, *flags in streets
    ]
    return group_junctions(spots, pieces)


def test_a_roundabout_is_one_junction_of_its_arms():
    ring = {
        f"r{k}": (15 * math.cos(k * math.pi / 2), 15 * math.sin(k * math.pi / 2)) for k in range(4)
    }
    arms = {f"a{k}": (6 * x, 6 * y) for k, (x, y) in enumerate(ring.values())}
    pieces = [(f"r{k}", f"r{(k + 1) % 4}", "", "is_ring", "is_one_way") for k in range(4)]
    pieces += [(f"r{k}", f"a{k}", f"Arm {k}") for k in range(4)]
    [found] = network(ring | arms, pieces)
    assert found.is_roundabout
    assert found.nodes == set(ring)
    assert sorted(found.streets) == ["Arm 0", "Arm 1", "Arm 2", "Arm 3"]
    assert found.xy == pytest.approx((0, 0), abs=1e-9)


def test_the_carriageways_of_a_divided_street_are_one_leg_each_way():
    places = {"a": (0, 12), "b": (0, -12), "n": (0, 120), "s": (0, -120)}
    places |= {"aw": (-150, 12), "ae": (150, 12), "bw": (-150, -12), "be": (150, -12)}
    one_way = [("ae", "a"), ("a", "aw"), ("bw", "b"), ("b", "be")]
    pieces = [(*ends, "Main", "is_one_way") for ends in one_way]
    pieces += [("n", "a", "Side"), ("b", "s", "Side"), ("a", "b", "Side")]
    [found] = network(places, pieces)
    assert found.nodes == {"a", "b"}
    assert list(found.streets) == ["Side", "Main", "Side", "Main"]


def test_two_crossings_a_block_apart_are_two():
    places = {"a": (0, 0), "b": (60, 0), "w": (-90, 0), "e": (160, 0)}
    places |= {"an": (0, 90), "as": (0, -90), "bn": (60, 90)}
    ends = [("w", "a"), ("a", "b"), ("b", "e"), ("a", "an"), ("a", "as"), ("b", "bn")]
    assert [each.legs for each in network(places, [(*pair, "X") for pair in ends])] == [4, 3]


def test_a_bend_is_no_junction():
    assert (
        network({"a": (0, 0), "b": (50, 0), "c": (50, 50)}, [("a", "b", "X"), ("b", "c", "X")])
        == []
    )


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    file = tmp_path_factory.mktemp("town") / "town.osm"
    names = ["Elm Street", "Mill Road", "Elm Street", "King's Avenue"]
    return map_files.osm(file, (0, 90, 180, 270), names=names, second=True)


@needs_osmium
def test_all_junctions_are_listed_with_streets_and_places(town):
    found = list_junctions(town).junctions
    assert [each.id for each in found] == ["1", "101"]
    assert set(found[0].streets) == {"Elm Street", "Mill Road", "King's Avenue"}
    assert found[0].degrees == pytest.approx(map_files.ORIGIN, abs=1e-6)


@needs_osmium
def test_packed_files_list_the_same(town, tmp_path):
    packed = tmp_path / "town.osm.gz"
    packed.write_bytes(gzip.compress(town.read_bytes()))
    assert list_junctions(packed).junctions == list_junctions(town).junctions
    packed.write_bytes(gzip.compress(town.read_bytes())[:300])
    with pytest.raises(InputError, match="damaged"):
        list_junctions(packed)


@needs_osmium
def test_protocol_buffers_are_read(town, tmp_path):
    import osmium

    packed = tmp_path / "town.osm.pbf"
    with osmium.SimpleWriter(str(packed)) as writer:
        for each in osmium.FileProcessor(str(town)):
            writer.add(each)
    found, expected = (list_junctions(file).junctions for file in (packed, town))
    assert [(x.id, x.streets) for x in found] == [(x.id, x.streets) for x in expected]
    cut = tmp_path / "cut.osm.pbf"
    cut.write_bytes(packed.read_bytes()[:-9])
    with pytest.raises(InputError, match="damaged"):
        list_junctions(cut)


@needs_sumo
def test_too_many_legs_are_refused_in_list_and_import(tmp_path):
    file = map_files.osm(tmp_path / "star.osm", range(0, 360, 36))
    [found] = list_junctions(file).junctions
    assert (found.legs, found.refusal) == (10, "it has 10 legs; an intersection has 3 to 8")
    with pytest.raises(InputError, match="cannot be imported: it has 10 legs"):
        import_map(file, name="x")


@needs_sumo
def test_lights_behind_a_fork_to_a_slip_lane_are_lights_of_the_leg(tmp_path):
    file = map_files.osm(tmp_path / "four.osm", (0, 90, 180, 270), signals=False)
    survey = import_map(file, name="x").survey
    way = max(survey.connections, key=lambda each: measure_length(each.line))
    place = find_point(way.line, 0.45 * measure_length(way.line))
    away = [measure_distances(place[None], x.line).min() for x in survey.approaches.values()]
    assert min(away) > 6.0
    lit = replace(survey, lights=(SurveyLight(place),))
    legs = find_legs(lit)
    [leg] = find_lit_legs(lit, legs, CrossingChoice({}, ()))
    assert way.approach in {lane.id for lane in legs[leg].approaches}


@needs_osmium
def test_ways_before_their_nodes_list_the_same(town, tmp_path):
    tree = ElementTree.parse(town)
    tree.getroot()[:] = sorted(tree.getroot(), key=lambda each: each.tag, reverse=True)
    tree.write(tmp_path / "turned.osm")
    assert list_junctions(tmp_path / "turned.osm").junctions == list_junctions(town).junctions


@needs_sumo
def test_a_junction_is_chosen_by_its_streets_and_ids_outlast_the_driving_side(town):
    with pytest.raises(InputError, match=r"no junction of Oak Lane; its streets are .*Elm Street"):
        import_map(town, name="x", streets=["Oak Lane"])
    lon = map_files.ORIGIN[1]
    for left in (False, True):
        made = import_map(town, name="x", junction="101", left_hand=left)
        assert made.survey.origin[1] > lon + 0.01
        assert {leg.road for leg in made.intersection_map.legs} == {
            "Elm Street", "Mill Road", "King's Avenue",
        }  # fmt: skip


def test_a_slip_lane_of_a_roundabout_to_another_street_is_no_part_of_it():
    ring = {
        f"r{k}": (15 * math.cos(k * math.pi / 2), 15 * math.sin(k * math.pi / 2)) for k in range(4)
    }
    places = ring | {"e": (90, 0), "n": (0, 90), "w": (-90, 0), "x": (20, -80)}
    places |= {"x1": (130, -80), "x2": (20, -170)}
    pieces = [(f"r{k}", f"r{(k + 1) % 4}", "", "is_ring", "is_one_way") for k in range(4)]
    pieces += [("r0", "e", "E"), ("r1", "n", "N"), ("r2", "w", "W")]
    pieces += [("r3", "x", "", "is_one_way", "is_slip"), ("x", "x1", "Other"), ("x2", "x", "Other")]
    found = next(each for each in network(places, pieces) if each.is_roundabout)
    assert found.nodes == set(ring)
    assert sorted(found.streets) == ["", "E", "N", "W"]


def test_streets_of_a_junction_that_meet_and_lead_nowhere_are_no_leg():
    places = {"a": (0, 6), "b": (0, -6), "end": (-30, 0)}
    places |= {"n": (0, 90), "s": (0, -90), "e": (90, 0)}
    pieces = [(*pair, "X") for pair in (("a", "b"), ("a", "n"), ("b", "s"), ("a", "e"))]
    pieces += [("a", "end", "Dead", "is_one_way"), ("b", "end", "Dead", "is_one_way")]
    [found] = network(places, pieces)
    assert list(found.streets) == ["X", "X", "X"]


@pytest.mark.parametrize(
    ("tags", "closed"),
    [
        ({"motor_vehicle": "no"}, True),
        ({"motor_vehicle": "private", "bus": "yes"}, True),
        ({"access": "no", "psv": "yes"}, True),
        ({"vehicle": "no", "motorcar": "yes"}, False),
        ({"access": "private"}, False),
        ({"bus": "yes"}, False),
    ],
)
def test_streets_for_buses_alone_are_no_streets_for_cars(tags, closed):
    assert is_driven({"highway": "tertiary", **tags}) is not closed


@needs_osmium
def test_a_street_for_buses_alone_is_neither_listed_nor_converted(tmp_path):
    file = map_files.osm(tmp_path / "four.osm", (0, 90, 180, 270))
    name = '<tag k="name" v="Street 2"/>'
    bus = '<tag k="motor_vehicle" v="no"/><tag k="bus" v="yes"/>'
    file.write_text(file.read_text().replace(name, name + bus))
    [found] = list_junctions(file).junctions
    assert set(found.streets) == {"Street 1", "Street 3", "Street 4"}
    cut_out(file, tmp_path / "part.osm", middle=map_files.ORIGIN)
    text = (tmp_path / "part.osm").read_text()
    assert [f"Street {k}" in text for k in range(1, 5)] == [True, False, True, True]
