"""What a relation demands of its event besides type, roles and severity: zone, order, figures."""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scenewright.scene.base import Point
from scenewright.scene.events import Event, EventZone
from scenewright.scene.kinds import get_kind, load_function
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import RelationRecord
from scenewright.tools.relation_checker.conflict_zones import (
    SHARED,
    find_nearest_zone,
    find_zone_occupancy,
)
from scenewright.tools.relation_checker.events import ONWARDS, SceneObservation
from scenewright.tools.relation_checker.following import CREEP, LOOK_AHEAD
from scenewright.tools.relation_checker.footprints import BoolArray, compute_angle_between
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.trajectory import Trajectory, extend_straight

HARD = 4.5
"""Braking that is hard [m/s^2]."""
MOVING = 4.0
"""Least speed before a hard braking [m/s]."""
SOON = {"collision": 5.0, "near_miss": 8.0}
"""How long before an event its leader may have braked [s]."""
CLOSE_UP = 1.05
"""Usual headway of who tailgates, at most [s]."""
CUT_IN = 1.6
"""Headway that who cuts in leaves, at most [s]."""
CHANGES, MERGES = 6.0, 3.0
"""A lane change may begin so long before an event, and end so long after it [s]."""
OTHER_LANE, LEAST_CHANGE = 2.2, 0.8
"""How far from the other's way one in the next lane drives, and how far it comes over [m]."""
GOES_ON = 5.0
"""How far a way is thought to go on straight beyond the ends of its track [m]."""
ANSWERS = 8.0
"""Within what time of it the follower must have come down to half its speed [s]."""


def find_missing_manoeuvre(
    relation: RelationRecord, event: Event, observed: SceneObservation
) -> str | None:
    """Why an event did not come about in the way asked for; None if it did, or any way will do."""
    if relation.manoeuvre is None:
        return None
    first, second = observed.by_id[relation.from_], observed.by_id[relation.to]
    observer = str(get_kind("manoeuvre", relation.manoeuvre).observe)
    describe = load_function(observer, __package__)
    if describe(first, second, event, observed) is not None:
        return None
    return f"it does not come about as {relation.manoeuvre}"


def describe_tailgating(
    follower: Trajectory, leader: Trajectory, event: Event, observed: SceneObservation
) -> str | None:
    """Half of the time that it follows, the headway is a second or less; only of a follow."""
    if event.type != "follow":
        return None
    ids = observed.ids
    for lane in observed.lanes:
        if ids[lane.follower] == follower.id:
            near = (lane.times >= event.time) & (lane.times <= float(event.evidence["until"]))
            near &= (lane.speed > CREEP) & (lane.leader == ids.index(leader.id))
            usual = float(np.median(lane.headway[near])) if near.any() else np.inf
            if usual <= CLOSE_UP:
                return f"agent {follower.id} drives {usual:.1f} s behind agent {leader.id}"
    return None


def describe_lane_change(
    first: Trajectory, second: Trajectory, event: Event, _observed: SceneObservation
) -> str | None:
    """It changes into the other's side."""
    changed = _measure_lane_change(first, second, event.time, 0.0)
    return None if changed is None else f"agent {first.id} moves {changed:.1f} m over"


def describe_cut_in(
    first: Trajectory, second: Trajectory, event: Event, observed: SceneObservation
) -> str | None:
    """It changes into the lane of the other, and is then next ahead of it, close."""
    changed = _measure_lane_change(first, second, event.time, MERGES)
    if changed is None:
        return None
    ids = observed.ids
    for lane in observed.lanes:
        if ids[lane.follower] == second.id:
            after = (np.abs(lane.times - event.time) <= MERGES) & (lane.headway <= CUT_IN)
            if (after & (lane.leader == ids.index(first.id))).any():
                return f"agent {first.id} moves {changed:.1f} m over, in ahead of agent {second.id}"
    return None


def _measure_lane_change(
    first: Trajectory, second: Trajectory, time: float, later: float
) -> float | None:
    """How far it comes over from its lane towards the way of the other [m]; None if it does not.

    Args:
        later: until how long after the event it may still be coming over [s].
    """
    # The way goes on a little straight at both ends; who is farther ahead or behind is in no lane
    # of it.
    ends = second.heading[[0, -1]]
    on = GOES_ON * np.stack((np.cos(ends), np.sin(ends)), axis=1)
    way = geos.LineString(np.vstack((second.xy[:1] - on[:1], second.xy, second.xy[-1:] + on[1:])))
    points = geos.points(first.xy)
    along, away = geos.line_locate_point(way, points), geos.distance(way, points)
    beside = (along > 1e-6) & (along < way.length - 1e-6)
    before = away[beside & (first.times >= time - CHANGES) & (first.times <= time)]
    after = away[beside & (np.abs(first.times - time) <= later + 0.15)]
    if not len(before) or not len(after) or before.max() < OTHER_LANE:
        return None
    changed = float(before.max() - after.min())
    return changed if changed >= LEAST_CHANGE else None


def describe_lead_braking(
    follower: Trajectory, leader: Trajectory, event: Event, observed: SceneObservation
) -> str | None:
    """The leader brakes hard from a drive, the follower next behind it in its lane."""
    since, until = event.time - SOON.get(event.type, 0.0), event.time
    if event.type == "follow":
        until = float(event.evidence["until"])
    hard = np.flatnonzero((leader.acceleration < -HARD) & _is_between(leader, since, until))
    ids = observed.ids
    lane = next((each for each in observed.lanes if ids[each.follower] == follower.id), None)
    if not len(hard) or lane is None:
        return None
    onset = float(leader.times[hard[0]])
    if leader.speed[_is_between(leader, onset - 1.5, onset)].max() < MOVING:
        return None
    # No other vehicle drives between the two in one lane as it begins to brake.
    k = int(np.argmin(np.abs(lane.times - onset)))
    if lane.leader[k] < 0 or ids[lane.leader[k]] != leader.id or lane.gap[k] > LOOK_AHEAD:
        return None
    if event.type == "follow":  # it comes down to half its speed, or less
        before = follower.speed[_is_between(follower, onset - 0.5, onset + 0.1)]
        after = follower.speed[_is_between(follower, onset, onset + ANSWERS)]
        if not (len(before) and len(after) and after.min() <= before.max() / 2):
            return None
    hardest = -float(leader.acceleration[_is_between(leader, onset, until)].min())
    what = f"agent {leader.id} brakes at {hardest:.1f} m/s² from {onset:.1f} s on"
    return f"{what}, ahead of agent {follower.id}"


def _is_between(track: Trajectory, since: float, until: float) -> BoolArray:
    """[T] the samples of a span [s]."""
    return np.asarray((track.times >= since - 1e-6) & (track.times <= until + 1e-6))


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
    marked = any(crosswalk.area.distance(point) <= ON_CROSSWALK for crosswalk in ground.crosswalks)
    on_road = bool(ground.road.contains(np.array([place]))[0])
    match zone:
        case "crosswalk":
            return marked
        case "sidewalk":
            return not marked and bool(ground.walkable.contains(np.array([place]))[0])
        case "conflict":
            # The lanes of the legs lie outside the junction.
            legs = (lanelet for lanelet in intersection_map.lanelets if lanelet.kind != "connector")
            areas = (geos.Polygon([*leg.left, *reversed(leg.right)]) for leg in legs)
            return on_road and not any(area.intersects(point) for area in areas)
        case "roadway":
            return on_road and not (on_foot and marked)
        case "lane":
            return on_road


_SLOWEST = 1.0
"""Speed [m/s] at which who hardly moves at the contact is taken to go on from it."""


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
    closest = observed.find_closest(pair)
    if closest is None:
        return None
    times = (closest.first_time, closest.second_time)
    ahead = closest.first if times[0] < times[1] else closest.second
    return PassingOrder(observed.ids[ahead], min(times), max(times))


def list_passing_orders(observed: SceneObservation, among: Set[int]) -> list[dict[str, Any]]:
    """Rows of who passes first, of all pairs of these agents that have an order."""
    orders = {
        pair: find_crossing_order(observed, pair)
        for pair in observed.encounters_by_pair
        if pair <= among
    }
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
        pair.append(extend_straight(until, distance=ONWARDS[track.type], speed=speed))
    zone = find_nearest_zone(pair[0], pair[1], event.location)
    stays = [] if zone is None else [find_zone_occupancy(each, zone) for each in pair]
    entered = [(stay.enter, track.id) for stay, track in zip(stays, pair, strict=False) if stay]
    if len(entered) < 2 or entered[0][0] == entered[1][0]:
        return None
    (early, first), (late, _) = sorted(entered)
    return PassingOrder(first, early, late)
