"""SUMO's lanes lie on ours, and its lights are ours. Skipped where SUMO is not installed."""

from xml.etree import ElementTree

import numpy as np
import pytest
import shapely

from lab.bundle.four_leg_network import write_network
from lab.bundle.four_leg_plan import AMSTERDAM_120
from lab.bundle.four_leg_traffic import find_sidewalk_edge
from scenewright.intersections import load_map
from scenewright.scene.map_elements import Route

pytest.importorskip("sumo")


@pytest.fixture(scope="module")
def place():
    return load_map("amsterdam_120")


@pytest.fixture(scope="module")
def network(place, tmp_path_factory):
    return write_network(tmp_path_factory.mktemp("net"), AMSTERDAM_120, place)


def lines(network, *, internal):
    root = ElementTree.parse(network).getroot()
    for edge in root.iter("edge"):
        if (edge.get("function") == "internal") == internal and edge.get("function") != "crossing":
            for lane in edge.iter("lane"):
                shape = [tuple(map(float, p.split(","))) for p in lane.attrib["shape"].split()]
                yield edge, lane, shapely.LineString(shape)


def test_driving_lanes_lie_on_our_lanelets(place, network):
    ours = {lane.id: shapely.LineString(lane.centreline) for lane in place.lanelets}
    seen = set()
    for edge, lane, line in lines(network, internal=False):
        if edge.get("function") or int(lane.attrib["index"]) < 2:
            continue
        near = shapely.clip_by_rect(line, -50, -50, 50, 50)
        name = min(ours, key=lambda key: shapely.hausdorff_distance(ours[key], near))
        assert shapely.hausdorff_distance(ours[name], near) < 0.05
        seen.add(name)
    assert seen == {lane.id for lane in place.lanelets if lane.kind in ("approach", "exit")}


def test_ways_through_the_junction_lie_on_our_connectors(place, network):
    ours = [lane for lane in place.lanelets if lane.kind == "connector"]
    theirs = shapely.union_all([line for _, _, line in lines(network, internal=True)])
    for lane in ours:
        assert np.max(shapely.distance(shapely.points(lane.centreline), theirs)) < 0.05


def test_lights_last_as_long_as_ours(place, network):
    root = ElementTree.parse(network.parent / "signals.add.xml").getroot()
    durations = [float(phase.attrib["duration"]) for phase in root.iter("phase")]
    assert durations == [phase.duration for phase in place.signals.phases]
    states = [phase.attrib["state"] for phase in root.iter("phase")]
    assert {len(state) for state in states} == {14 + 4}
    assert states[3] == states[7] == "r" * 18


def test_walkers_use_the_sidewalks_that_their_route_names():
    def route(leg, entry, exit_, side):
        return Route(
            id="x",
            type="pedestrian",
            entry=entry,
            exit=exit_,
            movement="crossing",
            crosswalk=leg,
            side=side,
        )

    along = route("north", "west", "east", "along>along")
    assert find_sidewalk_edge(along, at_entry=True) == "west_out"
    assert find_sidewalk_edge(along, at_entry=False) == "east_in"
    leg = route("north", "west", "east", "leg>leg")
    assert find_sidewalk_edge(leg, at_entry=True) == "north_in"
    assert find_sidewalk_edge(leg, at_entry=False) == "north_out"
