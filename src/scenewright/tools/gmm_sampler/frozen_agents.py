"""The amplified scene where agents of an earlier version stay: their candidates come first."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from scenewright.errors import Rejected
from scenewright.scene.base import AgentClass
from scenewright.scene.candidates import (
    AgentCandidates,
    Candidate,
    CandidateSet,
    DrawnWaypoints,
    DrivingProfile,
)
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.grounding import Grounding, RoleAssignment
from scenewright.scene.map import IntersectionMap
from scenewright.scene.rejection import Rejection
from scenewright.scene.selection import SelectedAgent
from scenewright.scene.social import Background, SocialGraph
from scenewright.scene.track import STEP
from scenewright.tools.gmm_sampler.generate import amplify, cast_foreground
from scenewright.tools.gmm_sampler.priors import Priors


def restrict_grounding(
    graph: SocialGraph,
    grounding: Grounding,
    pins: FrozenAgents,
    *,
    intersection_map: IntersectionMap,
) -> Grounding:
    """The grounding with the routes that are settled.

    Raises:
        Rejected: `ungroundable`, as the settled routes do not allow what the graph asks for.
    """
    from scenewright.tools.map_grounding.grounding import find_assignments

    routes = {
        name: tuple(each for each in open_ if each == pins.routes.get(name, each))
        for name, open_ in grounding.routes.items()
    }
    narrow = Grounding(routes=routes)
    found = find_assignments(
        as_played(graph, pins),
        narrow,
        intersection_map=intersection_map,
        rng=np.random.default_rng(0),
    )
    if not all(routes.values()) or next(found, None) is None:
        names = tuple(name for name in grounding.routes if name in pins.routes)
        detail = f"this cannot be done as long as {', '.join(names)} keep their ways"
        raise Rejected(
            Rejection(stage="scene_planner", code="ungroundable", agents=names, detail=detail)
        )
    return narrow


def as_played(graph: SocialGraph, pins: FrozenAgents) -> SocialGraph:
    """The graph in which relations that stay name their pattern, in the roles as played."""
    edges = list(graph.relations)
    for index, played in pins.patterns.items():
        roles = {"from_": played.from_, "to": played.to, "pattern": played.pattern}
        edges[index] = edges[index].model_copy(update=roles)
    return graph.model_copy(update={"relations": tuple(edges)})


def pinned_pool(
    graph: SocialGraph,
    grounding: Grounding,
    pins: FrozenAgents,
    priors: Priors,
    *,
    intersection_map: IntersectionMap,
    size: int,
    crowd_size: int | None,
    rng: np.random.Generator,
) -> CandidateSet:
    """Candidates of everybody, those of an earlier version first (see `amplify`)."""
    cast = _cast(graph, grounding, pins, priors, intersection_map=intersection_map, rng=rng)
    counts = Background(
        vehicles=pins.background["vehicle"], pedestrians=pins.background["pedestrian"]
    )
    context = graph.context.model_copy(update={"background": counts})
    fresh = amplify(
        graph.model_copy(update={"context": context}),
        cast,
        priors,
        intersection_map=intersection_map,
        hour=pins.hour,
        size=size,
        crowd_size=crowd_size,
        rng=rng,
    )
    return replace(fresh, agents=_agents(graph, fresh.agents, pins))


def _cast(
    graph: SocialGraph,
    grounding: Grounding,
    pins: FrozenAgents,
    priors: Priors,
    *,
    intersection_map: IntersectionMap,
    rng: np.random.Generator,
) -> RoleAssignment:
    played = as_played(graph, pins)
    cast = cast_foreground(
        played, grounding, priors, intersection_map=intersection_map, hour=pins.hour, rng=rng
    )
    patterns = tuple(pins.patterns.get(each.edge, each) for each in cast.patterns)
    return cast.model_copy(update={"patterns": patterns})


def _agents(
    graph: SocialGraph, fresh: Mapping[str, AgentCandidates], pins: FrozenAgents
) -> dict[str, AgentCandidates]:
    """The foreground, then who was in the background already, then others."""
    foreground = {node.id for node in graph.agents}
    found = {name: _with_earlier(fresh[name], pins) for name in foreground_order(graph)}
    for name, agent in pins.known.items():
        if name not in foreground:
            found[name] = _only(agent, fresh_like=None)
    taken = {*found, *pins.earlier.agents}
    for name, draws in fresh.items():
        if name not in foreground:
            new = _unused(draws.route.type, taken)
            taken.add(new)
            found[new] = replace(draws, name=new)
    return found


def _unused(kind: AgentClass, taken: set[str]) -> str:
    """A name that nobody in this version or the one before has."""
    return next(name for n in itertools.count(1) if (name := f"{kind}-{n}") not in taken)


def foreground_order(graph: SocialGraph) -> list[str]:
    """Names of the foreground in the order of the graph."""
    return [node.id for node in graph.agents]


def _with_earlier(draws: AgentCandidates, pins: FrozenAgents) -> AgentCandidates:
    """What was drawn, at the pace told, behind the candidate of the earlier version."""
    draws = _paced(draws, pins.pace.get(draws.name, 1.0))
    settled = {**pins.placed, **pins.fixed}.get(draws.name)
    if settled is not None:
        return _only(settled, fresh_like=draws)
    offered = pins.offered.get(draws.name)
    return draws if offered is None else _first(offered, draws)


def _only(agent: SelectedAgent, *, fresh_like: AgentCandidates | None) -> AgentCandidates:
    """Nothing but the candidate that the agent has."""
    candidate = agent.candidate
    drawn = _drawn(candidate)
    return AgentCandidates(
        name=agent.name,
        role="background" if fresh_like is None else fresh_like.role,
        route=candidate.route,
        shape=candidate.shape,
        subtype=candidate.subtype,
        draw=lambda: drawn,
        build=lambda _m: candidate,
        arrival=_middle(agent),
    )


def _first(agent: SelectedAgent, fresh: AgentCandidates) -> AgentCandidates:
    """The candidate that the agent has, then fresh ones."""
    candidate, own = agent.candidate, _drawn(agent.candidate)

    @cache
    def draw() -> DrawnWaypoints:
        other = fresh.drawn
        return DrawnWaypoints(
            np.concatenate([own.waypoints, other.waypoints]),
            np.concatenate([own.nll, other.nll]),
            np.concatenate([own.component, other.component]),
            (*own.time_laws, *other.time_laws),
            np.concatenate([own.time_nll, other.time_nll]),
        )

    def build(m: int) -> Candidate:
        return candidate if m == 0 else fresh.build(m - 1)

    return replace(
        fresh,
        shape=candidate.shape,
        subtype=candidate.subtype,
        draw=draw,
        build=build,
        arrival=_middle(agent),
        chance=None,
    )


def _paced(draws: AgentCandidates, pace: float) -> AgentCandidates:
    """The same with every free speed multiplied."""
    if pace == 1.0:
        return draws

    def build(m: int) -> Candidate:
        drawn = draws.build(m)
        return replace(drawn, time_law=paced(drawn.time_law, pace))

    return replace(draws, build=build)


def paced(law: DrivingProfile, pace: float) -> DrivingProfile:
    """The time law with its free speed multiplied."""
    return replace(law, speed=law.speed * pace)


def _drawn(candidate: Candidate) -> DrawnWaypoints:
    return DrawnWaypoints(
        candidate.waypoints[None],
        np.array([candidate.nll]),
        np.zeros(1, dtype=np.intp),
        (candidate.time_law,),
        np.array([candidate.time_nll]),
    )


def _middle(agent: SelectedAgent) -> float:
    """When [s] it was about half-way, at its free speed."""
    seconds = agent.candidate.path.length / max(agent.candidate.time_law.speed, 0.5)
    return agent.enters + round(seconds / 2 / STEP) * STEP
