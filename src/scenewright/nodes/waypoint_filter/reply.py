"""What the filter may be told: the reply model, its schema for a scene, and what it must hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, model_validator

from scenewright.errors import Rejected
from scenewright.nodes.schema import Schema, closed, listed, number, one_of
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


def program_schema(agents: Sequence[Mapping[str, str]], legs: Sequence[str]) -> Schema:
    """The reply's schema: agents and legs are those there are."""
    names = [agent["id"] for agent in agents]
    anybody = one_of(names)
    drivers = one_of(name for name in names if name.startswith("vehicle"))
    pair = {"first": anybody, "second": anybody}
    metres, seconds = number(0.1, 200), {"low": number(0, 10), "high": number(0.1, 10)}
    kinds: dict[str, Schema] = {
        "min_length": {"agent": anybody, "metres": metres},
        "speed": {"agent": anybody, "low": number(0, 20), "high": number(0.1, 20)},
        "passes_through": {
            "agent": anybody,
            "region": one_of(("crosswalk", "leg")),
            "leg": one_of(legs),
        },
        "runs_red": {"agent": anybody},
        "same_lane": {**pair, "metres": metres},
        "headway": {**pair, "low": number(0.1, 10), "high": number(0.1, 10)},
        "before": pair,
        "time_gap": {**pair, **seconds},
        "contact": {
            **pair,
            "kind": one_of(get_args(CollisionKind)),
            "speed": number(0.1, 20),
            "point_first": one_of(get_args(ImpactPoint)),
            "point_second": one_of(get_args(ImpactPoint)),
            "cause": one_of(("late_brake",)),
        },
        "gives_way": pair,
    }
    if any(name.startswith("vehicle") for name in names):
        limits = {"low": number(0, 8), "high": number(0.1, 8)}
        kinds["brakes_for"] = {"first": drivers, "second": anybody, **limits}
    if len(names) < 2:
        kinds = {name: keys for name, keys in kinds.items() if "second" not in keys}
    return closed(
        {"clauses": listed({"anyOf": [_clause(name, kinds[name]) for name in kinds]}, most=40)},
        required=("clauses",),
    )


def _clause(name: str, keys: Mapping[str, Schema]) -> Schema:
    needed = ("first", "second") if name == "contact" else keys
    return closed({"clause": one_of((name,)), **keys}, required=("clause", *needed))


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
