"""What the page asks for, beside the requests that commands share with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from scenewright.cli.options import Asked

ACTIONS = ("say", "say_without", "make", "make_without", "plan", "edit", "undo", "redo", "branch")


@dataclass(frozen=True)
class NewThread(Asked):
    """Where a conversation is begun; the page's own place and seed where none is given."""

    intersection: str | None = None
    seed: int | None = None


@dataclass(frozen=True)
class Turn(Asked):
    """A turn of a conversation."""

    action: str = field(metadata={"json_schema_extra": {"enum": list(ACTIONS)}})
    argument: str = ""


@dataclass(frozen=True)
class PlanSource(Asked):
    """What a plan is made from: its fields, a version of a conversation, or words."""

    intersection: str | None = None
    plan: Any = None
    thread: str | None = None
    version: str | None = None
    words: str | None = None


@dataclass(frozen=True)
class BackendChoice(Asked):
    """Who plans and reasons from now on."""

    backend: str
    base_url: str = ""
