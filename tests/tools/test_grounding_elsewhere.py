"""Other maps than four legs in right-hand traffic: what an instruction means there."""

import importlib.util

import map_files
import pytest

from scenewright.errors import Rejected
from scenewright.scene.relations import pattern_named
from scenewright.scene.social import AgentNode, SceneContext, SocialGraph
from scenewright.tools.map_grounding import ground, serves
from scenewright.tools.map_import import import_map


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    file = map_files.lanelet2(tmp_path_factory.mktemp("map") / "four.osm")
    return import_map(file, name="four").assembled.place


def route(place, name):
    return next(each for each in place.routes if each.id == name)


def test_in_left_hand_traffic_the_turn_across_oncoming_traffic_is_the_right_one(place):
    left_hand = place.model_copy(update={"left_hand_traffic": True})
    pattern = pattern_named("left_turn_yields_to_oncoming")
    oncoming = route(place, "vehicle:south>north:straight")
    turns = {
        turn: route(place, f"vehicle:north>{to}:{turn}")
        for turn, to in (("left", "east"), ("right", "west"))
    }
    assert serves(pattern, turns["left"], oncoming, on=place)
    assert not serves(pattern, turns["left"], oncoming, on=left_hand)


def test_lanes_that_part_before_the_stop_line_are_not_one_lane(place):
    pattern = pattern_named("follow_on_approach")
    ahead = route(place, "vehicle:north>south:straight")
    turning = route(place, "vehicle:north>east:left")
    assert serves(pattern, turning, ahead, on=place)
    lanes = tuple(
        m.model_copy(update={"lanelets": tuple(f"other:{x}" for x in m.lanelets)})
        if m.id == "north>east:left"
        else m
        for m in place.movements
    )
    parted = place.model_copy(update={"movements": lanes})
    assert not serves(pattern, turning, ahead, on=parted)


@pytest.mark.skipif(importlib.util.find_spec("sumo") is None, reason="SUMO is not installed")
def test_on_five_legs_a_turn_goes_where_the_map_leads(tmp_path):
    net = map_files.sumo_net(tmp_path / "five.net.xml", (0, 45, 90, 180, 270))
    five = import_map(net, name="five").assembled.place
    graph = SocialGraph(
        agents=(
            AgentNode(id="vehicle-1", type="vehicle", entry="south", exit="west", movement="left"),
        ),
        relations=(),
        context=SceneContext(),
    )
    assert ground(graph, on=five).routes["vehicle-1"]
    gone = five.model_copy(
        update={"routes": tuple(r for r in five.routes if r.id != "vehicle:south>west:left")}
    )
    if any(r.entry == "south" and r.movement == "left" for r in gone.routes):
        assert ground(graph, on=gone).routes["vehicle-1"]
    else:
        with pytest.raises(Rejected):
            ground(graph, on=gone)
