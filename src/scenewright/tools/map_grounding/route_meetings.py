"""How the routes of two road users lie to one another, and which patterns they serve."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from scenewright.scene.base import COMPASS_RING, OPPOSITE, Compass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.scene.relations import Pattern, Role
from scenewright.scene.uturns import make_route

_CORNER = 10.0
"""Crosswalks that end this near one another [m] share a corner."""

_MEDIAN = 14.0
"""Opposite directions of a road farther apart [m] are parted by more than a line."""

_FROM_THE_KERB = 4.3
"""Farthest from a kerb [m] that a conflict zone may begin for a pedestrian at the kerb to give way
there (SEMANTICS 4: 5 m, less a margin)."""

_MIRROR = {"left": "right", "right": "left"}


def list_meetings(pattern: Pattern, intersection_map: IntersectionMap) -> list[tuple[Route, Route]]:
    """Every pair of routes of a map on which a pattern can be played."""
    mirrored = is_mirrored(pattern, intersection_map)
    routes = (*intersection_map.routes, *map(make_route, intersection_map.uturns))
    roles = (pattern.from_, pattern.to)
    ways = (list_playable_routes(routes, role, mirrored=mirrored) for role in roles)
    return [(a, b) for a, b in product(*ways) if can_meet(pattern, a, b, intersection_map)]


def can_be_lawful(pattern: Pattern, *, intersection_map: IntersectionMap) -> bool:
    """Whether a pattern has routes on a map on which nobody has to run a red light."""
    return pattern.violator is None or any(
        share_green(a, b, intersection_map=intersection_map)
        for a, b in list_meetings(pattern, intersection_map)
    )


def can_serve(pattern: Pattern, a: Route, b: Route, *, intersection_map: IntersectionMap) -> bool:
    """Whether route `a` can play `from` and route `b` can play `to` of the pattern."""
    mirrored = is_mirrored(pattern, intersection_map)
    return (
        _can_play(a, pattern.from_, mirrored=mirrored)
        and _can_play(b, pattern.to, mirrored=mirrored)
        and can_meet(pattern, a, b, intersection_map)
    )


def can_meet(pattern: Pattern, a: Route, b: Route, intersection_map: IntersectionMap) -> bool:
    """Return whether two routes lie to one another as the pattern has it."""
    return _do_entries_fit(pattern, a, b) and _is_geometry_fitting(pattern, a, b, intersection_map)


def have_conflict(a: Route, b: Route, *, intersection_map: IntersectionMap) -> bool:
    """Whether the swept paths of two routes overlap on the map."""
    if "jaywalking" in (a.movement, b.movement):
        walker, other = (a, b) if a.movement == "jaywalking" else (b, a)
        return other.type == "vehicle" and walker.crosswalk in (other.entry, other.exit)
    return frozenset((a.zone_key, b.zone_key)) in intersection_map.zone_pairs


def share_green(a: Route, b: Route, *, intersection_map: IntersectionMap) -> bool:
    """Whether both may ever go at the same time; True where one of them has no signal."""
    groups = [intersection_map.find_signal_group(route) for route in (a, b)]
    if intersection_map.signals is None or None in groups:
        return True
    return any(
        all(phase.colours[str(group)] != "red" for group in groups)
        for phase in intersection_map.signals.phases
    )


def is_red_at_green(runner: Route, other: Route, *, intersection_map: IntersectionMap) -> bool:
    """Whether the light of the first is red at any time when that of the other is not."""
    groups = [intersection_map.find_signal_group(route) for route in (runner, other)]
    if intersection_map.signals is None or None in groups:
        return True
    return any(
        phase.colours[str(groups[0])] == "red" and phase.colours[str(groups[1])] != "red"
        for phase in intersection_map.signals.phases
    )


def is_kerb_near(walker: Route, other: Route, *, intersection_map: IntersectionMap) -> bool:
    """Whether the first, if on foot, steps off its kerb close to where it meets the other."""
    crosswalk = next(
        (each for each in intersection_map.crosswalks if each.leg == walker.crosswalk), None
    )
    if walker.type == "vehicle" or crosswalk is None or walker.entry not in crosswalk.sides:
        return True
    kerb, beyond = (np.array(point) for point in crosswalk.centreline)
    if crosswalk.sides[0] != walker.entry:
        kerb, beyond = beyond, kerb
    ahead = (beyond - kerb) / np.hypot(*(beyond - kerb))
    both = {walker.zone_key, other.zone_key}
    zones = [
        zone.polygon
        for zone in intersection_map.conflict_zones
        if {zone.first, zone.second} == both
    ]
    ways = [float(((np.array(zone) - kerb) @ ahead).min()) for zone in zones]
    return not ways or min(ways) <= _FROM_THE_KERB


def list_playable_routes(routes: Sequence[Route], role: Role, *, mirrored: bool) -> list[Route]:
    """The routes on which the role can be played."""
    return [route for route in routes if _can_play(route, role, mirrored=mirrored)]


def is_mirrored(pattern: Pattern, intersection_map: IntersectionMap) -> bool:
    """Whether left and right change places: the files speak of right-hand traffic.

    So a left turn across the path of others is a right turn there, its kind of collision included.
    """
    return intersection_map.left_hand_traffic and pattern.kind != "pedestrian_strike"


def _can_play(route: Route, role: Role, *, mirrored: bool) -> bool:
    movement = _MIRROR.get(route.movement, route.movement) if mirrored else route.movement
    return movement in role.movements


def _do_entries_fit(pattern: Pattern, a: Route, b: Route) -> bool:
    match pattern.entries:
        case "any":
            return a.type != b.type or a.entry != b.entry
        case "same":
            return a.entry == b.entry
        case "opposite":
            return OPPOSITE[a.entry] == b.entry
        case "lateral":
            return a.entry != b.entry and OPPOSITE[a.entry] != b.entry


def measure_ring_steps(leg: str, *, start: str) -> int:
    """How many eighths of a circle clockwise a leg lies from another one, 0 to 7.

    An agent from the north drives southwards and has the east, 2 from it, on its left.
    """
    return (COMPASS_RING.index(leg) - COMPASS_RING.index(start)) % len(COMPASS_RING)


def _is_geometry_fitting(
    pattern: Pattern, a: Route, b: Route, intersection_map: IntersectionMap
) -> bool:
    match pattern.geometry:
        case "crossing" if a.type == b.type == "pedestrian":
            return _do_walks_meet(pattern, a, b, intersection_map)
        case "crossing":
            return have_conflict(a, b, intersection_map=intersection_map) and (
                a.type != b.type or a.exit != b.exit
            )
        case "merging":
            return (
                a.exit == b.exit
                and a.entry != b.entry
                and have_conflict(a, b, intersection_map=intersection_map)
            )
        case "same_lane":
            return a.entry == b.entry and _share_a_lane(a, b, intersection_map)
        case "turn_across":
            # Who turns off from a lane of its own beside the other's never crosses its way.
            return a.exit != b.exit and a.entry == b.entry and _share_a_lane(a, b, intersection_map)
        case "same_way" | "overtaking" | "cutting_in":
            return a.entry == b.entry and a.exit == b.exit
        case "lane_change":
            return (
                a.id == b.id
                and sum(
                    lane.kind == "approach" and lane.leg == a.entry
                    for lane in intersection_map.lanelets
                )
                >= 2
            )
        case "opposing":
            return (
                a.entry == b.exit and a.exit == b.entry and not _is_divided(a, b, intersection_map)
            )


def _do_walks_meet(pattern: Pattern, a: Route, b: Route, intersection_map: IntersectionMap) -> bool:
    """Whether two cross one crosswalk in opposite directions, or meet at a corner, where one comes
    from a crosswalk and the other goes to the next."""
    if pattern.zone != "sidewalk":
        return a.crosswalk == b.crosswalk and a.entry != b.entry
    kerbs = [
        (_find_kerb(one, one.exit, intersection_map), _find_kerb(two, two.entry, intersection_map))
        for one, two in ((a, b), (b, a))
        if one.crosswalk != two.crosswalk
    ]
    return any(np.hypot(*(here - there)) <= _CORNER for here, there in kerbs)


def _find_kerb(route: Route, side: Compass, intersection_map: IntersectionMap) -> FloatArray:
    """The end of a route's crosswalk on a side [m]; NaN where it has none."""
    for crosswalk in intersection_map.crosswalks:
        if crosswalk.leg == route.crosswalk and side in crosswalk.sides:
            return np.array(crosswalk.centreline[crosswalk.sides.index(side)])
    return np.full(2, np.nan)


def _share_a_lane(a: Route, b: Route, intersection_map: IntersectionMap) -> bool:
    """Whether one lane before the stop line leads both ways."""
    lanes = [intersection_map.find_movement(route) for route in (a, b)]
    if None in lanes:
        return True
    approaches = {lane.id for lane in intersection_map.lanelets if lane.kind == "approach"}
    first, second = (approaches.intersection(lane.lanelets) for lane in lanes if lane)
    return bool(first & second)


def _is_divided(a: Route, b: Route, intersection_map: IntersectionMap) -> bool:
    """Whether a median parts the way that one drives out by from the other's way in."""
    out, into = intersection_map.find_movement(a), intersection_map.find_movement(b)
    if out is None or into is None:
        return False
    (x, y), (u, v) = out.centreline[-1], into.centreline[0]
    return float(np.hypot(x - u, y - v)) > _MEDIAN
