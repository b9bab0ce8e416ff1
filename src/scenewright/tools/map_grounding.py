"""Map grounding (paper 3.1): binds the social graph to routes, crosswalks and stop lines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from scenewright.errors import Rejected
from scenewright.scene.grounding import Cast, CastPattern, Grounding
from scenewright.scene.map import IntersectionMap, Route, VehicleMovement
from scenewright.scene.rejection import Rejection
from scenewright.scene.relations import Pattern, Role, patterns
from scenewright.scene.social import AgentNode, RelationEdge, SocialGraph

RouteWeight = Callable[[Route], float]
"""How common a route is; zero keeps it from being drawn unless nothing else is left."""

_SYMMETRIC = ("collide_at", "near_miss")


def ground(graph: SocialGraph, *, on: IntersectionMap) -> Grounding:
    """The routes open to each agent.

    Raises:
        Rejected: `ungroundable`, naming the agent or the relation that the map cannot serve.
    """
    routes = {agent.id: _routes_for(agent, on) for agent in graph.agents}
    for agent in graph.agents:
        if not routes[agent.id]:
            raise Rejected(_no_route(agent, on))
    grounding = Grounding(routes=routes)
    # One by one first: the search over all of them is exhaustive where one cannot be played.
    for edge in graph.relations:
        if not _playable(graph.model_copy(update={"relations": (edge,)}), grounding, on):
            raise Rejected(_never_meet(edge, on))
    if not _playable(graph, grounding, on):
        raise Rejected(_not_together(graph.relations[-1]))
    return grounding


def casts(
    graph: SocialGraph,
    grounding: Grounding,
    *,
    on: IntersectionMap,
    rng: np.random.Generator,
    weight: RouteWeight = lambda _route: 1.0,
) -> Iterator[Cast]:
    """Consistent choices of routes and patterns, likelier ones more often early; lazily."""
    order = {key: _shuffled(each, rng, weight) for key, each in grounding.routes.items()}
    yield from _assign(graph, on, rng, order, {}, ())


def meets(a: Route, b: Route, *, on: IntersectionMap) -> bool:
    """Whether the swept paths of two routes overlap on the map."""
    if "jaywalking" in (a.movement, b.movement):
        walker, other = (a, b) if a.movement == "jaywalking" else (b, a)
        return other.type == "vehicle" and walker.crosswalk in (other.entry, other.exit)
    return frozenset((_zone_key(a), _zone_key(b))) in on.zone_pairs


def green_together(a: Route, b: Route, *, on: IntersectionMap) -> bool:
    """Whether both may ever go at the same time; True where one of them has no signal."""
    groups = [signal_group(route, on=on) for route in (a, b)]
    if on.signals is None or None in groups:
        return True
    return any(
        all(phase.colours[str(group)] != "red" for group in groups) for phase in on.signals.phases
    )


def signal_group(route: Route, *, on: IntersectionMap) -> str | None:
    """The signal group that controls a route; None for jaywalkers and unsignalised ways."""
    if on.signals is None or route.movement == "jaywalking":
        return None
    key = _zone_key(route)
    for group in on.signals.groups:
        if key in group.movements or key in group.crosswalks:
            return group.id
    return None


def movement_of(route: Route, *, on: IntersectionMap) -> VehicleMovement | None:
    """The vehicle movement of a route; None for pedestrians."""
    return next((each for each in on.movements if each.id == route.movement_id), None)


def _routes_for(agent: AgentNode, on: IntersectionMap) -> tuple[Route, ...]:
    return tuple(route for route in on.routes if _admits(agent, route))


def _admits(agent: AgentNode, route: Route) -> bool:
    wanted = (agent.entry, agent.exit, agent.movement, agent.crosswalk)
    offered = (route.entry, route.exit, route.movement, route.crosswalk)
    if agent.type != route.type:
        return False
    if agent.movement is None and route.movement == "jaywalking":
        return False  # nobody jaywalks unasked
    return all(want is None or want == offer for want, offer in zip(wanted, offered, strict=True))


def _shuffled(
    routes: Sequence[Route], rng: np.random.Generator, weight: RouteWeight
) -> list[Route]:
    """A random order in which likelier routes tend to come first (Gumbel top-k)."""
    scores = [np.log(max(weight(route), 1e-9)) + rng.gumbel() for route in routes]
    return [routes[index] for index in np.argsort(scores)[::-1]]


def _assign(
    graph: SocialGraph,
    on: IntersectionMap,
    rng: np.random.Generator,
    order: dict[str, list[Route]],
    chosen: dict[str, Route],
    played: tuple[CastPattern, ...],
) -> Iterator[Cast]:
    """Depth first over the edges, then over agents that no edge binds."""
    if len(played) < len(graph.relations):
        index = len(played)
        edge = graph.relations[index]
        for routes, cast_pattern in _play(edge, index, graph, on, rng, order, chosen):
            yield from _assign(graph, on, rng, order, chosen | routes, (*played, cast_pattern))
        return
    free = {agent.id: order[agent.id][0] for agent in graph.agents if agent.id not in chosen}
    yield Cast(routes=chosen | free, patterns=played)


def _play(
    edge: RelationEdge,
    index: int,
    graph: SocialGraph,
    on: IntersectionMap,
    rng: np.random.Generator,
    order: dict[str, list[Route]],
    chosen: dict[str, Route],
) -> Iterator[tuple[dict[str, Route], CastPattern]]:
    for pattern in _draw(patterns_for(edge, graph), rng):
        for first, second in _role_orders(edge, pattern):
            for a in _open(first, order, chosen):
                for b in _open(second, order, chosen):
                    if serves(pattern, a, b, on=on):
                        violator = _violator(pattern, (first, second), (a, b), graph, on)
                        yield (
                            {first: a, second: b},
                            CastPattern(
                                edge=index,
                                pattern=pattern.id,
                                from_=first,
                                to=second,
                                violator=violator,
                            ),
                        )


def _open(agent: str, order: dict[str, list[Route]], chosen: dict[str, Route]) -> list[Route]:
    return [chosen[agent]] if agent in chosen else order[agent]


def patterns_for(edge: RelationEdge, graph: SocialGraph) -> list[Pattern]:
    """Patterns that serve the relation and, if one is named, the kind of collision."""
    classes = {graph.agent(edge.from_).type, graph.agent(edge.to).type}
    return [
        pattern
        for pattern in patterns()
        if pattern.relation == edge.type
        and {pattern.from_.type, pattern.to.type} == classes
        and edge.kind in (None, pattern.kind)
    ]


def _draw(found: list[Pattern], rng: np.random.Generator) -> list[Pattern]:
    scores = [np.log(pattern.weight) + rng.gumbel() for pattern in found]
    return [found[index] for index in np.argsort(scores)[::-1]]


def _role_orders(edge: RelationEdge, pattern: Pattern) -> list[tuple[str, str]]:
    orders = [(edge.from_, edge.to)]
    return [*orders, (edge.to, edge.from_)] if pattern.relation in _SYMMETRIC else orders


def serves(pattern: Pattern, a: Route, b: Route, *, on: IntersectionMap) -> bool:
    """Whether route `a` can play `from` and route `b` can play `to` of the pattern."""
    return (
        _plays(a, pattern.from_)
        and _plays(b, pattern.to)
        and _entries_lie(pattern, a, b)
        and _geometry_fits(pattern, a, b, on)
    )


def _plays(route: Route, role: Role) -> bool:
    return route.type == role.type and route.movement in role.movements


def _entries_lie(pattern: Pattern, a: Route, b: Route) -> bool:
    match pattern.entries:
        case "any":
            return a.type != b.type or a.entry != b.entry
        case "same":
            return a.entry == b.entry
        case "opposite":
            return _opposite(a.entry, b.entry)
        case "lateral":
            return a.entry != b.entry and not _opposite(a.entry, b.entry)


_RING = ("north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest")


def _opposite(a: str, b: str) -> bool:
    return abs(_RING.index(a) - _RING.index(b)) == 4


def _geometry_fits(pattern: Pattern, a: Route, b: Route, on: IntersectionMap) -> bool:
    match pattern.geometry:
        case "crossing":
            return meets(a, b, on=on) and (a.type != b.type or a.exit != b.exit)
        case "merging":
            return a.exit == b.exit and a.entry != b.entry and meets(a, b, on=on)
        case "same_lane":
            return a.entry == b.entry
        case "same_way":
            return a.entry == b.entry and a.exit == b.exit
        case "lane_change":
            return a.id == b.id and _lanes(a, on) >= 2
        case "opposing":
            return a.entry == b.exit and a.exit == b.entry


def _lanes(route: Route, on: IntersectionMap) -> int:
    return sum(lane.kind == "approach" and lane.leg == route.entry for lane in on.lanelets)


def _violator(
    pattern: Pattern,
    names: tuple[str, str],
    routes: tuple[Route, Route],
    graph: SocialGraph,
    on: IntersectionMap,
) -> str | None:
    for name in names:
        if graph.agent(name).runs_red:
            return name
    if pattern.violator is None or green_together(*routes, on=on):
        return None
    return names[0] if pattern.violator == "from" else names[1]


def _zone_key(route: Route) -> str:
    return route.movement_id or f"{route.crosswalk}:crosswalk"


def _no_route(agent: AgentNode, on: IntersectionMap) -> Rejection:
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
    detail = f"{agent.id} ({', '.join(wanted)}) has no way through {on.title}"
    return Rejection(stage="scene_planner", code="ungroundable", agents=(agent.id,), detail=detail)


def _playable(graph: SocialGraph, grounding: Grounding, on: IntersectionMap) -> bool:
    found = casts(graph, grounding, on=on, rng=np.random.default_rng(0))
    return next(found, None) is not None


def _never_meet(edge: RelationEdge, on: IntersectionMap) -> Rejection:
    return _relation_fails(
        edge,
        f"the routes of {edge.from_} and {edge.to} do not meet "
        f"so that '{_words(edge)}' could happen at {on.title}",
    )


def _not_together(edge: RelationEdge) -> Rejection:
    return _relation_fails(edge, f"'{_words(edge)}' does not fit together with the other relations")


def _relation_fails(edge: RelationEdge, detail: str) -> Rejection:
    return Rejection(
        stage="scene_planner", code="ungroundable", agents=(edge.from_, edge.to), detail=detail
    )


def _words(edge: RelationEdge) -> str:
    kind = f" ({edge.kind.replace('_', ' ')})" if edge.kind else ""
    return f"{edge.from_} {edge.type.replace('_', ' ')} {edge.to}{kind}"
