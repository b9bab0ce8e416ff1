"""Replies of a model on the remaining words: their model, their schema, their checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import Field, model_validator

from scenewright.errors import Rejected
from scenewright.nodes.remaining import list_unserved
from scenewright.nodes.schema import (
    Schema,
    build_array,
    build_enum,
    build_integer,
    build_number,
    build_object,
    build_reference,
)
from scenewright.scene.base import Model
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.constraints import (
    Clause,
    ConstraintProgram,
    OnRoad,
    OnWalkable,
    UnaryClause,
)
from scenewright.scene.rejection import Rejection
from scenewright.scene.remaining import AddedClause, AddedClauses
from scenewright.tools.dsl_validator.parse import MAX_CLAUSES, format_clause

_SERVES: dict[str, tuple[str, ...]] = {
    "collide_at": ("contact",),
    "near_miss": ("time_gap", "brakes_for", "stops_behind", "passes_beside"),
    "yield_to": ("gives_way",),
    "follow": ("headway", "stops_behind"),
}
"""By relation: the clauses of which one must bind its two agents."""

_DIRECTED = frozenset({"gives_way", "headway", "stops_behind"})
_GROUND = (OnRoad, OnWalkable)


_OFFERED: dict[str, tuple[str, ...]] = {
    "collide_at": ("near",),
    "near_miss": ("before", "time_gap", "near"),
    "yield_to": ("before", "time_gap", "near"),
    "follow": ("headway", "near"),
}
"""By relation: the clauses about its two agents that words may ask for beside its pattern."""

_ALONE = ("speed", "passes_through")
_RANGED = frozenset({"speed", "time_gap", "headway", "near"})
"""Clauses whose given bound replaces that of the pattern."""


class ServingClause(Model):
    """A clause and the number of the words that ask for it; both stand side by side in a reply."""

    words: int
    clause: Clause

    @model_validator(mode="before")
    @classmethod
    def _merge_arguments(cls, value: Any) -> Any:
        if not isinstance(value, Mapping) or isinstance(value.get("clause"), Mapping):
            return value
        rest = {key: each for key, each in value.items() if key != "words"}
        return {"clause": rest, **({"words": value["words"]} if "words" in value else {})}


class ClausesReply(Model):
    """Clauses for the remaining words; `cannot` has the numbers of those that none can hold."""

    clauses: tuple[ServingClause, ...] = Field(default=(), max_length=MAX_CLAUSES)
    cannot: tuple[int, ...] = Field(default=(), max_length=MAX_CLAUSES)

    def read(
        self,
        entries: Sequence[int],
        agents: Sequence[Mapping[str, str]],
        relations: Sequence[Mapping[str, Any]],
    ) -> AddedClauses:
        """The clauses by entry of the account.

        Args:
            entries: of the words, in the order of their numbers.
            agents, relations: those that the request names.

        Raises:
            Rejected: `malformed_program`: a clause that is not offered, words of no number, or
                words of which the reply says nothing.
        """
        unserved = list_unserved(
            [clause.words for clause in self.clauses], self.cannot, entries,
            stage="waypoint_filter", note="no clause can hold this",
        )  # fmt: skip
        known = {agent["id"] for agent in agents}
        for clause in (each.clause for each in self.clauses):
            said, unary = format_clause(clause), isinstance(clause, UnaryClause)
            named = _list_agents(clause)
            if not known.issuperset(named):
                raise _build_rejection((), f"{said}: agents are {', '.join(sorted(known))}")
            bound = [
                relation
                for relation in relations
                if {relation["from"], relation["to"]} == set(named)
            ]
            kinds = {kind for each in bound for kind in _OFFERED[each["type"]]}
            if clause.clause not in (_ALONE if unary else kinds):
                raise _build_rejection(named, f"{said} is not offered")
        return AddedClauses(
            clauses=tuple(
                AddedClause(entry=entries[clause.words - 1], clause=clause.clause)
                for clause in self.clauses
            ),
            unserved=unserved,
        )


_AGENT: dict[str, Schema] = {"agent": build_reference("agent")}
_RANGE = {"low": build_number(0, 20), "high": build_number(0.1, 20)}
_KEYS: dict[str, dict[str, Schema]] = {
    "speed": _AGENT | _RANGE,
    "passes_through": _AGENT
    | {"region": build_enum(("crosswalk", "leg")), "leg": build_reference("leg")},
    "before": {},
    "time_gap": _RANGE,
    "headway": _RANGE,
    "near": {"metres": build_number(0.1, 200)},
}
"""By clause: its keys, but for the agents of a pair."""


def list_offered_kinds(relations: Sequence[Mapping[str, Any]]) -> dict[str, tuple[str, ...]]:
    """The clauses that words may ask for in a scene of these relations, each with its keys."""
    pair = dict.fromkeys(kind for each in relations for kind in _OFFERED[each["type"]])
    keys = {kind: tuple(_KEYS[kind]) for kind in _ALONE}
    return keys | {kind: ("first", "second", *_KEYS[kind]) for kind in pair}


def build_clauses_schema(
    agents: Sequence[Mapping[str, str]],
    legs: Sequence[str],
    relations: Sequence[Mapping[str, Any]],
    count: int,
) -> Schema:
    """The reply's schema: agents and legs are those there are, pairs those of the relations.

    Args:
        count: of the words, which are numbered from 1.
    """
    words = {"words": build_reference("words")}
    forms = [_build_clause_schema((kind,), words | _KEYS[kind]) for kind in _ALONE]
    for relation in relations:
        ends = build_enum((relation["from"], relation["to"]))
        alike: dict[tuple[str, ...], list[str]] = {}  # one form for those of the same keys
        for kind in _OFFERED[relation["type"]]:
            alike.setdefault(tuple(_KEYS[kind]), []).append(kind)
        for kinds in alike.values():
            pair = {"first": ends, "second": ends, **_KEYS[kinds[0]]}
            forms.append(_build_clause_schema(kinds, words | pair))
    defs = {
        "words": build_integer(1, count),
        "agent": build_enum(agent["id"] for agent in agents),
        "leg": build_enum(legs),
    }
    clauses = build_array({"anyOf": forms}, most=2 * count + 4)
    keys = {"clauses": clauses, "cannot": build_array(build_reference("words"), most=count)}
    return build_object(keys, required=("clauses", "cannot"), defs=defs)


def _build_clause_schema(kinds: Sequence[str], keys: Mapping[str, Schema]) -> Schema:
    return build_object({"clause": build_enum(kinds), **keys}, required=("clause", *keys))


def extend_program(program: ConstraintProgram, added: Sequence[Clause]) -> ConstraintProgram:
    """The program with clauses added; a bound that is given replaces the written one."""
    bound = {_get_subject(each) for each in added if each.clause in _RANGED}
    kept = [clause for clause in program.clauses if _get_subject(clause) not in bound]
    kept += [each for each in added if each not in kept]
    return ConstraintProgram(clauses=tuple(kept)) if added else program


def select_clauses(
    program: ConstraintProgram, agents: Sequence[Mapping[str, str]]
) -> ConstraintProgram:
    """The clauses about these agents, but for those that keep them on their ground."""
    names = {agent["id"] for agent in agents}
    kept = (
        c for c in program.clauses if not isinstance(c, _GROUND) and _get_subject(c)[1] <= names
    )
    return ConstraintProgram(clauses=tuple(kept))


def _list_agents(clause: Clause) -> tuple[str, ...]:
    """The agents that a clause names."""
    if isinstance(clause, UnaryClause):
        return (clause.agent,)
    return (clause.first,) if clause.second is None else (clause.first, clause.second)


def _get_subject(clause: Clause) -> tuple[str, frozenset[str]]:
    return clause.clause, frozenset(_list_agents(clause))


def ground_program(program: ConstraintProgram, pool: CandidateSet) -> ConstraintProgram:
    """The program and, for each agent without a clause, that its path lies on the ground."""
    said = {clause.agent for clause in program.clauses if isinstance(clause, _GROUND)}
    missing: list[Clause] = []
    for name, draws in pool.agents.items():
        if name not in said and draws.route.movement != "jaywalking":
            on_foot = draws.route.type == "pedestrian"
            missing.append(OnWalkable(agent=name) if on_foot else OnRoad(agent=name))
    return ConstraintProgram(clauses=(*program.clauses, *missing)) if missing else program


def refuse_strangers(program: ConstraintProgram, pool: CandidateSet) -> None:
    """Every agent that a clause names takes part.

    Raises:
        Rejected: `malformed_program`, naming the clause and the agent.
    """
    for clause in program.clauses:
        for name in _list_agents(clause):
            if name not in pool.agents:
                said = format_clause(clause)
                raise _build_rejection((name,), f"{said}: there is no {name} in the scene")


def refuse_unserved(program: ConstraintProgram, relations: Sequence[Mapping[str, Any]]) -> None:
    """Every relation has a clause that brings it about.

    Raises:
        Rejected: `malformed_program`, naming the relation and the clause that it lacks.
    """
    bound = {
        (clause.clause, clause.first, clause.second)
        for clause in program.clauses
        if not isinstance(clause, UnaryClause)
    }
    for relation in relations:
        first, second = relation["from"], relation["to"]
        words = _SERVES[relation["type"]]
        if not any(
            (word, first, second) in bound
            or (word not in _DIRECTED and (word, second, first) in bound)
            for word in words
        ):
            needed = " or ".join(f"{word}({first}, {second})" for word in words)
            raise _build_rejection(
                (first, second), f"{relation['type']} of {first} and {second} lacks {needed}"
            )


def _build_rejection(agents: tuple[str, ...], detail: str) -> Rejected:
    return Rejected(
        Rejection(stage="waypoint_filter", code="malformed_program", agents=agents, detail=detail)
    )
