"""How an edit is tried: nearly everybody stays at first, and more may move each time."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

from scenewright.authoring.apply_edits import Revision
from scenewright.scene.frozen_agents import FrozenAgents, without_edits
from scenewright.scene.grounding import AssignedPattern
from scenewright.scene.selection import SelectedAgent
from scenewright.scene.social import RelationEdge, SocialGraph
from scenewright.scene.track import get_vehicle_shape

_SHARES = (1.0, 0.7, 0.4)
"""Of the background that is left where everybody is drawn anew and there is no room for all."""


def attempts(revision: Revision) -> Iterator[FrozenAgents]:
    """Pins for one attempt after the other, the firmest first; the last one lets everybody go."""
    seen: set[tuple[object, ...]] = set()
    for pins in _attempts(revision):
        key = (
            frozenset(pins.same), frozenset(pins.placed), frozenset(pins.offered),
            frozenset(pins.fixed), pins.lights, frozenset(pins.patterns),
            frozenset(pins.background.items()),
        )  # fmt: skip
        if key not in seen:
            seen.add(key)
            yield pins


def _attempts(revision: Revision) -> Iterator[FrozenAgents]:
    touched, other = revision.touched, revision.other
    if revision.by_hand:
        # What was told of a stop or a time must hold: whoever else has to do with it may move.
        around = touched | _partners(revision.by_hand | touched, revision.graph)
        for free in (touched, around - revision.by_hand):
            yield _pins(revision, free, keep_paths=True)
            yield _pins(revision, free, keep_paths=False)
        return
    if not revision.anew:
        around = touched | _partners(touched, revision.graph)
        everybody = frozenset(each.id for each in revision.graph.agents)
        yield _pins(revision, touched, keep_paths=True)
        if other:
            yield _pins(revision, (touched - _actors(revision)) | other, keep_paths=True)
        yield _pins(revision, touched, keep_paths=False)
        yield _pins(revision, around | other, keep_paths=True)
        yield _pins(revision, around | other, keep_paths=False)
        yield _pins(revision, everybody, keep_paths=True)
        yield _pins(revision, everybody, keep_paths=False)
        yield _pins(revision, everybody, keep_paths=True, lights=False)
    for share in _SHARES if _may_thin(revision.graph) else _SHARES[:1]:
        yield FrozenAgents(
            earlier=revision.earlier,
            background={kind: int(share * n) for kind, n in revision.background.items()},
            hour=revision.hour,
            lights=False,
            pace=revision.pace,
        )


def _may_thin(graph: SocialGraph) -> bool:
    """Whether nobody asked for so many in the background."""
    return graph.context.background is None and graph.context.density is None


def _pins(
    revision: Revision, free: frozenset[str], *, keep_paths: bool, lights: bool = True
) -> FrozenAgents:
    """Everybody but `free` and those who must act otherwise because of them stays."""
    graph, present = revision.graph, revision.present
    foreground = {each.id for each in graph.agents}
    free = _with_busy(free, revision)
    placed = _reacting(free, revision) if lights else {}
    fixed, offered = {}, {}
    for name, agent in present.items():
        if name in placed:
            continue
        if name in free:
            if keep_paths and name in foreground and _may_keep(name, agent, revision):
                offered[name] = _fitted(name, agent, revision)
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
        patterns=_patterns(revision) if keep_paths else _patterns(revision, fixed.keys()),
        lights=lights,
        pace=revision.pace,
    )


def _with_busy(free: frozenset[str], revision: Revision) -> frozenset[str]:
    """Also those who react to one of them, and to somebody else besides: both are done at once."""
    busy = set(free)
    for name in _reacting(free, revision):
        edges = [e for e in revision.graph.relations if name in (e.from_, e.to)]
        acts = [e for e in edges if _acts(name, e) and not {e.from_, e.to} & free]
        if acts:
            busy.add(name)
    return frozenset(busy)


def _reacting(free: frozenset[str], revision: Revision) -> dict[str, SelectedAgent]:
    """Who stays in place, but has to act otherwise as others are free, gone or related anew."""
    gone = {each.id for each in revision.before.agents} - {e.id for e in revision.graph.agents}
    moving = free | gone
    found = {}
    for name, agent in revision.present.items():
        if name in free or name not in {each.id for each in revision.graph.agents}:
            continue
        changed = [e for e in revision.before.relations if e not in revision.graph.relations]
        for edge in (*revision.graph.relations, *changed):
            if name not in (edge.from_, edge.to):
                continue
            other = edge.to if name == edge.from_ else edge.from_
            if _acts(name, edge) and (other in moving or edge in changed):
                found[name] = agent if name in revision.by_hand else without_edits(agent)
    return found


def _acts(name: str, edge: RelationEdge) -> bool:
    """Whether the agent does something for the relation's sake: stops, brakes, ends."""
    if edge.type == "collide_at":
        return True
    brakes = edge.type == "near_miss" and (edge.target_ttc is not None or edge.cause is not None)
    return brakes or (name == edge.from_ and edge.type in ("yield_to", "follow"))


def _may_keep(name: str, agent: SelectedAgent, revision: Revision) -> bool:
    return name not in revision.redrawn and agent.candidate.route in revision.grounding.routes[name]


def _fitted(name: str, agent: SelectedAgent, revision: Revision) -> SelectedAgent:
    """The agent unedited, at the pace and of the kind that it is to have."""
    candidate = agent.candidate
    node = revision.graph.agent(name)
    if node.subtype is not None and node.subtype != candidate.subtype:
        candidate = replace(candidate, subtype=node.subtype, shape=get_vehicle_shape(node.subtype))
    return replace(without_edits(agent), candidate=candidate)


def _patterns(
    revision: Revision, names: Collection[str] | None = None
) -> dict[int, AssignedPattern]:
    """How relations that are as before were played; of these agents alone, if named."""
    played = {each.edge: each for each in revision.earlier.patterns}
    found = {}
    for index, edge in enumerate(revision.graph.relations):
        if edge not in revision.before.relations:
            continue
        before = played.get(revision.before.relations.index(edge))
        if before is None or (names is not None and not {edge.from_, edge.to} <= set(names)):
            continue
        if {edge.from_, edge.to} & _changed_agents(revision):
            continue
        found[index] = before.model_copy(update={"edge": index})
    return found


def _changed_agents(revision: Revision) -> set[str]:
    was = {each.id: each for each in revision.before.agents}
    return {each.id for each in revision.graph.agents if was.get(each.id) != each}


def _partners(names: frozenset[str], graph: SocialGraph) -> frozenset[str]:
    found = set()
    for edge in graph.relations:
        if {edge.from_, edge.to} & names:
            found |= {edge.from_, edge.to}
    return frozenset(found)


def _actors(revision: Revision) -> frozenset[str]:
    """Who is touched only because a relation of it changed."""
    changed = {e.from_ for e in revision.graph.relations if e not in revision.before.relations}
    return frozenset(changed - _changed_agents(revision))
