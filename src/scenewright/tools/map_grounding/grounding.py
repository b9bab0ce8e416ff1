"""Map grounding (paper 3.1): binds the social graph to routes, crosswalks and stop lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain, product

import numpy as np

from scenewright.errors import Rejected
from scenewright.scene.base import RIDERS
from scenewright.scene.cache import RecentCache
from scenewright.scene.candidates import Grounding
from scenewright.scene.kinds import has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.scene.rejection import Rejection
from scenewright.scene.social import AgentNode, EntrySide, RelationEdge, SocialGraph
from scenewright.scene.uturns import make_route
from scenewright.tools.map_grounding.hiding import refuse_unhidden
from scenewright.tools.map_grounding.relation_faults import (
    find_collision_faults,
    find_reaction_faults,
    find_wrong_order,
)
from scenewright.tools.map_grounding.relation_files import load_checked_patterns
from scenewright.tools.map_grounding.role_search import find_assignments
from scenewright.tools.map_grounding.route_meetings import measure_ring_steps


def ground_graph(graph: SocialGraph, *, intersection_map: IntersectionMap) -> Grounding:
    """The routes open to each agent.

    Raises:
        Rejected: `ungroundable`, naming the agent or the relation that the map cannot serve.
    """
    return _GROUNDED.get(
        graph,
        intersection_map,
        load_checked_patterns(),
        make=lambda: _open_routes(graph, intersection_map),
    )


def can_ground(graph: SocialGraph, *, intersection_map: IntersectionMap) -> bool:
    """Whether the map has routes for each agent and relation."""
    try:
        ground_graph(graph, intersection_map=intersection_map)
    except Rejected:
        return False
    return True


_GROUNDED: RecentCache[SocialGraph, Grounding] = RecentCache(most=256)
"""Seeds of one text share a graph."""


def _open_routes(graph: SocialGraph, intersection_map: IntersectionMap) -> Grounding:
    try:
        return _ground(graph, intersection_map)
    except Rejected:
        open_ = _drop_entailed_exits(graph, intersection_map)
        if open_ == graph:
            raise
        return _ground(open_, intersection_map)


_FOUR = frozenset({"north", "east", "south", "west"})


def _drop_entailed_exits(graph: SocialGraph, intersection_map: IntersectionMap) -> SocialGraph:
    """The graph without exits that only the compass demands of a turn.

    A left turn from the north leads east where legs lie as on a compass. On a map
    with other legs it goes where its movements lead.
    """
    if {leg.name for leg in intersection_map.legs} == _FOUR:
        return graph
    agents = []
    for agent in graph.agents:
        if agent.type != "pedestrian" and None not in (agent.entry, agent.exit, agent.movement):
            turn = measure_ring_steps(str(agent.exit), start=str(agent.entry))
            if {2: "left", 4: "straight", 6: "right", 0: "uturn"}.get(turn) == agent.movement:
                agents.append(agent.model_copy(update={"exit": None}))
                continue
        agents.append(agent)
    return graph.model_copy(update={"agents": tuple(agents)})


def _ground(graph: SocialGraph, intersection_map: IntersectionMap) -> Grounding:
    uturns = tuple(map(make_route, intersection_map.uturns))
    routes = {}
    for agent in graph.agents:
        ways = intersection_map.routes + (uturns if agent.movement == "uturn" else ())
        routes[agent.id] = tuple(route for route in ways if _is_admitted(agent, route))
    for agent in graph.agents:
        if not routes[agent.id]:
            raise _report_no_route(agent, intersection_map)
    faults = chain(find_collision_faults(graph), find_reaction_faults(graph))
    if (fault := next(faults, None)) is not None:
        raise _reject(*fault)
    for edge in graph.relations:
        if edge.first is not None and (why := find_wrong_order(edge, graph)) is not None:
            raise _reject((edge.from_, edge.to), why)
    grounding = Grounding(routes=routes)
    refuse_unhidden(
        graph, intersection_map, playable=lambda g: _is_playable(g, grounding, intersection_map)
    )
    # One by one first: the search over all of them is exhaustive where one cannot be played.
    for edge in graph.relations:
        alone = graph.model_copy(update={"relations": (edge,)})
        if _is_playable(alone, grounding, intersection_map):
            continue
        untied = alone.model_copy(update={"ties": ()})
        if graph.ties and _is_playable(untied, grounding, intersection_map):
            ties = " and ".join(
                f"{tie.agent} comes from {_SIDE_WORDS[tie.side]} {tie.of}" for tie in graph.ties
            )
            detail = f"'{_format_edge(edge)}' cannot happen where {ties}"
        else:
            detail = (
                f"the routes of {edge.from_} and {edge.to} do not meet "
                f"so that '{_format_edge(edge)}' could happen at {intersection_map.title}"
                f"{_describe_lanes(edge, routes, intersection_map)}"
            )
        raise _reject((edge.from_, edge.to), detail)
    if len(graph.relations) != 1 and not _is_playable(graph, grounding, intersection_map):
        edge = graph.relations[-1]
        detail = f"'{_format_edge(edge)}' does not fit together with the other relations"
        raise _reject((edge.from_, edge.to), detail)
    return grounding


def _is_admitted(agent: AgentNode, route: Route) -> bool:
    wanted = (agent.entry, agent.exit, agent.movement, agent.crosswalk)
    offered = (route.entry, route.exit, route.movement, route.crosswalk)
    if agent.type in RIDERS:
        if not _can_ride(route, agent):
            return False
    elif agent.type != route.type:
        return False
    if agent.movement is None and route.movement == "jaywalking":
        return False  # jaywalking only on request
    if has_trait("reaction", agent.reaction, "aside") and route.movement != "straight":
        return False  # to a side of a straight way: in a bend a swerve shows nothing
    return all(want is None or want == offer for want, offer in zip(wanted, offered, strict=True))


def _can_ride(route: Route, agent: AgentNode) -> bool:
    """Whether a rider may take a route: on the lane, or, where the text says so, on a crosswalk."""
    on_crosswalk = agent.crosswalk is not None or agent.movement == "crossing"
    if route.type == "vehicle":
        return not on_crosswalk and route.movement != "uturn"
    straight = route.side is None or len(set(route.side.split(">"))) == 1
    return (
        on_crosswalk and route.movement == "crossing" and straight and "leg" not in str(route.side)
    )


def _report_no_route(agent: AgentNode, intersection_map: IntersectionMap) -> Rejected:
    wanted = [
        text
        for text in (
            agent.movement,
            agent.entry and f"from the {agent.entry}",
            agent.exit and f"to the {agent.exit}",
            agent.crosswalk and f"across the {agent.crosswalk} leg",
        )
        if text
    ]
    detail = f"{agent.id} ({', '.join(wanted)}) has no way through {intersection_map.title}"
    return _reject((agent.id,), detail)


def _is_playable(
    graph: SocialGraph, grounding: Grounding, intersection_map: IntersectionMap
) -> bool:
    found = find_assignments(
        graph, grounding, intersection_map=intersection_map, rng=np.random.default_rng(0)
    )
    return next(found, None) is not None


def _describe_lanes(
    edge: RelationEdge, routes: Mapping[str, Sequence[Route]], intersection_map: IntersectionMap
) -> str:
    """The lanes of each, where both come or leave by one leg on lanes of their own."""
    for kind, words in (("exit", "leave"), ("approach", "come")):
        held = {lane.id for lane in intersection_map.lanelets if lane.kind == kind}
        lanes: dict[str, set[str]] = {edge.from_: set(), edge.to: set()}
        for a, b in product(routes[edge.from_], routes[edge.to]):
            same = (a.exit == b.exit, a.entry == b.entry)
            if same == (kind == "exit", kind == "approach"):
                for name, way in ((edge.from_, a), (edge.to, b)):
                    movement = intersection_map.find_movement(way)
                    lanes[name] |= held.intersection(movement.lanelets if movement else ())
        if all(lanes.values()) and lanes[edge.from_].isdisjoint(lanes[edge.to]):
            ways = (f"{name} by {', '.join(sorted(own))}" for name, own in lanes.items())
            return f": they {words} on lanes of their own, {' and '.join(ways)}"
    return ""


_SIDE_WORDS: dict[EntrySide, str] = {
    "same": "the same leg as", "other": "another leg than", "opposite": "opposite",
    "lateral": "the cross street of", "left": "the left of", "right": "the right of",
}  # fmt: skip


def _reject(agents: tuple[str, ...], detail: str) -> Rejected:
    return Rejected(
        Rejection(stage="scene_planner", code="ungroundable", agents=agents, detail=detail)
    )


def _format_edge(edge: RelationEdge) -> str:
    kind = f" ({edge.kind.replace('_', ' ')})" if edge.kind else ""
    point = f" on its {edge.point_to.replace('_', ' ')}" if edge.point_to else ""
    return f"{edge.from_} {edge.type.replace('_', ' ')} {edge.to}{point}{kind}"
