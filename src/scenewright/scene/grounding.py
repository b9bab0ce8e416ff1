"""The social graph bound to the map (paper 3.1): who may travel which route, and together how."""

from __future__ import annotations

from scenewright.scene.base import Model
from scenewright.scene.map import Route


class AssignedPattern(Model):
    """How one relation is played: its pattern, who has which role, who runs the red light."""

    edge: int
    pattern: str
    from_: str
    to: str
    violator: str | None


class RoleAssignment(Model):
    """One consistent choice of routes for all agents of the social graph."""

    routes: dict[str, Route]
    patterns: tuple[AssignedPattern, ...]


class Grounding(Model):
    """Routes that each agent may travel; at least one `RoleAssignment` over them exists."""

    routes: dict[str, tuple[Route, ...]]
