"""The ways through an intersection, as far as words can tell them apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from scenewright.scene.base import AgentClass
from scenewright.scene.map import IntersectionMap
from scenewright.scene.uturns import make_route

WAY_FIELDS = ("exit", "movement", "entry", "crosswalk")
"""What tells an agent's way; of what was so before, what stands first is let go first."""


@dataclass(frozen=True)
class RouteDescription:
    """A way through the intersection."""

    type: AgentClass
    entry: str
    exit: str
    movement: str
    crosswalk: str | None = None

    def matches_route(self, kind: str, told: Mapping[str, Any]) -> bool:
        """Whether somebody of that class of whom this is told, or left open, may take it."""
        return self.type == kind and all(
            told.get(field) in (None, getattr(self, field)) for field in WAY_FIELDS
        )


def describe_routes(intersection_map: IntersectionMap) -> tuple[RouteDescription, ...]:
    """Every way of a map."""
    return tuple(
        RouteDescription(each.type, each.entry, each.exit, each.movement, each.crosswalk)
        for each in (*intersection_map.routes, *map(make_route, intersection_map.uturns))
    )


def _build_four_legs() -> tuple[RouteDescription, ...]:
    ring = ("north", "east", "south", "west")
    turns = {"left": 1, "straight": 2, "right": 3}
    driven = [
        RouteDescription("vehicle", entry, ring[(at + turn) % 4], name)
        for at, entry in enumerate(ring)
        for name, turn in turns.items()
    ]
    walked = [
        RouteDescription("pedestrian", ring[(at + side) % 4], ring[(at - side) % 4], movement, leg)
        for at, leg in enumerate(ring)
        for side in (1, -1)
        for movement in ("crossing", "jaywalking")
    ]
    turned = [RouteDescription("vehicle", entry, entry, "uturn") for entry in ring]
    return (*driven, *turned, *walked)


FOUR_LEGS = _build_four_legs()
"""Where no map is named: a crossing of two roads that run to the four compass points."""


def resolve_route(
    kind: str, was: Mapping[str, Any], told: Mapping[str, Any], ways: Sequence[RouteDescription]
) -> dict[str, Any] | None:
    """What is told of somebody's way, and of the way before as much as goes with that.

    Args:
        was: WAY_FIELDS as they were; told: those of them that are new.

    Returns:
        All of WAY_FIELDS; None if no way goes with what is told.
    """
    kept = [field for field in WAY_FIELDS if field not in told and was.get(field) is not None]
    for many in range(len(kept) + 1):
        for gone in combinations(kept, many):
            found = {field: was.get(field) for field in WAY_FIELDS}
            found |= dict.fromkeys(gone) | dict(told)
            if any(way.matches_route(kind, found) for way in ways):
                return found
    return None
