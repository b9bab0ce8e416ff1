"""Relation files with parsed clauses, so that a faulty one is reported before it is solved."""

from __future__ import annotations

import re

from scenewright.errors import InputError, Rejected
from scenewright.scene.base import Model
from scenewright.scene.constraints import (
    BrakesFor,
    Contact,
    GivesWay,
    Headway,
    PassesBeside,
    StopsBehind,
    TimeGap,
)
from scenewright.scene.relations import Pattern, get_pattern_file, load_patterns
from scenewright.scene.social import RelationType
from scenewright.tools.dsl_validator.parse import parse

_BROUGHT_ABOUT_BY: dict[RelationType, tuple[type[Model], ...]] = {
    "collide_at": (Contact,),
    "near_miss": (TimeGap, BrakesFor, StopsBehind, PassesBeside),
    "yield_to": (GivesWay,),
    "follow": (Headway, StopsBehind),
}
_PLACE = re.compile(r"line (\d+), column (\d+): (.*)", re.DOTALL)
_HOLE = re.compile(r"\{[^{}]*\}")


_checked: list[Pattern] = []
"""Those whose clauses have been read; each pattern is loaded once."""


def load_checked_patterns() -> tuple[Pattern, ...]:
    """Every pattern, its clauses read once as programs of the constraint language.

    Raises:
        InputError: a file is no relation, or a clause of it is none; says which, and where.
    """
    checked_patterns = load_patterns()
    known = {id(pattern) for pattern in _checked}
    for pattern in checked_patterns:
        if id(pattern) not in known:
            _check(pattern)
            _checked.append(pattern)
    return checked_patterns


def _check(pattern: Pattern) -> None:
    first, second = (
        "cyclist" if role.type == "rider" else role.type for role in (pattern.from_, pattern.to)
    )
    names = f"{first}-1", f"{second}-{2 if first == second else 1}"
    clauses: list[Model] = []
    for number, clause in enumerate(pattern.clauses):
        try:
            clauses += parse(pattern.fill(clause, from_=names[0], to=names[1])).clauses
        except Rejected as error:
            detail = _map_to_file(error.rejection.detail, clause, pattern, names)
            raise _build_refusal(pattern, f"constraints.{number}: {detail}") from None
    wanted = _BROUGHT_ABOUT_BY[pattern.relation]
    if not any(isinstance(clause, wanted) for clause in clauses):
        words = " or ".join(str(each.model_fields["clause"].default) for each in wanted)
        raise _build_refusal(
            pattern, f"constraints: a {pattern.relation} needs a clause {words}(...)"
        )


def _map_to_file(detail: str, clause: str, pattern: Pattern, names: tuple[str, str]) -> str:
    """What the parser says of a filled clause, said of the clause as it stands in the file."""
    found = _PLACE.fullmatch(detail)
    if found is None:
        return detail
    column = _map_column(int(found[2]), clause, pattern, names)
    why = found[3].replace(f"found '{names[0]}'", "found '{from}'")
    why = why.replace(f"found '{names[1]}'", "found '{to}'")
    return f"line {found[1]}, column {column}: {why}"


def _map_column(column: int, clause: str, pattern: Pattern, names: tuple[str, str]) -> int:
    """The column of a clause that a column of the filled clause comes from, both from 1."""
    shift = 0
    for hole in _HOLE.finditer(clause):
        filled = len(pattern.fill(hole[0], from_=names[0], to=names[1]))
        begins = hole.start() + shift
        if column - 1 < begins:
            break
        if column - 1 < begins + filled:
            return hole.start() + 1
        shift += filled - len(hole[0])
    return column - shift


def _build_refusal(pattern: Pattern, why: str) -> InputError:
    return InputError(f"{get_pattern_file(pattern)} is not a relation: {why}")
