"""The plan as a file: YAML that people write by hand, and what is wrong with it, line by line."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from itertools import islice, product
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from scenewright.errors import InputError
from scenewright.scene.base import (
    FieldError,
    FieldErrors,
    Model,
    find_model,
    find_model_at,
    list_fields,
    quote_value,
)
from scenewright.scene.kinds import list_values
from scenewright.scene.leg_predicates import LEG_FIELDS, check_predicate, find_legs, is_predicate
from scenewright.scene.map import IntersectionMap
from scenewright.scene.measures import UNITS
from scenewright.scene.osc_dsl import parse_osc_dsl, write_osc_dsl
from scenewright.scene.plan_constraints import PlanConstraint, parse_constraint
from scenewright.scene.social import (
    UNIT_OF,
    AgentNode,
    Meeting,
    ObjectNode,
    SocialGraph,
    get_figure,
)
from scenewright.scene.spread import Spread, check_spread, read_number, read_spread, read_time_span

MOST_BYTES = 1 << 18
"""Longest plan file."""
MOST_CHOICES = 200
"""Combinations of listed values of one plan."""
_WHOLE = ("members", "vehicles", "pedestrians")
"""Fields that count."""
_LISTS = ("agents", "relations", "ties", "objects", "measures", "said", "others", "lead", "figure")
"""Fields that hold lists; a list in any other field offers values to choose from."""
_SINGLE = ("text", "read_as", "id", "context", "background")
"""Fields that cannot be left open."""
_HEAD = """\
# A plan: what shall happen, as the solver gets it. Change it, then
#   scenewright plan FILE   checks it,
#   scenewright make FILE   makes the scene.
# A field in a comment is left free. Numbers may have a unit: 30 km/h, 1.5 s, 12 ft.
"""
_TEXT_HELP = "the words it was read from; once a field is changed, the fields alone count"
_READ_HELP = "digest of the fields as they were read"
_SAID_HELP = """\
# What the words became. Entries that became constraint or behavior hold what no field above does,
# and always count; the others belong to the text and change nothing.
"""
Path_ = tuple[str | int, ...]


class PlanFault(InputError):
    """What is wrong with fields of a file, a line each, in the order of the file.

    Attributes:
        faults: what is wrong, by the path of the field.
    """

    def __init__(self, name: str, lines: Mapping[Path_, int], faults: Mapping[Path_, str]) -> None:
        told = []
        for path, what in faults.items():
            held = next((path[:n] for n in range(len(path), -1, -1) if path[:n] in lines), None)
            line = "" if held is None else f", line {lines[held]}"
            where = f", {format_path(path)}" if path else ""
            told.append((lines.get(held or (), 0), f"{name}{line}{where}: {what}"))
        super().__init__(*(text for _, text in sorted(told, key=lambda each: each[0])))
        self.faults = dict(faults)


@dataclass(frozen=True)
class PlanFile:
    """A plan with what its file says of it.

    Attributes:
        text: words that it was read from; "" where there were none.
        as_read: no field was changed since, so the words say what shall happen.
        name, lines: of the file, and the line of each field by its path.
    """

    plan: SocialGraph
    text: str = ""
    as_read: bool = False
    name: str = field(default="plan", compare=False)
    lines: Mapping[Path_, int] = field(default_factory=dict, compare=False)


@dataclass(frozen=True)
class LogicalPlan:
    """A plan that leaves values open.

    Attributes:
        data: the fields as plain data, as the file has them; spreads: what is left open, by path.
        legs: what the leg of a field has, by path; each is any leg of a place that has it.
        places: intersections by name, () where the file names none; `any` is all there are.
        constraints: what the values of a point must fulfil.
    """

    name: str
    data: dict[str, Any]
    lines: Mapping[Path_, int] = field(default_factory=dict)
    spreads: dict[Path_, Spread] = field(default_factory=dict)
    legs: dict[Path_, str] = field(default_factory=dict)
    places: tuple[str, ...] = ()
    constraints: tuple[PlanConstraint, ...] = ()

    def place_at(self, place: IntersectionMap) -> LogicalPlan:
        """The plan with the legs of an intersection in place of what they shall have.

        Raises:
            InputError: no leg there has it; names the line and the field.
        """
        found = {at: find_legs(predicate, place) for at, predicate in self.legs.items()}
        none = {
            at: f"no leg of {place.name} {self.legs[at].strip()}"
            for at, legs in found.items()
            if not legs
        }
        if none:
            raise PlanFault(self.name, self.lines, none)
        # In the order of the file, so that a predicate in place of a list changes no point.
        spreads = {**{at: Spread("list", legs) for at, legs in found.items()}, **self.spreads}
        ordered = {path: spreads[path] for path in sorted(spreads, key=self.get_line)}
        return replace(self, spreads=ordered, legs={})

    def describe_open(self) -> dict[str, str]:
        """What each field that is left open may be, as the file has it, by the field's name."""
        told = {}
        for path in sorted({**self.spreads, **self.legs}, key=self.get_line):
            value: Any = self.data
            for step in path:
                value = value[step]
            some = value if isinstance(value, list) else [value]
            told[format_path(path)] = " or ".join(map(str, some))
        return told

    def get_line(self, path: Path_) -> int:
        """The line of a field; 0 where the plan is no file."""
        return self.lines.get(path, 0)

    def format_osc_dsl(self) -> str:
        """The plan in OpenSCENARIO DSL, which `read_logical_plan` reads back."""
        return write_osc_dsl(
            Path(self.name).stem, self.data, spreads=self.spreads, legs=self.legs,
            places=self.places,
            constraints=tuple(constraint.text for constraint in self.constraints),
        )  # fmt: skip

    def find_broken(self, values: Mapping[Path_, Any]) -> PlanFault | None:
        """The first constraint that a point's values do not fulfil; None where all hold.

        Raises:
            PlanFault: a constraint cannot be computed.
        """
        data = self.settle_data(values)
        for n, each in enumerate(self.constraints):
            try:
                if not each.holds(data):
                    return PlanFault(
                        self.name, self.lines, {("constraints", n): f"{each.text} does not hold"}
                    )
            except ValueError as error:
                raise PlanFault(self.name, self.lines, {("constraints", n): str(error)}) from error
        return None

    def settle(self, values: Mapping[Path_, Any]) -> PlanFile:
        """The plan with a value for each field that was left open.

        Raises:
            InputError: it is no plan; names the line and the field.
        """
        return _build_plan(self.settle_data(values), self.name, self.lines)

    def settle_data(self, values: Mapping[Path_, Any]) -> dict[str, Any]:
        """The fields as plain data, with a value for each that was left open."""
        data: dict[str, Any] = json.loads(json.dumps(self.data))
        for path, value in values.items():
            target: Any = data
            for step in path[:-1]:
                target = target[step]
            target[path[-1]] = value
        return data


def read_logical_plan(source: str | Path | Mapping[str, Any]) -> LogicalPlan:
    """The plan in a file or a mapping, its open values read but not settled.

    Raises:
        InputError: unreadable, or no plan; names the line and the field.
    """
    if isinstance(source, Mapping):
        name, lines = "plan", dict[Path_, int]()
        try:
            data = json.loads(json.dumps(source))
        except (TypeError, ValueError, RecursionError) as error:
            raise InputError(f"plan: {error}") from error
    else:
        name = str(source)
        if name.lower().endswith(".osc"):
            data, lines = parse_osc_dsl(_read_text(Path(source)), name)
        else:
            data, lines = read_yaml(Path(source))
    if not isinstance(data, dict):
        what = "is empty" if data is None else "holds no fields such as 'agents: ...'"
        missing = f"{what}; `scenewright plan TEXT --yaml` writes one to begin"
        raise PlanFault(name, lines, {(): missing})
    faults: dict[Path_, str] = {}
    places, written = data.pop("intersections", None), data.pop("constraints", None) or []
    if isinstance(places, str):
        places = [places]
    named = isinstance(places, list) and all(isinstance(place, str) and place for place in places)
    if places is not None and not named:
        faults["intersections",] = "any, the name of an intersection, or a list of names"
        places = None
    if not isinstance(written, list):
        faults["constraints",] = "is a list of comparisons"
        written = []
    constraints = []
    for n, text in enumerate(written):
        try:
            constraints.append(parse_constraint(text))
        except ValueError as error:
            faults["constraints", n] = str(error)
    plan = LogicalPlan(name, data, lines, {}, {}, tuple(places or ()), tuple(constraints))
    faults |= _read_values(plan, data, ())
    faults = _check_choices(plan, known=faults.keys()) | faults
    if faults:
        raise PlanFault(name, lines, faults)
    return plan


def _check_choices(plan: LogicalPlan, known: Set[Path_]) -> dict[Path_, str]:
    """What is wrong with fields, or a word of a list, whatever the open values are.

    Args:
        known: fields that are wrong by themselves.
    """
    words = {
        at: tuple(value for value in spread.values if isinstance(value, str))
        for at, spread in plan.spreads.items()
        if spread.kind == "list" and at[-1] != "value"
    }
    middle = {at: spread.compute_value(0.5) for at, spread in plan.spreads.items()}
    base = {**middle, **dict.fromkeys(plan.legs)}
    found: dict[Path_, str] = {}
    for at, word in [(None, ""), *((at, each) for at, own in words.items() for each in own)]:
        others = {key: values for key, values in words.items() if values and key != at}
        always: dict[Path_, str] | None = None
        for chosen in islice(product(*others.values()), MOST_CHOICES):
            values = {**base, **dict(zip(others, chosen, strict=True))}
            values |= {} if at is None else {at: word}
            try:
                _build_plan(plan.settle_data(values), plan.name, plan.lines, known)
                own: dict[Path_, str] = {}
            except PlanFault as error:
                own = error.faults
            kept = own.keys() if at is None else own.keys() & {at}
            always = {key: own[key] for key in kept if always is None or key in always}
            if not always:
                break
        for key, what in (always or {}).items():
            if key == at or not {key, (*key[:2], "value")} & plan.spreads.keys():
                found.setdefault(key, what)
    return found


def read_plan(source: str | Path | Mapping[str, Any]) -> PlanFile:
    """The plan in a file or a mapping.

    Raises:
        InputError: unreadable, or no plan; names the line and the field.
    """
    logical = read_logical_plan(source)
    several = "several values; `scenewright sweep` makes scenes of them, `make` needs one"
    open_ = [at for at, spread in logical.spreads.items() if spread.kind != "times"]
    left = dict.fromkeys((*open_, *logical.legs), several)
    if logical.places:
        left["intersections",] = "is read by `scenewright sweep`; others have --intersection"
    if left:
        raise PlanFault(logical.name, logical.lines, left)
    if (broken := logical.find_broken({})) is not None:
        raise broken
    return logical.settle({})


def _read_text(path: Path) -> str:
    try:
        if path.exists() and not path.is_file():
            raise InputError(f"cannot read {path}: it is no file")
        with path.open("rb") as stream:
            data = stream.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise InputError(f"{path} is longer than {MOST_BYTES:,} bytes")
        return data.decode("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot read {path}: {reason}") from error


class _Loader(yaml.SafeLoader):
    """YAML of plain values: 17:30 and `no` are words, and nothing stands for something else."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012 - the name is yaml's

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark
            raise yaml.composer.ComposerError(None, None, "an alias; write it out", mark)
        return super().compose_node(parent, index)


for _tag, _pattern, _first in (
    ("null", r"(?:~|null|)", ["~", "n", ""]),
    ("bool", r"(?:true|false)", ["t", "f"]),
    ("int", r"[-+]?\d+", list("-+0123456789")),
    ("float", r"[-+]?\d+\.\d*(?:e[-+]?\d+)?|[-+]?\d+e[-+]?\d+", list("-+0123456789")),
):
    _Loader.add_implicit_resolver(
        f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), _first
    )


def read_yaml(path: Path) -> tuple[Any, dict[Path_, int]]:
    """The values of a file, and the line of each by its path.

    Raises:
        InputError: unreadable, or not YAML of plain values; names the line.
    """
    # What YAML takes for a line's end, and no editor does, must not shift the lines of faults.
    text = re.sub("[\x85\u2028\u2029]", " ", re.sub("\r\n?", "\n", _read_text(path)))
    name = str(path)
    lines: dict[Path_, int] = {}
    try:
        node = _Loader(text).get_single_node()
        if node is None:
            return None, {(): 1}
        faults: dict[Path_, str] = {}
        data = _build_plain(node, (), lines, faults)
        if faults:
            raise PlanFault(name, lines, faults)
        return data, lines
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = error.problem or "not YAML"
        if "\\t" in problem or "\t" in text.split("\n")[mark.line]:
            raise _build_syntax_error(text, mark.line, name, "a tab; indent with spaces") from error
        line, begun = mark.line, (error.context_mark or mark).line
        for pattern, words, opened in _SYNTAX:
            if re.search(pattern, problem):
                line, problem = begun if opened else line, words
                break
        raise _build_syntax_error(text, line, name, problem) from error
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, int(error.position))
        raise _build_syntax_error(text, line, name, "a character that YAML forbids") from error
    except RecursionError as error:
        raise InputError(f"{name}: nested too deeply") from error


_SYNTAX = (
    ("end of stream", "it is opened here and closed nowhere", True),
    ("expected ',' or", "a bracket is opened here and not closed before the next entry", True),
    ("expected ':'", "a field is written as `name: value`, with a space after the colon", True),
    ("block end", "not indented as the line before; entries beside one another are alike", False),
    ("mapping values", "a second colon; put quotes around the value", False),
    ("cannot start any token", "a value that begins with such a sign needs quotes", False),
    ("another document", "a file holds one plan, without `---` in it", False),
)
"""What the parser finds, what to say of it, and whether the fault is where its token begins."""


def _build_syntax_error(text: str, line: int, name: str, problem: str) -> InputError:
    """The error at a line (from 0), with its first word, or the last key before a line without."""
    lines = text.split("\n")
    if "second colon" in problem and line and re.fullmatch(r"\s*[\w-]+\s*", lines[line - 1]):
        line, problem = line - 1, "a colon is missing, as in `name: value`"
    for above in reversed(lines[: line + 1]):
        if key := re.match(r"[\s\-{\[]*([A-Za-z][\w-]*)", above):
            return InputError(f"{name}, line {line + 1}, {key[1]}: {problem}")
    return InputError(f"{name}, line {line + 1}: {problem}")


def _build_plain(
    node: yaml.Node, path: Path_, lines: dict[Path_, int], faults: dict[Path_, str]
) -> Any:
    """Plain data of a node; the line of every field goes to `lines`, what is wrong to `faults`."""
    lines.setdefault(path, node.start_mark.line + 1)
    kind = node.tag.removeprefix("tag:yaml.org,2002:")
    if isinstance(node, yaml.MappingNode) and kind == "map":
        found: dict[str, Any] = {}
        for key, value in node.value:
            at = (*path, str(key.value) if isinstance(key, yaml.ScalarNode) else "?")
            if at[-1] in found:
                faults[at] = f"is there twice, first in line {lines[at]}"
            lines[at] = key.start_mark.line + 1
            found[str(at[-1])] = _build_plain(value, at, lines, faults)
        return found
    if isinstance(node, yaml.SequenceNode) and kind == "seq":
        return [_build_plain(each, (*path, n), lines, faults) for n, each in enumerate(node.value)]
    if isinstance(node, yaml.ScalarNode) and kind in ("str", "null", "bool", "int", "float"):
        try:
            return _CONVERT[kind](node.value)
        except ValueError:
            faults[path] = "too long a number"
    else:
        faults[path] = f"the tag {node.tag} is not read; write plain values"
    return None


_CONVERT: dict[str, Any] = {
    "str": str, "null": lambda _: None, "bool": "true".__eq__, "int": int, "float": float,
}  # fmt: skip


def format_path(path: Path_) -> str:
    """A field as people write it, such as `relations[0].target_pet`."""
    parts = (f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return "".join(parts).removeprefix(".")


def _read_values(plan: LogicalPlan, data: Any, path: Path_) -> dict[Path_, str]:
    """Turn numbers with a unit into SI, in place, and add the fields that are left open to a plan;
    what is wrong with others."""
    faults: dict[Path_, str] = {}
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in list(items):
        at = (*path, key)
        field_name = key if isinstance(key, str) else path[-1] if path else ""
        if isinstance(value, dict) or (isinstance(value, list) and field_name in _LISTS):
            faults |= _read_values(plan, value, at)
            continue
        if field_name in _SINGLE or (path and path[0] == "said"):
            continue
        unit = _find_unit(str(field_name), data)
        spread: Spread | None = None
        try:
            if field_name in LEG_FIELDS and is_predicate(value):
                check_predicate(value)
                plan.legs[at] = value
                continue
            if isinstance(value, bool) and (unit or field_name in _WHOLE):
                raise ValueError(f"a number, not {json.dumps(value)}")
            if isinstance(value, list):
                spread = Spread("list", tuple(read_number(v, unit) for v in value))
            elif isinstance(value, str) and (unit or field_name in _WHOLE):
                spread = read_spread(value, unit, whole=field_name in _WHOLE)
                if spread is None:
                    data[key] = read_number(value, unit)
            elif isinstance(value, str) and field_name == "time_of_day":
                spread = read_time_span(value)
            if spread is not None:
                check_spread(spread)
                plan.spreads[at] = spread
        except ValueError as error:
            faults[at] = str(error)
    return faults


def _find_unit(name: str, holder: Any) -> str | None:
    """The unit of a field; that of a figure depends on what is asked for."""
    if name in ("low", "high", "value") and isinstance(holder, dict):
        kind = holder.get("kind")
        return UNITS[kind].unit if isinstance(kind, str) and kind in UNITS else None
    if name == "figure":
        return "any"
    return UNIT_OF.get(name)


def _build_plan(
    data: dict[str, Any], name: str, lines: Mapping[Path_, int], known: Set[Path_] = frozenset()
) -> PlanFile:
    """The plan of plain data.

    Args:
        known: fields that are wrong, and need not be named once more.

    Raises:
        PlanFault: it is none; names all other fields that are wrong.
    """
    faults: dict[Path_, str] = {}
    text, digest = data.pop("text", None), data.pop("read_as", None)
    for key, value in (("text", text), ("read_as", digest)):
        if not isinstance(value, str | None):
            faults[key,] = "must be words"
    # Fill in what is plain from the rest: sections without content, classes, bounds of a value.
    for key in [key for key, value in data.items() if value is None]:
        del data[key]
    data.setdefault("agents", [])
    agents, measures = data.get("agents"), data.get("measures")
    for agent in agents if isinstance(agents, list) else ():
        if isinstance(agent, dict) and isinstance(agent.get("id"), str):
            agent.setdefault("type", agent["id"].partition("-")[0])
    for n, each in enumerate(measures if isinstance(measures, list) else ()):
        if isinstance(each, dict) and "value" in each:
            value, kind = each.pop("value"), each.get("kind")
            if not (isinstance(kind, str) and kind in UNITS):
                each.update(low=0.0, high=0.0)  # the kind is wrong, whatever its value
                continue
            slack = UNITS[kind].tolerance
            if not isinstance(value, int | float) or {"low", "high"} & each.keys():
                what = "is one number, and stands in place of low and high"
                faults["measures", n, "value"] = what
                value = 0.0
            each.update(low=max(value - slack, 0.0), high=value + slack)
    plan = _validate(data, faults, lines, known)
    if faults := {path: what for path, what in faults.items() if path not in known}:
        raise PlanFault(name, lines, faults)
    if plan is None:
        raise PlanFault(name, lines, dict.fromkeys(known, "is wrong"))
    as_read = bool(text) and digest == compute_digest(plan, text)
    return PlanFile(plan, text or "", as_read, name, lines)


def _validate(
    data: dict[str, Any], faults: dict[Path_, str], lines: Mapping[Path_, int], known: Set[Path_]
) -> SocialGraph | None:
    """The plan; None where it is none, with what is wrong in `faults`.

    A field that is wrong hides what is wrong with those that are checked after it, so it is left
    out, and what remains is checked again.
    """
    spots = {name: list(range(len(own))) for name, own in data.items() if isinstance(own, list)}
    lost: set[str] = set()
    turn = -1
    while True:
        turn += 1
        try:
            return SocialGraph.model_validate(data)
        except RecursionError:
            faults[()] = "nested too deeply"
            return None
        except ValidationError as error:
            found = describe_faults(error, lines)
        entries: set[tuple[str, int]] = set()
        for path, what in found.items():
            at = path
            if len(path) > 1 and (section := str(path[0])) in spots:
                entries.add((section, n := int(path[1])))
                at = (section, spots[section][n], *path[2:])
            # An entry that is wrong may be what others need.
            needs = path[:1] == ("objects",) or path[-1:] == ("manoeuvre",)
            left_out = (turn and what == _MISSING) or (needs and "relations" in lost)
            if at not in known and not left_out:
                faults.setdefault(at, what)
        if any(_leave_out(data, path) for path in found):
            continue
        lost |= {section for section, _ in entries}
        if not entries or "agents" in lost:
            return None
        for section, n in sorted(entries, reverse=True):
            del data[section][n], spots[section][n]


def _leave_out(data: Any, path: Path_) -> bool:
    """Take a field out of plain data; whether it was there."""
    for step in path[:-1]:
        data = data.get(step) if isinstance(data, dict) else data[step]
    if not path or not isinstance(data, dict) or path[-1] not in data:
        return False
    del data[path[-1]]
    return True


def describe_faults(
    error: ValidationError, lines: Mapping[Path_, int], model: type[Model] = SocialGraph
) -> dict[Path_, str]:
    """What is wrong with the fields of a file, and what would do, by their paths."""
    found: dict[Path_, str] = {}
    meant: set[Path_] = set()
    for each in error.errors(include_url=False):
        cause = each.get("ctx", {}).get("error")
        own = cause.faults if isinstance(cause, FieldErrors) else (cause,)
        for fault in own:
            path: Path_ = tuple(each["loc"])
            path = (*path, *fault.at) if isinstance(fault, FieldError) else path
            known = _list_fields_at(path[:-1], model) if each["type"] == "extra_forbidden" else []
            near = get_close_matches(str(path[-1]), known, 1) if path else []
            meant |= {(*path[:-1], name) for name in near}
            what = str(fault) if isinstance(fault, FieldError) else _word_fault(each, path, model)
            if known:
                says = f"; is {near[0]} meant?" if near else f"; there are {', '.join(known)}"
                if str(path[-1])[:1].isdigit():
                    says = "; a comma ends a field, decimals have a point, such as 1.2"
                what = f"there is no such field{says}"
            if path[2:] in (("low",), ("high",)) and (*path[:2], "value") in lines:
                path = (*path[:2], "value") if path[0] == "measures" else path
            found.setdefault(path, what)
    # A field that is missing was meant by another one's name.
    return {path: what for path, what in found.items() if path not in meant}


def _word_fault(fault: ErrorDetails, path: Path_, model: type[Model]) -> str:
    """What would do in a field, and what stands there instead."""
    last, given = str(path[-1]) if path else "", fault["input"]
    match fault["type"]:
        case "missing":
            return _MISSING
        case "literal_error":
            return f"must be {fault['ctx']['expected']}, not {_quote(given)}"
        case _ if last == "time_of_day":
            return f'a clock time such as "08:00" or a span "07:00-09:30", not {_quote(given)}'
        case "string_pattern_mismatch":
            return f"a name such as {_EXAMPLES.get(last, 'vehicle-1')}, not {_quote(given)}"
        case "model_type" | "model_attributes_type":
            return f"holds fields such as {', '.join(_list_fields_at(path, model)[:3])}"
    what = fault["msg"].removeprefix("Value error, ")
    wanted = _WANTED.get(fault["type"])
    what = wanted.format(**fault.get("ctx", {})) if wanted else f"{what[0].lower()}{what[1:]}"
    if fault["type"] == "tuple_type":  # a list has no unit, and what is given may be a range
        return what
    return f"{what} {UNIT_OF.get(last, '')}".rstrip() + f", not {_quote(given)}"


_MISSING = "is missing"
_WANTED = {
    "tuple_type": "a list, such as [0.8, 2.0], or with '- ' before each entry",
    "int_parsing": "a whole number", "int_from_float": "a whole number",
    "int_type": "a whole number", "float_parsing": "a number", "float_type": "a number",
    "bool_parsing": "true or false", "bool_type": "true or false", "string_type": "one word",
    "greater_than_equal": "at least {ge:g}", "less_than_equal": "at most {le:g}",
    "greater_than": "above {gt:g}", "less_than": "below {lt:g}",
    "too_long": "at most {max_length} entries",
}  # fmt: skip
"""What a field wants, by the kind of fault."""
_EXAMPLES = {"id": "vehicle-1, pedestrian-1 or object-1", "beyond": "object-1"}


def _quote(value: Any) -> str:
    if value is None or isinstance(value, dict | list | tuple):
        return "nothing" if value is None else "a list or mapping"
    return quote_value(value)


def _list_fields_at(path: Path_, model: type[Model]) -> list[str]:
    """The fields of what stands at a path of a model."""
    model = find_model_at(path, model)
    names = list_fields(model)
    own = ["text", *names, "intersections", "constraints"]
    return names if path or model is not SocialGraph else own


def compute_digest(plan: SocialGraph, text: str) -> str:
    """What changes with any field of a plan, or with its words."""
    data = plan.model_dump_json(by_alias=True, exclude_defaults=True)
    return hashlib.sha256(f"{text}\n{data}".encode("utf-8", "surrogatepass")).hexdigest()[:12]


# --- writing


def format_plan(plan: SocialGraph, text: str = "") -> str:
    """The plan as commented YAML, which `read_plan` reads back as it is."""
    lines = []
    if text:
        lines += [f"text: {_format(text)}  # {_TEXT_HELP}"]
        lines += [f"read_as: {_format(compute_digest(plan, text))}  # {_READ_HELP}"]
    told: set[tuple[type[Model], str]] = set()
    for name, info in SocialGraph.model_fields.items():
        value = getattr(plan, name)
        if name == "said":
            lines += [f"\n{_SAID_HELP}said:"] if plan.said else []
            for each in plan.said:
                own = each.model_dump(exclude_defaults=True).items()
                lines.append(f"  - {{{', '.join(f'{k}: {_format(v)}' for k, v in own)}}}")
        elif isinstance(value, Model):
            lines += ["", f"{name}:", *_format_model(value, "  ", told)]
        elif value:
            lines += ["", f"{name}:  # {info.description}", *_format_items(value, "  ", told)]
        else:
            lines += ["", f"# {name}:  # {info.description}"]
            model = find_model(info.annotation)
            for n, (free, own_info) in enumerate(model.model_fields.items() if model else ()):
                lead, help_ = "  " if n else "- ", _describe_field(own_info)
                lines.append(f"#   {lead}{own_info.alias or free}:  # {help_}")
    return _HEAD + "\n".join(lines) + "\n"


def _format_items(
    items: Sequence[Model], indent: str, told: set[tuple[type[Model], str]]
) -> Iterator[str]:
    for item in items:
        first, *rest = _format_model(item, f"{indent}  ", told)
        yield from (f"{indent}- {first.lstrip()}", *rest)


def _format_model(model: Model, indent: str, told: set[tuple[type[Model], str]]) -> Iterator[str]:
    """The fields of a model; help, and fields that are free, the first time only."""
    for name, info in type(model).model_fields.items():
        value, key = getattr(model, name), info.alias or name
        new = (type(model), name) not in told
        told.add((type(model), name))
        note = f"  # {_describe_field(info)}" if new and _describe_field(info) else ""
        if value is None or value == ():
            if new:
                yield f"{indent}# {key}:{note}"
        elif isinstance(value, Model):
            yield from (f"{indent}{key}:{note}", *_format_model(value, f"{indent}  ", told))
        elif isinstance(value, tuple) and isinstance(value[0], Model):
            yield from (f"{indent}{key}:{note}", *_format_items(value, f"{indent}  ", told))
        else:
            unit = _find_unit(name, {"kind": getattr(model, "kind", None)})
            if isinstance(model, ObjectNode | Meeting) and name == "figure" and model.encounter:
                unit = get_figure(model.encounter).unit
            written = f" {unit}" if unit and unit != "any" else ""
            yield f"{indent}{key}: {_format(value, written)}{note}"


def _describe_field(info: FieldInfo) -> str:
    """What a field is, its unit and bounds, and the values there are."""
    extra = info.json_schema_extra
    unit = f"[{extra['unit']}]" if isinstance(extra, dict) else ""
    bounds = [f"{each.ge:g}" for each in info.metadata if hasattr(each, "ge")]
    bounds += [f"{each.le:g}" for each in info.metadata if hasattr(each, "le")]
    span = " to ".join(bounds) if len(bounds) == 2 else ""
    allowed = list_values((info.annotation, *info.metadata))
    values = " | ".join(dict.fromkeys(map(str, allowed)))
    about = " ".join(filter(None, (info.description, unit)))
    return "; ".join(filter(None, (about, span, values)))


def _format(value: Any, unit: str = "") -> str:
    """A value as YAML on one line."""
    if isinstance(value, tuple):
        return f"[{', '.join(_format(each, unit) for each in value)}]"
    if isinstance(value, str):
        if re.fullmatch(r"[A-Za-z][\w-]*", value, re.ASCII) and value.lower() not in _NO_WORDS:
            return value
        shown = (c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08x}" for c in value)
        return f'"{"".join(shown)}"'
    return f"{json.dumps(value)}{unit}"


_NO_WORDS = ("true", "false", "null", "yes", "no", "on", "off", "y", "n")


def build_plan_schema() -> dict[str, Any]:
    """The JSON Schema of a plan file, for editors: values with units, and those left open."""
    schema = SocialGraph.model_json_schema(by_alias=True)
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "Plan of a scene"
    for words, help_ in (("text", _TEXT_HELP), ("read_as", _READ_HELP)):
        schema["properties"][words] = {"type": "string", "description": help_}
    open_: dict[str, Any] = {
        "type": "string",
        "pattern": r"^\s*(normal\(|lognormal\()?\s*[-+]?[0-9.]+",
    }
    choices: dict[str, Any] = {"type": "array"}
    for model in schema["$defs"].values():
        for name, own in model.get("properties", {}).items():
            types = {each.get("type") for each in (own, *own.get("anyOf", ()))}
            form: dict[str, Any]
            if types & {"number", "integer"} and name not in ("start", "end"):
                form = {"anyOf": [own, open_, choices]}
            elif name in ("lead", "figure"):
                form = {"type": "array", "items": {"type": ["number", "string"]}}
            elif "const" not in own and "array" not in types and name not in ("id", "background"):
                also = [{"type": "string", "pattern": "^has "}] if name in LEG_FIELDS else []
                form = {"anyOf": [own, *also, choices]}
            else:
                continue
            kept = {key: own.pop(key) for key in ("description", "unit") if key in own}
            model["properties"][name] = {**kept, **form}
    schema["properties"]["intersections"] = {
        "description": "of a sweep: any, a name, or a list of names",
        "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}],
    }
    schema["properties"]["constraints"] = {
        "description": "comparisons of fields, such as vehicle-1.entry != vehicle-2.entry",
        "type": "array",
        "items": {"type": "string"},
    }
    agent = schema["$defs"][AgentNode.__name__]
    agent["required"] = ["id"]
    schema["$defs"]["Measure"]["properties"]["value"] = {
        "type": ["number", "string", "array"],
        "description": "in place of low and high: so much, within the tolerance of its kind",
    }
    schema["$defs"]["Measure"]["required"] = ["kind", "agent"]
    return schema
