"""Other maps than four legs in right-hand traffic: what an instruction means there."""

import importlib.util
import types

import numpy as np
import pytest

import map_files
from scenewright import synthesize
from scenewright.errors import Rejected
from scenewright.scene.relations import get_pattern
from scenewright.scene.social import AgentNode, RelationEdge, SceneContext, SocialGraph
from scenewright.tools.fitting.custom_bundle import write_custom_bundle
from scenewright.tools.fitting.derive_priors import derive_priors
from scenewright.tools.map_grounding.grounding import ground_graph
from scenewright.tools.map_grounding.route_meetings import can_serve
from scenewright.tools.map_import import import_map
from scenewright.tools.relation_checker.legs import find_entry_leg, find_exit_leg


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    file = map_files.lanelet2(tmp_path_factory.mktemp("map") / "four.osm")
    return import_map(file, name="four").intersection_map


def route(place, name):
    return next(each for each in place.routes if each.id == name)


def test_in_left_hand_traffic_the_turn_across_oncoming_traffic_is_the_right_one(place):
    left_hand = place.model_copy(update={"left_hand_traffic": True})
    pattern = get_pattern("left_turn_yields_to_oncoming")
    oncoming = route(place, "vehicle:south>north:straight")
    turns = {
        turn: route(place, f"vehicle:north>{to}:{turn}")
        for turn, to in (("left", "east"), ("right", "west"))
    }
    assert can_serve(pattern, turns["left"], oncoming, intersection_map=place)
    assert not can_serve(pattern, turns["left"], oncoming, intersection_map=left_hand)


def test_lanes_that_part_before_the_stop_line_are_not_one_lane(place):
    pattern = get_pattern("follow_on_approach")
    ahead = route(place, "vehicle:north>south:straight")
    turning = route(place, "vehicle:north>east:left")
    assert can_serve(pattern, turning, ahead, intersection_map=place)
    lanes = tuple(
        m.model_copy(update={"lanelets": tuple(f"other:{x}" for x in m.lanelets)})
        if m.id == "north>east:left"
        else m
        for m in place.movements
    )
    parted = place.model_copy(update={"movements": lanes})
    assert not can_serve(pattern, turning, ahead, intersection_map=parted)


def test_a_hook_from_a_lane_beside_the_riders_is_refused_with_both_lanes(place):
    pattern = get_pattern("rider_right_hook_near_miss")
    turning, ahead = (
        route(place, f"vehicle:north>{name}") for name in ("west:right", "south:straight")
    )
    assert can_serve(pattern, turning, ahead, intersection_map=place)
    [lane] = (x for x in place.lanelets if x.id == "north:approach:1")
    kerb = lane.model_copy(update={"id": "north:approach:2"})
    parted = place.model_copy(
        update={
            "lanelets": (*place.lanelets, kerb),
            "movements": tuple(
                m.model_copy(update={"lanelets": (kerb.id, *m.lanelets[1:])})
                if m.id == "north>west:right"
                else m
                for m in place.movements
            ),
        }
    )
    assert not can_serve(pattern, turning, ahead, intersection_map=parted)
    agents = [("vehicle-1", "vehicle", "right"), ("cyclist-1", "cyclist", "straight")]
    nodes = [
        AgentNode(id=name, type=kind, entry="north", movement=turn) for name, kind, turn in agents
    ]
    edge = RelationEdge.model_validate(
        {"type": "near_miss", "from": "vehicle-1", "to": "cyclist-1", "pattern": pattern.id}
    )
    graph = SocialGraph(agents=tuple(nodes), relations=(edge,), context=SceneContext())
    with pytest.raises(Rejected) as refused:
        ground_graph(graph, intersection_map=parted)
    why = refused.value.rejection.detail
    assert (
        "they come on lanes of their own, vehicle-1 by north:approach:2 and cyclist-1 by north"
        in why
    )


def test_who_leaves_on_lanes_of_their_own_is_told_by_which(place):
    [lane] = (x for x in place.lanelets if x.id == "east:exit:1")
    turn, merge = "north>east:left", "south>east:right"
    parted = {
        "lanelets": (*place.lanelets, lane.model_copy(update={"id": "east:exit:2"})),
        "movements": tuple(
            m.model_copy(update={"lanelets": (*m.lanelets[:-1], "east:exit:2")})
            if m.id == merge
            else m
            for m in place.movements
        ),
        "conflict_zones": tuple(
            z for z in place.conflict_zones if {z.first, z.second} != {turn, merge}
        ),
    }
    agents = (
        AgentNode(id="vehicle-1", type="vehicle", entry="north", exit="east", movement="left"),
        AgentNode(id="vehicle-2", type="vehicle", entry="south", exit="east", movement="right"),
    )
    edge = RelationEdge(from_="vehicle-1", to="vehicle-2", type="collide_at")
    graph = SocialGraph(agents=agents, relations=(edge,), context=SceneContext())
    assert ground_graph(graph, intersection_map=place).routes["vehicle-1"]
    with pytest.raises(Rejected, match="vehicle-1 by east:exit:1 and vehicle-2 by east:exit:2"):
        ground_graph(
            graph, intersection_map=type(place).model_validate({**place.model_dump(), **parted})
        )


needs_sumo = pytest.mark.skipif(
    importlib.util.find_spec("sumo") is None, reason="SUMO is not installed"
)


@needs_sumo
def test_on_five_legs_a_turn_goes_where_the_map_leads(tmp_path):
    net = map_files.sumo_net(tmp_path / "five.net.xml", (0, 45, 90, 180, 270))
    five = import_map(net, name="five").intersection_map
    graph = SocialGraph(
        agents=(
            AgentNode(id="vehicle-1", type="vehicle", entry="south", exit="west", movement="left"),
        ),
        relations=(),
        context=SceneContext(),
    )
    assert ground_graph(graph, intersection_map=five).routes["vehicle-1"]
    gone = five.model_copy(
        update={"routes": tuple(r for r in five.routes if r.id != "vehicle:south>west:left")}
    )
    if any(r.entry == "south" and r.movement == "left" for r in gone.routes):
        assert ground_graph(graph, intersection_map=gone).routes["vehicle-1"]
    else:
        with pytest.raises(Rejected):
            ground_graph(graph, intersection_map=gone)


@needs_sumo
def test_the_lane_that_a_track_is_on_tells_its_leg_on_five_legs(tmp_path):
    net = map_files.sumo_net(tmp_path / "five.net.xml", (0, 45, 90, 180, 270))
    made = import_map(net, name="five")
    for each in made.intersection_map.routes:
        if each.type == "vehicle":
            for line in made.route_lines[each.id]:
                seen = driven(np.asarray(line), made.intersection_map.extent)
                assert find_entry_leg(seen, made.intersection_map) == each.entry
                assert find_exit_leg(seen, made.intersection_map) == each.exit


def test_where_a_road_bends_the_lane_decides_and_not_the_direction(place):
    bent = place.model_copy(
        update={
            "legs": tuple(x.model_copy(update={"bearing": x.bearing + 1.0}) for x in place.legs)
        }
    )
    line = np.array(next(m for m in place.movements if m.id == "north>south:straight").centreline)
    assert find_entry_leg(driven(line, place.extent), bent) == "north"
    assert find_exit_leg(driven(line, place.extent), bent) == "south"


@needs_sumo
def test_in_left_hand_traffic_a_right_turn_across_the_path_is_made_and_proven(
    tmp_path, monkeypatch
):
    (tmp_path / "own").mkdir(exist_ok=True)
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path / "own"))
    net = map_files.sumo_net(tmp_path / "left.net.xml", (0, 90, 180, 270), left_hand=True)
    made = import_map(net, name="left")
    priors = derive_priors(made.intersection_map, made.route_lines)
    write_custom_bundle(
        "left", made.intersection_map, made.route_lines, priors, provenance={}, frame={}, notes=[]
    )
    text = "A car turning right hits an oncoming car with nobody else around"
    scene = synthesize(text, intersection="left", seed=1, refiner="none")
    assert scene.proof.verified
    [event] = scene.proof.events
    assert (event.type, event.kind) == ("collision", "left_turn")
    movements = {agent.movement for agent in scene.record.agents}
    assert movements == {"right", "straight"}


def driven(line, extent):
    """A vehicle that drives along a line, as far as the map goes."""
    inside = line[np.abs(line).max(axis=1) <= extent]
    step = np.diff(inside, axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    return types.SimpleNamespace(xy=inside, heading=np.append(heading, heading[-1]))
