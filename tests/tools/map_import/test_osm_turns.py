"""Every turn that an OpenStreetMap file allows is on the map, from the lanes that it marks."""

import importlib.util

import numpy as np
import pytest

from scenewright.tools.map_import import import_map
from tests.tools.map_import.test_junction_kinds import write_osm

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("sumo") is None, reason="SUMO is not installed"
)
TWO = {"highway": "secondary", "lanes": 2, "name": "Main Street"}


def read_turns(made):
    return {(each.entry, each.exit) for each in made.intersection_map.movements}


def write_rule(file, kind, first, via, second):
    """A restriction between the ways of two numbers."""
    rule = f'<relation id="9"><member type="way" ref="{500 + first}" role="from"/>'
    rule += f'<member type="node" ref="{via}" role="via"/>'
    rule += f'<member type="way" ref="{500 + second}" role="to"/>'
    rule += f'<tag k="type" v="restriction"/><tag k="restriction" v="{kind}"/></relation></osm>'
    file.write_text(file.read_text().replace("</osm>", rule))
    return file


def write_divided(file, marks="left|through|through|right"):
    """A street of two carriageways that ends at a junction of two nodes, 8 m apart.

    The short street between them has lanes to the west marked for a turn to the south each, so that
    who comes from the south by its left lane cannot go on to the west as netconvert connects lanes.
    """
    nodes = {1: (4, 0, {}), 2: (-4, 0, {}), 3: (4, -90, {}), 4: (4, 90, {}), 5: (-4, 90, {})}
    nodes |= {6: (-4, -90, {}), 7: (-90, -4, {}), 8: (-90, 4, {}), 9: (90, 0, {})}
    up, across = ({"highway": "secondary", "name": x} for x in ("5th Avenue", "Northgate Way"))
    between = {"lanes": 6, "lanes:backward": 4, "lanes:forward": 2}
    between["turn:lanes:backward"] = "left|left|through|through;right"
    one = {"oneway": "yes"}
    ways = [
        ((3, 1), {**up, **one, "lanes": 4, "turn:lanes": marks}),
        ((1, 4), {**up, **one, "lanes": 2}),
        ((5, 2), {**up, **one, "lanes": 3, "turn:lanes": "left||"}),
        ((2, 6), {**up, **one, "lanes": 2}),
        ((7, 2), {**across, **one, "lanes": 3, "turn:lanes": "left|through|through;right"}),
        ((2, 8), {**across, **one, "lanes": 2}), ((2, 1), {**across, **between}),
        ((1, 9), {**across, **between}),
    ]  # fmt: skip
    return write_osm(file, nodes, ways)


def test_a_turn_that_is_lost_between_the_nodes_of_one_junction_is_added(tmp_path):
    made = import_map(write_divided(tmp_path / "x.osm"), name="x")
    sides = ("north", "east", "south", "west")
    assert read_turns(made) == {(a, b) for a in sides for b in sides if a != b}
    assert any("the way from south to west was added" in note for note in made.notes)
    lines = made.route_lines["vehicle:south>west:left"]
    assert all(np.hypot(*np.diff(line, axis=0).T).max() < 1.0 for line in lines)


def test_a_turn_that_the_file_forbids_is_not_added(tmp_path):
    file = write_rule(write_divided(tmp_path / "x.osm"), "no_left_turn", 0, 1, 6)
    made = import_map(file, name="x")
    assert ("south", "west") not in read_turns(made)
    assert ("north", "west") in read_turns(made)
    assert "no way leads from south to west" in made.notes


def test_lanes_lead_where_they_are_marked_for(tmp_path):
    made = import_map(write_divided(tmp_path / "x.osm"), name="x")
    lanes = {each.id: each for each in made.intersection_map.lanelets}
    exits = {
        name: {lanes[lanes[x].successors[0]].leg for x in each.successors}
        for name, each in lanes.items()
        if each.kind == "approach" and each.leg == "west"
    }
    # From the left to the right: for a turn to the left, straight on, straight on and to the right.
    order = sorted(exits, key=lambda name: -lanes[name].centreline[0][1])
    assert [exits[name] for name in order] == [{"north"}, {"east"}, {"east", "south"}]


@pytest.mark.parametrize(
    ("marks", "words"),
    [
        ("left|through|through|through", "name no lane for the way to Northgate Way"),
        ("left|through|right", "are not followed: 4 lanes are there"),
    ],
)
def test_marks_that_the_streets_contradict_are_named(tmp_path, marks, words):
    made = import_map(write_divided(tmp_path / "x.osm", marks), name="x")
    [note] = [each for each in made.notes if "turn:lanes of way 500" in each]
    assert marks in note
    assert words in note


def test_a_mark_for_a_turn_to_no_street_is_named(tmp_path):
    nodes = {1: (0, 0, {}), 2: (-90, 0, {}), 3: (90, 0, {}), 4: (0, -90, {})}
    marked = {**TWO, "oneway": "yes", "turn:lanes": "left;through|right"}
    side = {"highway": "residential", "name": "Mill Lane"}
    ways = [((2, 1), marked), ((1, 3), {**TWO, "oneway": "yes"}), ((4, 1), side)]
    made = import_map(write_osm(tmp_path / "x.osm", nodes, ways), name="x")
    [note] = [each for each in made.notes if "turn:lanes" in each]
    assert note.endswith("(left;through|right) name left, where no street leads")
