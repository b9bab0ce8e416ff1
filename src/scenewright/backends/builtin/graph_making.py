"""From a draft to the social graph: what follows, what cannot be, ids and fields."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import get_args

from scenewright.backends.builtin.draft import (
    LEFT_OF_HEADING,
    AgentDraft,
    Draft,
    Refused,
    RelationDraft,
)
from scenewright.backends.builtin.entail import fill_entailed, find_partner
from scenewright.backends.builtin.impacts import Impacts
from scenewright.backends.builtin.phrases import assign_agents
from scenewright.backends.builtin.scope import build_nothing_planned
from scenewright.scene.base import OPPOSITE, AgentClass
from scenewright.scene.kinds import find_marked
from scenewright.scene.social import (
    MOST_AGENTS,
    MOST_RELATIONS,
    AgentNode,
    Background,
    EntrySide,
    EntryTie,
    RelationEdge,
    SceneContext,
    SocialGraph,
)
from scenewright.scene.track import VEHICLE_SIZES

_SIDES: dict[str, EntrySide] = {
    "opposite": "opposite", "mutual": "opposite", "same": "same", "lateral": "lateral",
    "of_left": "left", "of_right": "right", "other": "other",
}  # fmt: skip

Tie = tuple[AgentDraft, AgentDraft, EntrySide]
"""Agent, the other one, and where the agent comes from as seen by the other one."""


def list_ties(draft: Draft) -> list[Tie]:
    """What the text says of entries, once for every pair, without what an edit has overruled."""
    found: dict[frozenset[int], Tie] = {}
    stated = (
        (agent, other, _SIDES[word])
        for agent in draft.agents
        for word, named in agent.relatives
        if word in _SIDES and (other := named or find_partner(agent, draft)) is not None
    )
    for agent, other, side in (*stated, *_list_implied_ties(draft)):
        vehicles = agent.drives and other.drives and agent is not other
        if vehicles and other in draft.agents and not _is_overruled(agent, other, side):
            found.setdefault(frozenset((id(agent), id(other))), (agent, other, side))
    return list(found.values())


def name_turns_across(draft: Draft) -> None:
    """An agent that turns across an oncoming vehicle and hits it has a left-turn collision.

    In left-hand traffic it turns right; the kind has one name.
    """
    opposite = {frozenset((id(a), id(b))) for a, b, side in list_ties(draft) if side == "opposite"}
    for relation in draft.relations:
        moves = {relation.from_.movement, relation.to.movement}
        across = draft.site.across
        turns = across in moves and moves <= {across, None, "straight"} and len(moves) == 2
        entry = relation.from_.entry
        facing = entry is not None and relation.to.entry == OPPOSITE[entry]
        oncoming = facing or relation.pair() in opposite
        if relation.type == "collide_at" and relation.kind is None and turns and oncoming:
            relation.kind = "left_turn"


def _list_implied_ties(draft: Draft) -> Iterator[Tie]:
    """ "nearly collide head-on": towards one another; "nearly rear-ends": in one lane."""
    for relation in draft.relations:
        if relation.type == "near_miss" and relation.kind == "rear_end":
            yield relation.to, relation.from_, "same"
        if relation.type == "near_miss" and relation.kind == "head_on":
            yield relation.to, relation.from_, "opposite"


def _is_overruled(agent: AgentDraft, other: AgentDraft, side: EntrySide) -> bool:
    """Whether both entries are known and lie otherwise."""
    if agent.entry is None or other.entry is None:
        return False
    left = LEFT_OF_HEADING.get(OPPOSITE[other.entry])
    lies: dict[EntrySide, bool] = {
        "same": agent.entry == other.entry,
        "other": agent.entry != other.entry,
        "opposite": agent.entry == OPPOSITE[other.entry],
        "lateral": agent.entry not in (other.entry, OPPOSITE[other.entry]),
        "left": agent.entry == left,
        "right": agent.entry == OPPOSITE.get(left or ""),
    }
    return not lies[side]


_FASTEST, _LONGEST = 20.0, 8.0
"""Speed [m/s], and PET and TTC [s], that may be asked for."""


def finish_draft(draft: Draft) -> Draft:
    """The draft with all that follows from it; Refused where it cannot be."""
    for what, found, most in (
        ("agents", draft.agents, MOST_AGENTS),
        ("relations", draft.relations, MOST_RELATIONS),
    ):
        if len(found) > most:
            raise Refused(
                "out_of_scope",
                f"The text names {len(found)} {what}; a scene holds at most {most}, so name fewer.",
            )
    if any(edge.from_ is edge.to for edge in draft.relations):
        raise Refused("impossible", "Nothing happens between an agent and itself; name another.")
    _keep_one_event_per_pair(draft)
    _settle_orders(draft.relations)
    for relation in draft.relations:
        assign_agents(relation, draft.site)
    fill_entailed(draft)
    name_turns_across(draft)
    _name_red_causes(draft)
    for relation in draft.relations:
        # The vehicle strikes, also where the pedestrian is the sentence's subject.
        on_foot = [each.type == "pedestrian" for each in (relation.from_, relation.to)]
        if relation.type in {"collide_at", "near_miss"} and on_foot == [True, False]:
            relation.from_, relation.to = relation.to, relation.from_
            relation.point_from, relation.point_to = relation.point_to, relation.point_from
    speed = draft.context.speed
    if speed is not None and speed > _FASTEST:
        raise Refused(
            "impossible",
            f"{speed:.0f} m/s is too fast here; ask for at most {_FASTEST:.0f} m/s (72 km/h).",
        )
    for name, seconds in (("PET", draft.context.pet), ("TTC", draft.context.ttc)):
        if seconds is not None and seconds > _LONGEST:
            raise Refused(
                "impossible",
                f"A {name} of {seconds:g} s is no encounter; ask for at most {_LONGEST:g} s.",
            )
    empty = draft.context.vehicles == 0 and draft.context.pedestrians == 0
    if not draft.agents and empty:
        raise build_nothing_planned()
    return draft


def _keep_one_event_per_pair(draft: Draft) -> None:
    """Collision, else yielding, else near miss (SEMANTICS 4); a follow may come before any."""
    for relation in list(draft.relations):
        types = {r.type for r in draft.relations if r.pair() == relation.pair()}
        if {"collide_at", "yield_to"} <= types:
            raise Refused(
                "contradictory",
                "An agent cannot yield to another and hit it in one encounter; keep "
                "one of the two.",
            )
        if relation.type == "yield_to" and any(
            other.type == "yield_to" and other.from_ is relation.to and other.to is relation.from_
            for other in draft.relations
        ):
            raise Refused(
                "contradictory", "Two agents cannot both give way to one another; keep one yield."
            )
        softened = relation.type == "yield_to" and relation.soft and "near_miss" in types
        overruled = relation.type == "near_miss" and types & {"collide_at", "yield_to"}
        if softened or overruled:
            draft.relations.remove(relation)
            for other in draft.relations:  # its order becomes that of the other
                if relation.first is not None and other.pair() == relation.pair():
                    other.first = other.first or relation.first


_UNORDERED = ("sideswipe", "head_on")
"""Collisions along one road, where no agent comes first to a place that both pass."""


def _settle_orders(relations: Iterable[RelationDraft]) -> None:
    """Orders that the relation has by itself are left to it.

    Raises:
        Refused: the agent to pass first yields, follows, drives into the other or brakes for it.
    """
    for relation in relations:
        if relation.first is None:
            continue
        if relation.ahead not in (None, relation.first):
            raise Refused(
                "contradictory",
                "One of the two passes first and gives way, follows or runs into the other from "
                "behind; keep one, or say that the two nearly collide.",
            )
        if relation.type == "near_miss" and relation.first is relation.braker:
            raise Refused(
                "contradictory",
                "An agent that brakes hard for another lets it pass first; say that the other "
                "one brakes, or that it passes first.",
            )
        one, two = relation.from_, relation.to
        vehicles = one.type == two.type == "vehicle"
        one_way = vehicles and one.entry is not None and one.entry == two.entry
        along_one_road = relation.kind in _UNORDERED or one_way
        if relation.ahead is not None or (relation.type == "collide_at" and along_one_road):
            relation.first = None


def _name_red_causes(draft: Draft) -> None:
    """A collision or near miss with one that runs red owes to that, and so does letting it by."""
    for relation in draft.relations:
        ran = relation.to.runs_red or (relation.from_.runs_red and relation.type != "yield_to")
        if ran and relation.type == "yield_to":
            relation.cause = find_marked("cause", "red")
        elif ran and relation.type in {"collide_at", "near_miss"}:
            relation.cause = relation.cause or find_marked("cause", "red")


def place_impacts(draft: Draft, impacts: Impacts) -> None:
    """Points of impact belong to the one collision there is; pedestrians have none."""
    collisions = [each for each in draft.relations if each.type == "collide_at"]
    if len(collisions) != 1:
        return
    (hit,) = collisions
    vehicles = [agent for agent in (hit.from_, hit.to) if agent.type != "pedestrian"]
    if len(vehicles) == 2:
        hit.point_from, hit.point_to = impacts.striking, impacts.struck
    elif vehicles == [hit.from_]:
        hit.point_from = impacts.striking
    else:  # "a pedestrian walks into the side of a bus"; the vehicle will be `from`
        hit.point_to = impacts.struck


def make_graph(draft: Draft) -> SocialGraph:
    """The social graph of a finished draft."""
    ids = name_agents(draft.agents)
    nodes = tuple(make_node(agent, ids[id(agent)]) for agent in draft.agents)
    edges = tuple(make_edge(relation, ids, draft) for relation in draft.relations)
    tied = tuple(
        EntryTie(agent=ids[id(agent)], of=ids[id(other)], side=side)
        for agent, other, side in list_ties(draft)
    )
    measures = tuple(m for each in draft.measures if (m := each.name_agents(ids)) is not None)
    return SocialGraph(
        agents=nodes,
        relations=edges,
        ties=tied,
        measures=tuple(dict.fromkeys(measures)),
        context=make_context(draft),
    )


def name_agents(agents: Sequence[AgentDraft]) -> dict[int, str]:
    """Identity of a draft -> the name of its agent in the social graph."""
    counts = dict.fromkeys(get_args(AgentClass), 0)
    result: dict[int, str] = {}
    for agent in agents:
        counts[agent.type] += 1
        result[id(agent)] = f"{agent.type}-{counts[agent.type]}"
    return result


def make_node(agent: AgentDraft, name: str) -> AgentNode:
    """The vertex of a draft."""
    subtype = agent.subtype if agent.type == "vehicle" else None
    return AgentNode.model_validate(
        {
            "id": name,
            "type": agent.type,
            "subtype": subtype if subtype in VEHICLE_SIZES else None,
            "entry": agent.entry,
            "exit": agent.exit,
            "movement": agent.movement,
            "crosswalk": agent.crosswalk,
            "runs_red": agent.runs_red,
            "motion": agent.motion,
            "reaction": agent.reaction,
            "members": agent.members,
        }
    )


def make_edge(relation: RelationDraft, ids: dict[int, str], draft: Draft) -> RelationEdge:
    """The edge of a draft, with the severity that the text asks for."""
    context = draft.context
    collision, miss = relation.type == "collide_at", relation.type == "near_miss"
    return RelationEdge.model_validate(
        {
            "type": relation.type,
            "from": ids[id(relation.from_)],
            "to": ids[id(relation.to)],
            "kind": relation.kind if collision else None,
            "cause": relation.cause,
            "braker": None if relation.braker is None else ids[id(relation.braker)],
            "manoeuvre": relation.manoeuvre,
            "pattern": relation.pattern,
            "target_pet": context.pet if not collision else None,
            "target_ttc": context.ttc if miss else None,
            "impact_speed": (context.speed or None) if collision else None,
            "point_from": relation.point_from if collision else None,
            "point_to": relation.point_to if collision else None,
            "first": None if relation.first is None else ids[id(relation.first)],
            "strikes": ids[id(relation.strikes)] if collision and relation.strikes else None,
        }
    )


def make_context(draft: Draft) -> SceneContext:
    """The context of a draft."""
    context = draft.context
    counts = {"vehicles": context.vehicles, "pedestrians": context.pedestrians}
    known = any(count is not None for count in counts.values())
    return SceneContext.model_validate(
        {
            "density": context.density,
            "time_of_day": context.time_of_day,
            "background": Background(**counts) if known else None,
        }
    )
