"""The constraint program that follows from a plan: the clauses of every relation's file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import TypeAdapter, ValidationError

from scenewright.errors import Rejected, describe_misfit
from scenewright.scene.constraints import (
    Before,
    BrakesFor,
    Clause,
    ConstraintProgram,
    Contact,
    Headway,
    OnRoad,
    OnWalkable,
    RunsRed,
    StopsBehind,
    Strikes,
    TimeGap,
)
from scenewright.scene.kinds import get_kind, has_trait
from scenewright.scene.measures import Measure, get_aim
from scenewright.scene.rejection import Rejection
from scenewright.scene.relations import Pattern, get_pattern
from scenewright.tools.dsl_validator.parse import parse

_CLAUSE: TypeAdapter[Clause] = TypeAdapter(Clause)
_PET_BAND, _TTC_BAND = 0.05, 0.08
"""How far from the PET and the TTC asked for the clauses may be met [s]."""

_NEAR_MISS_PET = 1.4
"""A longer PET is a near miss only where an agent brakes hard [s] (SEMANTICS 4, less a margin)."""

_SHORT_HEADWAY = (0.9, 1.5)
"""Behind a leader whose way ends in a collision, so that there is time to be seen following [s]."""

_ANY_HEADWAY = (0.7, 3.4)
"""Of a vehicle that runs into its leader while that gives way [s]."""

_CLOSE_CALL = (0.7, 1.35)
"""Path TTC of a vehicle that brakes hard, where the text names none [s]."""


def write_program(facts: Mapping[str, Any]) -> ConstraintProgram:
    """The program of a planned scene.

    Args:
        facts: `relations` with their patterns and severity, `agents`, `kinds`: how one of them
            moves or reacts, `violators`, who run a red
            light, and `measures`, the figures asked for, as plain values.

    Raises:
        Rejected: `malformed_program`: a figure that no clause can hold.
    """
    try:
        return ConstraintProgram(clauses=tuple(dict.fromkeys(_list_clauses(facts))))
    except ValidationError as error:
        detail = f"{error.title}: {describe_misfit(error)}"
        rejection = Rejection(stage="waypoint_filter", code="malformed_program", detail=detail)
        raise Rejected(rejection) from error


def _list_clauses(facts: Mapping[str, Any]) -> list[Clause]:
    """Every relation's clauses, in order, then where the agents stay and which run red."""
    found: list[Clause] = []
    for relation in facts["relations"]:
        clauses = _list_relation_clauses(get_pattern(relation["pattern"]), relation)
        found += [_adapt_headway(clause, relation, facts["relations"]) for clause in clauses]
    for each in facts.get("measures", ()):
        found = _add_measure(Measure.model_validate(each), found)
    for agent in facts["agents"]:
        if agent["movement"] == "crossing":
            found.append(OnWalkable(agent=agent["id"]))
        elif agent["movement"] != "jaywalking":
            found.append(OnRoad(agent=agent["id"]))
    for each in facts.get("kinds", ()):
        lines = "\n".join(get_kind(each["axis"], each["kind"]).constraints)
        found += parse(lines.replace("{agent}", each["id"])).clauses
    return found + [RunsRed(agent=name) for name in facts["violators"]]


def _change(clause: Clause, **values: Any) -> Clause:
    """The clause with other values, validated again."""
    return _CLAUSE.validate_python({**clause.model_dump(), **values})


def _adapt_headway(
    clause: Clause, follow: dict[str, Any], relations: Sequence[dict[str, Any]]
) -> Clause:
    """The clause, if it is a headway, as what else happens to the leader allows it."""
    pair = {follow["from"], follow["to"]}
    hits = [relation for relation in relations if relation["type"] == "collide_at"]
    hits = [hit for hit in hits if follow["to"] in (hit["from"], hit["to"])]
    if not isinstance(clause, Headway) or not hits:
        return clause
    waits = any(r["type"] == "yield_to" and r["from"] == follow["to"] for r in relations)
    if {hits[0]["from"], hits[0]["to"]} != pair:
        low, high = _SHORT_HEADWAY
    elif waits:
        low, high = _ANY_HEADWAY
    else:
        return clause
    return _change(clause, low=low, high=high)


_CLAUSES = {"pet": "time_gap", "ttc": "brakes_for"}
"""Clauses by measures that are called otherwise."""


def _add_measure(measure: Measure, clauses: list[Clause]) -> list[Clause]:
    """The clauses with the measure; a bound that the text names takes the place of the file's."""
    name = _CLAUSES.get(measure.kind, measure.kind)
    agents = {"agent": measure.agent}
    if measure.other is not None:
        agents = {"first": measure.agent, "second": measure.other}
    written = [  # of that name, and about these agents in either order
        clause
        for clause in clauses
        if clause.clause == name
        and {getattr(clause, key, None) for key in agents} == set(agents.values())
    ]
    kept = [clause for clause in clauses if clause not in written]
    if name == "brakes_for" and not written:
        # Without hard braking, the figure is looked at on what comes about.
        return [*kept, _build_figure("ttc", agents, measure)]
    if name in _BESIDE:
        kept.append(_build_figure(_BESIDE[name], agents, measure))
    if written:
        agents = {key: getattr(written[0], key) for key in agents}
    return [*kept, _build_figure(name, agents, measure)]


_BESIDE = {"headway": "time_headway", "speed": "kept_speed"}
"""Clauses on the finished motion, beside those that candidates are chosen by."""


def _build_figure(name: str, agents: Mapping[str, str], measure: Measure) -> Clause:
    low, high = (float(f"{bound:.4g}") for bound in get_aim(measure))
    return _CLAUSE.validate_python({"clause": name, **agents, "low": low, "high": high})


def _list_relation_clauses(pattern: Pattern, relation: dict[str, Any]) -> list[Clause]:
    """The pattern's clauses, with the severity that the relation asks for."""
    clauses = _fill_pattern(pattern, relation)
    first = relation.get("first") or (relation[pattern.order] if pattern.order else None)
    order = _put_first(Before, relation, relation.get("first"))
    if relation["type"] == "collide_at":
        found = [_adapt_contact(e, relation) if isinstance(e, Contact) else e for e in clauses]
        strikes = relation[pattern.striker] if pattern.striker else None
        strikes = relation.get("strikes") or strikes
        return [*found, *order, *_put_first(Strikes, relation, strikes)]
    if any(isinstance(clause, StopsBehind) for clause in clauses):
        if (ttc := relation["target_ttc"]) is None:
            return clauses
        low, high = _widen(ttc, _TTC_BAND)
        return [
            _change(clause, low=low, high=high) if isinstance(clause, StopsBehind) else clause
            for clause in clauses
        ]
    if relation["type"] == "near_miss":
        return _adapt_near_miss([*clauses, *order], relation, first=first)
    pet = relation["target_pet"] if relation["type"] == "yield_to" else None
    return clauses if pet is None else [*clauses, _build_time_gap(relation, pet)]


def _fill_pattern(pattern: Pattern, relation: dict[str, Any]) -> list[Clause]:
    """The file's clauses about the two; a contact, but along one road, names the striker first."""
    names = {"from_": relation["from"], "to": relation["to"]}
    lines = "\n".join(pattern.fill(line, **names) for line in pattern.clauses)
    parts = {relation["from"]: relation["striker"], relation["to"]: relation["struck"]}
    return [
        _change(clause, first=parts[clause.first], second=parts[clause.second])
        if isinstance(clause, Contact) and not has_trait("collision", clause.kind, "no_order")
        else clause
        for clause in parse(lines).clauses
    ]


def _put_first(
    clause: type[Before | Strikes], relation: dict[str, Any], first: str | None
) -> list[Clause]:
    """The clause that the named one of the two passes first, or strikes; none without a name."""
    names = sorted((relation["from"], relation["to"]), key=lambda name: name != first)
    return [] if first is None else [clause(first=names[0], second=names[1])]


def _adapt_near_miss(
    clauses: list[Clause], relation: dict[str, Any], *, first: str | None
) -> list[Clause]:
    """A gap in time; or hard braking, where the text speaks of it, of a TTC or of a longer PET."""
    pet, ttc = relation["target_pet"], relation["target_ttc"]
    brakes = ttc is not None or has_trait("cause", relation["cause"], "late")
    brakes = brakes or (pet is not None and pet > _NEAR_MISS_PET)
    if pet is None and not brakes:
        return clauses
    # An agent that brakes lets the other pass first; the clause for that says so by itself.
    dropped = (TimeGap, BrakesFor, Before) if brakes else (TimeGap,)
    kept = [clause for clause in clauses if not isinstance(clause, dropped)]
    if brakes:
        kept.append(_build_brakes_for(relation, ttc, first=first))
    return kept if pet is None else [*kept, _build_time_gap(relation, pet)]


def _build_brakes_for(
    relation: dict[str, Any], ttc: float | None, *, first: str | None
) -> BrakesFor:
    """The named braker, else the second to pass, else the first vehicle; a TTC may be free."""
    names = [relation["striker"], relation["struck"]]
    names.sort(key=lambda name: name == first)
    names.sort(key=lambda name: not name.startswith("vehicle"))
    names.sort(key=lambda name: name != relation.get("braker"))
    low, high = _CLOSE_CALL if ttc is None else _widen(ttc, _TTC_BAND)
    return BrakesFor(first=names[0], second=names[1], low=low, high=high)


def _build_time_gap(relation: dict[str, Any], pet: float) -> TimeGap:
    low, high = _widen(pet, _PET_BAND)
    return TimeGap(first=relation["from"], second=relation["to"], low=low, high=high)


def _widen(target: float, band: float) -> tuple[float, float]:
    return round(max(target - band, 0.0), 3), round(target + band, 3)


def _adapt_contact(clause: Contact, relation: dict[str, Any]) -> Clause:
    """The contact clause with the speed, the points of impact and the braking asked for."""
    points = {relation["striker"]: relation["point_from"], relation["struck"]: relation["point_to"]}
    late = has_trait("cause", relation["cause"], "late") and clause.first.startswith("vehicle")
    speed = relation["impact_speed"]
    asked = {
        "speed": None if speed is None else float(f"{speed:.6g}"),
        "point_first": points[clause.first],
        "point_second": points[clause.second],
        "cause": relation["cause"] if late else None,
    }
    return _change(clause, **{key: value for key, value in asked.items() if value is not None})
