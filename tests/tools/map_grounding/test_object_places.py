"""Where objects may stand on the shipped map, and what is refused there."""

from __future__ import annotations

import pytest
import shapely

from scenewright.errors import Rejected
from scenewright.intersections import load_map
from scenewright.scene.social import ObjectKind, ObjectNode, SocialGraph
from scenewright.tools.map_grounding.grounding import ground_graph
from scenewright.tools.map_grounding.object_places import find_places, make_footprint

MAP = load_map("amsterdam_120")
ROAD = shapely.union_all([shapely.Polygon(a.exterior, a.holes) for a in MAP.road])
CROSSWALKS = shapely.union_all([shapely.Polygon(c.polygon) for c in MAP.crosswalks])
LANES = {each.id: each for each in MAP.lanelets}


def outlines(kind: ObjectKind, subtype: str | None = None) -> list[shapely.Polygon]:
    node = ObjectNode.model_validate({"id": "object-1", "kind": kind, "subtype": subtype})
    return [make_footprint(each) for each in find_places(node, MAP, leg="north", side="entry")]


def lane(name: str) -> shapely.Polygon:
    return shapely.Polygon((*LANES[name].left, *LANES[name].right[::-1]))


@pytest.mark.parametrize("kind", ["parked", "double_parked", "stalled", "bus_stop", "box", "bin"])
def test_objects_stand_where_they_belong(kind: ObjectKind) -> None:
    places = outlines(kind)
    driven = shapely.union_all([lane("north:approach:inner"), lane("north:approach:outer")])
    assert len(places) > 20
    for place in places:
        assert place.distance(CROSSWALKS) > 0.3
        on_road = place.intersection(ROAD).area / place.area
        in_lane = place.intersection(driven).area / place.area
        match kind:
            case "parked" | "bus_stop":
                assert on_road > 0.97
                assert in_lane < 0.1
            case "double_parked" | "stalled":
                assert in_lane > 0.97
            case _:
                assert on_road == 0.0


def graph(walker: dict[str, str] | None = None, **more: object) -> SocialGraph:
    node = {"id": "object-1", "kind": "parked", "subtype": "truck", "hides": "pedestrian-1",
            "hidden_from": "vehicle-1"}  # fmt: skip
    return SocialGraph.model_validate(
        {
            "agents": [
                {"id": "vehicle-1", "type": "vehicle", "entry": "north"},
                {"id": "pedestrian-1", "type": "pedestrian", **(walker or {})},
            ],
            "relations": [{"type": "collide_at", "from": "vehicle-1", "to": "pedestrian-1"}],
            "objects": [{**node, **more}],
        }
    )


def test_a_hidden_pedestrian_comes_from_the_kerb_of_the_approach() -> None:
    routes = ground_graph(graph(), intersection_map=MAP).routes
    assert routes["pedestrian-1"]
    with pytest.raises(Rejected, match="must come from that kerb"):
        ground_graph(graph(walker={"crosswalk": "north", "entry": "east"}), intersection_map=MAP)
    with pytest.raises(Rejected, match="must come from that kerb"):
        ground_graph(graph(walker={"crosswalk": "south"}), intersection_map=MAP)


def test_nothing_hides_behind_what_is_seen_over() -> None:
    with pytest.raises(Rejected, match="too low to hide"):
        ground_graph(graph(kind="bin", subtype=None), intersection_map=MAP)


def test_a_rider_is_hidden_where_it_comes_over_the_crosswalk_but_not_between_two() -> None:
    hidden = graph().model_dump(by_alias=True)
    rider = {"id": "cyclist-1", "type": "cyclist", "movement": "crossing"}
    hidden["agents"] = [hidden["agents"][0], rider]
    hidden["relations"][0]["to"] = hidden["objects"][0]["hides"] = "cyclist-1"
    routes = ground_graph(SocialGraph.model_validate(hidden), intersection_map=MAP).routes
    assert {each.crosswalk for each in routes["cyclist-1"]} >= {"north"}
    beyond = {"id": "object-2", "kind": "parked", "subtype": "car", "beyond": "object-1"}
    hidden["objects"] = [*hidden["objects"], beyond]
    with pytest.raises(Rejected, match="not between two"):
        ground_graph(SocialGraph.model_validate(hidden), intersection_map=MAP)
    alongside = hidden | {"agents": [hidden["agents"][0], {**rider, "movement": "straight"}]}
    alongside["objects"] = hidden["objects"][:1]
    with pytest.raises(Rejected):
        ground_graph(SocialGraph.model_validate(alongside), intersection_map=MAP)
