"""The routes through an intersection, as far as words distinguish them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from scenewright.scene.base import AgentClass
from scenewright.scene.map import IntersectionMap
from scenewright.scene.uturns import make_route

WAY_FIELDS = ("exit", "movement", "entry", "crosswalk")
"""The fields of an agent's route; of earlier values, those listed first are dropped first."""


@dataclass(frozen=True)
class RouteDescription:
    """A way through the intersection."""

    type: AgentClass
    entry: str
    exit: str
    movement: str
    crosswalk: str | None = None


def describe_routes(intersection_map: IntersectionMap) -> tuple[RouteDescription, ...]:
    """Every way of a map."""
    return tuple(
        RouteDescription(route.type, route.entry, route.exit, route.movement, route.crosswalk)
        for route in (*intersection_map.routes, *map(make_route, intersection_map.uturns))
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
    kind: str, was: Mapping[str, Any], given: Mapping[str, Any], ways: Sequence[RouteDescription]
) -> dict[str, Any] | None:
    """Complete given fields of an agent's route by as many of its earlier ones as fit.

    Args:
        was: WAY_FIELDS as they were; given: the new values among them.

    Returns:
        All of WAY_FIELDS; None if no route fits the given ones.
    """
    kept = [field for field in WAY_FIELDS if field not in given and was.get(field) is not None]
    for many in range(len(kept) + 1):
        for gone in combinations(kept, many):
            found = {field: was.get(field) for field in WAY_FIELDS}
            found |= dict.fromkeys(gone) | dict(given)
            if any(
                way.type == kind and all(v in (None, getattr(way, f)) for f, v in found.items())
                for way in ways
            ):
                return found
    return None
