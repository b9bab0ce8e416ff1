"""Map grounding (paper 3.1): binds the social graph to routes, crosswalks and stop lines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain, product
from typing import TypeVar

import numpy as np

from scenewright.errors import Rejected
from scenewright.scene.base import RIDERS, Compass, FloatArray
from scenewright.scene.cache import RecentCache
from scenewright.scene.candidates import AssignedPattern, Grounding, RoleAssignment
from scenewright.scene.kinds import has_trait
from scenewright.scene.map import IntersectionMap, Route
from scenewright.scene.rejection import Rejection
from scenewright.scene.relations import Pattern, Role, get_pattern
from scenewright.scene.route_table import make_route
from scenewright.scene.social import AgentNode, EntrySide, RelationEdge, SocialGraph
from scenewright.tools.map_grounding.hiding import can_hide, refuse_unhidden
from scenewright.tools.map_grounding.orders import (
    ORDERED,
    find_wrong_order,
    keeps_striker,
)
from scenewright.tools.map_grounding.relation_files import load_checked_patterns

_Drawn = TypeVar("_Drawn")
RouteWeight = Callable[[Route], float]
"""How common a route is; zero keeps it from being drawn unless nothing else is left."""

_SYMMETRIC = ("collide_at", "near_miss")

_FROM_THE_KERB = 4.3
"""Farthest from a kerb [m] that a conflict zone may begin for a pedestrian at the kerb to give way
there (SEMANTICS 4: 5 m, less a margin)."""


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
            turn = (_RING.index(str(agent.exit)) - _RING.index(str(agent.entry))) % len(_RING)
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
    faults = chain(_find_collision_faults(graph), _find_reaction_faults(graph))
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


def find_assignments(
    graph: SocialGraph,
    grounding: Grounding,
    *,
    intersection_map: IntersectionMap,
    rng: np.random.Generator,
    weight: RouteWeight = lambda _route: 1.0,
    lawful: bool = False,
) -> Iterator[RoleAssignment]:
    """Consistent choices of routes and patterns, likelier ones more often early; lazily.

    Args:
        lawful: only those in which no agent runs a red light unasked.
    """
    order = {
        name: _shuffle(routes, [max(weight(route), 1e-9) for route in routes], rng)
        for name, routes in grounding.routes.items()
    }
    allowed = find_asked_runners(graph) if lawful else frozenset(grounding.routes)
    yield from _assign(graph, intersection_map, rng, order, allowed, {}, ())


def find_asked_runners(graph: SocialGraph) -> frozenset[str]:
    """Agents of which the request says that they run a red light, or that one of two does."""
    caused = (edge for edge in graph.relations if has_trait("cause", edge.cause, "red_light"))
    pairs = {name for edge in caused for name in (edge.from_, edge.to)}
    return frozenset(pairs | {agent.id for agent in graph.agents if agent.runs_red})


def list_unasked_runners(graph: SocialGraph, assignment: RoleAssignment) -> list[str]:
    """Agents that run a red light in an assignment though the request does not say so."""
    runners = {pattern.violator for pattern in assignment.patterns if pattern.violator is not None}
    return sorted(runners - find_asked_runners(graph))


def may_run_unasked(
    graph: SocialGraph, grounding: Grounding, *, intersection_map: IntersectionMap
) -> bool:
    """Whether some relation by itself can be played so that one runs a red light unasked."""
    rng, asked = np.random.default_rng(0), find_asked_runners(graph)
    order = {name: list(routes) for name, routes in grounding.routes.items()}
    return any(
        played.violator is not None and played.violator not in asked
        for edge in graph.relations
        for _, played in _play(edge, 0, graph, intersection_map, rng, order, {})
    )


def list_meetings(pattern: Pattern, intersection_map: IntersectionMap) -> list[tuple[Route, Route]]:
    """Every pair of routes of a map on which a pattern can be played."""
    mirrored = _is_mirrored(pattern, intersection_map)
    routes = (*intersection_map.routes, *map(make_route, intersection_map.uturns))
    roles = (pattern.from_, pattern.to)
    ways = (_list_playable_routes(routes, role, mirrored=mirrored) for role in roles)
    return [(a, b) for a, b in product(*ways) if _meet_so(pattern, a, b, intersection_map)]


def can_be_lawful(pattern: Pattern, *, intersection_map: IntersectionMap) -> bool:
    """Whether a pattern has routes on a map on which nobody has to run a red light."""
    return pattern.violator is None or any(
        share_green(a, b, intersection_map=intersection_map)
        for a, b in list_meetings(pattern, intersection_map)
    )


def have_conflict(a: Route, b: Route, *, intersection_map: IntersectionMap) -> bool:
    """Whether the swept paths of two routes overlap on the map."""
    if "jaywalking" in (a.movement, b.movement):
        walker, other = (a, b) if a.movement == "jaywalking" else (b, a)
        return other.type == "vehicle" and walker.crosswalk in (other.entry, other.exit)
    return frozenset((a.zone_key, b.zone_key)) in intersection_map.zone_pairs


def share_green(a: Route, b: Route, *, intersection_map: IntersectionMap) -> bool:
    """Whether both may ever go at the same time; True where one of them has no signal."""
    groups = [intersection_map.find_signal_group(route) for route in (a, b)]
    if intersection_map.signals is None or None in groups:
        return True
    return any(
        all(phase.colours[str(group)] != "red" for group in groups)
        for phase in intersection_map.signals.phases
    )


def count_signal_conflicts(cast: RoleAssignment, *, intersection_map: IntersectionMap) -> int:
    """How many relations of a cast the lights do not allow as the programme runs, or the map.

    Two who obey must have green together; of two, one runs red where the other has green. Changes
    of the lights leave a little room for exceptions, so that such a cast is not hopeless. Nor is
    one in which a pedestrian would give way from the kerb on the far side of the roadway.
    """
    runs = {pattern.violator for pattern in cast.patterns} - {None}
    odd = 0
    for pattern in cast.patterns:
        pair = [cast.routes[name] for name in (pattern.from_, pattern.to) if name not in runs]
        if len(pair) == 2:
            odd += not share_green(*pair, intersection_map=intersection_map)
        elif len(pair) == 1:
            (runner,) = {pattern.from_, pattern.to} & runs
            odd += not _is_red_at_green(
                cast.routes[runner], pair[0], intersection_map=intersection_map
            )
        if get_pattern(pattern.pattern).relation == "yield_to":
            odd += not _is_kerb_near(
                cast.routes[pattern.from_],
                cast.routes[pattern.to],
                intersection_map=intersection_map,
            )
    return odd


def _is_kerb_near(walker: Route, other: Route, *, intersection_map: IntersectionMap) -> bool:
    """Whether the first, if on foot, steps off its kerb close to where it meets the other."""
    crosswalk = next(
        (each for each in intersection_map.crosswalks if each.leg == walker.crosswalk), None
    )
    if walker.type == "vehicle" or crosswalk is None or walker.entry not in crosswalk.sides:
        return True
    kerb, beyond = (np.array(point) for point in crosswalk.centreline)
    if crosswalk.sides[0] != walker.entry:
        kerb, beyond = beyond, kerb
    ahead = (beyond - kerb) / np.hypot(*(beyond - kerb))
    both = {walker.zone_key, other.zone_key}
    zones = [
        zone.polygon
        for zone in intersection_map.conflict_zones
        if {zone.first, zone.second} == both
    ]
    ways = [float(((np.array(zone) - kerb) @ ahead).min()) for zone in zones]
    return not ways or min(ways) <= _FROM_THE_KERB


def _is_red_at_green(runner: Route, other: Route, *, intersection_map: IntersectionMap) -> bool:
    """Whether the light of the first is red at any time when that of the other is not."""
    groups = [intersection_map.find_signal_group(route) for route in (runner, other)]
    if intersection_map.signals is None or None in groups:
        return True
    return any(
        phase.colours[str(groups[0])] == "red" and phase.colours[str(groups[1])] != "red"
        for phase in intersection_map.signals.phases
    )


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


def _shuffle(
    each: Sequence[_Drawn], weights: Sequence[float], rng: np.random.Generator
) -> list[_Drawn]:
    """A random order in which heavier ones tend to come first (Gumbel top-k)."""
    scores = np.log(weights) + rng.gumbel(size=len(each))
    return [each[index] for index in np.argsort(scores)[::-1]]


def _assign(
    graph: SocialGraph,
    intersection_map: IntersectionMap,
    rng: np.random.Generator,
    order: dict[str, list[Route]],
    allowed: frozenset[str],
    chosen: dict[str, Route],
    played: tuple[AssignedPattern, ...],
) -> Iterator[RoleAssignment]:
    """Depth first over the edges, then over agents that no edge binds.

    Args:
        allowed: agents that may run a red light.
    """
    if len(played) < len(graph.relations):
        index = len(played)
        edge = graph.relations[index]
        for routes, cast_pattern in _play(edge, index, graph, intersection_map, rng, order, chosen):
            if cast_pattern.violator is None or cast_pattern.violator in allowed:
                now, done = chosen | routes, (*played, cast_pattern)
                yield from _assign(graph, intersection_map, rng, order, allowed, now, done)
        return
    for routes in _assign_free_agents(graph, intersection_map, order, chosen):
        yield RoleAssignment(routes=routes, patterns=played)


def _assign_free_agents(
    graph: SocialGraph,
    intersection_map: IntersectionMap,
    order: dict[str, list[Route]],
    chosen: dict[str, Route],
) -> Iterator[dict[str, Route]]:
    """The routes chosen and, for agents that no edge binds, the first that go with them."""
    free = next((agent.id for agent in graph.agents if agent.id not in chosen), None)
    if free is None:
        yield chosen
        return
    for route in order[free]:
        routes = chosen | {free: route}
        if _are_ties_kept(graph, routes) and can_hide(graph, routes, intersection_map):
            yield from _assign_free_agents(graph, intersection_map, order, routes)


def _are_ties_kept(graph: SocialGraph, routes: dict[str, Route]) -> bool:
    """Whether the entries lie to one another as the text has them, as far as they are chosen."""
    return all(
        is_on_side(tie.side, routes[tie.agent].entry, of=routes[tie.of].entry)
        for tie in graph.ties
        if tie.agent in routes and tie.of in routes
    )


def is_on_side(side: EntrySide, entry: str, *, of: str) -> bool:
    """Whether an entry lies on that side of another one.

    >>> is_on_side("left", "east", of="north"), is_on_side("lateral", "south", of="north")
    (True, False)
    """
    turn = (_RING.index(entry) - _RING.index(of)) % len(_RING)
    match side:
        case "same":
            return turn == 0
        case "other":
            return turn != 0
        case "opposite":
            return turn == 4
        case "lateral":
            return turn not in (0, 4)
        # An agent from the north drives southwards and has the east on its left.
        case "left":
            return 0 < turn < 4
        case "right":
            return turn > 4


def _play(
    edge: RelationEdge,
    index: int,
    graph: SocialGraph,
    intersection_map: IntersectionMap,
    rng: np.random.Generator,
    order: dict[str, list[Route]],
    chosen: dict[str, Route],
) -> Iterator[tuple[dict[str, Route], AssignedPattern]]:
    found = find_patterns(edge, graph)
    rare = [each for each in found if each.is_last_resort or _is_unsaid(each, edge)]
    usual = [each for each in found if each not in rare]
    found = [*_shuffle(usual, [each.weight for each in usual], rng), *rare]
    asked = any(graph.agent(name).runs_red for name in (edge.from_, edge.to))
    # A red-light runner runs red, if possible, while the other one has green.
    # Passing on yellow it meets agents that had green with it, else those that get green next;
    # that is no reason to run red.
    yellow = any(
        has_trait("motion", graph.agent(n).motion, "at_yellow") for n in (edge.from_, edge.to)
    )
    for apart in (False, True) if yellow else (True, False) if asked else (None,):
        for pattern in found:
            mirrored = _is_mirrored(pattern, intersection_map)
            for names in _list_role_orders(edge, pattern):
                roles = tuple(zip(names, (pattern.from_, pattern.to), strict=True))
                if not all(role.admits(graph.agent(name).type) for name, role in roles):
                    continue
                ways = (
                    _list_playable_routes(
                        [chosen[name]] if name in chosen else order[name], role, mirrored=mirrored
                    )
                    for name, role in roles
                )
                for a, b in product(*ways):
                    if not _meet_so(pattern, a, b, intersection_map):
                        continue
                    routes = {names[0]: a, names[1]: b}
                    now = chosen | routes
                    if not _are_ties_kept(graph, now) or not can_hide(graph, now, intersection_map):
                        continue
                    green = share_green(a, b, intersection_map=intersection_map)
                    if (
                        apart is not green
                        and _is_struck_side_right(edge, routes)
                        and _is_clear_of_wrecks(graph, now)
                    ):
                        together = green or yellow
                        violator = _find_violator(pattern, names, graph, together=together)
                        yield (
                            routes,
                            AssignedPattern(
                                edge=index, pattern=pattern.id, from_=names[0], to=names[1],
                                violator=violator,
                            ),
                        )  # fmt: skip


def _is_struck_side_right(edge: RelationEdge, routes: dict[str, Route]) -> bool:
    """Whether the striking one of two that cross straight comes from the side to be struck."""
    striking, struck = routes[edge.from_], routes[edge.to]
    if edge.point_to not in ("left", "right") or {striking.movement, struck.movement} != {
        "straight"
    }:
        return True
    turn = (_RING.index(striking.entry) - _RING.index(struck.entry)) % 8
    # An agent from the north drives southwards and has the east on its left.
    return turn in (0, 4) or (edge.point_to == "left") == (turn < 4)


def find_patterns(edge: RelationEdge, graph: SocialGraph) -> list[Pattern]:
    """Patterns that serve the relation and, if one is named, the kind of collision."""
    first, second = graph.agent(edge.from_), graph.agent(edge.to)
    figures = (edge.target_pet, edge.target_ttc, edge.cause)
    leaves_path = any(has_trait("reaction", a.reaction, "leaves_way") for a in (first, second))
    by_red = has_trait("cause", edge.cause, "red_light") and edge.kind is None
    return [
        pattern
        for pattern in load_checked_patterns()
        if pattern.relation == edge.type
        and edge.pattern in (None, pattern.id)
        and (
            edge.pattern is not None
            or edge.manoeuvre == pattern.manoeuvre
            or _is_unsaid(pattern, edge)
        )
        and (
            (pattern.from_.admits(first.type) and pattern.to.admits(second.type))
            or (pattern.from_.admits(second.type) and pattern.to.admits(first.type))
        )
        and edge.kind in (None, pattern.kind)
        # Overtaking in one lane leaves no PET or TTC to ask for.
        and (pattern.geometry != "overtaking" or figures == (None, None, None))
        and _can_strike(pattern, edge)
        # Running a red light causes nothing among those who follow one another.
        and not (by_red and pattern.entries == "same")
        # Who leaves its path as a reaction must meet another that crosses it.
        and (pattern.geometry == "crossing" or not leaves_path)
        # The order of passing, if one is asked for, must show.
        and (edge.first is None or pattern.geometry in ORDERED)
    ]


def _is_unsaid(pattern: Pattern, edge: RelationEdge) -> bool:
    """Whether the request names no way of a near miss in one lane, which needs some."""
    unsaid = edge.manoeuvre is None and edge.pattern is None
    return unsaid and pattern.manoeuvre is not None and edge.type == "near_miss"


def _can_strike(pattern: Pattern, edge: RelationEdge) -> bool:
    """Whether collisions of the pattern's kind may touch the vehicles where the edge says."""
    wanted = (edge.point_from or "", edge.point_to or "")
    match pattern.kind:
        case "rear_end":
            return wanted[0][:5] in ("", "front") and wanted[1][:4] in ("", "rear")
        case "head_on":
            return all(point == "" or point.startswith("front") for point in wanted)
        case "sideswipe":
            return not {"front", "rear"}.intersection(wanted)
    return True


def _list_role_orders(edge: RelationEdge, pattern: Pattern) -> list[tuple[str, str]]:
    orders = [(edge.from_, edge.to)]
    is_stated = edge.pattern is not None or edge.manoeuvre is not None
    is_stated = is_stated and pattern.from_.type == pattern.to.type
    # Rear-end and side impacts name the striker, and a rider's pattern fixes its roles.
    ridden = pattern.kind in ("rear_end", "sideswipe") and pattern.from_.type != pattern.to.type
    if pattern.relation in _SYMMETRIC and not is_stated and not ridden:
        orders.append((edge.to, edge.from_))  # no phrase says which agent does it to which
    return [
        order
        for order in orders
        if None in (edge.first, pattern.order)
        or edge.first == order[("from", "to").index(str(pattern.order))]
        if keeps_striker(edge, pattern, order)
    ]


def can_serve(pattern: Pattern, a: Route, b: Route, *, intersection_map: IntersectionMap) -> bool:
    """Whether route `a` can play `from` and route `b` can play `to` of the pattern."""
    mirrored = _is_mirrored(pattern, intersection_map)
    return (
        _can_play(a, pattern.from_, mirrored=mirrored)
        and _can_play(b, pattern.to, mirrored=mirrored)
        and _meet_so(pattern, a, b, intersection_map)
    )


def _meet_so(pattern: Pattern, a: Route, b: Route, intersection_map: IntersectionMap) -> bool:
    """Return whether two routes lie to one another as the pattern has it."""
    return _do_entries_fit(pattern, a, b) and _is_geometry_fitting(pattern, a, b, intersection_map)


def _list_playable_routes(routes: Sequence[Route], role: Role, *, mirrored: bool) -> list[Route]:
    """The routes on which the role can be played."""
    return [route for route in routes if _can_play(route, role, mirrored=mirrored)]


def _is_mirrored(pattern: Pattern, intersection_map: IntersectionMap) -> bool:
    """Whether left and right change places: the files speak of right-hand traffic.

    So a left turn across the path of others is a right turn there, its kind of collision included.
    """
    return intersection_map.left_hand_traffic and pattern.kind != "pedestrian_strike"


_MIRROR = {"left": "right", "right": "left"}


def _can_play(route: Route, role: Role, *, mirrored: bool) -> bool:
    movement = _MIRROR.get(route.movement, route.movement) if mirrored else route.movement
    return movement in role.movements


def _do_entries_fit(pattern: Pattern, a: Route, b: Route) -> bool:
    match pattern.entries:
        case "any":
            return a.type != b.type or a.entry != b.entry
        case "same":
            return a.entry == b.entry
        case "opposite":
            return _are_opposite(a.entry, b.entry)
        case "lateral":
            return a.entry != b.entry and not _are_opposite(a.entry, b.entry)


_RING = ("north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest")


def _are_opposite(a: str, b: str) -> bool:
    return abs(_RING.index(a) - _RING.index(b)) == 4


def _is_geometry_fitting(
    pattern: Pattern, a: Route, b: Route, intersection_map: IntersectionMap
) -> bool:
    match pattern.geometry:
        case "crossing" if a.type == b.type == "pedestrian":
            return _do_walks_meet(pattern, a, b, intersection_map)
        case "crossing":
            return have_conflict(a, b, intersection_map=intersection_map) and (
                a.type != b.type or a.exit != b.exit
            )
        case "merging":
            return (
                a.exit == b.exit
                and a.entry != b.entry
                and have_conflict(a, b, intersection_map=intersection_map)
            )
        case "same_lane":
            return a.entry == b.entry and _share_a_lane(a, b, intersection_map)
        case "turn_across":
            # Who turns off from a lane of its own beside the other's never crosses its way.
            return a.exit != b.exit and a.entry == b.entry and _share_a_lane(a, b, intersection_map)
        case "same_way" | "overtaking" | "cutting_in":
            return a.entry == b.entry and a.exit == b.exit
        case "lane_change":
            return (
                a.id == b.id
                and sum(
                    lane.kind == "approach" and lane.leg == a.entry
                    for lane in intersection_map.lanelets
                )
                >= 2
            )
        case "opposing":
            return (
                a.entry == b.exit and a.exit == b.entry and not _is_divided(a, b, intersection_map)
            )


def _do_walks_meet(pattern: Pattern, a: Route, b: Route, intersection_map: IntersectionMap) -> bool:
    """Whether two cross one crosswalk in opposite directions, or meet at a corner, where one comes
    from a crosswalk and the other goes to the next."""
    if pattern.zone != "sidewalk":
        return a.crosswalk == b.crosswalk and a.entry != b.entry
    kerbs = [
        (_find_kerb(one, one.exit, intersection_map), _find_kerb(two, two.entry, intersection_map))
        for one, two in ((a, b), (b, a))
        if one.crosswalk != two.crosswalk
    ]
    return any(np.hypot(*(here - there)) <= _CORNER for here, there in kerbs)


def _find_kerb(route: Route, side: Compass, intersection_map: IntersectionMap) -> FloatArray:
    """The end of a route's crosswalk on a side [m]; NaN where it has none."""
    for crosswalk in intersection_map.crosswalks:
        if crosswalk.leg == route.crosswalk and side in crosswalk.sides:
            return np.array(crosswalk.centreline[crosswalk.sides.index(side)])
    return np.full(2, np.nan)


_CORNER = 10.0
"""Crosswalks that end this near one another [m] share a corner."""


def _share_a_lane(a: Route, b: Route, intersection_map: IntersectionMap) -> bool:
    """Whether one lane before the stop line leads both ways."""
    lanes = [intersection_map.find_movement(route) for route in (a, b)]
    if None in lanes:
        return True
    approaches = {lane.id for lane in intersection_map.lanelets if lane.kind == "approach"}
    first, second = (approaches.intersection(lane.lanelets) for lane in lanes if lane)
    return bool(first & second)


_MEDIAN = 14.0
"""Opposite directions of a road farther apart [m] are parted by more than a line."""


def _is_divided(a: Route, b: Route, intersection_map: IntersectionMap) -> bool:
    """Whether a median parts the way that one drives out by from the other's way in."""
    out, into = intersection_map.find_movement(a), intersection_map.find_movement(b)
    if out is None or into is None:
        return False
    (x, y), (u, v) = out.centreline[-1], into.centreline[0]
    return float(np.hypot(x - u, y - v)) > _MEDIAN


def _find_violator(
    pattern: Pattern,
    names: tuple[str, str],
    graph: SocialGraph,
    *,
    together: bool,
) -> str | None:
    """Who of the two runs a red light, if anyone; `together`: they may have green at one time."""
    for name in names:
        if graph.agent(name).runs_red:
            return name
    if pattern.violator is None or together:
        return None
    usual, other = names if pattern.violator == "from" else names[::-1]
    # A giver at a red light gives way to the light, vehicles in line need one light, and
    # who only brakes too late is not the one that ran red.
    late = [edge for edge in graph.relations if has_trait("cause", edge.cause, "late")]
    bound = {name for edge in late for name in (edge.from_, edge.to) if name.startswith("vehicle")}
    bound |= {edge.from_ for edge in graph.relations if edge.type in ("yield_to", "follow")}
    bound |= {edge.to for edge in graph.relations if edge.type == "follow"}
    return other if usual in bound and other not in bound else usual


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


_Fault = tuple[tuple[str, ...], str]
"""Agents that cannot do what is asked on any map, and why."""


def _find_collision_faults(graph: SocialGraph) -> Iterator[_Fault]:
    """Second collisions of one agent that nothing pushes there, hit groups, late braking alone."""
    hits: dict[str, list[RelationEdge]] = {}
    for edge in graph.relations:
        if edge.type == "collide_at":
            hits.setdefault(edge.from_, []).append(edge)
            hits.setdefault(edge.to, []).append(edge)
    for name, edges in hits.items():
        pushed = any(edge.is_pushed and edge.from_ == name for edge in edges)
        if len(edges) > 1 + pushed:
            yield (
                (edges[1].from_, edges[1].to),
                f"{name} would be in {len(edges)} collisions, but its track ends at the first; "
                "ask for one collision of each agent, or for one that pushes it into the next",
            )
    for edge in graph.relations:
        pair = (edge.from_, edge.to)
        for name in pair if edge.type == "collide_at" else ():
            if graph.agent(name).members is not None:
                yield (
                    pair,
                    f"{name} is a group, and the member that is hit cannot be chosen; ask for "
                    "a near miss or a yield, or have one pedestrian hit",
                )
    for edge in graph.relations:
        if has_trait("cause", edge.cause, "late") and edge.type not in ("collide_at", "near_miss"):
            yield (
                (edge.from_, edge.to),
                f"{edge.cause} goes with collide_at or near_miss alone, as a yielding or following "
                "agent brakes in time; ask for a near miss, or leave the braking out",
            )


def _find_reaction_faults(graph: SocialGraph) -> Iterator[_Fault]:
    """Braking pedestrians, waiting for a vehicle that never passes, and reactions to no threat."""
    for edge in graph.relations:
        if edge.braker is not None and graph.agent(edge.braker).type != "vehicle":
            yield (
                (edge.from_, edge.to),
                f"{edge.braker} has no brakes; as braker write the vehicle of the two, or leave "
                "the key out",
            )
    for wait, hit in _find_waits_and_hits(graph):
        walker, struck = graph.agent(wait.from_), graph.agent(_get_other(hit, wait.to))
        if walker.crosswalk is not None and walker.crosswalk == struck.crosswalk:
            yield (
                (wait.from_, wait.to),
                f"{wait.to} is to hit {struck.id} on the {walker.crosswalk} crosswalk and stays "
                f"there, so it never passes {walker.id}, which waits for it at that crosswalk; "
                "give the two pedestrians different crosswalks",
            )
    threats = (e for e in graph.relations if e.type in ("collide_at", "near_miss"))
    threatened = {name for edge in threats for name in (edge.from_, edge.to)}
    for agent in graph.agents:
        if agent.reaction not in (None, "none") and agent.id not in threatened:
            how = str(agent.reaction).replace("_", " ")
            yield (agent.id,), f"{agent.id} {how}, which goes with a collision or a near miss alone"


def _find_waits_and_hits(graph: SocialGraph) -> Iterator[tuple[RelationEdge, RelationEdge]]:
    """Find pairs of edges: a pedestrian waits for a vehicle that hits another pedestrian."""
    walks = {
        agent.id
        for agent in graph.agents
        if agent.type == "pedestrian" and agent.movement != "jaywalking"
    }
    for wait, hit in product(graph.relations, repeat=2):
        if (wait.type, hit.type) != ("yield_to", "collide_at") or wait.from_ not in walks:
            continue
        if wait.to in (hit.from_, hit.to) and _get_other(hit, wait.to) in walks - {wait.from_}:
            yield wait, hit


def _get_other(edge: RelationEdge, name: str) -> str:
    return edge.to if name == edge.from_ else edge.from_


def _is_clear_of_wrecks(graph: SocialGraph, routes: dict[str, Route]) -> bool:
    """Return whether no pedestrian waits for a vehicle that stays on its crosswalk after a hit."""
    for wait, hit in _find_waits_and_hits(graph):
        named = (wait.from_, wait.to, _get_other(hit, wait.to))
        if set(named) <= routes.keys():
            walker, vehicle, struck = (routes[name] for name in named)
            # It crosses the crosswalk of its entry before that of its exit.
            if struck.crosswalk in (walker.crosswalk, vehicle.entry):
                return False
    return True


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
