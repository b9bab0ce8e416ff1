"""U-turns that an intersection has room for and that its map does not list."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.map_elements import Crosswalk, Lanelet, Leg, Route, VehicleMovement

_NARROWEST = 5.5
"""Least distance between the lane that a U-turn leaves and the one that it ends in [m]."""

_BEYOND = 2.5
"""How far beyond the crosswalk the turn begins [m]."""

_SPACING = 1.0
_SWEEP = 1.0
"""Half the width that a movement sweeps, for conflicts [m]."""


def derive_uturns(
    legs: Sequence[Leg],
    lanelets: Sequence[Lanelet],
    crosswalks: Sequence[Crosswalk],
    movements: Sequence[VehicleMovement],
) -> tuple[VehicleMovement, ...]:
    """A U-turn for every leg with exit lanes far enough from its inner approach lane."""
    listed = {movement.entry for movement in movements if movement.turn == "uturn"}
    uturns = (
        _derive_uturn(
            [lane for lane in lanelets if lane.leg == leg.name],
            [crosswalk for crosswalk in crosswalks if crosswalk.leg == leg.name],
            next((movement for movement in movements if movement.entry == leg.name), None),
        )
        for leg in legs
        if leg.name not in listed
    )
    return tuple(uturn for uturn in uturns if uturn is not None)


def make_route(movement: VehicleMovement) -> Route:
    """The route of a U-turn."""
    side = movement.entry
    return Route(
        id=f"vehicle:{movement.id}", type="vehicle", entry=side, exit=side, movement="uturn",
        movement_id=movement.id,
    )  # fmt: skip


def _derive_uturn(
    lanes: Sequence[Lanelet], crosswalks: Sequence[Crosswalk], usual: VehicleMovement | None
) -> VehicleMovement | None:
    """The U-turn on the lanes of a leg, by the lights of a usual movement from it."""
    into = [lane for lane in lanes if lane.kind == "approach"]
    out = [lane for lane in lanes if lane.kind == "exit"]
    if not into or not out or usual is None:
        return None
    ends = {lane.id: np.array(lane.centreline[0]) for lane in out}
    inner = min(
        into, key=lambda lane: min(np.hypot(*(end - lane.centreline[-1])) for end in ends.values())
    )
    away = {name: float(np.hypot(*(end - inner.centreline[-1]))) for name, end in ends.items()}
    outer = max(out, key=lambda lane: away[lane.id])
    if away[outer.id] < _NARROWEST:
        return None
    line = _draw_uturn(np.array(inner.centreline), np.array(outer.centreline), crosswalks)
    leg = usual.entry
    return VehicleMovement(
        id=f"{leg}>{leg}:uturn", entry=leg, exit=leg, turn="uturn",
        lanelets=(inner.id, outer.id), stop_line=usual.stop_line,
        centreline=tuple((round(x, 3), round(y, 3)) for x, y in line.tolist()),
        signal_group=usual.signal_group,
    )  # fmt: skip


def _draw_uturn(into: FloatArray, out: FloatArray, crosswalks: Sequence[Crosswalk]) -> FloatArray:
    """[P, 2] along one lane, past the crosswalk, half a circle round and back along the other."""
    ahead = into[-1] - into[-2]
    ahead = ahead / np.hypot(*ahead)
    corners = [np.array(p) for crosswalk in crosswalks for p in crosswalk.polygon]
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
    uturn: VehicleMovement, movements: Sequence[VehicleMovement], crosswalks: Sequence[Crosswalk]
) -> Iterator[frozenset[str]]:
    """The movements of other legs and the crosswalks that a U-turn meets, as unordered pairs."""
    line = _resample(np.array(uturn.centreline))
    for other in movements:
        theirs = _resample(np.array(other.centreline))
        if other.entry != uturn.entry and _compute_gap(line, theirs) < 2 * _SWEEP:
            yield frozenset((uturn.id, other.id))
    for crosswalk in crosswalks:
        middle = _resample(np.array(crosswalk.centreline))
        if _compute_gap(line, middle) < crosswalk.width / 2 + _SWEEP:
            yield frozenset((uturn.id, crosswalk.id))


def _compute_gap(one: FloatArray, two: FloatArray) -> float:
    return float(np.hypot(*(one[:, None] - two[None]).transpose(2, 0, 1)).min())


def _resample(line: FloatArray) -> FloatArray:
    steps = np.hypot(*np.diff(line, axis=0).T)
    s = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.arange(0.0, s[-1], _SPACING)
    return np.stack([np.interp(at, s, line[:, axis]) for axis in (0, 1)], axis=1)
