"""Groups of pedestrians, each one party of a relation (SEMANTICS section 8)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from scenewright.scene.events import Event, Finding
from scenewright.scene.record import AgentRecord, RelationRecord
from scenewright.tools.relation_checker.contact import find_common_times
from scenewright.tools.relation_checker.events import SceneObservation

TOGETHER = 1.5
"""How far from the nearest other member each one walks, at most [m]."""


def list_groups(agents: Iterable[AgentRecord]) -> dict[int, tuple[int, ...]]:
    """All members of each group, its leader first, by the leader's id."""
    groups: dict[int, tuple[int, ...]] = {}
    for agent in agents:
        if agent.group is not None:
            groups[agent.group] = (*groups.get(agent.group, (agent.group,)), agent.id)
    return groups


def list_group_pairs(
    pair: tuple[int, int], groups: dict[int, tuple[int, ...]]
) -> list[tuple[int, int]]:
    """A pair, and those of the other members of the groups that it names."""
    first, second = (groups.get(each, (each,)) for each in pair)
    return [(a, b) for a in first for b in second]


def find_group_events(
    relations: Sequence[RelationRecord], events: Sequence[Event], groups: dict[int, tuple[int, ...]]
) -> frozenset[int]:
    """Positions of the events of other members that their group's relation asks for as well."""
    wanted = {
        (relation.type, frozenset(pair))
        for relation in relations
        for pair in list_group_pairs((relation.from_, relation.to), groups)
    }
    kinds = {(event.type, frozenset((event.from_, event.to))) for event in events} & wanted
    return frozenset(
        k for k, e in enumerate(events) if (e.type, frozenset((e.from_, e.to))) in kinds
    )


def _strays(number: int, members: Sequence[int], observed: SceneObservation) -> bool:
    """Whether a member is ever too far from the nearest other one, or mostly alone."""
    tracks = observed.by_id
    own, others = tracks.get(number), [tracks[n] for n in members if n in tracks and n != number]
    if own is None or own.is_vehicle or not others:
        return True
    nearest = np.full(len(own.times), np.inf)
    for other in others:
        times = find_common_times(own, other)
        away = np.hypot(*(own.at(times)[0] - other.at(times)[0]).T)
        k = own.find_indices(times)
        nearest[k] = np.minimum(nearest[k], away)
    shared = np.isfinite(nearest)
    return bool(shared.mean() < 0.5 or nearest[shared].max() > TOGETHER)


def check_groups(agents: Sequence[AgentRecord], observed: SceneObservation) -> tuple[Finding, ...]:
    """A finding for each member that does not walk with its group, on one route, all the time."""
    records = {agent.id: agent for agent in agents}
    found: list[Finding] = []
    for leader, members in list_groups(agents).items():
        routes = {records[member].route for member in members if member in records}
        strays = [member for member in members if _strays(member, members, observed)]
        led = leader in records and records[leader].group is None
        if not led or len(routes) > 1 or strays:
            detail = f"the group of agent {leader} does not walk together on one route"
            found.append(Finding(rule="group_apart", agents=members, detail=detail))
    return tuple(found)
