"""What the filter may be told: the reply model, its schema for a scene, and what it must hold."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, model_validator

from scenewright.errors import Rejected
from scenewright.nodes.schema import Schema, closed, listed, number, one_of, shared
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.constraints import (
    Clause,
    ConstraintProgram,
    Contact,
    OnRoad,
    OnWalkable,
    UnaryClause,
)
from scenewright.scene.rejection import Rejection
from scenewright.scene.relations import Pattern
from scenewright.scene.social import CollisionKind, ImpactPoint
from scenewright.tools.dsl_validator.parse import MAX_CLAUSES, format_clause, parse

_SERVES: dict[str, tuple[str, ...]] = {
    "collide_at": ("contact",),
    "near_miss": ("time_gap", "brakes_for"),
    "yield_to": ("gives_way",),
    "follow": ("headway",),
}
"""By relation: the clauses of which one must bind its two agents."""

_DIRECTED = frozenset({"gives_way", "headway"})
_EITHER_STRIKES = frozenset({"rear_end", "sideswipe", "head_on"})
"""Kinds of contact whose pattern says who plays which role."""

_GROUND = (OnRoad, OnWalkable)


class ProgramReply(BaseModel):
    """A constraint program, as clauses or in its text form."""

    model_config = ConfigDict(extra="forbid")

    program: str | None = None
    clauses: tuple[Clause, ...] | None = Field(default=None, max_length=MAX_CLAUSES)

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        if (self.program is None) == (self.clauses is None):
            raise ValueError("expected 'clauses', a list")
        return self

    def read(self) -> ConstraintProgram:
        """The program.

        Raises:
            Rejected: `malformed_program`; says where the text leaves the language.
        """
        if self.program is not None:
            return parse(self.program)
        return ConstraintProgram(clauses=self.clauses or ())


_SPEED_TOLD = re.compile(r"\bkm|kmh|mph|kph|m/s|per (hour|second)", re.IGNORECASE)
_AGENT: dict[str, Schema] = {"agent": shared("agent")}
_PAIR: dict[str, Schema] = {"first": shared("agent"), "second": shared("agent")}
_RANGE = {"low": number(0, 20), "high": number(0.1, 20)}
_METRES = {"metres": number(0.1, 200)}
_CONTACT: dict[str, Schema] = {
    "kind": one_of(get_args(CollisionKind)),
    "speed": number(0.1, 20),
    "point_first": shared("point"),
    "point_second": shared("point"),
    "cause": one_of(("late_brake",)),
}
_KEYS: dict[str, dict[str, Schema]] = {
    "min_length": _AGENT | _METRES,
    "speed": _AGENT | _RANGE,
    "passes_through": _AGENT | {"region": one_of(("crosswalk", "leg")), "leg": shared("leg")},
    "runs_red": _AGENT,
    "near": _PAIR | _METRES,
    "same_lane": _PAIR | _METRES,
    "headway": _PAIR | _RANGE,
    "before": _PAIR,
    "time_gap": _PAIR | _RANGE,
    "contact": _PAIR | _CONTACT,
    "gives_way": _PAIR,
    "brakes_for": _PAIR | _RANGE,
    "no_interaction": _PAIR,
}
"""By clause: its keys."""

Offer = Mapping[str, tuple[str, ...]]
"""Clauses that a program may hold, each with its keys."""


def offered(
    relations: Sequence[Mapping[str, Any]], *, violators: Sequence[str], instruction: str
) -> Offer:
    """What a program for these relations may need; a model need not hear of anything else.

    Args:
        relations: with the severity asked for, and under "wants" the clauses of their patterns.
    """
    wanted = [clause for each in relations for clause in each["wants"]]
    found = {clause["clause"] for clause in wanted}
    for each in relations:
        found |= set(_SERVES[each["type"]][:1])
        if "target_pet" in each:
            found.add("time_gap")
        if "target_ttc" in each or (each["type"] == "near_miss" and "cause" in each):
            found.add("brakes_for")
    found |= {"runs_red"} if violators else set()
    found |= {"speed"} if _SPEED_TOLD.search(instruction) else set()
    keys = {kind: tuple(_KEYS[kind]) for kind in _KEYS if kind in found}
    if "contact" in keys:
        keys["contact"] = (*_PAIR, *(key for key in _CONTACT if _told(key, wanted, relations)))
    return keys


def _told(
    key: str, wanted: Sequence[Mapping[str, Any]], relations: Sequence[Mapping[str, Any]]
) -> bool:
    """Whether a contact is to be closer described by this key."""
    if any(clause["clause"] == "contact" and key in clause for clause in wanted):
        return True
    match key:
        case "speed":
            return any("impact_speed" in each for each in relations)
        case "cause":
            return any(each.get("cause") == "late_brake" for each in relations)
        case "point_first" | "point_second":
            return any("point_from" in each or "point_to" in each for each in relations)
    return False


def program_schema(
    agents: Sequence[Mapping[str, str]],
    legs: Sequence[str],
    offer: Offer,
    relations: Sequence[Mapping[str, Any]] = (),
) -> Schema:
    """The reply's schema: agents and legs are those there are, clauses those that are offered.

    Clauses with the same keys are one alternative; of two agents, with each relation's own.

    Args:
        relations: as for `offered`.
    """
    alike: dict[tuple[str, ...], list[str]] = {}
    for kind, keys in (offer or {"min_length": tuple(_KEYS["min_length"])}).items():
        alike.setdefault((kind,) if kind == "contact" else keys, []).append(kind)
    forms = [
        form | {"properties": {**form["properties"], **pair}}
        for kinds in alike.values()
        for form in (_form(kinds, offer),)
        for pair in (_pairs(kinds, relations) if "first" in form["properties"] else ({},))
    ]
    named = {key for keys in offer.values() for key in keys}
    defs = {"agent": one_of(agent["id"] for agent in agents)}
    defs |= {"leg": one_of(legs)} if "leg" in named else {}
    defs |= {"point": one_of(get_args(ImpactPoint))} if "point_first" in named else {}
    # A weak model leaves a list empty where it may.
    least = 1 if relations else 0
    clauses = listed(forms[0] if len(forms) == 1 else {"anyOf": forms}, least=least, most=40)
    return closed({"clauses": clauses}, required=("clauses",), defs=defs)


def _pairs(kinds: Sequence[str], relations: Sequence[Mapping[str, Any]]) -> list[Schema]:
    """Who may be first and second: the two of a relation, one way round where it has but one."""
    found: list[Schema] = []
    for each in relations:
        ways = [(each["from"], each["to"])]
        wants = [c for c in each["wants"] if c["clause"] in kinds and "first" in c]
        ways += [(c["first"], c["second"]) for c in wants]
        if not _DIRECTED.issuperset(kinds):
            ways.append((each["to"], each["from"]))
        ends = {key: one_of(way[at] for way in ways) for at, key in enumerate(_PAIR)}
        found += [] if ends in found else [ends]
    return found or [dict(_PAIR)]


def _form(kinds: Sequence[str], offer: Offer) -> Schema:
    known = _KEYS[kinds[0]]
    keys = {key: known[key] for key in offer.get(kinds[0], known)}
    return closed(
        {"clause": one_of(kinds), **keys},
        required=("clause", *(key for key in keys if key not in _CONTACT)),
    )


def wanted_by(
    pattern: Pattern, *, from_: str, to: str, striker: str, struck: str
) -> list[dict[str, Any]]:
    """The clauses of a relation file about two agents, as plain values; the ground is left out."""
    program = parse("\n".join(pattern.filled(line, from_=from_, to=to) for line in pattern.clauses))
    found = []
    for clause in program.clauses:
        if isinstance(clause, Contact) and clause.kind not in _EITHER_STRIKES:
            clause = clause.model_copy(update={"first": striker, "second": struck})  # noqa: PLW2901
        if not isinstance(clause, _GROUND):
            told = clause.model_dump(mode="json", exclude_none=True)
            found.append({"clause": clause.clause, **told})
    return found


def on_the_ground(program: ConstraintProgram, pool: CandidateSet) -> ConstraintProgram:
    """The program and, for everybody of whom it says nothing, that the way lies on the ground."""
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
        named = (
            (clause.agent,) if isinstance(clause, UnaryClause) else (clause.first, clause.second)
        )
        for name in named:
            if name is not None and name not in pool.agents:
                raise _refused((name,), f"{format_clause(clause)}: there is no {name} in the scene")


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
            raise _refused(
                (first, second), f"{relation['type']} of {first} and {second} lacks {needed}"
            )


def _refused(agents: tuple[str, ...], detail: str) -> Rejected:
    return Rejected(
        Rejection(stage="waypoint_filter", code="malformed_program", agents=agents, detail=detail)
    )
