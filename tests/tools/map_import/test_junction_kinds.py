"""What is one junction and what is none: kinds of faults that files of users showed."""

import importlib.util
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from scenewright.cli.import_commands import list_rows
from scenewright.errors import InputError
from scenewright.tools.map_import import import_map, list_junctions
from scenewright.tools.map_import.assemble import assemble_map
from scenewright.tools.map_import.driving_side import find_opendrive_side
from scenewright.tools.map_import.opendrive_features import read_opendrive_file
from scenewright.tools.map_import.survey_lanes import _Path
from tests.tools.map_import.test_junctions import network
from tests.tools.map_import.test_rings import bend, commonroad, list_lanes

needs_sumo = pytest.mark.skipif(
    importlib.util.find_spec("sumo") is None, reason="SUMO is not installed"
)

STEPS = [np.array(step) for step in ((1, 0), (0, 1), (-1, 0), (0, -1))]
PITCH, THROAT = 60.0, 8.0


def draw_grid(file, count):
    """Lanes of `count` by `count` two-way streets, 60 m apart, one lane each way."""

    def place(corner, step, distance):
        return PITCH * corner + distance * step + 1.75 * np.array([step[1], -step[0]])

    def has(corner):
        return corner.min() >= 0 and corner.max() < count

    lanes = []
    for corner in np.argwhere(np.ones((count, count))):
        lanes += [
            np.array([place(corner, step, THROAT), place(corner, step, PITCH - THROAT)])
            for step in STEPS
            if has(corner + step)
        ]
        for step in (each for each in STEPS if has(corner - each)):
            for onto in (each for each in STEPS if has(corner + each) and each @ step >= 0):
                begin, end = place(corner, step, -THROAT), place(corner, onto, THROAT)
                lanes.append(bend(begin, begin + step * ((end - begin) @ step), end))
    return commonroad(file, lanes)


def test_no_block_of_a_grid_is_a_roundabout_and_corners_are_no_junctions(tmp_path):
    found = list_junctions(draw_grid(tmp_path / "grid.xml", 3)).junctions
    assert sorted(each.legs for each in found) == [3, 3, 3, 3, 4]
    assert not any(each.is_roundabout for each in found)


def test_the_ways_that_are_looked_at_grow_as_the_junctions_do(tmp_path, monkeypatch):
    join, names = _Path.join.__func__, []
    monkeypatch.setattr(
        _Path, "join", classmethod(lambda *given: names.append(given[2]) or join(*given))
    )
    found = list_junctions(draw_grid(tmp_path / "grid.xml", 5)).junctions
    assert len(found) == 21
    assert len(names) < 16 * len(found)


def test_a_file_without_a_junction_is_refused_in_one_line_by_list_and_import(tmp_path):
    lanes = [np.array([(0.0, y), (60.0, y), (120.0, y)]) for y in (0.0, -3.5)]
    file = commonroad(tmp_path / "road.xml", lanes)
    for read in (list_rows, lambda path: import_map(path, name="x")):
        with pytest.raises(InputError, match="no junction of three or more legs"):
            read(str(file))


def test_strips_are_no_lanes_for_cars_and_are_counted(tmp_path):
    file = commonroad(tmp_path / "ring.xml", list_lanes())
    strip = "".join(
        f"<{side}><point><x>34</x><y>{y}</y></point><point><x>90</x><y>{y}</y></point></{side}>"
        for side, y in (("leftBound", 6.5), ("rightBound", 5.0))
    )
    text = file.read_text().replace(
        "</commonRoad>", f'<lanelet id="99">{strip}</lanelet></commonRoad>'
    )
    file.write_text(text)
    made = import_map(file, name="x")
    assert "1 strips narrower than 2 m were dropped: no lanes for cars" in made.notes
    assert len(made.survey.approaches) == 4


@pytest.mark.parametrize(
    ("rules", "left", "words"),
    [
        (("RHT", "RHT", "LHT"), False, 'right: 2 roads .* rule="RHT", but 1 have rule="LHT"'),
        (("RHT", "LHT"), False, 'but 1 have rule="LHT"; --left-hand changes it'),
        (("LHT", "LHT"), True, '2 roads of the file have rule="LHT"$'),
    ],
)
def test_opposite_rules_of_driving_in_one_file_are_named(tmp_path, rules, left, words):
    roads = "".join(f'<road id="{k}" rule="{rule}"/>' for k, rule in enumerate(rules))
    (tmp_path / "x.xodr").write_text(f"<OpenDRIVE>{roads}</OpenDRIVE>")
    side = find_opendrive_side(read_opendrive_file(tmp_path / "x.xodr"))
    assert side.left_hand is left
    assert re.search(words, side.describe())


SLIP = {"c": (0, 0), "n": (0, 90), "w": (-90, 0), "e": (110, 0), "s": (0, -110)}
SLIP |= {"fork": (0, -40), "end": (35, 0)}
STREETS = [("n", "c", "Long"), ("c", "fork", "Long"), ("fork", "s", "Long"), ("w", "c", "Mill"),
           ("c", "end", "Ring"), ("end", "e", "Ring")]  # fmt: skip


def test_a_slip_lane_of_no_class_of_its_own_is_part_of_the_junction_and_no_leg():
    [found] = network(SLIP, [*STREETS, ("fork", "end", "Ring", "is_one_way")])
    assert found.nodes == {"c", "fork", "end"}
    assert sorted(found.streets) == ["Long", "Long", "Mill", "Ring"]


def test_a_street_round_a_large_block_is_no_slip_lane():
    far = SLIP | {"fork": (0, -60), "end": (60, 0), "mid": (60, -60)}
    around = [("fork", "mid", "Ring", "is_one_way"), ("mid", "end", "Ring", "is_one_way")]
    assert [each.legs for each in network(far, [*STREETS, *around])] == [4, 3, 3]


def test_a_far_node_to_which_only_one_junction_leads_is_no_part_of_it():
    places = {"c": (0, 0), "m": (-21, 4), "w": (-150, 0), "n": (0, 150), "e": (150, 0)}
    places |= {"s": (0, -150)}
    pieces = [("c", "m", "", "is_one_way"), ("m", "w", "", "is_one_way")]
    pieces += [("w", "c", "", "is_one_way"), ("m", "s", ""), ("c", "n", ""), ("c", "e", "")]
    [found] = network(places, pieces)
    assert found.nodes == {"c", "m"}


def write_osm(file, nodes, ways):
    """Nodes (x, y, tags) in metres by id, and ways (nodes, tags)."""
    lat = math.degrees(1 / 6_371_000.0)

    def write(tags):
        return "".join(f'<tag k="{k}" v="{v}"/>' for k, v in tags.items())

    text = "".join(
        f'<node id="{k}" lat="{52 + y * lat:.9f}" '
        f'lon="{10 + x * lat / math.cos(math.radians(52)):.9f}">{write(tags)}</node>'
        for k, (x, y, tags) in nodes.items()
    )
    for k, (refs, tags) in enumerate(ways):
        text += f'<way id="{500 + k}">' + "".join(f'<nd ref="{n}"/>' for n in refs)
        text += write(tags) + "</way>"
    file.write_text(f'<osm version="0.6">{text}</osm>')
    return file


@needs_sumo
def test_a_crossing_inside_the_junction_is_named_and_no_crosswalk_along_the_other_street(tmp_path):
    wide = {"highway": "primary", "lanes": 4}
    nodes = {1: (0, 0, {}), 2: (-4.5, 0, {"highway": "crossing"}), 3: (-80, 0, {}), 4: (80, 0, {})}
    nodes |= {5: (0, 80, {}), 6: (0, -80, {})}
    ways = [((3, 2, 1, 4), {**wide, "name": "Cross"}), ((6, 1, 5), {**wide, "name": "Long"})]
    made = import_map(write_osm(tmp_path / "x.osm", nodes, ways), name="x")
    walks = {each.leg: np.array(each.centreline) for each in made.intersection_map.crosswalks}
    assert len(walks) == 4
    assert all(np.hypot(*np.diff(walk, axis=0)[0]) < 15 for walk in walks.values())
    assert walks["west"][:, 0].max() < -6.5
    [fact] = [each for each in made.crosswalks if each.leg == "west"]
    assert fact.origin == "derived"
    assert "node 2 lies" in fact.left_out[0]
    assert "too deep inside the junction" in fact.left_out[0]


@needs_sumo
def test_the_turn_over_a_slip_lane_is_there_or_the_report_counts_it_as_lost(tmp_path):
    nodes = {1: (0, 0, {}), 2: (-90, 0, {}), 3: (35, 0, {}), 4: (110, 0, {}), 5: (0, 90, {})}
    nodes |= {6: (0, -40, {}), 7: (0, -110, {})}
    small = {"highway": "residential"}
    ways = [((2, 1, 3, 4), {**small, "name": "Ring"}), ((7, 6, 1, 5), {**small, "name": "Long"})]
    slip = [((6, 3), {**small, "name": "Ring", "oneway": "yes"})]
    bar = '<relation id="9"><member type="way" ref="501" role="from"/><member type="node" ref="1" '
    bar += 'role="via"/><member type="way" ref="500" role="to"/><tag k="type" v="restriction"/>'
    bar += '<tag k="restriction" v="no_right_turn"/></relation></osm>'
    file = write_osm(tmp_path / "x.osm", nodes, [*ways, *slip])
    file.write_text(file.read_text().replace("</osm>", bar))
    made = import_map(file, name="x")
    assert [each.legs for each in list_junctions(file).junctions] == [4]
    turns = {(each.entry, each.exit) for each in made.intersection_map.movements}
    assert len(turns) == 12
    assert next(each for each in made.items if each.item == "ways through").score == 1.0


def test_a_turning_lane_leaves_the_lane_beside_it(tmp_path):
    file = commonroad(tmp_path / "four.xml", list_lanes())
    survey = import_map(file, name="x").survey
    lane = min(survey.approaches.values(), key=lambda each: -each.line[0][0])
    line = lane.line[-12:] + np.array([0.0, 3.5])
    own = replace(lane, id="turn", line=line)
    ways = [each for each in survey.connections if each.approach == lane.id]
    approaches = {**survey.approaches, "turn": own}
    turn = [replace(each, approach="turn") for each in ways[:1]]
    survey = replace(survey, approaches=approaches, connections=(*survey.connections, *turn))
    made = assemble_map(survey, "commonroad", name="x").intersection_map
    lanes = [np.array(x.centreline) for x in made.lanelets if x.leg == "east"]
    [turning, straight] = [x for x in lanes if x[0, 0] > x[-1, 0]]
    apart = np.abs(turning[:, 1] - np.interp(turning[:, 0], straight[::-1, 0], straight[::-1, 1]))
    assert apart[:2].max() < 0.3
    assert apart[-3:].min() > 3.0


def test_one_way_streets_of_a_grid_are_no_carriageways_of_one_street():
    places = {"a": (0, 0), "b": (40, 0), "an": (0, 90), "as": (0, -90), "bn": (40, 90)}
    places |= {"bs": (40, -90), "w": (-90, 0), "e": (130, 0)}
    main = [("w", "a", "Main"), ("a", "b", "Main"), ("b", "e", "Main")]

    def count(first, second):
        up = [("as", "a", first, "is_one_way"), ("a", "an", first, "is_one_way")]
        down = [("bn", "b", second, "is_one_way"), ("b", "bs", second, "is_one_way")]
        return [each.legs for each in network(places, [*main, *up, *down])]

    assert count("Elm Street", "Oak Street") == [4, 4]
    assert count("Elm Street", "Elm Street") == [4]
    assert len(count("", "")) == 1


@needs_sumo
def test_streets_that_are_tagged_too_narrow_for_two_lanes_are_streets(tmp_path):
    narrow = {"highway": "residential", "lanes": 1, "width": 3}
    nodes = {1: (0, 0, {}), 2: (-80, 0, {}), 3: (80, 0, {}), 4: (0, 80, {})}
    ways = [((2, 1, 3), {**narrow, "name": "Cross"}), ((1, 4), {**narrow, "name": "Long"})]
    file = write_osm(tmp_path / "x.osm", nodes, ways)
    [listed] = list_junctions(file).junctions
    made = import_map(file, name="x")
    assert listed.legs == len(made.intersection_map.legs) == 3
    assert {lane.width for lane in made.intersection_map.lanelets} == {2.5}
    assert any("tagged too narrow" in note for note in made.notes)


@needs_sumo
def test_ways_that_an_editor_drew_have_ids_below_zero_and_its_nodes_are_refused_in_one_line(
    tmp_path,
):
    nodes = {1: (0, 0, {}), 2: (-80, 0, {}), 3: (80, 0, {}), 4: (0, 80, {})}
    road = {"highway": "residential"}
    file = write_osm(tmp_path / "x.osm", nodes, [((2, 1, 3), road), ((1, 4), road)])
    file.write_text(file.read_text().replace('way id="', 'way id="-'))
    assert len(import_map(file, name="x").intersection_map.legs) == 3
    file.write_text(re.sub('(node id|ref)="', r'\1="-', file.read_text()))
    with pytest.raises(InputError, match="nodes with ids below zero"):
        list_junctions(file)


def test_a_lane_that_becomes_wider_goes_on(tmp_path):
    lanes = list_lanes()
    whole = import_map(commonroad(tmp_path / "four.xml", lanes), name="x").intersection_map
    text = (tmp_path / "four.xml").read_text()
    # The outer bound of the lane from the east ends 1.5 m beside that of its way on.
    end = "<point><x>34.0000</x><y>4.7500</y></point></rightBound>"
    assert text.count(end) == 1
    (tmp_path / "wide.xml").write_text(text.replace(end, end.replace("4.75", "6.25")))
    made = import_map(tmp_path / "wide.xml", name="x").intersection_map
    assert len(made.movements) == len(whole.movements)
