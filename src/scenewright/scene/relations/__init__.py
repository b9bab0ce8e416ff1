"""Relations as data: one small TOML file per conflict pattern (paper 3.1, SEMANTICS section 4).

A pattern is a leaf of the taxonomy theme -> subtype -> pattern. It names its roles, the relation
it serves, where the two paths conflict, who ignores the red light if the two never have green
together, the segments that realise it and the constraint program that must hold. Adding a file
adds a pattern; no code knows their names.
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources
from typing import Literal

from pydantic import Field

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
    phrases: tuple[str, ...] = ()


@cache
def patterns() -> tuple[Pattern, ...]:
    """Every pattern shipped, ordered by id."""
    folder = resources.files(__name__)
    files = [entry for entry in folder.iterdir() if entry.name.endswith(".toml")]
    loaded = [Pattern.model_validate(tomllib.loads(file.read_text("utf-8"))) for file in files]
    return tuple(sorted(loaded, key=lambda pattern: pattern.id))


def pattern_named(name: str) -> Pattern:
    """The pattern with this id; KeyError if there is none."""
    for pattern in patterns():
        if pattern.id == name:
            return pattern
    raise KeyError(name)
