"""What a relation demands of its event besides type, roles and severity: zone, order, figures."""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scenewright.scene.base import Point
from scenewright.scene.events import Event, EventZone
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import RelationRecord
from scenewright.tools.relation_checker.conflict_zones import (
    SHARED,
    find_nearest_zone,
    find_zone_occupancy,
)
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.footprints import compute_angle_between
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.manoeuvres import find_missing_manoeuvre
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.trajectory import extend_straight

ON_CROSSWALK = 0.5
"""How far beside a crosswalk [m] still counts as on it."""

_BEYOND = {"vehicle": 25.0, "pedestrian": 5.0, "cyclist": 25.0, "scooter": 25.0}
"""How far [m] the path of a waiting agent is extended."""

TOLERANCES = {
    "pet": 0.15, "path_ttc": 0.3, "clearance": 0.2, "relative_speed": 1.0,
    "least_headway": 0.3, "least_gap": 0.5,
}  # fmt: skip


def find_unmet_condition(
    relation: RelationRecord,
    event: Event,
    observed: SceneObservation,
    intersection_map: IntersectionMap | None,
) -> str | None:
    """Why an event of the right type and roles is not what the relation's file demands."""
    other_strikes = relation.strikes not in (None, event.from_)
    reason = (
        _check_bounds(relation, event)
        or _check_order(relation, event, observed)
        or (f"{event.from_} strikes, {relation.strikes} was to" if other_strikes else None)
        or find_missing_manoeuvre(relation, event, observed)
    )
    zone, inside = relation.zone, True
    first, second = observed.by_id[event.from_], observed.by_id[event.to]
    if reason is not None:
        return reason
    if zone == "lane":
        time = np.array([event.time])
        inside = bool(compute_angle_between(first.at(time)[1], second.at(time)[1])[0] <= SHARED)
    elif zone is not None and intersection_map is not None:
        # Where the two met, or would have: their conflict zone; the contact itself where they did.
        place, middle = event.location, None
        if event.type not in ("collision", "follow"):
            giver = first
            if event.type == "yielding":  # it may still wait when the scene ends
                speed = 2.0 if first.is_vehicle else 1.0
                giver = extend_straight(first, distance=_BEYOND[first.type], speed=speed)
            middle = find_nearest_zone(giver, second, place)
        if middle is not None:
            place = float(middle.centroid.x), float(middle.centroid.y)
        on_foot = not (first.is_vehicle and second.is_vehicle)
        inside = is_in_zone(place, zone, intersection_map, on_foot=on_foot)
    return None if inside else f"not in the zone demanded ({zone})"


def _check_bounds(relation: RelationRecord, event: Event) -> str | None:
    for figure, (low, high) in relation.within.items():
        value = event.evidence.get(figure)
        if not isinstance(value, int | float) or not math.isfinite(value):
            return f"no {figure} observed, [{low:g}, {high:g}] demanded"
        slack = TOLERANCES.get(figure, 0.0) + 1e-6
        if not low - slack <= value <= high + slack:
            return f"{figure} {value:.2f} observed, [{low:g}, {high:g}] demanded"
    return None


def _check_order(relation: RelationRecord, event: Event, observed: SceneObservation) -> str | None:
    """The first agent through the stretch where the two come closest in time, or collide."""
    if relation.first is None:
        return None
    order = find_passing_order(observed, event)
    if order is None:  # the scene ends while one of the two still waits
        return None if relation.type == "yielding" else "nobody passes before the other"
    if order.first == relation.first:
        return None
    return f"{order.first} passes first, {relation.first} was to"


def is_in_zone(
    place: Point, zone: EventZone, intersection_map: IntersectionMap, *, on_foot: bool
) -> bool:
    """Whether a place [m] lies in a zone of the map; `on_foot`: one of the two walks."""
    ground, point = get_ground_raster(intersection_map), geos.Point(place)
    marked = any(each.area.distance(point) <= ON_CROSSWALK for each in ground.crosswalks)
    on_road = bool(ground.road.contains(np.array([place]))[0])
    match zone:
        case "crosswalk":
            return marked
        case "sidewalk":
            return not marked and bool(ground.walkable.contains(np.array([place]))[0])
        case "conflict":
            # The lanes of the legs lie outside the junction.
            legs = (each for each in intersection_map.lanelets if each.kind != "connector")
            areas = (geos.Polygon([*each.left, *reversed(each.right)]) for each in legs)
            return on_road and not any(area.intersects(point) for area in areas)
        case "roadway":
            return on_road and not (on_foot and marked)
        case "lane":
            return on_road


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
    closest = min(observed.list_encounters(pair), key=lambda each: each.pet, default=None)
    if closest is None:
        return None
    times = (closest.first_time, closest.second_time)
    ahead = closest.first if times[0] < times[1] else closest.second
    return PassingOrder(observed.ids[ahead], min(times), max(times))


def list_passing_orders(observed: SceneObservation, among: Set[int]) -> list[dict[str, Any]]:
    """Rows of who passes first, of all pairs of these agents that have an order."""
    ids = observed.ids
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
    pair = []
    for track in (observed.by_id[event.from_], observed.by_id[event.to]):
        # As if the contact had not been: straight on from there.
        last = track.index(event.time)
        until = replace(track, xy=track.xy[: last + 1], heading=track.heading[: last + 1])
        speed = max(float(track.speed[last]), _SLOWEST)
        onwards = _ON_FOOT if track.type == "pedestrian" else _ONWARDS
        pair.append(extend_straight(until, distance=onwards, speed=speed))
    zone = find_nearest_zone(pair[0], pair[1], event.location)
    stays = [] if zone is None else [find_zone_occupancy(each, zone) for each in pair]
    entered = [(stay.enter, track.id) for stay, track in zip(stays, pair, strict=False) if stay]
    if len(entered) < 2 or entered[0][0] == entered[1][0]:
        return None
    (early, first), (late, _) = sorted(entered)
    return PassingOrder(first, early, late)
