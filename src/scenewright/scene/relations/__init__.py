"""Relations as data: one small TOML file per conflict pattern (paper 3.1, SEMANTICS section 4).

A pattern is a leaf of the taxonomy theme -> subtype -> pattern. It names its roles, the relation
it serves, where the two paths conflict, who ignores the red light if the two never have green
together, the segments that realise it and the constraint program that must hold. Adding a file
adds a pattern; no code knows their names. A user's own files lie in a folder that the environment
variable SCENEWRIGHT_RELATIONS names; one with the id of a shipped pattern replaces it.
"""

from __future__ import annotations

import os
import tomllib
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from scenewright.errors import InputError
from scenewright.scene.base import AgentClass, Model, Movement
from scenewright.scene.record import SegmentStatus
from scenewright.scene.social import Cause, CollisionKind, RelationType

Geometry = Literal["crossing", "merging", "same_lane", "same_way", "lane_change", "opposing"]
RoleName = Literal["from", "to"]


class Role(Model):
    """Who can play a part, and by which segments it is realised."""

    type: AgentClass
    movements: tuple[Movement, ...]
    segments: tuple[SegmentStatus, ...]


class Pattern(Model):
    """A conflict pattern.

    Attributes:
        geometry: how the two routes must meet on the map.
        entries: how the two entries must lie to one another.
        violator: the role that runs the red light where the two never have green together.
        constraints: clauses of the constraint language, `{from}` and `{to}` filled in.
        weight: how often it is drawn where the text leaves the pattern open.
    """

    id: str
    theme: str
    subtype: str
    relation: RelationType
    kind: CollisionKind | None = None
    cause: Cause | None = None
    geometry: Geometry
    entries: Literal["any", "same", "opposite", "lateral"] = "any"
    violator: RoleName | None = None
    weight: float = 1.0
    from_: Role = Field(alias="from")
    to: Role
    constraints: tuple[str, ...]


def patterns() -> tuple[Pattern, ...]:
    """Every pattern, shipped or in the folder that SCENEWRIGHT_RELATIONS names, ordered by id.

    Raises:
        InputError: a file of that folder is no pattern, or the folder cannot be read.
    """
    return _patterns(os.environ.get("SCENEWRIGHT_RELATIONS"))


@cache
def _patterns(own: str | None) -> tuple[Pattern, ...]:
    files: list[Traversable] = list(resources.files(__name__).iterdir())
    if own is not None:
        files += _files_of(Path(own))
    loaded = [_load(file) for file in files if file.name.endswith(".toml")]
    return tuple(sorted({each.id: each for each in loaded}.values(), key=lambda each: each.id))


def _files_of(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError as error:
        raise InputError(f"cannot read relations in {folder}: {error.strerror}") from error


def _load(file: Traversable) -> Pattern:
    try:
        return Pattern.model_validate(tomllib.loads(file.read_text("utf-8")))
    except (ValueError, OSError) as error:
        first = error.errors(include_url=False)[0] if isinstance(error, ValidationError) else None
        where = ".".join(str(part) for part in first["loc"]) + ": " if first else ""
        why = first["msg"] if first else str(error)
        raise InputError(f"{file.name} is not a relation: {where}{why}") from error


def pattern_named(name: str) -> Pattern:
    """The pattern with this id; KeyError if there is none."""
    for pattern in patterns():
        if pattern.id == name:
            return pattern
    raise KeyError(name)
