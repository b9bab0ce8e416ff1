"""Tags of streets, and the crossings and lights of OpenStreetMap elements held in memory."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.tools.map_import.osm_features import (
    list_osm_crossings,
    list_osm_lights,
    list_osm_lines,
)
from scenewright.tools.map_import.osm_file import OsmFile, is_driven, is_one_way, read_number


@pytest.mark.parametrize(
    ("text", "number"),
    [("3.5", 3.5), ("4 m", 4.0), ("", None), (None, None), ("wide", None), ("  2", 2.0)],
)
def test_the_number_that_a_tag_begins_with(text, number):
    assert read_number(text) == number


@pytest.mark.parametrize(
    ("tags", "one_way"),
    [
        ({}, False), ({"oneway": "no"}, False), ({"oneway": "yes"}, True), ({"oneway": "-1"}, True),
        ({"junction": "roundabout"}, True), ({"junction": "circular"}, True),
    ],
)  # fmt: skip
def test_a_way_is_one_way_by_its_tag_or_round_an_island(tags, one_way):
    assert is_one_way(tags) is one_way


@pytest.mark.parametrize(
    ("tags", "driven"),
    [
        ({"highway": "residential"}, True), ({"highway": "service"}, False),
        ({"highway": "footway"}, False), ({"highway": "primary", "area": "yes"}, False),
        ({"highway": "primary", "access": "no"}, False), ({}, False),
    ],
)  # fmt: skip
def test_streets_are_what_cars_drive_along(tags, driven):
    assert is_driven(tags) is driven


def make_file(node_tags=None, *, degrees=0.0, road=None, walks=()):
    """A road of 80 m with a node in its middle, and footways across it by id."""
    a = math.radians(degrees)
    matrix = np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]])
    places = {"1": (-40, 0), "2": (0, 0), "3": (40, 0), "4": (20, -9), "5": (20, 9)}
    nodes = {name: np.array(xy, float) @ matrix for name, xy in places.items()}
    ways = {"10": ({"highway": "primary", **(road or {})}, ("1", "2", "3"))}
    ways |= {name: (tags, ("4", "5")) for name, tags in walks}
    return OsmFile(nodes, {"2": node_tags} if node_tags else {}, ways), matrix


@given(st.floats(0.0, 360.0), st.integers(1, 5))
def test_a_crossing_node_lies_straight_across_as_wide_as_the_lanes(degrees, lanes):
    osm, matrix = make_file({"highway": "crossing"}, degrees=degrees, road={"lanes": str(lanes)})
    [crossing] = list_osm_crossings(osm, np.zeros(2))
    across = (crossing.line[1] - crossing.line[0]) @ matrix.T
    assert np.abs(across) == pytest.approx((0.0, 3.25 * lanes + 3.0), abs=1e-9)
    assert crossing.line.mean(axis=0) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert not crossing.is_bounded


@pytest.mark.parametrize(
    ("tags", "signalised", "marked"),
    [
        ({"crossing": "traffic_signals"}, True, True), ({"crossing": "zebra"}, False, True),
        ({"crossing": "unmarked"}, False, False), ({}, None, True),
        ({"crossing:signals": "yes"}, True, True), ({"crossing:markings": "no"}, None, False),
    ],
)  # fmt: skip
def test_the_tags_of_a_crossing_say_its_lights_and_marks(tags, signalised, marked):
    osm, _ = make_file({"highway": "crossing", **tags})
    [crossing] = list_osm_crossings(osm, np.zeros(2))
    assert (crossing.is_signalised, crossing.is_marked) == (signalised, marked)


@pytest.mark.parametrize(
    ("tags", "count"),
    [
        ({"highway": "footway", "footway": "crossing"}, 1),
        ({"highway": "footway", "footway": "crossing", "crossing": "no"}, 0),
        ({"highway": "footway"}, 0), ({"highway": "cycleway", "cycleway": "crossing"}, 0),
        ({"highway": "cycleway", "cycleway": "crossing", "foot": "yes"}, 1),
    ],
)  # fmt: skip
def test_a_way_on_foot_over_a_road_is_a_crossing_between_its_ends(tags, count):
    osm, _ = make_file(walks=[("20", tags)])
    found = list_osm_crossings(osm, np.array([20.0, 1.0]))
    assert len(found) == count
    for crossing in found:
        assert crossing.source == "way 20"
        assert crossing.line.mean(axis=0) == pytest.approx((0.0, -1.0))
        assert sorted(crossing.limits[:, 1]) == pytest.approx([-10.0, 8.0])


def test_lights_are_those_on_roads():
    osm, _ = make_file({"highway": "traffic_signals"})
    [light] = list_osm_lights(osm, np.array([1.0, 2.0]))
    assert light.place == pytest.approx((-1.0, -2.0))
    osm.node_tags["4"] = {"highway": "traffic_signals"}
    assert len(list_osm_lights(osm, np.zeros(2))) == 1


def test_lines_for_pictures_are_sorted_by_kind():
    osm, _ = make_file(walks=[("20", {"highway": "path", "path": "crossing"}),
                              ("21", {"highway": "steps"})])  # fmt: skip
    kinds = {kind: len(lines) for kind, lines in list_osm_lines(osm).items()}
    assert kinds == {"roads": 1, "crossings": 1, "paths": 1, "crossing_nodes": 0, "lights": 0}
