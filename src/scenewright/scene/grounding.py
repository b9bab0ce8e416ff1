"""The social graph bound to the map (paper 3.1): who may travel which route, and together how."""

from __future__ import annotations

from scenewright.scene.base import Model
from scenewright.scene.map import Route


class CastPattern(Model):
    """How one relation is played: its pattern, who has which role, who runs the red light."""

    edge: int
    pattern: str
    from_: str
    to: str
    violator: str | None


class Cast(Model):
    """One consistent choice of routes for all agents of the social graph."""

    routes: dict[str, Route]
    patterns: tuple[CastPattern, ...]


class Grounding(Model):
    """Routes that each agent may travel; at least one `Cast` over them is known to exist."""

    routes: dict[str, tuple[Route, ...]]
