"""Order of passing (SEMANTICS 8): leaving a conflict zone first, entering that of a collision."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from typing import Any

from scenewright.scene.events import Event
from scenewright.tools.relation_checker.conflict_zones import (
    find_nearest_zone,
    find_zone_occupancy,
)
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.trajectory import Trajectory, extend_straight

_ONWARDS, _ON_FOOT = 15.0, 5.0
"""How far [m] the ways of two who collide are taken to go straight on from the contact."""

_SLOWEST = 1.0
"""Speed [m/s] of that for who hardly moves at the contact."""


@dataclass(frozen=True)
class PassingOrder:
    """Which of two comes first, and when [s] they come.

    Attributes:
        first: id of the agent; first_time, second_time: when either is at the place that both
            pass with the least time between, or enters the zone in which they collide.
    """

    first: int
    first_time: float
    second_time: float


def find_passing_order(observed: SceneObservation, event: Event) -> PassingOrder | None:
    """The order of an event's two agents; None where there is none.

    None for two who share a lane, and where one of them still waits when the scene ends.
    """
    if event.type == "collision":
        return _find_entering_order(observed, event)
    return find_crossing_order(observed, {event.from_, event.to})


def find_crossing_order(observed: SceneObservation, pair: Set[int]) -> PassingOrder | None:
    """The order of two who do not touch, where they come closest in time; None without one."""
    ids = [track.id for track in observed.tracks]
    between = [e for e in observed.encounters if {ids[e.first], ids[e.second]} == pair]
    if not between:
        return None
    closest = min(between, key=lambda each: each.pet)
    times = (closest.first_time, closest.second_time)
    ahead = closest.first if times[0] < times[1] else closest.second
    return PassingOrder(ids[ahead], min(times), max(times))


def list_passing_orders(observed: SceneObservation, among: Set[int]) -> list[dict[str, Any]]:
    """Rows of who passes first, of all pairs of these agents that have an order."""
    ids = [track.id for track in observed.tracks]
    orders: dict[frozenset[int], PassingOrder | None] = {}
    for pair in (frozenset((ids[each.first], ids[each.second])) for each in observed.encounters):
        if pair <= among and pair not in orders:
            orders[pair] = find_crossing_order(observed, pair)
    for event in observed.events:
        if event.type == "collision" and {event.from_, event.to} <= among:
            orders[frozenset((event.from_, event.to))] = _find_entering_order(observed, event)
    return [
        {
            "first": order.first,
            "second": next(iter(pair - {order.first})),
            "times": [round(order.first_time, 3), round(order.second_time, 3)],
        }
        for pair, order in sorted(orders.items(), key=lambda each: sorted(each[0]))
        if order is not None
    ]


def _find_entering_order(observed: SceneObservation, event: Event) -> PassingOrder | None:
    """The colliding agent that is in the conflict zone first; None where both come at once."""
    tracks = {track.id: track for track in observed.tracks}
    pair = [_carry_on(tracks[each], event.time) for each in (event.from_, event.to)]
    zone = find_nearest_zone(pair[0], pair[1], event.location)
    stays = [] if zone is None else [find_zone_occupancy(each, zone.polygon) for each in pair]
    entered = [(stay.enter, track.id) for stay, track in zip(stays, pair, strict=False) if stay]
    if len(entered) < 2 or entered[0][0] == entered[1][0]:
        return None
    (early, first), (late, _) = sorted(entered)
    return PassingOrder(first, early, late)


def _carry_on(track: Trajectory, time: float) -> Trajectory:
    """The track as if the contact at `time` had not been: straight on from there."""
    last = track.index(time)
    until = Trajectory(
        track.id, track.type, track.length, track.width, track.start,
        track.xy[: last + 1], track.heading[: last + 1],
    )  # fmt: skip
    speed = max(float(track.speed[last]), _SLOWEST)
    return extend_straight(
        until, distance=_ON_FOOT if track.type == "pedestrian" else _ONWARDS, speed=speed
    )
