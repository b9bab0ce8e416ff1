"""Replies of a model to the planner: their model, their schema for a map, what a plan entails."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, get_args

from pydantic import Discriminator, RootModel, Tag, model_validator

from scenewright.nodes.scene_planner.hints import HINTS
from scenewright.nodes.schema import (
    Schema,
    build_array,
    build_enum,
    build_integer,
    build_number,
    build_object,
    build_reference,
    build_text,
    speaks_of,
)
from scenewright.scene.base import AgentClass
from scenewright.scene.kinds import is_heard, list_names
from scenewright.scene.relations import Pattern, load_patterns
from scenewright.scene.route_table import RouteDescription
from scenewright.scene.social import (
    MOST_AGENTS,
    MOST_BACKGROUND,
    MOST_OBJECTS,
    MOST_RELATIONS,
    AgentNode,
    Density,
    EntrySide,
    ImpactPoint,
    ObjectKind,
    Refusal,
    RelationType,
    SocialGraph,
)
from scenewright.scene.stems import stem_word
from scenewright.scene.track import EMERGENCY
from scenewright.tools.map_grounding.role_search import is_on_side

_CLOCK = "[0-2][0-9]:[0-5][0-9]"
TIME = f"^{_CLOCK}(-{_CLOCK})?$"
_TEXT = "^[ !#-Z^-\uffff]{1,120}$"
"""Words in any script; decoders break on quotes, brackets, backslashes and control characters."""
MOST_PATTERNS = 6
ID = rf"^({'|'.join(get_args(AgentClass))})-([1-9]|1[0-2])$"
"""Of at most MOST_AGENTS agents."""

_FIELDS = ("entry", "exit", "movement", "crosswalk")
_WORD = re.compile(r"[a-z]+")
_COMMON = frozenset(
    (
        *("a", "an", "the", "of", "its", "his", "her", "for", "to", "into", "on", "in", "at"),
        *("from", "and", "with", "out", "up", "over", "as", "by", "is", "are", "one", "two"),
        *("vehicle", "pedestrian", "car", "truck", "bus", "man", "woman", "who", "that"),
        *("while", "then", "left", "right"),
    )
)
"""Words that do not distinguish phrases."""


def _classify_reply(value: Any) -> str:
    refusal = isinstance(value, Refusal) or (isinstance(value, Mapping) and "code" in value)
    return "refused" if refusal else "plan"


class PlanReply(
    RootModel[
        Annotated[
            Annotated[SocialGraph, Tag("plan")] | Annotated[Refusal, Tag("refused")],
            Discriminator(_classify_reply),
        ]
    ]
):
    """A social graph, or a refusal: as such, under the key `refused`, or with its code there."""

    @model_validator(mode="before")
    @classmethod
    def _read_plan_or_refusal(cls, value: Any) -> Any:
        if not isinstance(value, Mapping) or "code" in value:
            return value
        rest = {key: each for key, each in value.items() if key not in ("refused", "reason")}
        code = value.get("refused")
        if code is None and not rest:
            raise ValueError("name the agents and what happens, or refuse")
        if code is None:  # of a plan the reason is not asked, and does no harm
            # The plan, every agent of the class that its id names, where none is given.
            agents = rest.get("agents")
            if not isinstance(agents, list | tuple):
                return dict(rest)
            for n, each in enumerate(agents := list(agents)):
                kind = (
                    str(each.get("id", "")).partition("-")[0] if isinstance(each, Mapping) else ""
                )
                if kind in get_args(AgentClass) and "type" not in each:
                    agents[n] = {**each, "type": kind}
            return {**rest, "agents": agents}
        if rest.get("agents") or rest.get("relations"):
            raise ValueError("either 'refused' or agents and relations, not both")
        if not isinstance(code, str):
            return code
        if not value.get("reason"):
            raise ValueError("a refusal needs its 'reason'")
        return {"code": code, "reason": value["reason"]}


def build_plan_schema(
    ways: Sequence[RouteDescription], patterns: Sequence[Pattern], words: str
) -> Schema:
    """The reply's schema: sides, crosswalks and patterns are those there are.

    Args:
        words: figures and places on a vehicle are asked for where they may speak of them; a weak
            model fills in whatever it is offered.
    """
    legs = build_enum(side for way in ways for side in (way.entry, way.exit))
    crossed = [way.crosswalk for way in ways if way.crosswalk is not None]
    agent_id, side = build_reference("id"), build_reference("side")
    all_cross = set(crossed) == set(legs["enum"])
    agent = {
        "id": agent_id,
        "subtype": build_subtype_schema(words),
        "entry": side,
        "exit": side,
        "movement": build_enum([*(way.movement for way in ways), "uturn"]),
        **({"crosswalk": side if all_cross else build_enum(crossed)} if crossed else {}),
        "runs_red": {"type": "boolean"},
        **build_motion_schema(words),
    }
    relation = {
        "type": build_enum(get_args(RelationType)),
        "from": agent_id,
        "to": agent_id,
        "kind": build_enum(list_names("collision")),
        "cause": build_enum(list_names("cause")),
        "braker": agent_id,
        **build_order_schema(words, agent_id),
        **build_manoeuvre_schema(words),
        **({"pattern": build_enum(pattern.id for pattern in patterns)} if patterns else {}),
        **build_severity_schema(words),
    }
    tie = {"agent": agent_id, "of": agent_id, "side": build_enum(get_args(EntrySide))}
    count = build_integer(0, MOST_BACKGROUND)
    context = {
        "density": build_enum(get_args(Density)),
        "time_of_day": build_text(TIME),
        "background": build_object({"vehicles": count, "pedestrians": count}),
    }
    said = {
        "words": build_reference("text"),
        "became": build_enum(HINTS),
        "agents": build_array(agent_id, most=4),
    }
    codes = build_enum(("out_of_scope", "contradictory", "impossible"))
    return build_object(
        {
            # What ends everything comes last: decoders keep to this order, and a weak model
            # takes the first key that it is offered.
            "agents": build_array(build_object(agent, required=("id",)), most=MOST_AGENTS),
            "relations": build_array(
                build_object(relation, required=("type", "from", "to")), most=MOST_RELATIONS
            ),
            "ties": build_array(build_object(tie, required=tie), most=MOST_AGENTS),
            **build_object_schema(words, side),
            "context": build_object(context),
            "said": build_array(build_object(said, required=("words", "became")), most=40),
            "refused": codes,
            "reason": build_reference("text"),
        },
        required=("agents", "relations"),  # said even where there are none
        defs={
            "id": build_text(ID),
            "text": build_text(_TEXT),
            "side": legs,
            **build_point_schema(words),
        },
    )


def build_severity_schema(words: str) -> Schema:
    """The keys of a relation that say how bad it gets, as far as the words may speak of them."""
    found: Schema = {}
    if speaks_of("figures", words):
        found |= {"target_pet": build_number(0, 8), "target_ttc": build_number(0, 8)}
        found["impact_speed"] = build_number(0.1, 20)
    if build_point_schema(words):
        found |= dict.fromkeys(("point_from", "point_to"), build_reference("point"))
    return found


def build_subtype_schema(words: str) -> Schema:
    """The subtypes of vehicles; those of emergency vehicles where the words may speak of them."""
    special = speaks_of("emergency", words)
    return build_enum(name for name in list_names("subtype") if special or name not in EMERGENCY)


def build_manoeuvre_schema(words: str) -> Schema:
    """How a relation in one lane comes about, where the words may speak of it."""
    return (
        {"manoeuvre": build_enum(list_names("manoeuvre"))} if is_heard("manoeuvre", words) else {}
    )


def build_object_schema(words: str, side: Schema) -> Schema:
    """What stands, as a key of the reply, where the words may speak of it."""
    if not speaks_of("standing", words):
        return {}
    agent = build_reference("id")
    figure = {"type": "array", "items": build_number(0, 30), "minItems": 2, "maxItems": 2}
    how = build_enum(list_names("encounter"))
    other = {"agent": agent, "encounter": how, "figure": figure}
    node = {
        "id": build_text(r"object-[1-9]"),
        "kind": build_enum(get_args(ObjectKind)),
        "subtype": build_subtype_schema(words),
        "leg": side,
        "hides": agent,
        "hidden_from": agent,
        "lead": {"type": "array", "items": build_number(0, 10), "minItems": 2, "maxItems": 2},
        "lane": build_enum(("left", "right")),
        "met_by": agent,
        "encounter": how,
        "figure": figure,
        "others": build_array(build_object(other, required=("agent", "encounter")), most=3),
    }
    return {"objects": build_array(build_object(node, required=("id", "kind")), most=MOST_OBJECTS)}


def build_order_schema(words: str, agent: Schema) -> Schema:
    """The key of a relation that names the agent passing first, where the words may speak of
    that."""
    return {"first": agent} if speaks_of("order", words) else {}


_MOVING: tuple[AgentClass, ...] = ("pedestrian", "vehicle")


def build_motion_schema(words: str) -> Schema:
    """How a pedestrian crosses, and how many do as one, where the words may speak of it."""
    classes = [of for of in _MOVING if is_heard("motion", words, of=of)]
    known = [name for of in classes for name in list_names("motion", of=of)]
    motion = {"motion": build_enum(known)} if known else {}
    motion |= (
        {"reaction": build_enum(list_names("reaction"))} if is_heard("reaction", words) else {}
    )
    return motion | ({"members": build_integer(2, 8)} if speaks_of("groups", words) else {})


def build_point_schema(words: str) -> Schema:
    """The places on a vehicle, for `$defs`, where the words may speak of one."""
    return {"point": build_enum(get_args(ImpactPoint))} if speaks_of("parts", words) else {}


def find_similar_patterns(instruction: str, *, left_hand: bool = False) -> tuple[Pattern, ...]:
    """The relation files whose phrases share words with the text, most alike first.

    Of a user's files and the shipped ones alike; a model need not hear of the others, nor of
    those that name a turn where that is the other one.
    """
    said = _list_stems(instruction)
    found = []
    for pattern in load_patterns():
        if left_hand and pattern.names_a_turn:
            continue
        phrases = [_list_stems(words) for words, _ in pattern.list_phrase_words()]
        # The greatest share of a phrase's own words that are said.
        alike = max((len(own & said) / len(own) for own in phrases if own), default=0.0)
        if alike > 0.5:
            found.append((-alike, pattern.id, pattern))
    return tuple(each for *_, each in sorted(found, key=lambda each: each[:2])[:MOST_PATTERNS])


def _list_stems(words: str) -> set[str]:
    return {stem_word(word[:40]) for word in _WORD.findall(words.lower()) if word not in _COMMON}


def complete_plan(graph: SocialGraph, ways: Iterable[RouteDescription]) -> SocialGraph:
    """The graph with what its entries, exits, turns and ties entail of one another (SEMANTICS 2).

    Nothing is changed that is given, and nothing added where several ways are left.
    """
    ways = tuple(ways)
    agents = {agent.id: agent for agent in graph.agents}
    for _ in range(2):
        agents = {name: _complete_agent(agent, ways) for name, agent in agents.items()}
        for name, other, side in _list_side_ties(graph):
            if agents[name].type == agents[other].type == "vehicle":
                # The entry of either from that of the other, where but one leg is left.
                legs = dict.fromkeys(way.entry for way in ways if way.type == "vehicle")
                one, two = agents[name], agents[other]
                if one.entry is None and two.entry is not None:
                    fits = [leg for leg in legs if is_on_side(side, leg, of=two.entry)]
                    agents[name] = _set_entry(one, fits)
                elif two.entry is None and one.entry is not None:
                    fits = [leg for leg in legs if is_on_side(side, one.entry, of=leg)]
                    agents[other] = _set_entry(two, fits)
    done = tuple(_complete_agent(agent, ways) for agent in agents.values())
    return graph.model_copy(update={"agents": done})


def _complete_agent(agent: AgentNode, ways: Sequence[RouteDescription]) -> AgentNode:
    values = {field: getattr(agent, field) for field in _FIELDS}
    if agent.type == "pedestrian" and values["crosswalk"] and values["movement"] is None:
        values["movement"] = "crossing"
    open_ = [
        way
        for way in ways
        if way.type == agent.type
        and all(values[f] is None or values[f] == getattr(way, f) for f in _FIELDS)
    ]
    if not open_ or values["movement"] == "jaywalking":
        return agent
    fixed = ("entry", "exit") if agent.type == "pedestrian" else _FIELDS[:3]
    for field in fixed:
        options = {getattr(way, field) for way in open_}
        # An agent without any side given is left free, even if there is only one route.
        told = sum(value is not None for value in values.values())
        if values[field] is None and len(options) == 1 and told >= 2:
            values[field] = options.pop()
    return agent.model_copy(update=values)


def _list_side_ties(graph: SocialGraph) -> list[tuple[str, str, EntrySide]]:
    """Pairs of agents with the side of one entry to the other, from ties and relations."""
    bonds: list[tuple[str, str, EntrySide]] = [(t.agent, t.of, t.side) for t in graph.ties]
    for edge in graph.relations:
        if edge.type == "follow" or edge.kind == "rear_end":
            bonds.append((edge.from_, edge.to, "same"))
        elif edge.kind == "head_on":
            bonds.append((edge.from_, edge.to, "opposite"))
    return bonds


def _set_entry(agent: AgentNode, legs: Sequence[str]) -> AgentNode:
    return agent.model_copy(update={"entry": legs[0]}) if len(legs) == 1 else agent
