"""The amplified scene where agents of an earlier version stay: their candidates come first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from scenewright.errors import Rejected
from scenewright.scene.candidates import (
    AgentCandidates,
    Candidate,
    CandidateSet,
    DrawnWaypoints,
    DrivingProfile,
    Grounding,
)
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.map import IntersectionMap
from scenewright.scene.rejection import Rejection
from scenewright.scene.selection import SelectedAgent
from scenewright.scene.social import Background, SocialGraph
from scenewright.scene.track import STEP
from scenewright.tools.gmm_sampler.generate import amplify, assign_foreground, list_free_names
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
    from scenewright.tools.map_grounding.role_search import find_assignments

    routes = {
        name: tuple(each for each in open_ if each == pins.routes.get(name, each))
        for name, open_ in grounding.routes.items()
    }
    narrow = Grounding(routes=routes)
    assignments = find_assignments(
        _settle_patterns(graph, pins),
        narrow,
        intersection_map=intersection_map,
        rng=np.random.default_rng(0),
    )
    if not all(routes.values()) or next(assignments, None) is None:
        names = tuple(name for name in grounding.routes if name in pins.routes)
        detail = f"this cannot be done as long as {', '.join(names)} keep their ways"
        raise Rejected(
            Rejection(stage="scene_planner", code="ungroundable", agents=names, detail=detail)
        )
    return narrow


def _settle_patterns(graph: SocialGraph, pins: FrozenAgents) -> SocialGraph:
    """The graph in which relations that stay name their pattern, in the roles as played."""
    edges = list(graph.relations)
    for index, played in pins.patterns.items():
        roles = {"from_": played.from_, "to": played.to, "pattern": played.pattern}
        edges[index] = edges[index].model_copy(update=roles)
    return graph.model_copy(update={"relations": tuple(edges)})


def build_candidates_with_frozen(
    graph: SocialGraph,
    grounding: Grounding,
    pins: FrozenAgents,
    priors: Priors,
    *,
    intersection_map: IntersectionMap,
    size: int,
    background_size: int | None,
    rng: np.random.Generator,
    lawful: bool = True,
) -> CandidateSet:
    """Candidates of all agents, those of an earlier version first (see `amplify`).

    Raises:
        Rejected: as `assign_foreground` does.
    """
    assignment = assign_foreground(
        _settle_patterns(graph, pins), grounding, priors,
        intersection_map=intersection_map, hour=pins.hour, rng=rng, lawful=lawful,
    )  # fmt: skip
    patterns = tuple(pins.patterns.get(pattern.edge, pattern) for pattern in assignment.patterns)
    counted = graph
    if pins.background is not None:
        counts = Background.model_construct(  # more may have been drawn than can be asked for
            vehicles=pins.background["vehicle"], pedestrians=pins.background["pedestrian"]
        )
        context = graph.context.model_copy(update={"background": counts})
        counted = graph.model_copy(update={"context": context})
    fresh = amplify(
        counted,
        assignment.model_copy(update={"patterns": patterns}),
        priors,
        intersection_map=intersection_map,
        hour=pins.hour,
        size=size,
        background_size=background_size,
        rng=rng,
    )
    # The members of each group by leader, with the names they had in the earlier version.
    taken = {*(node.id for node in graph.agents), *pins.earlier.agents}
    groups: dict[str, tuple[str, ...]] = {}
    for leader, members in fresh.groups.items():
        names = tuple(n for n, a in pins.earlier.agents.items() if a.agent.group == leader)
        if len(names) != len(members):
            names = tuple(list_free_names(taken, "pedestrian", len(members)))
        taken |= {*names}
        groups[leader] = names
    return replace(fresh, agents=_merge_agents(graph, fresh, groups, pins), groups=groups)


def _merge_agents(
    graph: SocialGraph,
    fresh: CandidateSet,
    groups: Mapping[str, tuple[str, ...]],
    pins: FrozenAgents,
) -> dict[str, AgentCandidates]:
    """The foreground in the order of the graph, earlier background agents, then fresh ones."""
    named = {node.id: node.id for node in graph.agents}
    agents = {name: _prefer_earlier(fresh.agents[name], pins) for name in named}
    for leader, names in fresh.groups.items():
        named |= dict(zip(names, groups[leader], strict=True))
        agents |= _merge_members(leader, groups[leader], [fresh.agents[n] for n in names], pins)
        if not pins.earlier.agents.keys() >= {*groups[leader]}:
            agents[leader] = fresh.agents[leader]  # a group of another size than before
    for name, agent in pins.known.items():
        if name not in agents and agent.group is None:
            agents[name] = _offer_only(agent, fresh=None)
    taken = {*agents, *pins.earlier.agents}
    for name, candidates in fresh.agents.items():
        if name not in named:
            [new] = list_free_names(taken, candidates.route.type, 1)
            taken.add(new)
            agents[new] = replace(candidates, name=new)
    return agents


def _merge_members(
    leader: str,
    names: tuple[str, ...],
    fresh: Sequence[AgentCandidates],
    pins: FrozenAgents,
) -> dict[str, AgentCandidates]:
    """The members of a group: their candidates stay or come first where their leader's do."""
    members = {}
    for name, candidates in zip(names, fresh, strict=True):
        members[name] = replace(candidates, name=name)
        before = pins.earlier.agents.get(name)
        if before is None:
            continue
        if leader in {**pins.placed, **pins.fixed}:
            members[name] = _offer_only(before.agent, fresh=candidates)
        elif leader in pins.offered:
            members[name] = _offer_first(before.agent, members[name])
    return members


def _prefer_earlier(candidates: AgentCandidates, pins: FrozenAgents) -> AgentCandidates:
    """The candidate of the earlier version, alone or first, and fresh ones at the asked speed."""
    factor, given = pins.pace.get(candidates.name, 1.0), candidates.build
    if factor != 1.0:
        candidates = replace(
            candidates,
            build=lambda m: replace(
                built := given(m), time_law=scale_speed(built.time_law, factor)
            ),
        )
    settled = {**pins.placed, **pins.fixed}.get(candidates.name)
    if settled is not None:
        return _offer_only(settled, fresh=candidates)
    offered = pins.offered.get(candidates.name)
    return candidates if offered is None else _offer_first(offered, candidates)


def _offer_only(agent: SelectedAgent, *, fresh: AgentCandidates | None) -> AgentCandidates:
    """Nothing but the candidate that the agent has."""
    candidate = agent.candidate
    drawn = _convert_to_drawn(candidate)
    return AgentCandidates(
        name=agent.name,
        role="background" if fresh is None else fresh.role,
        route=candidate.route,
        shape=candidate.shape,
        subtype=candidate.subtype,
        draw=lambda: drawn,
        build=lambda _m: candidate,
        arrival=_estimate_arrival(agent),
    )


def _offer_first(agent: SelectedAgent, fresh: AgentCandidates) -> AgentCandidates:
    """The candidate that the agent has, then fresh ones."""
    candidate, own = agent.candidate, _convert_to_drawn(agent.candidate)

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
        arrival=_estimate_arrival(agent),
        chance=None,
    )


def scale_speed(profile: DrivingProfile, factor: float) -> DrivingProfile:
    """The driving profile with its free speed multiplied."""
    return replace(profile, speed=profile.speed * factor)


def _convert_to_drawn(candidate: Candidate) -> DrawnWaypoints:
    return DrawnWaypoints(
        candidate.waypoints[None],
        np.array([candidate.nll]),
        np.zeros(1, dtype=np.intp),
        (candidate.time_law,),
        np.array([candidate.time_nll]),
    )


def _estimate_arrival(agent: SelectedAgent) -> float:
    """When [s] it was about half-way, at its free speed."""
    seconds = agent.candidate.path.length / max(agent.candidate.time_law.speed, 0.5)
    return agent.enters + round(seconds / 2 / STEP) * STEP
