"""The constraint program that follows from a plan: the clauses of every relation's file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scenewright.scene.constraints import ConstraintProgram
from scenewright.scene.measures import UNITS, Measure, get_aim
from scenewright.scene.relations import Pattern, get_pattern
from scenewright.tools.dsl_validator.parse import parse

_PET_BAND, _TTC_BAND = 0.05, 0.08
"""How far from the PET and the TTC asked for the clauses may be met [s]."""

_NEAR_MISS_PET = 1.4
"""A longer PET is a near miss only where somebody brakes hard [s] (SEMANTICS 4, less a margin)."""

_SHORT_HEADWAY = (0.9, 1.5)
"""Behind a leader whose way ends in a collision, so that there is time to be seen following [s]."""

_ANY_HEADWAY = (0.7, 3.4)
"""Of who runs into its leader while that gives way [s]."""

_RUN = "speed({}) in [2.5, 4.2] m/s"
_MOTIONS = {
    "runs": _RUN,
    "darts_out": _RUN,
    "stops_midway": "pauses({})",
    "turns_back": "turns_back({})",
    "passes_yellow": "runs_yellow({})",
}
"""By motion of an agent: the clause that brings it about."""

_CLOSE_CALL = (0.7, 1.35)
"""Path TTC of a vehicle that brakes hard, where the text names none [s]."""


def write_program(facts: Mapping[str, Any]) -> ConstraintProgram:
    """The program of a planned scene.

    Args:
        facts: `relations` with their patterns and severity, `agents`, `violators`, who run a red
            light, and `measures`, the figures asked for, as plain values.
    """
    return parse(_lines(facts))


def _lines(facts: Mapping[str, Any]) -> str:
    """Every relation's clauses, in order, then where everybody stays and who runs red."""
    lines: list[str] = []
    for relation in facts["relations"]:
        clauses = _clauses(get_pattern(relation["pattern"]), relation)
        lines += [_headway(line, relation, facts["relations"]) for line in clauses]
    for each in facts.get("measures", ()):
        lines = _measured(Measure.model_validate(each), lines)
    for agent in facts["agents"]:
        name = agent["id"]
        if agent["movement"] != "jaywalking":
            walks = agent["movement"] == "crossing"
            lines.append(f"{'on_walkable' if walks else 'on_road'}({name})")
    lines += [_MOTIONS[each["motion"]].format(each["id"]) for each in facts.get("motions", ())]
    lines += [f"no_reaction({name})" for name in facts.get("unreacting", ())]
    for agent in facts["violators"]:
        lines.append(f"runs_red({agent})")
    return "\n".join(dict.fromkeys(lines))


def _headway(line: str, follow: dict[str, Any], relations: list[dict[str, Any]]) -> str:
    """The clause, if it is a headway, as what else happens to the leader allows it."""
    pair = {follow["from"], follow["to"]}
    hits = [each for each in relations if each["type"] == "collide_at"]
    hits = [each for each in hits if follow["to"] in (each["from"], each["to"])]
    if not line.startswith("headway(") or not hits:
        return line
    waits = any(r["type"] == "yield_to" and r["from"] == follow["to"] for r in relations)
    if {hits[0]["from"], hits[0]["to"]} != pair:
        low, high = _SHORT_HEADWAY
    elif waits:
        low, high = _ANY_HEADWAY
    else:
        return line
    return f"{line.partition(' in ')[0]} in [{low:g}, {high:g}] s"


_CLAUSES = {"pet": "time_gap", "ttc": "brakes_for"}
"""Clauses by measures that are called otherwise."""


def _measured(measure: Measure, lines: list[str]) -> list[str]:
    """The program's lines with the measure; a bound that is told takes the place of the written."""
    name = _CLAUSES.get(measure.kind, measure.kind)
    low, high = get_aim(measure)
    bounds = f" in [{low:.4g}, {high:.4g}] {UNITS[measure.kind].unit}"
    pairs = [f"{measure.agent}, {measure.other}", f"{measure.other}, {measure.agent}"]
    heads = [f"{name}({pair})" for pair in pairs] if measure.other else [f"{name}({measure.agent})"]
    head = next((head for head in heads if any(head in line for line in lines)), heads[0])
    if name == "headway":
        lines = [*lines, f"time_headway({pairs[0]}){bounds}"]
    if name == "speed":
        lines = [*lines, f"kept_speed({measure.agent}){bounds}"]
    if name == "brakes_for" and not any(head in line for line in lines):
        # Without hard braking, the figure is looked at on what comes about.
        return [*lines, f"ttc({pairs[0]}){bounds}"]
    return [*(line for line in lines if not line.startswith(head)), head + bounds]


def _clauses(pattern: Pattern, relation: dict[str, Any]) -> list[str]:
    """The pattern's clauses, with the severity that the relation asks for."""
    names = {"from_": relation["from"], "to": relation["to"]}
    struck = {"from_": relation["striker"], "to": relation["struck"]}
    lines = [
        pattern.filled(line, **(struck if _names_striker(line) else names))
        for line in pattern.clauses
    ]
    first = relation.get("first") or (relation[pattern.order] if pattern.order else None)
    if relation["type"] == "collide_at":
        lines = [
            _contact(each, relation) if each.startswith("contact(") else each for each in lines
        ]
        return [*lines, *_before(relation)]
    if pattern.manoeuvre == "lead_brakes":
        return [_stop(line, relation) for line in lines]
    if relation["type"] == "near_miss":
        return _near_miss([*lines, *_before(relation)], relation, first=first)
    pet = relation["target_pet"] if relation["type"] == "yield_to" else None
    return lines if pet is None else [*lines, _time_gap(relation, pet)]


def _before(relation: dict[str, Any]) -> list[str]:
    """The order of passing that the text asks for."""
    first, names = relation.get("first"), [relation["from"], relation["to"]]
    if first is None:
        return []
    names.sort(key=lambda name: name != first)
    return [f"before({', '.join(names)})"]


def _near_miss(lines: list[str], relation: dict[str, Any], *, first: str | None) -> list[str]:
    """A gap in time; or hard braking, where the text speaks of it, of a TTC or of a longer PET."""
    pet, ttc = relation["target_pet"], relation["target_ttc"]
    brakes = ttc is not None or relation["cause"] == "late_brake"
    brakes = brakes or (pet is not None and pet > _NEAR_MISS_PET)
    if pet is None and not brakes:
        return lines
    # Who brakes lets the other pass first; the clause for that says so by itself.
    dropped = ("time_gap(", "brakes_for(", "before(") if brakes else ("time_gap(",)
    kept = [line for line in lines if not line.startswith(dropped)]
    if brakes:
        kept.append(_brakes_for(relation, ttc, first=first))
    return kept if pet is None else [*kept, _time_gap(relation, pet)]


def _brakes_for(relation: dict[str, Any], ttc: float | None, *, first: str | None) -> str:
    """The named braker, else who passes second, else the first vehicle; a TTC may be free."""
    names = [relation["striker"], relation["struck"]]
    names.sort(key=lambda name: name == first)
    names.sort(key=lambda name: not name.startswith("vehicle"))
    names.sort(key=lambda name: name != relation.get("braker"))
    low, high = _CLOSE_CALL if ttc is None else _around(ttc, _TTC_BAND)
    return f"brakes_for({', '.join(names)}) in [{low:g}, {high:g}] s"


def _stop(line: str, relation: dict[str, Any]) -> str:
    """The clause, if it is a stop behind the leader, with the path TTC asked for."""
    ttc = relation["target_ttc"]
    if ttc is None or not line.startswith("stops_behind("):
        return line
    low, high = _around(ttc, _TTC_BAND)
    return f"{line.partition(' in ')[0]} in [{low:g}, {high:g}] s"


def _time_gap(relation: dict[str, Any], pet: float) -> str:
    low, high = _around(pet, _PET_BAND)
    return f"time_gap({relation['from']}, {relation['to']}) in [{low:g}, {high:g}] s"


def _around(target: float, band: float) -> tuple[float, float]:
    return round(max(target - band, 0.0), 3), round(target + band, 3)


def _contact(line: str, relation: dict[str, Any]) -> str:
    """The contact clause with the speed, the points of impact and the braking asked for."""
    speed = relation["impact_speed"]
    line, _, cause = line.partition(") ")
    line = line.removesuffix(")") + (")" if speed is None else f", {speed:g} m/s)")
    points = {relation["striker"]: relation["point_from"], relation["struck"]: relation["point_to"]}
    first = line[len("contact(") :].split(",")[0]
    second = next(name for name in points if name != first)
    for word, name in (("with", first), ("on", second)):
        line += f" {word} {points[name]}" if points[name] is not None else ""
    late = relation["cause"] == "late_brake" and first.startswith("vehicle")
    cause = "late_brake" if late else cause
    return f"{line} {cause}" if cause else line


def _names_striker(line: str) -> bool:
    """Contacts in which one drives into the other, whoever plays which role of the pattern."""
    return line.startswith("contact(") and not any(
        kind in line for kind in ("rear_end", "sideswipe", "head_on")
    )
