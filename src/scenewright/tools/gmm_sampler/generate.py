"""The amplified scene (paper Eq. 1) and M waypoint candidates for every agent of it (Eq. 2)."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any, Literal

import numpy as np

from scenewright.errors import Rejected
from scenewright.scene.base import RIDERS, AgentClass, FloatArray
from scenewright.scene.candidates import (
    AgentCandidates,
    AssignedPattern,
    Candidate,
    CandidateSet,
    DrawnWaypoints,
    DrivingProfile,
    Grounding,
    RoleAssignment,
)
from scenewright.scene.kinds import get_kind, has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.scene.rejection import Rejection
from scenewright.scene.relations import get_pattern
from scenewright.scene.social import SceneContext, SocialGraph
from scenewright.scene.track import PEDESTRIAN, Shape, get_rider_shape, get_vehicle_shape
from scenewright.tools.gmm_sampler.assumed_priors import build_rider_priors, build_uturn_priors
from scenewright.tools.gmm_sampler.background_counts import (
    draw_background_counts,
    find_least_counts,
)
from scenewright.tools.gmm_sampler.beside_riders import keep_pace, make_room
from scenewright.tools.gmm_sampler.driving_profile_prior import (
    apply_measures,
    compute_profile_nll,
    count_slow_routes,
    sample_driving_profiles,
)
from scenewright.tools.gmm_sampler.groups import form_group, walk_beside
from scenewright.tools.gmm_sampler.lane_holding import (
    ApproachLanes,
    find_approach_lanes,
    sample_lane_departures,
)
from scenewright.tools.gmm_sampler.priors import HOURS, Priors, WaypointPrior
from scenewright.tools.gmm_sampler.sample import (
    build_path,
    compute_waypoint_nll,
    score_waypoints,
)
from scenewright.tools.gmm_sampler.wander import sample_lateral_wander, sample_pace

_QUEUES = 28.0
"""In the corpus 1 - exp(-v / 28) of the standing vehicles stand behind another, where v vehicles
are seen in 30 s: 0.19 of them at v = 5.9, 0.34 at 11.3, 0.48 at 18.1, 0.55 at 20.0."""
_SECOND_OF_TWO = 0.17
"""Of the pedestrians in the background. 22 % of all have a companion in the corpus; here those that
a relation binds have none, and 78 of 100 find room beside the other."""
_HEADWAY = (1.0, 4.0)
"""Of a vehicle that arrives close to another [s]."""
_SECONDS = 30.0
QUIET = 0.5
"""Hours with less than this share of the busiest hour's trips are had only by being asked for."""
_ASSIGNMENTS, _RIDER_ASSIGNMENTS, _MOST_ASSIGNMENTS = 6, 24, 40
"""Assignments drawn, of which the best is taken: without and with riders; where a speed asked for
or two that do the same want more."""

_RUN_ACCELERATION = 2.0
"""How pedestrians who run set off and stop [m/s^2]."""

_OVERTAKES = 0.4
"""How much faster than the other who cuts in drives at least [m/s]."""

_Role = Literal["foreground", "background"]


def choose_hour(context: SceneContext, priors: Priors, rng: np.random.Generator) -> float:
    """Time of day [h]: as asked, within the range asked, or drawn by how busy the hours are.

    An hour that is not asked for is none of the quiet ones.
    """
    if context.time_of_day is None:
        hour = float(rng.choice(HOURS, p=priors.busyness))
        busy = np.where(priors.busyness >= QUIET * priors.busyness.max(), priors.busyness, 0.0)
        # who names no hour does not mean an empty street at five
        return hour if busy[int(hour)] else float(rng.choice(HOURS, p=busy / busy.sum()))
    start, _, end = context.time_of_day.partition("-")
    if not end:
        return _parse_clock(start)
    span = (_parse_clock(end) - _parse_clock(start)) % 24.0
    quarter = round(rng.uniform(0.0, span) * 4) / 4
    return float((_parse_clock(start) + min(quarter, span)) % 24.0)


def _parse_clock(clock: str) -> float:
    hours, minutes = clock.split(":")
    return int(hours) + int(minutes) / 60.0


def assign_foreground(
    graph: SocialGraph,
    grounding: Grounding,
    priors: Priors,
    *,
    intersection_map: IntersectionMap,
    hour: float,
    rng: np.random.Generator,
    lawful: bool = True,
) -> RoleAssignment:
    """Routes and patterns of the foreground.

    Args:
        lawful: no agent runs a red light unasked; else some agent does, if one can.

    Raises:
        Rejected: `unlawful`: in every assignment some agent runs a red light unasked.
    """
    from scenewright.tools.map_grounding.role_search import (
        count_signal_conflicts,
        find_assignments,
        list_unasked_runners,
    )
    from scenewright.tools.map_grounding.route_meetings import have_conflict

    weights = {
        route.id: math.sqrt(_get_rate(priors, route, hour)) + 1e-3
        for open_ in grounding.routes.values()
        for route in open_
    }

    # Two that do the same to a third, as two cars that give way to it, meet one another only by
    # chance; those of a chain have to be in one lane.
    roles = {
        name: {(e.type, e.to) for e in graph.relations if e.from_ == name}
        for name in grounding.routes
    }
    alike = [pair for pair in itertools.combinations(roles, 2) if roles[pair[0]] & roles[pair[1]]]

    def count_meetings(routes: Mapping[str, Route]) -> int:
        """How many pairs that do the same to a third have ways that cross, or drive in one lane."""
        return sum(
            have_conflict(routes[a], routes[b], intersection_map=intersection_map)
            or (routes[a].id == routes[b].id and routes[a].type == "vehicle")
            for a, b in alike
        )

    def count_faults(assignment: RoleAssignment) -> tuple[int, int, int, int, int]:
        violators = {
            pattern.violator for pattern in assignment.patterns if pattern.violator is not None
        }
        conflicts = count_signal_conflicts(assignment, intersection_map=intersection_map)
        obeys = not lawful and not list_unasked_runners(graph, assignment)
        slow, meetings = count_slow_routes(graph, assignment), count_meetings(assignment.routes)
        return int(obeys), slow, conflicts, meetings, len(violators)

    def draw(*, lawful: bool = lawful) -> RoleAssignment:
        found = find_assignments(
            graph, grounding, intersection_map=intersection_map, rng=rng, lawful=lawful,
            weight=lambda route: weights[route.id],
        )  # fmt: skip
        try:
            return next(found)
        except StopIteration:
            runners = list_unasked_runners(graph, draw(lawful=False))
            detail = (
                f"{' and '.join(runners)} would have to run a red light, "
                "which the request does not say"
            )
            raise Rejected(
                Rejection(
                    stage="agent_generator", code="unlawful", agents=tuple(runners), detail=detail
                )
            ) from None

    tries = _RIDER_ASSIGNMENTS if any(a.type in RIDERS for a in graph.agents) else _ASSIGNMENTS
    best = draw()
    fewest = count_faults(best)
    for n in range(1, _MOST_ASSIGNMENTS):
        obeys, slow, _, meetings, _ = fewest
        if n >= tries and not (obeys or slow or meetings):
            break
        other = draw()
        faults = count_faults(other)
        if faults < fewest:
            best, fewest = other, faults
    return best


def amplify(
    graph: SocialGraph,
    assignment: RoleAssignment,
    priors: Priors,
    *,
    intersection_map: IntersectionMap,
    hour: float,
    size: int,
    rng: np.random.Generator,
    background_size: int | None = None,
    numbers: np.random.Generator | None = None,
    max_agents: int | None = None,
) -> CandidateSet:
    """Candidates of every agent: those of the social graph, then the background and spares.

    Args:
        size: M, candidates of each agent; background_size: of each in the background, if fewer.
        numbers: draws how many there are, if not `rng`.
        max_agents: most agents that the scene may hold; None for as many as p_tod gives.
    """
    agents = {}
    lanes = cache(partial(find_approach_lanes, intersection_map))
    for node in graph.agents:
        route = assignment.routes[node.id]
        own = priors
        if node.type in RIDERS:
            own = build_rider_priors(priors, node.type, route, intersection_map=intersection_map)
        elif route.id not in priors.waypoints:
            own = build_uturn_priors(priors, route, intersection_map=intersection_map)
        agents[node.id] = _draw_agent(
            node.id, "foreground", route, own, size, rng,
            lanes(route.movement_id if node.type == "vehicle" else None),  # riders keep to a side
            subtype=node.subtype, kind=node.type,
        )  # fmt: skip
        speeds = get_kind("motion", node.motion).ranges.get("speed") if node.motion else None
        if speeds is not None:
            agents[node.id] = _let_run(agents[node.id], speeds, priors, rng)
    groups: dict[str, tuple[str, ...]] = {}
    for node in graph.agents:
        if node.members is not None:
            members = list_free_names(agents, "pedestrian", node.members - 1)
            agents |= form_group(agents[node.id], members)
            groups[node.id] = tuple(members)
    # Who drives the wrong way need not drift over the centre line to meet others there.
    wrong = {agent.id for agent in graph.agents if has_trait("motion", agent.motion, "wrong_way")}
    drifting = tuple(p for p in assignment.patterns if not {p.from_, p.to} & wrong)
    _draw_lane_departures(agents, drifting, priors, rng=rng)
    _fit_to_riders(agents, assignment, priors, rng=rng)
    apply_measures(agents, graph, rng)
    counts = draw_background_counts(
        graph, priors, hour=hour, rng=numbers or rng, max_agents=max_agents
    )
    for kind, count in counts.items():
        spares = 2 + count // 2 if count else 0
        routes, arrivals = _draw_background(
            kind, count, spares, priors, intersection_map=intersection_map, hour=hour, rng=rng
        )
        names = list_free_names(agents, kind, count + spares)
        for n, (name, route, arrival) in enumerate(zip(names, routes, arrivals, strict=True)):
            agents[name] = _draw_agent(
                name, "background", route, priors, background_size or size, rng,
                lanes(route.movement_id), arrival=arrival, reserve=n >= count,
            )  # fmt: skip
        if kind == "pedestrian":
            _pair_up(agents, names[:count], rng)
    return CandidateSet(
        agents=agents, cast=assignment, hour=hour, background=counts,
        yielding_model=priors.yielding_model, groups=groups,
        least=find_least_counts(graph, counts),
    )  # fmt: skip


def _pair_up(
    agents: dict[str, AgentCandidates], names: Sequence[str], rng: np.random.Generator
) -> None:
    """Let some pedestrians walk with the one before them, as often as in the corpus, in place."""
    alone = list(names)
    while len(alone) > 1:
        leader, other = alone[0], alone[1]
        pair = rng.random() < _SECOND_OF_TWO / (1.0 - _SECOND_OF_TWO)
        if pair:
            agents[other] = walk_beside(agents[leader], other, rng)
        alone = alone[2:] if pair else alone[1:]


def _draw_agent(
    name: str,
    role: _Role,
    route: Route,
    priors: Priors,
    size: int,
    rng: np.random.Generator,
    lanes: ApproachLanes,
    *,
    subtype: str | None = None,
    kind: AgentClass | None = None,
    arrival: float | None = None,
    reserve: bool = False,
) -> AgentCandidates:
    """Candidates of an agent, drawn on demand with a random generator of its own."""
    seed: Any = rng.bit_generator.seed_seq
    [own] = seed.spawn(1)
    subtype, shape = _draw_shape(kind or route.type, route, subtype, priors, rng)
    prior = priors.waypoints[route.id]

    @cache
    def draw() -> DrawnWaypoints:
        own_rng = np.random.default_rng(own)
        waypoints, nll, component = lanes.draw(prior, own_rng, size=size)
        profiles = sample_driving_profiles(priors, route.id, own_rng, size=size)
        speeds = np.array([profile.speed for profile in profiles])
        pace = sample_pace(shape.type, prior.length, own_rng, speeds=speeds)
        profile_nll = compute_profile_nll(priors, route.id, profiles)
        walks = shape.type == "pedestrian"
        aside = sample_lateral_wander(prior.length, own_rng, size=size) if walks else None
        return DrawnWaypoints(waypoints, nll, component, tuple(profiles), profile_nll, pace, aside)

    build = _make_builder(route, shape, subtype, draw, prior, lanes)
    chance = None if arrival is None else arrival / _SECONDS
    return AgentCandidates(name, role, route, shape, subtype, draw, build, arrival, chance, reserve)


def _make_builder(
    route: Route,
    shape: Shape,
    subtype: str | None,
    draw: Callable[[], DrawnWaypoints],
    prior: WaypointPrior,
    lanes: ApproachLanes | None = None,
) -> Callable[[int], Candidate]:
    """A function that builds the candidate of an index from what was drawn.

    Args:
        lanes: to which its path is held; None where it may leave its lane.
    """

    def build(m: int) -> Candidate:
        drawn = draw()
        waypoints, nll, law = drawn.waypoints[m], float(drawn.nll[m]), drawn.time_laws[m]
        aside = drawn.aside(m) if drawn.aside else None
        path = build_path(prior, waypoints, int(drawn.component[m]), aside)
        held = None if lanes is None else lanes.hold(path)
        if held is not None:
            path, waypoints = held
            nll = float(compute_waypoint_nll(prior, waypoints[None])[0])
        return Candidate(
            route=route,
            waypoints=waypoints,
            path=path,
            nll=nll,
            time_law=replace(law, pace=drawn.pace(m)) if drawn.pace else law,
            time_nll=float(drawn.time_nll[m]),
            shape=shape,
            subtype=subtype,
        )

    return build


def _draw_lane_departures(
    agents: dict[str, AgentCandidates],
    patterns: Sequence[AssignedPattern],
    priors: Priors,
    *,
    rng: np.random.Generator,
) -> None:
    """Lane changes and drifts over the centre line: waypoints that lead onto another's path."""
    for played in patterns:
        geometry = get_pattern(played.pattern).geometry
        if geometry not in ("lane_change", "opposing"):
            continue
        own, other = agents[played.from_], agents[played.to]
        waypoints = sample_lane_departures(
            own.drawn.waypoints, other.drawn.waypoints, rng, reverse=geometry == "opposing"
        )
        laws = own.drawn.time_laws
        if has_trait("manoeuvre", get_pattern(played.pattern).manoeuvre, "merges_ahead"):
            # Who overtakes drives faster than the other, to draw away after cutting in.
            fastest = max(law.speed for law in other.drawn.time_laws) + _OVERTAKES
            laws = tuple(replace(law, speed=max(law.speed, fastest)) for law in laws)
        agents[own.name] = _replace_drawn(own, priors, waypoints=waypoints, laws=laws)


def _let_run(
    agent: AgentCandidates, between: tuple[float, float], priors: Priors, rng: np.random.Generator
) -> AgentCandidates:
    """Give the pedestrian the speed profiles of a running one, at a speed between two [m/s]."""
    laws, rate = agent.drawn.time_laws, _RUN_ACCELERATION
    speeds = rng.uniform(*between, len(laws)).tolist()
    running = tuple(
        replace(each, speed=speed, acceleration=rate, braking=rate)
        for each, speed in zip(laws, speeds, strict=True)
    )
    return _replace_drawn(agent, priors, laws=running)


_BESIDE_RIDERS: dict[str, tuple[float, float]] = {
    "turn_across": (0.4, 0.8),
    "overtaking": (0.6, 1.1),
    "cutting_in": (0.5, 0.9),
}
"""Gaps that vehicles leave beside riders [m], by how the two meet."""
_LEAVES_ROOM = {"turn_across": (0.40, 0.66), "overtaking": (2.0, 3.0), "cutting_in": (0.15, 0.34)}
"""Share of their way from which on, and at which at last, they take it back."""


def _fit_to_riders(
    agents: dict[str, AgentCandidates],
    assignment: RoleAssignment,
    priors: Priors,
    *,
    rng: np.random.Generator,
) -> None:
    """Vehicles that drive beside a rider, or behind one or before one at its pace."""
    for played in assignment.patterns:
        pattern = get_pattern(played.pattern)
        own, other = agents[played.from_], agents[played.to]
        if not {own.shape.type, other.shape.type} & set(RIDERS):
            continue
        if pattern.geometry in _BESIDE_RIDERS:
            waypoints = make_room(
                own, priors.waypoints[own.route.id], other, _BESIDE_RIDERS[pattern.geometry], rng,
                until=_LEAVES_ROOM[pattern.geometry],
            )  # fmt: skip
            agents[own.name] = _replace_drawn(own, priors, waypoints=waypoints)
        elif pattern.relation == "follow":
            agents[own.name], agents[other.name] = keep_pace(own, other, rng)


def _replace_drawn(
    agent: AgentCandidates,
    priors: Priors,
    *,
    waypoints: FloatArray | None = None,
    laws: tuple[DrivingProfile, ...] | None = None,
) -> AgentCandidates:
    """The agent with other waypoints or driving profiles than were drawn; it may leave its lane."""
    drawn, prior = agent.drawn, priors.waypoints[agent.route.id]
    if waypoints is not None:
        nll, component = score_waypoints(prior, waypoints)
        drawn = replace(drawn, waypoints=waypoints, nll=nll, component=component)
    if laws is not None:
        drawn = replace(drawn, time_laws=laws)
    build = _make_builder(agent.route, agent.shape, agent.subtype, lambda: drawn, prior)
    return replace(agent, draw=lambda: drawn, build=build)


def _draw_shape(
    kind: AgentClass,
    route: Route,
    subtype: str | None,
    priors: Priors,
    rng: np.random.Generator,
) -> tuple[str | None, Shape]:
    if kind in RIDERS:
        return None, get_rider_shape(kind)
    if kind == "pedestrian":
        return None, PEDESTRIAN
    if subtype is None:
        shares = priors.subtypes.get(route.id) or {"car": 1.0}
        total = list(itertools.accumulate(map(float, shares.values())))
        subtype = list(shares)[bisect_right([each / total[-1] for each in total], rng.random())]
    return subtype, get_vehicle_shape(subtype)


def _draw_background(
    kind: AgentClass,
    count: int,
    spares: int,
    priors: Priors,
    *,
    intersection_map: IntersectionMap,
    hour: float,
    rng: np.random.Generator,
) -> tuple[list[Route], list[float]]:
    """Routes and arrivals [s] of background agents as they arrive, then those of the spares.

    Routes are drawn by how busy they are at that hour.
    """
    routes = [r for r in intersection_map.routes if r.type == kind and r.movement != "jaywalking"]
    chosen = _draw_routes(routes, count + spares, priors, hour, rng)
    # Exponential intervals (paper 3.2), conditioned on so many arrivals within the scene.
    gaps = rng.exponential(size=count + spares + 1)
    times = _SECONDS * np.cumsum(gaps)[:-1] / gaps.sum()
    arrivals = [float(time) for time in rng.permutation(times)]
    if kind == "vehicle":
        _form_queues(chosen, arrivals, routes, priors, hour=hour, rng=rng)
    order = sorted(range(len(arrivals)), key=lambda n: (n >= count, arrivals[n]))
    return [chosen[n] for n in order], [arrivals[n] for n in order]


def _draw_routes(
    routes: Sequence[Route], count: int, priors: Priors, hour: float, rng: np.random.Generator
) -> list[Route]:
    rates = np.array([_get_rate(priors, route, hour) for route in routes]) + 1e-3
    chosen = rng.choice(len(routes), size=count, p=rates / rates.sum())
    return [routes[index] for index in chosen.tolist()]


def _form_queues(
    chosen: list[Route],
    arrivals: list[float],
    routes: Sequence[Route],
    priors: Priors,
    *,
    hour: float,
    rng: np.random.Generator,
) -> None:
    """Let as many vehicles arrive close to another as do at that hour, however few they are.

    A scene shows some of the hour's traffic, not thinner traffic: its queues are the hour's.
    """
    counts = priors.counts[int(hour) % HOURS]
    busy = float(counts.weights @ counts.means[:, 0] / counts.weights.sum())
    share = 1.0 - float(np.exp(-busy / _QUEUES))
    for n in range(1, len(chosen)):
        if rng.random() >= share:
            continue
        other = int(rng.integers(n))
        same_entry = [r for r in routes if r.entry == chosen[other].entry]
        [chosen[n]] = _draw_routes(same_entry, 1, priors, hour, rng)
        apart = float(rng.uniform(*_HEADWAY)) * (1.0 if rng.random() < 0.5 else -1.0)
        within = 0.0 <= arrivals[other] + apart < _SECONDS
        arrivals[n] = arrivals[other] + (apart if within else -apart)


def _get_rate(priors: Priors, route: Route, hour: float) -> float:
    rates = priors.frequency.get(route.id)
    return 0.0 if rates is None else float(rates[int(hour) % HOURS])


def list_free_names(taken: Container[str], kind: AgentClass, count: int) -> list[str]:
    """The first names of a class that no agent has."""
    free = (name for n in itertools.count(1) if (name := f"{kind}-{n}") not in taken)
    return list(itertools.islice(free, count))
