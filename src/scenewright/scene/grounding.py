"""The social graph bound to the map (paper 3.1): the routes of each agent, and how they combine."""

from __future__ import annotations

from scenewright.scene.base import Model
from scenewright.scene.map import Route


class AssignedPattern(Model):
    """How one relation is realised: its pattern, the roles, the red-light runner."""

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
