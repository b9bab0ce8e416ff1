"""The text form of the constraint language: text to typed tree and back (paper 3.3).

The language is described in docs/constraint-language.md; its grammar is `constraints.lark`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress
from functools import cache, lru_cache
from importlib.resources import files
from typing import cast, get_args

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedInput, UnexpectedToken
from pydantic import ValidationError

from scenewright.errors import Rejected
from scenewright.scene.base import Model
from scenewright.scene.constraints import (
    CONTACT_CAUSE,
    REACTS,
    AgentFigure,
    BrakesFor,
    Clause,
    ConstraintProgram,
    Contact,
    Headway,
    MinLength,
    Near,
    PairClause,
    PairFigure,
    PassesBeside,
    PassesThrough,
    Reacts,
    SameLane,
    SpeedBetween,
    StopsBehind,
    TimeGap,
    UnaryClause,
)
from scenewright.scene.kinds import KindOf, list_shipped
from scenewright.scene.measures import get_unit
from scenewright.scene.rejection import Rejection

MAX_BYTES = 20_000
MAX_CLAUSES = 200

_MODELS: dict[str, type[Model]] = {
    name: model
    for model in get_args(UnaryClause | PairClause)
    for name in get_args(model.model_fields["clause"].annotation)
}
_WORDS = {
    "VEHICLE": "a vehicle such as vehicle-1",
    "PEDESTRIAN": "a pedestrian such as pedestrian-1",
    "RIDER": "a rider such as cyclist-1",
    "KIND": "a kind of collision such as angle",
    "HOW": "a way of reacting such as swerves",
    "POINT": "a point of impact such as front_left",
    "LATE": "a cause of the contact",
    "_WITH": "'with'",
    "_ON": "'on'",
    "COMPASS": "a direction such as north",
    "CROSSWALK": "'crosswalk'",
    "LEG": "'leg'",
    "JUNCTION": "'junction'",
    "NUMBER": "a number",
    "_IN": "'in'",
    "_AT_LEAST": "'>='",
    "_AT_MOST": "'<='",
    "_METRES": "the unit 'm'",
    "_SECONDS": "the unit 's'",
    "_METRES_PER_SECOND": "the unit 'm/s'",
    "_METRES_PER_SECOND_2": "the unit 'm/s2'",
    "_PERCENT": "'%'",
    "_SEPARATOR": "a new line or ';'",
    "LPAR": "'('",
    "RPAR": "')'",
    "LSQB": "'['",
    "RSQB": "']'",
    "COMMA": "','",
}
_BOUNDS = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}
_FOUND = re.compile(r"[\w.+-]+(/\w+)?|.", re.DOTALL)
_LONGEST_QUOTE = 40


@lru_cache(maxsize=256)
def parse(text: str) -> ConstraintProgram:
    """The program that a text spells, clause for clause in its order.

    Requests of one kind share their programs, so the latest are remembered.

    Args:
        text: at most 20 kB and 200 clauses in the language of docs/constraint-language.md.

    Raises:
        Rejected: `waypoint_filter/malformed_program`; the detail names the line and column,
            what was expected there and what was found, or the value that cannot be.
    """
    size = len(text.encode("utf-8", "surrogatepass"))
    if size > MAX_BYTES:
        raise _build_refusal(f"the program has {size} bytes, the limit is {MAX_BYTES}")
    try:
        clauses = cast("list[Tree[Token]]", _build_parser().parse(text).children)
    except UnexpectedInput as error:
        raise _build_refusal(_describe_syntax_error(error, text=text)) from None
    if len(clauses) > MAX_CLAUSES:
        raise _build_refusal(f"the program has {len(clauses)} clauses, the limit is {MAX_CLAUSES}")
    return ConstraintProgram(clauses=tuple(_build_clause(tree) for tree in clauses))


def format_program(program: ConstraintProgram) -> str:
    """The program as text, one clause per line; `parse` gives the same program back."""
    return "\n".join(format_clause(clause) for clause in program.clauses)


def format_clause(clause: Clause) -> str:
    """One clause as text."""
    names = [clause.agent] if isinstance(clause, UnaryClause) else [clause.first, clause.second]
    arguments = [name for name in names if name is not None]
    if isinstance(clause, PassesThrough):
        arguments.append(clause.region if clause.leg is None else f"{clause.region} {clause.leg}")
    if isinstance(clause, Reacts):
        arguments.append(clause.how)
    if isinstance(clause, Contact):
        arguments += [clause.kind] if clause.kind else []
        arguments += [f"{_number(clause.speed)} m/s"] if clause.speed is not None else []
    return f"{clause.clause}({', '.join(arguments)}){_bound(clause)}"


@cache
def _build_parser() -> Lark:
    grammar = files("scenewright.tools.dsl_validator").joinpath("constraints.lark")
    text = grammar.read_text("utf-8")
    made = {"reactions": REACTS, "causes": CONTACT_CAUSE, "collisions": KindOf("collision")}
    words = {word: kinds.list_names() for word, kinds in made.items()}
    words["motions"] = tuple(k.clause for k in list_shipped("motion") if k.clause)
    for word, names in words.items():
        text = text.replace(f"<<{word}>>", "|".join(names))
    return Lark(text, parser="lalr", propagate_positions=True)


def _build_clause(tree: Tree[Token]) -> Clause:
    """The typed clause: the grammar keeps values in the order of the model's fields."""
    values = [None if token is None else str(token) for token in tree.children]
    clause = str(values.pop(0) if tree.data == "motion" else tree.data)
    model = _MODELS[clause]
    names = [name for name in model.model_fields if name != "clause"]
    try:
        fields = {"clause": clause, **dict(zip(names, values, strict=False))}
        return cast("Clause", model.model_validate(fields))
    except ValidationError as error:
        place = _place(tree.meta.line, tree.meta.column)
        detail = f"{place}: {clause}: {_describe_value_error(error)}"
        tokens = [child for child in tree.children if isinstance(child, Token)]
        names = [str(token) for token in tokens if token.type in {"VEHICLE", "PEDESTRIAN", "RIDER"}]
        raise _build_refusal(detail, agents=tuple(dict.fromkeys(names))) from None


def _build_refusal(detail: str, *, agents: tuple[str, ...] = ()) -> Rejected:
    return Rejected(
        Rejection(stage="waypoint_filter", code="malformed_program", agents=agents, detail=detail)
    )


def _place(line: int, column: int) -> str:
    return f"line {line}, column {column}"


def _describe_syntax_error(error: UnexpectedInput, *, text: str) -> str:
    """Where the text leaves the grammar, what could have stood there, and what does."""
    at = error.pos_in_stream
    # at the end of the text the parser points at the last token it read
    if at is None or (isinstance(error, UnexpectedToken) and error.token.type == "$END"):
        at = len(text)
    found = _FOUND.match(text, at)
    place = _place(text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at))
    # Read step by step, as the error itself also lists what merged parser states would take.
    steps = _build_parser().parse_interactive(text)
    with suppress(UnexpectedInput):
        steps.exhaust_lexer()
    expected = _format_terminals(steps.accepts())  # type: ignore[no-untyped-call]
    return f"{place}: expected {expected}, found {_quote(found)}"


def _quote(found: re.Match[str] | None) -> str:
    if found is None:
        return "the end of the text"
    if found[0] in "\r\n":
        return "the end of the line"
    word = found[0]
    return repr(word if len(word) <= _LONGEST_QUOTE else word[:_LONGEST_QUOTE] + "...")


def _format_terminals(terminals: Iterable[str]) -> str:
    """Alternatives in words; any clause may begin where one may, so they are named together."""
    names = {name for name in terminals if name != "$END"}
    if {"VEHICLE", "PEDESTRIAN"} <= names:
        return "an agent such as vehicle-1 or pedestrian-1"
    words = [word for name, word in _WORDS.items() if name in names]
    if names - set(_WORDS):
        return f"a clause ({', '.join(_MODELS)})"
    return " or ".join(words)


def _describe_value_error(error: ValidationError) -> str:
    """The first fault among a clause's values."""
    fault = error.errors(include_url=False)[0]
    field = ".".join(str(part) for part in fault["loc"])
    if fault["type"] in _BOUNDS:
        key, words = _BOUNDS[fault["type"]]
        return f"{field} must be {words} {fault['ctx'][key]:g}, got {fault['input']}"
    if fault["type"] == "value_error":
        return str(fault["ctx"]["error"])
    return f"{field} cannot be {str(fault['input'])[:_LONGEST_QUOTE]!r}"


def _bound(clause: Clause) -> str:
    """Write the part of a clause after its parentheses."""
    match clause:
        case MinLength() | SameLane():
            return f" >= {_number(clause.metres)} m"
        case Near():
            return f" <= {_number(clause.metres)} m"
        case Contact():
            where = (("with", clause.point_first), ("on", clause.point_second))
            points = "".join(f" {word} {point}" for word, point in where if point is not None)
            return points if clause.cause is None else f"{points} {clause.cause}"
        case SpeedBetween():
            return f" in [{_number(clause.low)}, {_number(clause.high)}] m/s"
        case PassesBeside():
            return f" in [{_number(clause.low)}, {_number(clause.high)}] m"
        case AgentFigure() | PairFigure():
            unit = get_unit(clause.clause)
            return f" in [{_number(clause.low)}, {_number(clause.high)}] {unit}"
        case TimeGap() | Headway() | BrakesFor() | StopsBehind():
            return f" in [{_number(clause.low)}, {_number(clause.high)}] s"
        case _:
            return ""


def _number(value: float) -> str:
    """The shortest digits that read back as the same number."""
    return repr(float(value)).removesuffix(".0")
