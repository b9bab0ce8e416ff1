"""From a draft to the social graph: what follows, what cannot be, ids and fields."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from scenewright.backends.builtin.draft import (
    LEFT_OF_HEADING,
    AgentDraft,
    ContextDraft,
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
    found: dict[frozenset[AgentDraft], Tie] = {}
    stated = (
        (agent, other, _SIDES[word])
        for agent in draft.agents
        for word, named in agent.relatives
        if word in _SIDES and (other := named or find_partner(agent, draft)) is not None
    )
    for agent, other, side in (*stated, *_list_implied_ties(draft)):
        vehicles = agent.drives and other.drives and agent is not other
        if vehicles and other in draft.agents and not _is_overruled(agent, other, side):
            found.setdefault(frozenset((agent, other)), (agent, other, side))
    return list(found.values())


def name_turns_across(draft: Draft) -> None:
    """An agent that turns across an oncoming vehicle and hits it has a left-turn collision.

    In left-hand traffic it turns right; the kind has one name.
    """
    opposite = {frozenset((a, b)) for a, b, side in list_ties(draft) if side == "opposite"}
    for relation in draft.relations:
        moves = {relation.from_.movement, relation.to.movement}
        across = draft.site.across
        turns = across in moves and moves <= {across, None, "straight"} and len(moves) == 2
        entry = relation.from_.entry
        facing = entry is not None and relation.to.entry == OPPOSITE[entry]
        oncoming = facing or relation.pair in opposite
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
        on_foot = [agent.type == "pedestrian" for agent in relation.ends]
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
        types = {r.type for r in draft.relations if r.pair == relation.pair}
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
        if relation.type == "near_miss" and types & {"collide_at", "yield_to"}:
            draft.relations.remove(relation)
            for other in draft.relations:  # its order becomes that of the other
                if relation.first is not None and other.pair == relation.pair:
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
        first, second = relation.ends
        vehicles = first.type == second.type == "vehicle"
        one_way = vehicles and first.entry is not None and first.entry == second.entry
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
    collisions = [relation for relation in draft.relations if relation.type == "collide_at"]
    if len(collisions) != 1:
        return
    (hit,) = collisions
    vehicles = [agent for agent in hit.ends if agent.type != "pedestrian"]
    if len(vehicles) == 2:
        hit.point_from, hit.point_to = impacts.striking, impacts.struck
    elif vehicles == [hit.from_]:
        hit.point_from = impacts.striking
    else:  # "a pedestrian walks into the side of a bus"; the vehicle will be `from`
        hit.point_to = impacts.struck


def make_graph(draft: Draft) -> SocialGraph:
    """The social graph of a finished draft."""
    names, context = name_agents(draft.agents), draft.context
    counts = Background(vehicles=context.vehicles, pedestrians=context.pedestrians)
    background = None if counts == Background() else counts
    measures = (measure.name_agents(names) for measure in draft.measures)
    return SocialGraph(
        agents=tuple(_make_node(agent, name) for agent, name in names.items()),
        relations=tuple(_make_edge(relation, names, context) for relation in draft.relations),
        ties=tuple(
            EntryTie(agent=names[agent], of=names[other], side=side)
            for agent, other, side in list_ties(draft)
        ),
        measures=tuple(dict.fromkeys(measure for measure in measures if measure is not None)),
        context=SceneContext.model_validate(
            {
                "density": context.density,
                "time_of_day": context.time_of_day,
                "background": background,
            }
        ),
    )


def name_agents(agents: Sequence[AgentDraft]) -> dict[AgentDraft, str]:
    """The names that the drafts' agents have in the social graph."""
    counts = Counter[AgentClass]()
    names: dict[AgentDraft, str] = {}
    for agent in agents:
        counts[agent.type] += 1
        names[agent] = f"{agent.type}-{counts[agent.type]}"
    return names


_SAME_IN_NODE = AgentNode.model_fields.keys() - {"id", "subtype"}
"""Fields that an agent has under the same name as its draft."""


def _make_node(agent: AgentDraft, name: str) -> AgentNode:
    known = agent.type == "vehicle" and agent.subtype in VEHICLE_SIZES
    same = {field: getattr(agent, field) for field in _SAME_IN_NODE}
    return AgentNode.model_validate(
        {"id": name, "subtype": agent.subtype if known else None, **same}
    )


_OF_COLLISIONS = ("kind", "strikes", "point_from", "point_to")
"""Fields that other relations have no use for."""


def _make_edge(
    relation: RelationDraft, names: Mapping[AgentDraft, str], context: ContextDraft
) -> RelationEdge:
    """The edge of a draft, with the severity that the text asks for."""
    collision = relation.type == "collide_at"
    fields = {field: getattr(relation, field, None) for field in RelationEdge.model_fields}
    fields |= {field: names[a] for field, a in fields.items() if isinstance(a, AgentDraft)}
    if collision:
        fields["impact_speed"] = context.speed or None
    else:
        fields |= {**dict.fromkeys(_OF_COLLISIONS), "target_pet": context.pet}
    if relation.type == "near_miss":
        fields["target_ttc"] = context.ttc
    return RelationEdge.model_validate(fields)
