"""The amplified scene (paper Eq. 1) and M waypoint candidates for every agent of it (Eq. 2)."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np

from scenewright.scene.base import AgentClass
from scenewright.scene.candidates import AgentCandidates, Candidate, CandidateSet, DrawnWaypoints
from scenewright.scene.grounding import Grounding, RoleAssignment
from scenewright.scene.map import IntersectionMap, Route
from scenewright.scene.relations import get_pattern
from scenewright.scene.social import SceneContext, SocialGraph
from scenewright.scene.track import PEDESTRIAN, Shape, vehicle_shape
from scenewright.tools.gmm_sampler.maneuver import drift
from scenewright.tools.gmm_sampler.priors import HOURS, Priors, WaypointPrior
from scenewright.tools.gmm_sampler.sample import (
    nll_and_component,
    sample_count,
    sample_waypoints,
)
from scenewright.tools.gmm_sampler.spline import path_of
from scenewright.tools.gmm_sampler.time_law_prior import (
    compute_profile_nll,
    sample_driving_profiles,
)

DENSITIES: dict[str, tuple[int, int]] = {"low": (1, 4), "medium": (5, 10), "high": (11, 20)}
"""Background agents by density word (SEMANTICS section 5)."""

_MOST_BACKGROUND = 20
_TRAFFIC_SHARE = (0.55, 0.8)
"""Vehicles among the background where the text speaks of how dense the traffic is."""

_QUEUES = 28.0
"""In the corpus 1 - exp(-v / 28) of the standing vehicles stand behind another, where v vehicles
are seen in 30 s: 0.19 of them at v = 5.9, 0.34 at 11.3, 0.48 at 18.1, 0.55 at 20.0."""

_BEHIND = (1.0, 4.0)
"""How much earlier or later one comes who comes close to another [s]."""

_SECONDS = 30.0
_CASTS = 6


def hour_of(context: SceneContext, priors: Priors, rng: np.random.Generator) -> float:
    """Time of day [h]: as asked, within the range asked, or drawn by how busy the hours are."""
    if context.time_of_day is None:
        return float(rng.choice(HOURS, p=priors.busyness))
    start, _, end = context.time_of_day.partition("-")
    if not end:
        return _hours(start)
    span = (_hours(end) - _hours(start)) % 24.0
    quarter = round(rng.uniform(0.0, span) * 4) / 4
    return float((_hours(start) + min(quarter, span)) % 24.0)


def cast_foreground(
    graph: SocialGraph,
    grounding: Grounding,
    priors: Priors,
    *,
    intersection_map: IntersectionMap,
    hour: float,
    rng: np.random.Generator,
) -> RoleAssignment:
    """Routes and patterns of the foreground; no red light is run where that can be avoided."""
    from scenewright.tools.map_grounding.grounding import count_signal_conflicts, find_assignments

    weights = {
        route.id: math.sqrt(_rate(priors, route, hour)) + 1e-3
        for open_ in grounding.routes.values()
        for route in open_
    }

    def weight(route: Route) -> float:
        return weights[route.id]

    drawn = [
        next(
            find_assignments(
                graph, grounding, intersection_map=intersection_map, rng=rng, weight=weight
            )
        )
        for _ in range(_CASTS)
    ]
    return min(
        drawn,
        key=lambda cast: (
            count_signal_conflicts(cast, intersection_map=intersection_map),
            len(_violators(cast)),
        ),
    )


def _violators(cast: RoleAssignment) -> set[str]:
    return {each.violator for each in cast.patterns if each.violator is not None}


def amplify(
    graph: SocialGraph,
    cast: RoleAssignment,
    priors: Priors,
    *,
    intersection_map: IntersectionMap,
    hour: float,
    size: int,
    rng: np.random.Generator,
    crowd_size: int | None = None,
) -> CandidateSet:
    """Candidates of every agent: those of the social graph, then the background and spares.

    Args:
        size: M, candidates of each agent; crowd_size: of each in the background, if fewer.
    """
    agents = {
        node.id: _draws(
            node.id, "foreground", cast.routes[node.id], node.subtype, priors, size, rng
        )
        for node in graph.agents
    }
    _maneuvers(agents, cast, priors, rng=rng)
    counts = background_counts(graph, priors, hour=hour, rng=rng)
    for kind, count in counts.items():
        names = _names(graph, kind, count + _spares(count))
        routes = _background_routes(
            kind, len(names), priors, intersection_map=intersection_map, hour=hour, rng=rng
        )
        arrivals = _arrivals(len(names), rng)
        if kind == "vehicle":
            _queued(routes, arrivals, priors, intersection_map=intersection_map, hour=hour, rng=rng)
        routes, arrivals = _in_order(routes, arrivals, count)
        for n, (name, route, arrival) in enumerate(zip(names, routes, arrivals, strict=True)):
            agents[name] = _draws(
                name, "background", route, None, priors, crowd_size or size, rng,
                arrival, reserve=n >= count,
            )  # fmt: skip
    return CandidateSet(
        agents=agents, cast=cast, hour=hour, background=counts, manners=priors.manners
    )


def background_counts(
    graph: SocialGraph, priors: Priors, *, hour: float, rng: np.random.Generator
) -> dict[AgentClass, int]:
    """How many background agents of each class: as asked, by density, or N - |V| of p_tod."""
    vehicles, pedestrians = sample_count(priors, rng, hour=int(hour) % HOURS, instant=True)
    present = len(graph.agents)
    asked = graph.context.background
    share = (vehicles + 1.0) / (vehicles + pedestrians + 2.0)
    if graph.context.density is not None:
        low, high = DENSITIES[graph.context.density]
        total = int(rng.integers(low, high + 1))
        share = float(np.clip(share, *_TRAFFIC_SHARE))
    else:
        total = int(np.clip(vehicles + pedestrians - present, 0, _MOST_BACKGROUND))
    drawn_vehicles = int(np.clip(round(total * share), 0, total))
    counts: dict[AgentClass, int] = {
        "vehicle": drawn_vehicles,
        "pedestrian": total - drawn_vehicles,
    }
    if asked is not None:
        counts["vehicle"] = counts["vehicle"] if asked.vehicles is None else asked.vehicles
        free = asked.pedestrians is None
        counts["pedestrian"] = counts["pedestrian"] if free else int(asked.pedestrians or 0)
    return counts


def _draws(
    name: str,
    role: Literal["foreground", "background"],
    route: Route,
    subtype: str | None,
    priors: Priors,
    size: int,
    rng: np.random.Generator,
    arrival: float | None = None,
    *,
    reserve: bool = False,
) -> AgentCandidates:
    """What the priors offer, with a random generator of the agent's own: drawn on demand."""
    seed: Any = rng.bit_generator.seed_seq
    [own] = seed.spawn(1)
    subtype, shape = _shape(route, subtype, priors, rng)
    prior = priors.waypoints[route.id]
    made: list[DrawnWaypoints] = []

    def draw() -> DrawnWaypoints:
        if not made:
            made.append(_drawn(prior, priors, np.random.default_rng(own), size))
        return made[0]

    return _offered(name, role, route, subtype, shape, draw, prior, arrival, reserve=reserve)


def _drawn(
    prior: WaypointPrior, priors: Priors, rng: np.random.Generator, size: int
) -> DrawnWaypoints:
    waypoints = sample_waypoints(prior, rng, size=size)
    laws = sample_driving_profiles(priors, prior.route, rng, size=size)
    time_nll = compute_profile_nll(priors, prior.route, laws)
    nll, component = nll_and_component(prior, waypoints)
    return DrawnWaypoints(waypoints, nll, component, tuple(laws), time_nll)


def _offered(
    name: str,
    role: Literal["foreground", "background"],
    route: Route,
    subtype: str | None,
    shape: Shape,
    draw: Callable[[], DrawnWaypoints],
    prior: WaypointPrior,
    arrival: float | None = None,
    *,
    reserve: bool = False,
) -> AgentCandidates:
    """The draws and how to make candidates of them."""

    def build(m: int) -> Candidate:
        drawn = draw()
        return Candidate(
            route=route,
            waypoints=drawn.waypoints[m],
            path=path_of(prior, drawn.waypoints[m], int(drawn.component[m])),
            nll=float(drawn.nll[m]),
            time_law=drawn.time_laws[m],
            time_nll=float(drawn.time_nll[m]),
            shape=shape,
            subtype=subtype,
        )

    chance = None if arrival is None else arrival / _SECONDS
    return AgentCandidates(
        name, role, route, shape, subtype, draw, build, arrival, chance, reserve
    )  # fmt: skip


def _maneuvers(
    agents: dict[str, AgentCandidates],
    cast: RoleAssignment,
    priors: Priors,
    *,
    rng: np.random.Generator,
) -> None:
    """Lane changes and drifts over the centre line: waypoints that lead onto another's way."""
    for played in cast.patterns:
        geometry = get_pattern(played.pattern).geometry
        if geometry not in ("lane_change", "opposing"):
            continue
        own, other = agents[played.from_], agents[played.to]
        prior = priors.waypoints[own.route.id]
        waypoints = drift(
            own.drawn.waypoints, other.drawn.waypoints, rng, reverse=geometry == "opposing"
        )
        nll, component = nll_and_component(prior, waypoints)
        drawn = replace(own.drawn, waypoints=waypoints, nll=nll, component=component)
        agents[own.name] = _offered(
            own.name,
            own.role,
            own.route,
            own.subtype,
            own.shape,
            partial(_same, drawn),
            prior,
        )


def _same(drawn: DrawnWaypoints) -> DrawnWaypoints:
    return drawn


def _shape(
    route: Route, subtype: str | None, priors: Priors, rng: np.random.Generator
) -> tuple[str | None, Shape]:
    if route.type == "pedestrian":
        return None, PEDESTRIAN
    if subtype is None:
        shares = priors.subtypes.get(route.id) or {"car": 1.0}
        total = list(itertools.accumulate(map(float, shares.values())))
        subtype = list(shares)[bisect_right([each / total[-1] for each in total], rng.random())]
    return subtype, vehicle_shape(subtype)


def _background_routes(
    kind: AgentClass,
    count: int,
    priors: Priors,
    *,
    intersection_map: IntersectionMap,
    hour: float,
    rng: np.random.Generator,
) -> list[Route]:
    """Routes of background agents, drawn by how busy they are at that hour."""
    routes = [r for r in intersection_map.routes if r.type == kind and r.movement != "jaywalking"]
    rates = np.array([_rate(priors, route, hour) for route in routes]) + 1e-3
    chosen = rng.choice(len(routes), size=count, p=rates / rates.sum())
    return [routes[index] for index in chosen.tolist()]


def _queued(
    routes: list[Route],
    arrivals: list[float],
    priors: Priors,
    *,
    intersection_map: IntersectionMap,
    hour: float,
    rng: np.random.Generator,
) -> None:
    """Lets as many come close to another vehicle as do at that hour, whatever their number here.

    A scene shows some of the hour's traffic, not thinner traffic: its queues are the hour's.
    """
    counts = priors.counts[int(hour) % HOURS]
    busy = float(counts.weights @ counts.means[:, 0] / counts.weights.sum())
    share = 1.0 - float(np.exp(-busy / _QUEUES))
    for n in range(1, len(routes)):
        if rng.random() >= share:
            continue
        other = int(rng.integers(n))
        same = [
            r
            for r in intersection_map.routes
            if r.type == "vehicle" and r.entry == routes[other].entry
        ]
        rates = np.array([_rate(priors, route, hour) for route in same]) + 1e-3
        routes[n] = same[int(rng.choice(len(same), p=rates / rates.sum()))]
        apart = float(rng.uniform(*_BEHIND)) * (1.0 if rng.random() < 0.5 else -1.0)
        within = 0.0 <= arrivals[other] + apart < _SECONDS
        arrivals[n] = arrivals[other] + (apart if within else -apart)


def _in_order(
    routes: Sequence[Route], arrivals: Sequence[float], count: int
) -> tuple[list[Route], list[float]]:
    """Those wanted as they arrive, then the spares: whoever comes first is first in its queue."""
    order = sorted(range(len(arrivals)), key=lambda n: (n >= count, arrivals[n]))
    return [routes[n] for n in order], [arrivals[n] for n in order]


def _rate(priors: Priors, route: Route, hour: float) -> float:
    rates = priors.frequency.get(route.id)
    return 0.0 if rates is None else float(rates[int(hour) % HOURS])


def _names(graph: SocialGraph, kind: AgentClass, count: int) -> list[str]:
    taken = {agent.id for agent in graph.agents}
    free = (f"{kind}-{n}" for n in itertools.count(1) if f"{kind}-{n}" not in taken)
    return list(itertools.islice(free, count))


def _spares(count: int) -> int:
    """How many more are drawn than wanted; nobody where nobody is wanted."""
    return 0 if count == 0 else 2 + count // 2


def _arrivals(count: int, rng: np.random.Generator) -> list[float]:
    """Exponential intervals (paper 3.2), conditioned on `count` arrivals within the scene."""
    gaps = rng.exponential(size=count + 1)
    times = _SECONDS * np.cumsum(gaps)[:-1] / gaps.sum()
    return [float(time) for time in rng.permutation(times)]


def _hours(clock: str) -> float:
    hours, minutes = clock.split(":")
    return int(hours) + int(minutes) / 60.0
