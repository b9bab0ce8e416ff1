"""Attempts to solve an edit: nearly all agents stay at first, and each time more may move."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

from scenewright.authoring.apply_edits import Revision
from scenewright.scene.candidates import AssignedPattern
from scenewright.scene.frozen_agents import FrozenAgents, without_edits
from scenewright.scene.selection import SelectedAgent
from scenewright.scene.social import RelationEdge, SocialGraph
from scenewright.scene.track import get_vehicle_shape

_SHARES = (1.0, 0.7, 0.4)
"""Shares of the background kept where all agents are drawn anew and there is no room for all."""


def generate_attempts(revision: Revision) -> Iterator[FrozenAgents]:
    """Frozen agents for each attempt, most of them first; the last attempt frees all agents."""
    seen: set[tuple[object, ...]] = set()
    for pins in _generate_attempts(revision):
        key = (
            frozenset(pins.same), frozenset(pins.placed), frozenset(pins.offered),
            frozenset(pins.fixed), pins.lights, frozenset(pins.patterns),
            frozenset((pins.background or {}).items()),
        )  # fmt: skip
        if key not in seen:
            seen.add(key)
            yield pins


def _generate_attempts(revision: Revision) -> Iterator[FrozenAgents]:
    touched, other = revision.touched, revision.other
    if revision.by_hand:
        # A stop or time that was given must hold: the agents related to it may move.
        around = touched | _find_partners(revision.by_hand | touched, revision.graph)
        for free in (touched, around - revision.by_hand):
            yield _build_pins(revision, free, keep_paths=True)
            yield _build_pins(revision, free, keep_paths=False)
        return
    if not revision.anew:
        around = touched | _find_partners(touched, revision.graph)
        all_agents = frozenset(agent.id for agent in revision.graph.agents)
        yield _build_pins(revision, touched, keep_paths=True)
        if other:  # without those that are touched only because a relation of theirs changed
            was = revision.before.relations
            changed = {e.from_ for e in revision.graph.relations if e not in was}
            actors = changed - _find_changed_agents(revision)
            yield _build_pins(revision, (touched - actors) | other, keep_paths=True)
        yield _build_pins(revision, touched, keep_paths=False)
        yield _build_pins(revision, around | other, keep_paths=True)
        yield _build_pins(revision, around | other, keep_paths=False)
        yield _build_pins(revision, all_agents, keep_paths=True)
        yield _build_pins(revision, all_agents, keep_paths=False)
        yield _build_pins(revision, all_agents, keep_paths=True, lights=False)
    context, counts = revision.graph.context, revision.background
    asked = context.background is not None or context.density is not None or counts is None
    for share in _SHARES[:1] if asked else _SHARES:
        yield FrozenAgents(
            earlier=revision.earlier,
            background=counts and {kind: int(share * n) for kind, n in counts.items()},
            hour=revision.hour,
            lights=False,
            pace=revision.pace,
        )


def _build_pins(
    revision: Revision, free: frozenset[str], *, keep_paths: bool, lights: bool = True
) -> FrozenAgents:
    """Freezes all agents but `free` and those that must act otherwise because of them."""
    graph, present = revision.graph, revision.present
    foreground = {agent.id for agent in graph.agents}
    # Who reacts to one of them and to another agent too is solved at once with both.
    asked = free
    for name in _find_reacting(asked, revision):
        edges = [edge for edge in graph.relations if name in edge.pair]
        if any(_is_acting(name, edge) and not edge.pair & asked for edge in edges):
            free |= {name}
    placed = _find_reacting(free, revision) if lights else {}
    fixed, offered = {}, {}
    for name, agent in present.items():
        if name in placed:
            continue
        if name in free:
            kept = keep_paths and name in foreground and name not in revision.redrawn
            if kept and agent.candidate.route in revision.grounding.routes[name]:
                # Unedited, at the pace and of the kind that it is to have.
                candidate, subtype = agent.candidate, graph.agent(name).subtype
                if subtype is not None and subtype != candidate.subtype:
                    shape = get_vehicle_shape(subtype)
                    candidate = replace(candidate, subtype=subtype, shape=shape)
                offered[name] = replace(without_edits(agent), candidate=candidate)
        elif lights:
            fixed[name] = agent
    same = frozenset(name for name in fixed if name not in revision.amended)
    return FrozenAgents(
        earlier=revision.earlier,
        background=revision.background,
        hour=revision.hour,
        fixed=fixed,
        same=same,
        placed=placed,
        offered=offered,
        patterns=_list_patterns(revision) if keep_paths else _list_patterns(revision, fixed.keys()),
        lights=lights,
        pace=revision.pace,
    )


def _find_reacting(free: frozenset[str], revision: Revision) -> dict[str, SelectedAgent]:
    """Agents that keep their path but must act otherwise as others are free, gone or related
    anew."""
    gone = {agent.id for agent in revision.before.agents} - {e.id for e in revision.graph.agents}
    moving = free | gone
    found = {}
    for name, agent in revision.present.items():
        if name in free or name not in {each.id for each in revision.graph.agents}:
            continue
        changed = [e for e in revision.before.relations if e not in revision.graph.relations]
        for edge in (*revision.graph.relations, *changed):
            if name not in edge.pair:
                continue
            other = edge.get_other(name)
            if _is_acting(name, edge) and (other in moving or edge in changed):
                found[name] = agent if name in revision.by_hand else without_edits(agent)
    return found


def _is_acting(name: str, edge: RelationEdge) -> bool:
    """Whether the agent does something for the relation's sake: stops, brakes, ends."""
    if edge.type == "collide_at":
        return True
    brakes = edge.type == "near_miss" and (edge.target_ttc is not None or edge.cause is not None)
    return brakes or (name == edge.from_ and edge.type in ("yield_to", "follow"))


def _list_patterns(
    revision: Revision, names: Collection[str] | None = None
) -> dict[int, AssignedPattern]:
    """How relations that are as before were played; of these agents alone, if named."""
    played = {pattern.edge: pattern for pattern in revision.earlier.patterns}
    found = {}
    for index, edge in enumerate(revision.graph.relations):
        if edge not in revision.before.relations:
            continue
        before = played.get(revision.before.relations.index(edge))
        if before is None or (names is not None and not edge.pair <= set(names)):
            continue
        if edge.pair & _find_changed_agents(revision):
            continue
        found[index] = before.model_copy(update={"edge": index})
    return found


def _find_changed_agents(revision: Revision) -> set[str]:
    was = {agent.id: agent for agent in revision.before.agents}
    return {agent.id for agent in revision.graph.agents if was.get(agent.id) != agent}


def _find_partners(names: frozenset[str], graph: SocialGraph) -> frozenset[str]:
    return frozenset().union(*(edge.pair for edge in graph.relations if edge.pair & names))
