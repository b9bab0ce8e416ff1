"""The routes through an intersection, as far as words distinguish them; U-turns it has room for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.map import Crosswalk, IntersectionMap, Leg, Route, VehicleMovement

_NARROWEST = 5.5
"""Least distance between the lane that a U-turn leaves and the one that it ends in [m]."""

_BEYOND = 2.5
"""How far beyond the crosswalk the turn begins [m]."""

_SPACING = 1.0
_SWEEP = 1.0
"""Half the width that a movement sweeps, for conflicts [m]."""


def derive_uturns(intersection_map: IntersectionMap) -> tuple[VehicleMovement, ...]:
    """A U-turn for every leg whose exit lanes lie far enough from its inner approach lane."""
    listed = {each.entry for each in intersection_map.movements if each.turn == "uturn"}
    found = (_derive(intersection_map, leg) for leg in intersection_map.legs)
    return tuple(each for each in found if each is not None and each.entry not in listed)


def make_route(movement: VehicleMovement) -> Route:
    """The route of a U-turn."""
    side = movement.entry
    return Route(
        id=f"vehicle:{movement.id}", type="vehicle", entry=side, exit=side, movement="uturn",
        movement_id=movement.id,
    )  # fmt: skip


def _derive(intersection_map: IntersectionMap, leg: Leg) -> VehicleMovement | None:
    lanes = [each for each in intersection_map.lanelets if each.leg == leg.name]
    into = [each for each in lanes if each.kind == "approach"]
    out = [each for each in lanes if each.kind == "exit"]
    own = [each for each in intersection_map.movements if each.entry == leg.name]
    if not into or not out or not own:
        return None
    ends = {each.id: np.array(each.centreline[0]) for each in out}
    inner = min(
        into, key=lambda lane: min(np.hypot(*(end - lane.centreline[-1])) for end in ends.values())
    )
    away = {name: float(np.hypot(*(end - inner.centreline[-1]))) for name, end in ends.items()}
    outer = max(out, key=lambda lane: away[lane.id])
    if away[outer.id] < _NARROWEST:
        return None
    crosswalks = [each for each in intersection_map.crosswalks if each.leg == leg.name]
    line = _draw(np.array(inner.centreline), np.array(outer.centreline), crosswalks)
    return VehicleMovement(
        id=f"{leg.name}>{leg.name}:uturn", entry=leg.name, exit=leg.name, turn="uturn",
        lanelets=(inner.id, outer.id), stop_line=own[0].stop_line,
        centreline=tuple((round(x, 3), round(y, 3)) for x, y in line.tolist()),
        signal_group=own[0].signal_group,
    )  # fmt: skip


def _draw(into: FloatArray, out: FloatArray, crosswalks: list[Crosswalk]) -> FloatArray:
    """[P, 2] along one lane, past the crosswalk, half a circle round and back along the other."""
    ahead = into[-1] - into[-2]
    ahead = ahead / np.hypot(*ahead)
    corners = [np.array(p) for each in crosswalks for p in each.polygon]
    past = max([float((p - into[-1]) @ ahead) for p in corners], default=0.0) + _BEYOND
    begin = into[-1] + past * ahead
    side = out[0] - into[-1]
    across = side - (side @ ahead) * ahead
    turns = np.linspace(0.0, np.pi, 13)
    radius = float(np.hypot(*across)) / 2
    arc = np.array(
        [begin + (1 - np.cos(t)) / 2 * across + radius * np.sin(t) * ahead for t in turns]
    )
    return np.concatenate([into, arc, out])


def find_conflicts(
    movement: VehicleMovement, intersection_map: IntersectionMap
) -> Iterator[frozenset[str]]:
    """The movements of other legs and the crosswalks that a U-turn meets, as unordered pairs."""
    line = _resample(np.array(movement.centreline))
    for other in intersection_map.movements:
        theirs = _resample(np.array(other.centreline))
        if other.entry != movement.entry and _compute_gap(line, theirs) < 2 * _SWEEP:
            yield frozenset((movement.id, other.id))
    for crosswalk in intersection_map.crosswalks:
        middle = _resample(np.array(crosswalk.centreline))
        if _compute_gap(line, middle) < crosswalk.width / 2 + _SWEEP:
            yield frozenset((movement.id, crosswalk.id))


def _compute_gap(one: FloatArray, two: FloatArray) -> float:
    return float(np.hypot(*(one[:, None] - two[None]).transpose(2, 0, 1)).min())


def _resample(line: FloatArray) -> FloatArray:
    steps = np.hypot(*np.diff(line, axis=0).T)
    s = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.arange(0.0, s[-1], _SPACING)
    return np.stack([np.interp(at, s, line[:, axis]) for axis in (0, 1)], axis=1)


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
