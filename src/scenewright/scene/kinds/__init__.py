"""Kinds of what agents do, as data: one small TOML file each, by axis (docs/kinds.md).

The types, schemas, prompts, phrasing and tables of the other rooms are made from these files. A
user's own lie beside the relations, in the folder that SCENEWRIGHT_RELATIONS names.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module, resources
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args, get_origin

from pydantic import (
    AfterValidator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    model_validator,
)
from pydantic_core import PydanticKnownError, core_schema

from scenewright.scene.base import AgentClass, Model
from scenewright.scene.data_files import build_refusal, list_files, read_models

Axis = Literal[
    "manoeuvre", "motion", "reaction", "encounter", "cause", "collision", "relation", "subtype"
]

Trait = Literal[
    "of_contact", "late", "chain", "merges_ahead", "by_to", "by_all",
    "afoot", "at_yellow", "wrong_way", "running", "returns", "on_road", "at_light",
    "reacts", "leaves_way", "aside", "back", "hurries",
    "drives_on", "leads_round", "waits_first", "waits", "heads_queue", "behind_agent", "stands",
    "ends", "door", "red_light", "directed", "no_order", "of_vehicles", "emergency",
]  # fmt: skip
"""What other rooms ask of a kind instead of its name; docs/kinds.md says what each means."""

_Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=64)]
_Line = Annotated[str, Field(min_length=1, max_length=400)]
_Function = Annotated[str, Field(pattern=r"^[a-z_]+:[A-Za-z][A-Za-z_]*$", max_length=80)]


_Pattern = Annotated[str, AfterValidator(lambda text: re.sub(r"\s*\n\s*", "", text.strip()))]
"""A regular expression, in which line breaks and indentation do not count."""

_NEEDS: dict[Axis, tuple[str, ...]] = {
    "manoeuvre": ("says", "observe"), "motion": ("agents", "constraints", "observe"),
    "reaction": ("agents", "constraints"), "cause": (), "collision": (),
    "relation": ("says", "verbs", "stand_ins"), "subtype": ("figures",),
    "encounter": ("shown", "figure", "template", "observe"),
}  # fmt: skip
"""What a kind of an axis cannot be without."""


class AskedFigure(Model):
    """What may be asked of an encounter: the figure that the checker measures."""

    name: _Name
    unit: Literal["m", "s", "m/s"]
    least: float = Field(ge=0)
    most: float = Field(gt=0)


class Kind(Model):
    """A kind of one axis; docs/kinds.md says what each field means."""

    id: _Name
    axis: Axis
    place: int = 100
    help: _Line
    agents: tuple[AgentClass, ...] = ()
    marks: tuple[_Line, ...] = ()
    reads: _Pattern | None = None
    words: tuple[_Line, ...] = Field(default=(), max_length=12)
    heard: _Pattern | None = None
    prompt: str = Field(default="", max_length=400)
    says: dict[_Name, _Line] = Field(default_factory=dict)
    shown: str | None = None
    verbs: tuple[tuple[str, ...], ...] = ()
    stand_ins: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    constraints: tuple[_Line, ...] = Field(default=(), max_length=12)
    claims: tuple[_Name, ...] = ()
    traits: frozenset[Trait] = frozenset()
    wider: str | None = None
    figure: AskedFigure | None = None
    template: _Function | None = None
    observe: _Function | None = None
    figures: dict[_Name, float] = Field(default_factory=dict)
    ranges: dict[_Name, tuple[float, float]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check_needs(self) -> Self:
        """Check that it has what the other rooms ask of a kind of its axis."""
        for field in _NEEDS[self.axis]:
            if not getattr(self, field):
                raise ValueError(f"{field}: a {self.axis} needs it")
        if self.axis in ("motion", "reaction", "encounter") and "any" not in self.says:
            raise ValueError(f"says: a {self.axis} needs 'any'")
        return self

    @property
    def clause(self) -> str | None:
        """The clause that stands for it, where the solver has a template for it alone."""
        return self.constraints[0].partition("(")[0] if self.template and self.constraints else None

    def say(self, from_: str = "", to: str = "", *, relation: str = "any") -> str:
        """The sentence about the two, or what follows the name of an agent."""
        text = self.says.get(relation) or self.says["any"]
        return text.format(**{"from": from_, "to": to})


def list_kinds(axis: Axis) -> tuple[Kind, ...]:
    """The kinds of an axis, shipped and a user's own, in their order.

    Raises:
        InputError: a file of the user's folder is no kind.
    """
    return tuple(each for (own, _), each in _index_user_kinds().items() if own == axis)


def list_shipped(axis: Axis) -> tuple[Kind, ...]:
    """The kinds of an axis that come with the package, for what is made at import."""
    return tuple(each for (own, _), each in _load_kinds(None).items() if own == axis)


def list_names(
    axis: Axis, *, trait: Trait | None = None, of: AgentClass | None = None
) -> tuple[str, ...]:
    """The ids of an axis: those with a trait, of a class of agents, or all."""
    return tuple(
        kind.id
        for kind in list_kinds(axis)
        if (trait is None or trait in kind.traits) and (of is None or of in kind.agents)
    )


def get_kind(axis: Axis, name: str) -> Kind:
    """The kind of this id; KeyError if there is none."""
    return _index_user_kinds()[axis, name]


def find_kind(axis: Axis, name: str | None) -> Kind | None:
    """The kind of this id, if there is one."""
    return _index_user_kinds().get((axis, name or ""))


def has_trait(axis: str, name: str | None, trait: Trait) -> bool:
    """Whether a name is that of a kind of the axis with a trait."""
    kind = _index_user_kinds().get((axis, name or ""))
    return kind is not None and trait in kind.traits


def list_readings(axis: Axis) -> tuple[tuple[re.Pattern[str], str], ...]:
    """What asks for a kind in a text, and the mark that stands for it; later places first."""
    kinds = reversed(list_kinds(axis))
    return tuple((_compile_words(k.reads, k.words), (*k.marks, k.id)[0]) for k in kinds)


@cache
def _compile_words(pattern: str | None, words: tuple[str, ...]) -> re.Pattern[str]:
    """A regular expression and plain words as one; without either it finds nothing."""
    parts = filter(None, (pattern, *(rf"\b{re.escape(word)}\b" for word in words)))
    return re.compile("|".join(parts) or "(?!)", re.IGNORECASE)


def is_heard(axis: Axis, text: str, *, of: AgentClass | None = None) -> bool:
    """Whether a text may speak of a kind of an axis, so that a model hears of them all."""
    kinds = (kind for kind in list_kinds(axis) if of is None or of in kind.agents)
    return any(_compile_words(kind.heard, kind.words).search(text) for kind in kinds)


def find_marked(axis: Axis, mark: str, *, of: AgentClass | None = None) -> str | None:
    """The kind that a mark of the reader, or its own id, asks for, of a class of agents."""
    kinds = (kind for kind in list_kinds(axis) if of is None or of in kind.agents)
    return next((kind.id for kind in kinds if mark in (kind.id, *kind.marks)), None)


@cache
def load_function(name: str, package: str) -> Any:
    """The function that a kind names as its template or observer, of the room that calls this."""
    module, _, function = name.partition(":")
    return getattr(import_module(f"{package}.{module}"), function)


class KindOf:
    """Makes `Annotated[str, KindOf(axis)]` the type of a kind's id, with the enum of all.

    Args:
        axes: axes of which the kinds are.
        trait: what those have that are meant, where not all are.
    """

    def __init__(self, *axes: Axis, trait: Trait | None = None) -> None:
        self.axes, self.trait = axes, trait

    def list_names(self) -> tuple[str, ...]:
        """The ids that the type allows."""
        return tuple(name for axis in self.axes for name in list_names(axis, trait=self.trait))

    def check(self, value: Any) -> str:
        """The value, if it is the id of a kind."""
        names = self.list_names()
        if isinstance(value, str) and value in names:
            return value
        *others, last = map(repr, names)
        raise PydanticKnownError("literal_error", {"expected": f"{', '.join(others)} or {last}"})

    def __get_pydantic_core_schema__(
        self, _source: Any, _handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Build the schema of a checked string."""
        return core_schema.no_info_plain_validator_function(self.check)

    def __get_pydantic_json_schema__(
        self, _schema: core_schema.CoreSchema, _handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Build the JSON schema, with the kinds as they are now."""
        return {"enum": list(self.list_names()), "type": "string"}


def _index_user_kinds() -> dict[tuple[str, str], Kind]:
    return _load_kinds(os.environ.get("SCENEWRIGHT_RELATIONS"))


@cache
def _load_kinds(own: str | None) -> dict[tuple[str, str], Kind]:
    """By axis and id: the shipped kinds, and those of a folder."""
    folders = (each for each in resources.files(__name__).iterdir() if each.is_dir())
    found = read_models(chain.from_iterable(f.iterdir() for f in folders), Kind, "kind", _get_key)
    if own is not None:
        known = {name for _, kind in found.values() for name in (kind.template, kind.observe)}
        added = read_models(list_files(Path(own)), Kind, "kind", _get_key)
        for file, kind in added.values():
            if kind.reads or kind.heard:
                raise build_refusal(file, "kind", "reads, heard: only shipped kinds have these")
            for field in ("template", "observe"):
                if (name := getattr(kind, field)) not in {None, *known}:
                    # A file holds no code, and starts none of its own choice.
                    raise build_refusal(file, "kind", f"{field}: no shipped kind has {name!r}")
        found |= added
    kinds = sorted((kind for _, kind in found.values()), key=lambda kind: (kind.place, kind.id))
    return {(kind.axis, kind.id): kind for kind in kinds}


def _get_key(kind: Kind) -> str:
    return f"{kind.axis} {kind.id}"


def list_values(annotations: Any) -> Iterator[Any]:
    """The values that the literals and kinds in types allow."""
    for annotation in annotations:
        if get_origin(annotation) is Literal:
            yield from get_args(annotation)
        elif isinstance(annotation, KindOf):
            yield from annotation.list_names()
        else:
            yield from list_values(get_args(annotation))
