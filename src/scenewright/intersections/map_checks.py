"""Whether the numbers of a map can be those of an intersection."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scenewright.scene.base import Point
from scenewright.scene.map import IntersectionMap

FARTHEST = 10_000.0
"""Nothing of an intersection lies further from its middle [m]."""
MOST_POINTS = 2_000_000


def find_map_fault(place: IntersectionMap) -> str | None:
    """The first thing that no map has, in words; None for a map that can be used."""
    points = 0
    for what, line, least in _list_lines(place):
        points += len(line)
        if len(line) < least:
            return f"{what} has {len(line)} points; it needs {least}"
        if not (np.abs(np.array(line, dtype=np.float64)) <= FARTHEST).all():
            return f"{what} has a point that is no place within {FARTHEST:g} m"
    if points > MOST_POINTS:
        return f"it has {points:,} points; at most {MOST_POINTS:,}"
    for what, value, most in _list_numbers(place):
        if not 0.0 < value <= most:
            return f"{what} is {value:g}; it must be above 0 and at most {most:g}"
    return next(_list_missing(place), None)


def _list_lines(place: IntersectionMap) -> Iterator[tuple[str, tuple[Point, ...], int]]:
    """Every line and ring: what it is, its points, how many it needs."""
    for lane in place.lanelets:
        for name in ("left", "right", "centreline"):
            yield f"{name} of lanelet {lane.id}", getattr(lane, name), 2
    for way in place.movements:
        yield f"the way of {way.id}", way.centreline, 2
    for walk in place.crosswalks:
        yield f"crosswalk {walk.id}", walk.polygon, 3
        yield f"the middle of crosswalk {walk.id}", walk.centreline, 2
    for stop in place.stop_lines:
        yield f"stop line {stop.id}", stop.line, 2
    for region in place.goal_regions:
        yield f"the goal region {region.id}", region.polygon, 3
    for zone in place.conflict_zones:
        yield f"the conflict zone {zone.id}", zone.polygon, 3
    for area in (*place.road, *place.walkable):
        yield "an area of the ground", area.exterior, 3
        for hole in area.holes:
            yield "a hole in the ground", hole, 3


def _list_numbers(place: IntersectionMap) -> Iterator[tuple[str, float, float]]:
    """Every length, speed and time: what it is, its value, the most that it may be."""
    yield "the extent", place.extent, FARTHEST
    for lane in place.lanelets:
        yield f"the width of lanelet {lane.id}", lane.width, 50.0
        yield f"the speed limit of lanelet {lane.id}", lane.speed_limit, 100.0
    for walk in place.crosswalks:
        yield f"the width of crosswalk {walk.id}", walk.width, 50.0
    for phase in place.signals.phases if place.signals else ():
        yield "a phase of the lights", phase.duration, 3600.0


def _list_missing(place: IntersectionMap) -> Iterator[str]:
    """What the lights name and the map does not have, in words."""
    if place.signals is None:
        return
    groups, ways = (
        {group.id for group in place.signals.groups},
        {movement.id for movement in place.movements},
    )
    crosswalks = {crosswalk.id for crosswalk in place.crosswalks}
    for way in place.movements:
        if way.signal_group is not None and way.signal_group not in groups:
            yield f"there are no lights {way.signal_group[:80]!r} for {way.id}"
    for group in place.signals.groups:
        for name in (*set(group.movements).difference(ways), *set(group.crosswalks) - crosswalks):
            yield f"the lights {group.id} are for {name[:80]!r}, which it does not have"
    for phase in place.signals.phases:
        if not groups <= set(phase.colours):
            yield f"a phase of the lights has no colour for {min(groups - set(phase.colours))!r}"
