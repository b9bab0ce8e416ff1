"""Plans in ASAM OpenSCENARIO DSL 2.1: fields as `keep` constraints, written and read back.

A file begins with the types of a plan's fields, made from the models; agents are actors of the
standard library, extended by them. What is left open is a range or a list of values.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from scenewright.errors import InputError
from scenewright.scene.account import LEFT_TO_STAGES
from scenewright.scene.base import Model
from scenewright.scene.kinds import list_values
from scenewright.scene.leg_predicates import LEG_FIELDS
from scenewright.scene.measures import UNITS, Measure
from scenewright.scene.plan_constraints import NAMED
from scenewright.scene.social import (
    UNIT_OF,
    AgentNode,
    Background,
    EntryTie,
    Meeting,
    ObjectNode,
    RelationEdge,
    SceneContext,
)
from scenewright.scene.spread import Spread

Path_ = tuple[str | int, ...]
ACTORS = {"vehicle": "vehicle", "pedestrian": "person", "cyclist": "bicycle", "scooter": "vehicle"}
"""Actors of the standard library by agent class."""
_STRUCTS: dict[str, type[Model]] = {
    "relations": RelationEdge, "ties": EntryTie, "objects": ObjectNode, "measures": Measure,
}  # fmt: skip
_PHYSICAL = {
    "s": ("time", "s"), "m": ("length", "m"), "m/s": ("speed", "mps"),
    "m/s2": ("acceleration", "mpss"), "%": ("float", ""),
}  # fmt: skip
"""Physical type and unit of OpenSCENARIO DSL by our unit."""
_UNITS = {name: unit for unit, (_, name) in _PHYSICAL.items() if name}
_KEYWORDS = frozenset((
    "action", "actor", "and", "as", "bool", "call", "cover", "def", "default", "do", "elapsed",
    "emit", "enum", "event", "every", "expression", "extend", "external", "factor", "fall", "false",
    "float", "global", "hard", "if", "import", "in", "inherits", "int", "is", "it", "keep", "list",
    "modifier", "not", "of", "offset", "on", "one_of", "only", "or", "parallel", "range", "record",
    "remove_default", "rise", "sample", "scenario", "serial", "string", "struct", "true", "type",
    "uint", "undefined", "unit", "until", "use", "var", "wait", "with",
))  # fmt: skip
_DECLARED = re.compile(r"    (\w+): (\w+)")
_KEPT = re.compile(r"    keep\((.+)\)")
_TERM = re.compile(r"(\w+)((?:\.\w+)+) (==|in) (.+)")
_NUMBER = re.compile(r"(-?[0-9.]+(?:e[-+]?[0-9]+)?)([a-z]*)")
_ACTOR = rf"\b({NAMED})"
_NAME = re.compile(rf"{_ACTOR}_(\d+)")


def write_osc_dsl(
    name: str, data: Mapping[str, Any], *, spreads: Mapping[Path_, Spread],
    legs: Mapping[Path_, str], places: Sequence[str] = (), constraints: Sequence[str] = (),
) -> str:  # fmt: skip
    """The file of a plan; arguments as of `LogicalPlan`, numbers in SI units.

    A distribution is written as the range between its corners; the words a plan was read from
    stand in a comment.
    """
    declared = list(_declare_entries(data))
    names = {path: own for path, own, _ in declared}
    body = [f"{own}: {type_}" for _, own, type_ in declared]
    body += (f"keep({each})" for each in _list_kept(data, names, spreads=spreads, legs=legs))
    if places:
        body += ["places: list of string", f"keep(places == {json.dumps(list(places))})"]
    for text in constraints:
        own = re.sub(rf"{_ACTOR}-(\d+)", r"\1_\2", text)
        own = re.sub(r"(relation|measure|tie)s\[(\d+)\]", lambda m: f"{m[1]}_{int(m[2]) + 1}", own)
        body.append(f"keep({own})")
    acts = [f"{own}.{'walk' if type_ == 'person' else 'drive'}()"
            for path, own, type_ in declared if path[0] == "agents"]  # fmt: skip
    notes = [f"# read from: {data['text']}"] if data.get("text") else []
    notes += [
        f"# not held by any field: {each['words']}"
        for each in data.get("said", ())
        if each["became"] in LEFT_TO_STAGES
    ]
    title = re.sub(r"\W", "_", f"plan_{name}")
    lines = [
        "# ASAM OpenSCENARIO DSL 2.1: a plan of scenewright.",
        *(" ".join(note.split()) for note in notes), "import osc.standard.all", "",
        *_write_types(), f"scenario {title}:", *(f"    {line}" for line in body),
        "    do parallel:", *(f"        {act}" for act in acts or ["wait elapsed(30s)"]),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _declare_entries(data: Mapping[str, Any]) -> Iterator[tuple[Path_, str, str]]:
    """A variable for each agent, relation, tie, object, measure and further meeting; its type."""
    for section in ("agents", *_STRUCTS):
        for n, entry in enumerate(data.get(section, ())):
            type_ = section[:-1]
            own = entry.get("id", f"{type_}_{n + 1}").replace("-", "_")
            if section == "agents":
                type_ = ACTORS[entry["id"].partition("-")[0]]
            elif section == "measures":
                type_ += f"_of_{_PHYSICAL[UNITS[entry['kind']].unit][0]}"
            yield (section, n), own, type_
            for k, _ in enumerate(entry.get("others", ())):
                yield (section, n, "others", k), f"{own}_other_{k + 1}", "meeting"
    if data.get("context"):
        yield ("context",), "context", "scene_context"


def _list_kept(
    data: Mapping[str, Any], names: Mapping[Path_, str], *,
    spreads: Mapping[Path_, Spread], legs: Mapping[Path_, str],
) -> Iterator[str]:  # fmt: skip
    """What is kept of each field: a value, or a range or list of them."""
    for path, value in _list_leaves(data, ()):
        if path[0] in ("text", "read_as") or path[-1] == "id" or path[::2] == ("agents", "type"):
            continue
        deepest = max(n for n in range(len(path)) if n == 0 or path[:n] in names)
        owner = [names[path[:deepest]]] if deepest else []
        field = ".".join([*owner, *(_escape(str(step)) for step in path[deepest:])])
        unit = UNIT_OF.get(str(path[-1]))
        if path[0] == "measures" and path[-1] in ("low", "high", "value"):
            unit = UNITS[data["measures"][path[1]]["kind"]].unit
        spread = spreads.get(path)
        if path in legs:
            yield f"{field}_has == {json.dumps(legs[path])}"
        elif spread is None or spread.kind == "times":
            yield f"{field} == {_write(value, unit)}"
        elif spread.kind == "list":
            yield f"{field} in [{', '.join(_write(each, unit) for each in spread.values)}]"
        else:
            yield f"{field} in {_write([spread.compute_value(x) for x in (0.0, 1.0)], unit)}"


def _write_types() -> Iterator[str]:
    """Enumerations and structs of the plan's fields."""
    enums: dict[tuple[str, ...], str] = {}
    types: list[str] = []
    structs: dict[str, type[Model]] = {
        "traffic_participant": AgentNode, "background": Background, "scene_context": SceneContext,
        "relation": RelationEdge, "tie": EntryTie, "meeting": Meeting, "object": ObjectNode,
    }  # fmt: skip
    for name, model in structs.items():
        extend = "extend" if name == "traffic_participant" else "struct"
        types.append(f"{extend} {name}:")
        for key, info in model.model_fields.items():
            own, extra = info.alias or key, info.json_schema_extra
            unit = str(extra["unit"]) if isinstance(extra, dict) else None
            values = tuple(map(str, list_values((info.annotation, *info.metadata))))
            if key in ("others", "id") or (key == "type" and model is AgentNode):
                continue
            if values and "True" not in values:
                type_ = enums.setdefault(values, f"{name}_{_escape(own)}")
            else:
                type_ = _name_type(info.annotation, unit)
            types.append(f"    {_escape(own)}: {type_}")
            if own in LEG_FIELDS:
                types.append(f"    {own}_has: string")
        types.append("")
    measured = list_values((Measure.model_fields["kind"].annotation,))
    enums[tuple(map(str, measured))] = "measured"
    for type_ in dict.fromkeys(each[0] for each in _PHYSICAL.values()):
        types += [f"struct measure_of_{type_}:", "    kind: measured",
                  "    agent: traffic_participant", "    other: traffic_participant",
                  *(f"    {bound}: {type_}" for bound in ("low", "high", "value")), ""]  # fmt: skip
    for values, name in enums.items():
        yield f"enum {name}: [{', '.join(map(_escape, values))}]"
    yield ""
    yield from types


def _name_type(annotation: Any, unit: str | None) -> str:
    text = str(annotation)
    if unit is not None:
        return _PHYSICAL[unit][0]
    for part, type_ in (("vehicle|pedestrian", "traffic_participant"), ("object-", "object"),
                        ("Background", "background"), ("bool", "bool"), ("int", "int"),
                        ("float", "float")):  # fmt: skip
        if part in text:
            return type_
    return "string"


def _escape(name: str) -> str:
    return f"{name}_" if name in _KEYWORDS else name


def _list_leaves(data: Any, path: Path_) -> Iterator[tuple[Path_, Any]]:
    for key, value in data.items() if isinstance(data, Mapping) else enumerate(data):
        first = next(iter(value), None) if isinstance(value, list) else value
        if key == "said":
            continue
        if isinstance(first, dict):
            yield from _list_leaves(value, (*path, key))
        elif value is not None and value != []:
            yield (*path, key), value


def _write(value: Any, unit: str | None) -> str:
    if isinstance(value, list):
        return f"[{'..'.join(_write(each, unit) for each in value)}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value) if unit is None else f"{float(value)!r}{_PHYSICAL[unit][1]}"
    if re.fullmatch(rf"{_ACTOR}-\d+", value):
        return str(value.replace("-", "_"))
    return _escape(value) if re.fullmatch(r"[a-z]\w*", value, re.ASCII) else json.dumps(value)


def parse_osc_dsl(text: str, name: str) -> tuple[dict[str, Any], dict[Path_, int]]:
    """The fields that a file of this form keeps, as a plan file has them, and their lines.

    Raises:
        InputError: no scenario, or a line that keeps no field; names the line.
    """
    data: dict[str, Any] = {}
    lines: dict[Path_, int] = {}
    found: dict[str, Path_] = {}
    within = False
    for number, line in enumerate(map(str.rstrip, text.split("\n")), start=1):
        within = (within or line.startswith("scenario ")) and not line.startswith("    do ")
        if not within or line.startswith("scenario ") or line.lstrip()[:1] in ("", "#"):
            continue
        if declared := _DECLARED.fullmatch(line):
            if declared[2] == "scene_context":
                found[declared[1]] = (declared[1],)
                continue
            path = _declare(declared[1], declared[2], data, found)
        elif kept := _KEPT.fullmatch(line):
            path = _keep(kept[1], data, found)
        elif line == "    places: list of string":
            continue
        else:
            what = "declare an actor, or keep(...) a field of it"
            raise InputError(f"{name}, line {number}: {what}, not {line.strip()[:60]!r}")
        lines[path] = number
    if not re.search(r"^scenario ", text, re.MULTILINE):
        raise InputError(f"{name} holds no scenario; `scenewright plan FILE --osc-dsl` writes one")
    return data, lines


def _declare(name: str, type_: str, data: dict[str, Any], found: dict[str, Path_]) -> Path_:
    """Where the fields of a variable belong, for which room is made; kept in `found` too."""
    owner, _, rest = name.partition("_other_")
    if rest and owner in found:
        data["objects"][found[owner][1]].setdefault("others", []).append({})
        found[name] = (*found[owner], "others", int(rest) - 1)
    else:
        section = f"{type_.partition('_of_')[0]}s" if type_ not in ACTORS.values() else "agents"
        held = data.setdefault(section, [])
        named = section in ("agents", "objects")
        held.append({"id": name.replace("_", "-")} if named else {})
        found[name] = (section, len(held) - 1)
    return found[name]


def _keep(text: str, data: dict[str, Any], found: dict[str, Path_]) -> Path_:
    """Set the field that a constraint is about; one that compares fields is itself kept."""
    try:
        path, value = _read_kept(text, found)
    except ValueError:
        held = data.setdefault("constraints", [])
        own = re.sub(rf"{_ACTOR}_(\d+)", r"\1-\2", text)
        held.append(re.sub(r"\b(relation|measure|tie)_(\d+)",
                           lambda m: f"{m[1]}s[{int(m[2]) - 1}]", own))  # fmt: skip
        return "constraints", len(held) - 1
    target: Any = data
    for step in path[:-1]:
        target = target.setdefault(step, {}) if isinstance(target, dict) else target[step]
    target[path[-1]] = value
    return path


def _read_kept(text: str, found: dict[str, Path_]) -> tuple[Path_, Any]:
    """The field that a constraint sets, and its value; ValueError where it compares fields."""
    if text.startswith("places == "):
        return ("intersections",), json.loads(text.removeprefix("places == "))
    term = _TERM.fullmatch(text)
    if term is None or term[1] not in found:
        raise ValueError(text)
    owner, fields, sign, written = term.groups()
    steps = [each.removesuffix("_") for each in fields[1:].split(".")]
    path = (*found[owner], *steps)
    if steps[-1].endswith("_has"):
        return (*path[:-1], steps[-1].removesuffix("_has")), json.loads(written)
    if not (written.startswith("[") and written.endswith("]")):
        return path, _read(written)
    between = ".." if ".." in written else ", "
    values = [_read(each) for each in written[1:-1].split(between)]
    if sign == "in" and between == "..":
        (low, *_), (high, *unit) = (str(value).split(" ") for value in values)
        return path, " ".join([low, "..", high, *unit])
    return path, values


def _read(text: str) -> Any:
    """A value as a plan file has it: a number with its unit, a name, a truth value."""
    if number := _NUMBER.fullmatch(text):
        plain = number[1]
        if number[2] and number[2] not in _UNITS:
            raise ValueError(text)
        if number[2]:
            return f"{plain} {_UNITS[number[2]]}"
        return float(plain) if "." in plain or "e" in plain else int(plain)
    if text.startswith('"'):
        return json.loads(text)
    if not re.fullmatch(r"\w+", text):
        raise ValueError(text)
    if named := _NAME.fullmatch(text):
        return f"{named[1]}-{named[2]}"
    return {"true": True, "false": False}.get(text, text.removesuffix("_"))
