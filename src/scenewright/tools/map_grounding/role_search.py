"""The search for routes and patterns that show all relations of a graph at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TypeVar

import numpy as np

from scenewright.scene.candidates import AssignedPattern, Grounding, RoleAssignment
from scenewright.scene.kinds import has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.scene.relations import Pattern, get_pattern
from scenewright.scene.social import EntrySide, RelationEdge, SocialGraph
from scenewright.tools.map_grounding.hiding import can_hide
from scenewright.tools.map_grounding.relation_faults import (
    ORDERED,
    find_waits_and_hits,
    keeps_striker,
)
from scenewright.tools.map_grounding.relation_files import load_checked_patterns
from scenewright.tools.map_grounding.route_meetings import (
    can_meet,
    is_kerb_near,
    is_mirrored,
    is_red_at_green,
    list_playable_routes,
    measure_ring_steps,
    share_green,
)

RouteWeight = Callable[[Route], float]
"""How common a route is; zero keeps it from being drawn unless nothing else is left."""

_Drawn = TypeVar("_Drawn")

_SYMMETRIC = ("collide_at", "near_miss")


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
    may_run_red = find_asked_runners(graph) if lawful else frozenset(grounding.routes)
    yield from _RoleSearch(graph, intersection_map, rng, order).assign({}, (), may_run_red)


def may_run_unasked(
    graph: SocialGraph, grounding: Grounding, *, intersection_map: IntersectionMap
) -> bool:
    """Whether some relation by itself can be played so that one runs a red light unasked."""
    search = _RoleSearch(graph, intersection_map, np.random.default_rng(0), grounding.routes)
    unasked = {None, *find_asked_runners(graph)}
    return any(
        played.violator not in unasked
        for edge in graph.relations
        for _, played in search.play(edge, 0, {})
    )


@dataclass(frozen=True)
class _RoleSearch:
    """A depth-first search over the relations of a graph, then over agents that none binds.

    Attributes:
        order: routes of each agent in the order in which they are tried.
    """

    graph: SocialGraph
    intersection_map: IntersectionMap
    rng: np.random.Generator
    order: Mapping[str, Sequence[Route]]

    def assign(
        self,
        chosen: dict[str, Route],
        played: tuple[AssignedPattern, ...],
        may_run_red: frozenset[str],
    ) -> Iterator[RoleAssignment]:
        """Routes of all agents, given some of them, and patterns of the relations not played."""
        if len(played) == len(self.graph.relations):
            for routes in self._assign_free_agents(chosen):
                yield RoleAssignment(routes=routes, patterns=played)
            return
        edge = self.graph.relations[len(played)]
        for routes, pattern in self.play(edge, len(played), chosen):
            if pattern.violator is None or pattern.violator in may_run_red:
                yield from self.assign(chosen | routes, (*played, pattern), may_run_red)

    def _assign_free_agents(self, chosen: dict[str, Route]) -> Iterator[dict[str, Route]]:
        """The routes chosen and, for agents that no edge binds, the first that go with them."""
        free = next((agent.id for agent in self.graph.agents if agent.id not in chosen), None)
        if free is None:
            yield chosen
            return
        for route in self.order[free]:
            routes = chosen | {free: route}
            if self._is_consistent(routes):
                yield from self._assign_free_agents(routes)

    def _is_consistent(self, routes: dict[str, Route]) -> bool:
        """Whether the routes chosen so far keep the ties and let objects hide whom they are to."""
        ties_kept = all(
            is_on_side(tie.side, routes[tie.agent].entry, of=routes[tie.of].entry)
            for tie in self.graph.ties
            if tie.agent in routes and tie.of in routes
        )
        return ties_kept and can_hide(self.graph, routes, self.intersection_map)

    def play(
        self, edge: RelationEdge, index: int, chosen: dict[str, Route]
    ) -> Iterator[tuple[dict[str, Route], AssignedPattern]]:
        """Routes of the two agents of a relation, beside those chosen, and the pattern of it."""
        graph, intersection_map = self.graph, self.intersection_map
        patterns = find_patterns(edge, graph)
        rare = [
            pattern for pattern in patterns if pattern.is_last_resort or _is_unsaid(pattern, edge)
        ]
        usual = [pattern for pattern in patterns if pattern not in rare]
        patterns = [*_shuffle(usual, [pattern.weight for pattern in usual], self.rng), *rare]
        pair = [graph.agent(name) for name in (edge.from_, edge.to)]
        # A red-light runner runs red, if possible, while the other one has green.
        # Passing on yellow it meets agents that had green with it, else those that get green next;
        # that is no reason to run red.
        yellow = any(has_trait("motion", agent.motion, "at_yellow") for agent in pair)
        asked = any(agent.runs_red for agent in pair)
        for apart in (False, True) if yellow else (True, False) if asked else (None,):
            for pattern in patterns:
                for names, a, b in self._list_meeting_routes(edge, pattern, chosen):
                    routes = {names[0]: a, names[1]: b}
                    green = share_green(a, b, intersection_map=intersection_map)
                    if (
                        self._is_consistent(chosen | routes)
                        and apart is not green
                        and _is_struck_side_right(edge, routes)
                        and _is_clear_of_wrecks(graph, chosen | routes)
                    ):
                        violator = _find_violator(pattern, names, graph, together=green or yellow)
                        yield (
                            routes,
                            AssignedPattern(
                                edge=index, pattern=pattern.id, from_=names[0], to=names[1],
                                violator=violator,
                            ),
                        )  # fmt: skip

    def _list_meeting_routes(
        self, edge: RelationEdge, pattern: Pattern, chosen: dict[str, Route]
    ) -> Iterator[tuple[tuple[str, str], Route, Route]]:
        """Who plays which role of a pattern, and two routes that lie as the pattern has it."""
        mirrored = is_mirrored(pattern, self.intersection_map)
        for names in _list_role_orders(edge, pattern):
            roles = tuple(zip(names, (pattern.from_, pattern.to), strict=True))
            if not all(role.admits(self.graph.agent(name).type) for name, role in roles):
                continue
            ways = (
                list_playable_routes(
                    [chosen[name]] if name in chosen else self.order[name], role, mirrored=mirrored
                )
                for name, role in roles
            )
            for a, b in product(*ways):
                if can_meet(pattern, a, b, self.intersection_map):
                    yield names, a, b


def find_asked_runners(graph: SocialGraph) -> frozenset[str]:
    """Agents of which the request says that they run a red light, or that one of two does."""
    caused = (edge for edge in graph.relations if has_trait("cause", edge.cause, "red_light"))
    pairs = {name for edge in caused for name in edge.pair}
    return frozenset(pairs | {agent.id for agent in graph.agents if agent.runs_red})


def list_unasked_runners(graph: SocialGraph, assignment: RoleAssignment) -> list[str]:
    """Agents that run a red light in an assignment though the request does not say so."""
    runners = {pattern.violator for pattern in assignment.patterns if pattern.violator is not None}
    return sorted(runners - find_asked_runners(graph))


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
            odd += not is_red_at_green(
                cast.routes[runner], pair[0], intersection_map=intersection_map
            )
        if get_pattern(pattern.pattern).relation == "yield_to":
            odd += not is_kerb_near(
                cast.routes[pattern.from_],
                cast.routes[pattern.to],
                intersection_map=intersection_map,
            )
    return odd


def _shuffle(
    options: Sequence[_Drawn], weights: Sequence[float], rng: np.random.Generator
) -> list[_Drawn]:
    """A random order in which heavier ones tend to come first (Gumbel top-k)."""
    scores = np.log(weights) + rng.gumbel(size=len(options))
    return [options[index] for index in np.argsort(scores)[::-1]]


def is_on_side(side: EntrySide, entry: str, *, of: str) -> bool:
    """Whether an entry lies on that side of another one.

    >>> is_on_side("left", "east", of="north"), is_on_side("lateral", "south", of="north")
    (True, False)
    """
    turn = measure_ring_steps(entry, start=of)
    match side:
        case "same":
            return turn == 0
        case "other":
            return turn != 0
        case "opposite":
            return turn == 4
        case "lateral":
            return turn not in (0, 4)
        case "left":
            return 0 < turn < 4
        case "right":
            return turn > 4


def _is_struck_side_right(edge: RelationEdge, routes: dict[str, Route]) -> bool:
    """Whether the striking one of two that cross straight comes from the side to be struck."""
    striking, struck = routes[edge.from_], routes[edge.to]
    if edge.point_to not in ("left", "right") or {striking.movement, struck.movement} != {
        "straight"
    }:
        return True
    turn = measure_ring_steps(striking.entry, start=struck.entry)
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
    bound = {name for edge in late for name in edge.pair if name.startswith("vehicle")}
    bound |= {edge.from_ for edge in graph.relations if edge.type in ("yield_to", "follow")}
    bound |= {edge.to for edge in graph.relations if edge.type == "follow"}
    return other if usual in bound and other not in bound else usual


def _is_clear_of_wrecks(graph: SocialGraph, routes: dict[str, Route]) -> bool:
    """Return whether no pedestrian waits for a vehicle that stays on its crosswalk after a hit."""
    for wait, hit in find_waits_and_hits(graph):
        named = (wait.from_, wait.to, hit.get_other(wait.to))
        if set(named) <= routes.keys():
            walker, vehicle, struck = (routes[name] for name in named)
            # It crosses the crosswalk of its entry before that of its exit.
            if struck.crosswalk in (walker.crosswalk, vehicle.entry):
                return False
    return True
