"""Constraints between the fields of a plan file, such as `vehicle-1.entry != vehicle-2.entry`."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, get_args

from scenewright.scene.base import AgentClass

_LONGEST = 300
NAMED = "|".join((*get_args(AgentClass), "object"))
"""First parts of ids of agents and objects, as a pattern."""
_FIELD = re.compile(
    rf"\b(?:(?:{NAMED})-\d+(?:\.\w+)+"
    r"|(?:agents|relations|ties|objects|measures)\[\d+\](?:\.\w+|\[\d+\])+"
    r"|context(?:\.\w+)+)"
)
_STEP = re.compile(r"[\w-]+")
_OPERATORS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.In: lambda a, b: a in b, ast.NotIn: lambda a, b: a not in b,
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
}  # fmt: skip


@dataclass(frozen=True)
class PlanConstraint:
    """A comparison that the values of a point must fulfil.

    Attributes:
        text: as written; fields: those that it names, in the order of `tree`'s names _0, _1, ...
    """

    text: str
    fields: tuple[str, ...]
    tree: ast.expr

    def holds(self, data: Mapping[str, Any]) -> bool:
        """Whether the values fulfil it; numbers are in SI units.

        Args:
            data: the fields of a plan as plain data.

        Raises:
            ValueError: a field that it names is not there, or the values cannot be compared.
        """
        values = {f"_{n}": _find_value(data, name) for n, name in enumerate(self.fields)}
        try:
            return bool(_evaluate(self.tree, values))
        except (TypeError, ZeroDivisionError, OverflowError) as error:
            raise ValueError(f"{self.text!r} cannot be computed: {error}") from error


def parse_constraint(text: Any) -> PlanConstraint:
    """The constraint that a text writes.

    Raises:
        ValueError: it is none.
    """
    what = "a comparison of fields such as vehicle-1.entry != vehicle-2.entry, numbers in SI units"
    if not isinstance(text, str) or len(text) > _LONGEST:
        raise ValueError(f"{what}, of at most {_LONGEST} characters")
    fields: list[str] = []

    def keep(found: re.Match[str]) -> str:
        fields.append(found[0])
        return f"_{len(fields) - 1}"

    try:
        tree = ast.parse(_FIELD.sub(keep, text.strip()), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ValueError(f"{what}, not {text!r}") from error
    if not fields or not isinstance(tree, ast.Compare | ast.BoolOp | ast.UnaryOp):
        raise ValueError(f"{what}, not {text!r}")
    for node in ast.walk(tree):
        if not isinstance(node, _ALLOWED):
            raise ValueError(f"{what}, with + - * / and or not in, not {text!r}")
    return PlanConstraint(text.strip(), tuple(fields), tree)


_ALLOWED = (
    ast.Compare, ast.BoolOp, ast.And, ast.Or, ast.UnaryOp, ast.Not, ast.USub, ast.BinOp,
    ast.Constant, ast.Name, ast.Load, ast.List, *_OPERATORS,
)  # fmt: skip


def _evaluate(node: ast.expr, values: Mapping[str, Any]) -> Any:
    """The value of an expression; a name that is no field is a word, such as west."""
    match node:
        case ast.Constant():
            return node.value
        case ast.Name():
            return values.get(node.id, node.id)
        case ast.List():
            return [_evaluate(elt, values) for elt in node.elts]
        case ast.UnaryOp():
            own = _evaluate(node.operand, values)
            return not own if isinstance(node.op, ast.Not) else -own
        case ast.BinOp():
            left, right = _evaluate(node.left, values), _evaluate(node.right, values)
            if not (isinstance(left, int | float) and isinstance(right, int | float)):
                raise TypeError(f"{left!r} or {right!r} is no number")
            return _OPERATORS[type(node.op)](left, right)
        case ast.BoolOp():
            both = (_evaluate(value, values) for value in node.values)
            return all(both) if isinstance(node.op, ast.And) else any(both)
        case ast.Compare():
            terms = [_evaluate(each, values) for each in (node.left, *node.comparators)]
            return all(
                _compare(type(op), a, b)
                for op, a, b in zip(node.ops, terms, terms[1:], strict=False)
            )
    raise TypeError(f"{ast.unparse(node)} is no value")


def _compare(operation: type, left: Any, right: Any) -> bool:
    if operation in (ast.In, ast.NotIn) and not isinstance(right, list):
        raise TypeError(f"after `in` comes a list such as [north, south], not {right!r}")
    if operation in (ast.Lt, ast.LtE, ast.Gt, ast.GtE) and not (
        isinstance(left, int | float) and isinstance(right, int | float)
    ):
        raise TypeError(f"{left!r} or {right!r} is no number")
    return bool(_OPERATORS[operation](left, right))


def _find_value(data: Mapping[str, Any], name: str) -> Any:
    """The value of a field; agents and objects are found by their ids.

    Raises:
        ValueError: the plan has no such field, or it is not set.
    """
    steps = _STEP.findall(name)
    value: Any = data
    if "-" in steps[0]:
        held, own = [*data.get("agents", ()), *data.get("objects", ())], steps.pop(0)
        value = next((each for each in held if each.get("id") == own), None)
    for step in steps:
        try:
            value = value[int(step) if isinstance(value, list) else step]
        except (KeyError, IndexError, TypeError, ValueError):
            value = None
    if value is None:
        raise ValueError(f"{name} is not set in this plan; a measure is measures[0].value")
    return value
