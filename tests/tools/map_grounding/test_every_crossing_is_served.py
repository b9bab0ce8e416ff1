"""Two whose ways cross can collide, nearly collide and give way: some pattern serves them."""

from __future__ import annotations

from itertools import product

import pytest

from scenewright.intersections import load_map
from scenewright.scene.map_elements import Route
from scenewright.scene.social import AgentNode, RelationEdge, SocialGraph
from scenewright.scene.uturns import make_route
from scenewright.tools.map_grounding.grounding import ground_graph
from scenewright.tools.map_grounding.role_search import is_on_side
from scenewright.tools.map_grounding.route_meetings import have_conflict

ON = load_map("amsterdam_120")
DRIVEN = [each for each in ON.routes if each.type == "vehicle"]
TURNING = [make_route(each) for each in ON.uturns]
WALKED = [each for each in ON.routes if each.movement == "crossing"]
ACROSS = [each for each in ON.routes if each.movement == "jaywalking"]
PARTIES = (
    *(("vehicle", route) for route in (*DRIVEN, *TURNING)),
    *(("cyclist", route) for route in DRIVEN),
    *(("pedestrian", route) for route in (*WALKED, *ACROSS)),
)
BEYOND = {"uturn", "jaywalking"}


def list_pairs():
    """One pair of routes for each two classes, movements and how the entries lie."""
    found = {}
    for (first, a), (second, b) in product(PARTIES, PARTIES):
        if a is b or first == second == "pedestrian" or {a.movement, b.movement} == BEYOND:
            continue
        if have_conflict(a, b, intersection_map=ON):
            apart = is_on_side("opposite", a.entry, of=b.entry)
            found.setdefault((first, a.movement, second, b.movement, apart), (a, b))
    return [(key[0], a, key[2], b) for key, (a, b) in found.items()]


def make_node(kind: str, number: int, route: Route) -> AgentNode:
    on_foot = {"crosswalk": route.crosswalk} if kind == "pedestrian" else {}
    return AgentNode(
        id=f"{kind}-{number}", type=kind, entry=route.entry, exit=route.exit,
        movement=route.movement, **on_foot,
    )  # fmt: skip


@pytest.mark.parametrize("relation", ["collide_at", "near_miss", "yield_to"])
def test_every_crossing_is_served(relation):
    pairs = list_pairs()
    assert len(pairs) > 60
    for first, a, second, b in pairs:
        # a vehicle that has hit somebody on the way into its U-turn has not made one
        if relation == "collide_at" and {a.movement, b.movement} == {"uturn", "crossing"}:
            continue
        nodes = (make_node(first, 1, a), make_node(second, 2, b))
        edge = RelationEdge(type=relation, from_=nodes[0].id, to=nodes[1].id)
        ground_graph(SocialGraph(agents=nodes, relations=(edge,)), intersection_map=ON)
