"""What a relation demands of its event besides type, roles and severity: zone, order, figures."""

from __future__ import annotations

import math

import numpy as np

from scenewright.scene.base import Point
from scenewright.scene.events import Event, EventZone
from scenewright.scene.map import IntersectionMap, Lanelet
from scenewright.scene.record import RelationRecord
from scenewright.tools.relation_checker.conflict_zones import SHARED, find_conflict_zones
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.footprints import compute_angle_between
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.manoeuvres import find_missing_manoeuvre
from scenewright.tools.relation_checker.passing_order import find_passing_order
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.trajectory import Trajectory, extend_straight

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
    return (
        _check_bounds(relation, event)
        or _check_order(relation, event, observed)
        or _check_striker(relation, event)
        or find_missing_manoeuvre(relation, event, observed)
        or (_check_zone(relation, event, observed, intersection_map))
    )


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


def _check_striker(relation: RelationRecord, event: Event) -> str | None:
    """Why another agent than the one asked for strikes."""
    if relation.strikes in (None, event.from_):
        return None
    return f"{event.from_} strikes, {relation.strikes} was to"


def _check_zone(
    relation: RelationRecord,
    event: Event,
    observed: SceneObservation,
    intersection_map: IntersectionMap | None,
) -> str | None:
    zone = relation.zone
    if zone is None or (zone != "lane" and intersection_map is None):
        return None
    tracks = {track.id: track for track in observed.tracks}
    pair = tracks[event.from_], tracks[event.to]
    inside = _run_in_one_direction(*pair, time=event.time) if zone == "lane" else False
    if intersection_map is not None and zone != "lane":
        inside = is_in_zone(
            _find_meeting_place(event, *pair), zone, intersection_map, on_foot=_walks(*pair)
        )
    return None if inside else f"not in the zone demanded ({zone})"


def _walks(first: Trajectory, second: Trajectory) -> bool:
    return not (first.is_vehicle and second.is_vehicle)


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
            return on_road and not any(_covers(lane, point) for lane in intersection_map.lanelets)
        case "roadway":
            return on_road and not (on_foot and marked)
        case "lane":
            return on_road


def _covers(lane: Lanelet, point: geos.Point) -> bool:
    """Whether a lane of a leg, thus outside the junction, covers the point."""
    if lane.kind == "connector":
        return False
    return bool(geos.Polygon([*lane.left, *reversed(lane.right)]).intersects(point))


def _run_in_one_direction(first: Trajectory, second: Trajectory, *, time: float) -> bool:
    at = np.array([time])
    headings = first.at(at)[1], second.at(at)[1]
    return bool(compute_angle_between(*headings)[0] <= SHARED)


def _find_meeting_place(event: Event, first: Trajectory, second: Trajectory) -> Point:
    """Where the two met, or would have: their conflict zone; the contact itself where they did."""
    if event.type in ("collision", "follow"):
        return event.location
    if event.type == "yielding":  # it may still wait when the scene ends
        first = extend_straight(
            first, distance=_BEYOND[first.type], speed=2.0 if first.is_vehicle else 1.0
        )
    here = geos.Point(event.location)
    zones = [zone.polygon for zone in find_conflict_zones(first, second)]
    if not zones:
        return event.location
    middle = min(zones, key=lambda area: float(area.distance(here))).centroid
    return float(middle.x), float(middle.y)
