"""What tracks show of each road user: its class, where it comes from, goes to, and crosses."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.relation_checker import RoadUser

geos: Any = import_module("shapely")  # has no types of its own
_ALONG = math.radians(50.0)
"""A vehicle on a leg moves within this of the leg's direction."""
_BESIDE = math.radians(35.0)
"""A vehicle on a leg lies within this of the leg's bearing from the middle."""
_OUTSIDE = 12.0
"""Nearer to the middle than this a vehicle is on no leg [m]."""
_WAY = 1.0
"""Way over which the direction at an end of a track is measured [m]."""
_CROSSED = 2.0
"""A pedestrian crosses where at least this much of its way lies on the crosswalk or road [m]."""


@dataclass(frozen=True)
class SeenAgent:
    """What the track of one road user shows.

    Attributes:
        id: its number; type: class, such as vehicle or pedestrian.
        entry, exit: leg that a vehicle comes from and leaves by; None where the track does not
            show it.
        movement: the turn between the two; crossing or jaywalking of a pedestrian; None as above.
        crosswalks: legs whose crosswalk a pedestrian uses.
    """

    id: int
    type: str
    entry: Compass | None
    exit: Compass | None
    movement: str | None
    crosswalks: frozenset[Compass]


def see_agents(users: Iterable[RoadUser], intersection: IntersectionMap) -> list[SeenAgent]:
    """Every road user of a scene, as the map lets its track be read."""
    found = []
    turns = {(each.entry, each.exit): each.turn for each in intersection.movements}
    for user in users:
        xy = user.track.xy
        if user.shape.type == "pedestrian":
            way = geos.LineString(xy) if len(xy) > 1 else geos.LineString()
            walks = ((each.leg, geos.Polygon(each.polygon)) for each in intersection.crosswalks)
            used = frozenset(leg for leg, area in walks if way.intersection(area).length > _CROSSED)
            road = (geos.Polygon(area.exterior, area.holes) for area in intersection.road)
            on_road = sum(way.intersection(area).length for area in road) > _CROSSED
            movement = "crossing" if used else "jaywalking" if on_road else None
            found.append(SeenAgent(user.id, "pedestrian", None, None, movement, used))
            continue
        entry, leaving = _find_leg(xy, intersection), _find_leg(xy[::-1], intersection)
        movement = turns.get((entry, leaving)) if entry and leaving else None
        found.append(SeenAgent(user.id, user.shape.type, entry, leaving, movement, frozenset()))
    return found


def _find_leg(xy: FloatArray, intersection: IntersectionMap) -> Compass | None:
    """The leg on which a way begins (or, given backwards, ends); None where it is on none."""
    away = np.hypot(*(xy - xy[0]).T)
    if away.max() < _WAY or np.hypot(*xy[0]) < _OUTSIDE:
        return None
    ahead = xy[int(np.argmax(away >= _WAY))] - xy[0]
    outward = math.atan2(-ahead[1], -ahead[0])
    place = math.atan2(xy[0][1], xy[0][0])
    near = [
        (_differ(place, leg.bearing), leg.name)
        for leg in intersection.legs
        if _differ(place, leg.bearing) < _BESIDE and _differ(outward, leg.bearing) < _ALONG
    ]
    return min(near)[1] if near else None


def _differ(a: float, b: float) -> float:
    return abs(math.remainder(a - b, math.tau))
