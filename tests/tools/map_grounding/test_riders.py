"""Where cyclists and scooter riders may go, and who does what to whom with them."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright.intersections import load_map
from scenewright.scene.social import SocialGraph
from scenewright.tools.map_grounding.grounding import ground_graph
from scenewright.tools.map_grounding.role_search import find_assignments

MAP = load_map("amsterdam_120")


def graph_of(relation: str, from_: str, to: str, **more: object) -> SocialGraph:
    agents = [{"id": name, "type": name[:-2], **more.get(name, {})} for name in (from_, to)]
    edge = {"type": relation, "from": from_, "to": to, "kind": more.get("kind")}
    return SocialGraph.model_validate({"agents": agents, "relations": [edge]})


@pytest.mark.parametrize(
    ("striking", "struck", "pattern"),
    [
        ("vehicle-1", "cyclist-1", "vehicle_rear_ends_rider"),
        ("scooter-1", "vehicle-1", "rider_rear_ends_vehicle"),
    ],
)
def test_who_drives_into_the_back_of_whom_is_never_turned_round(striking, struck, pattern):
    graph = graph_of("collide_at", striking, struck, kind="rear_end")
    grounding = ground_graph(graph, intersection_map=MAP)
    for seed in range(8):
        rng = np.random.default_rng(seed)
        (played,) = next(find_assignments(graph, grounding, intersection_map=MAP, rng=rng)).patterns
        assert (played.pattern, played.from_, played.to) == (pattern, striking, struck)


def test_riders_keep_to_the_lanes_unless_a_crosswalk_is_named():
    on_lane = graph_of("near_miss", "vehicle-1", "cyclist-1")
    routes = ground_graph(on_lane, intersection_map=MAP).routes["cyclist-1"]
    assert {route.movement for route in routes} == {"straight", "left", "right"}
    on_crosswalk = graph_of(
        "near_miss", "vehicle-1", "scooter-1", **{"scooter-1": {"crosswalk": "north"}}
    )
    routes = ground_graph(on_crosswalk, intersection_map=MAP).routes["scooter-1"]
    assert {(route.movement, route.crosswalk) for route in routes} == {("crossing", "north")}
