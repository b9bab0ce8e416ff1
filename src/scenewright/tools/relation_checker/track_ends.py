"""Where tracks begin after the scene does, and end before it (SEMANTICS section 9)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.events import Event, Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.objects import ObjectRecord
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.trajectory import Trajectory

STARTS_WITHIN = 1e-6
"""A track that begins this shortly after the scene [s] is there from its start."""
ENDS_WITHIN = 0.2 + 1e-6
"""A track that ends this shortly before the scene [s] was ended by it."""
EDGE = 4.0
"""How near to the edge of the map, or to an end of a way through it, vehicles come and go [m]."""
BESIDE_GOAL = 2.0
"""How far beside a goal region agents may begin and end [m]."""
BESIDE_OBJECT = 2.0
"""How far from the side of an object a pedestrian is that steps out of it [m]."""
LEAD = 3.0
"""How long an agent is there before its event [s]; how close to one no pedestrian comes or goes."""
IN_VIEW = 20.0
"""What is no further from an event than this is in view of it [m]."""


def check_ends(
    tracks: Sequence[Trajectory],
    intersection_map: IntersectionMap,
    *,
    until: float,
    collided: frozenset[int],
    foreground: frozenset[int],
    events: Sequence[Event],
    objects: Sequence[ObjectRecord],
) -> tuple[Finding, ...]:
    """Tracks that begin after the scene does, or end before it, where no agent comes or goes.

    Not asked on maps without goal regions.

    Args:
        until: end of the scene [s]; collided: ids of those that a collision may end.
        foreground: ids of those whose late beginnings are named instead.
        events: those asked for, in view of which no pedestrian comes out of nowhere.
        objects: which pedestrians may step out of.
    """
    found = []
    conflicts = [event for event in events if event.type != "follow"]
    for track in tracks if intersection_map.goal_regions else ():
        # A pedestrian may step out of what it begins beside.
        steps_out = track.type == "pedestrian" and any(
            math.dist(track.xy[0], (each.x, each.y)) <= each.length / 2 + BESIDE_OBJECT
            for each in objects
        )
        late = track.start > STARTS_WITHIN and not steps_out
        early = track.end < until - ENDS_WITHIN and track.id not in collided
        named = track.id in foreground
        for rule, does, asked, k, seen in (
            ("appears", "begins", late, 0, () if named else conflicts),
            ("vanishes", "ends", early, -1, conflicts),
        ):
            fault = _find_fault(track, k, seen, intersection_map) if asked else None
            if fault is not None:
                time, (x, y) = float(track.times[k]), track.xy[k].tolist()
                found.append(Finding(
                    rule=rule, agents=(track.id,), time=round(time, 3),
                    detail=f"{track.type} {track.id} {does} at {time:.1f} s {fault}, at "
                    f"({x:.1f}, {y:.1f})",
                ))  # fmt: skip
    return tuple(found)


def _find_fault(
    track: Trajectory, k: int, conflicts: Sequence[Event], intersection_map: IntersectionMap
) -> str | None:
    """Why no agent of its class comes or goes where a track begins or ends; None where they do.

    Vehicles and riders come and go at the edge of the map. Beside the road pedestrians do anywhere
    but in view of a conflict: there are doors; in goal regions of theirs they always do, and so do
    riders.

    Args:
        k: 0 for its beginning, -1 for its end.
    """
    place, time = track.xy[k], float(track.times[k])
    walks = track.type == "pedestrian"
    if not walks:  # ways of vehicles begin or end there, or it is in a goal region of theirs
        ways = (each.centreline for each in intersection_map.movements)
        at_end = any(math.dist(place, end) <= EDGE for way in ways for end in (way[0], way[-1]))
        at_edge = float(np.abs(place).max()) >= intersection_map.extent - EDGE
        if at_edge or at_end or _is_at_goal("vehicle", place, intersection_map):
            return None
    on_road = bool(get_ground_raster(intersection_map).road.contains(place[None])[0])
    on_foot = (walks or track.is_rider) and not on_road
    if on_foot and _is_at_goal("pedestrian", place, intersection_map):
        return None
    if not walks or on_road:
        return "on the carriageway" if walks else "in the middle of the map"
    return next(
        (f"in view of the {each.type} at {each.time:.1f} s" for each in conflicts
         if abs(each.time - time) < LEAD and math.dist(place, each.location) < IN_VIEW),
        None,
    )  # fmt: skip


def _is_at_goal(kind: AgentClass, place: FloatArray, intersection_map: IntersectionMap) -> bool:
    """Whether a place is in, or just beside, a goal region of a class."""
    x, y = place.tolist()
    return any(
        max(west - x, x - east, south - y, y - north) <= BESIDE_GOAL
        for of, _, (west, south, east, north) in get_ground_raster(intersection_map).goals
        if of == kind
    )


def list_late_beginnings(
    tracks: Sequence[Trajectory], events: Sequence[Event]
) -> list[dict[str, Any]]:
    """Every agent that is there for less than 3 s before an event of its own."""
    begins = {track.id: track.start for track in tracks}
    return [
        {"agent": agent, "event": event.type, "lead": round(event.time - begins[agent], 3) + 0.0}
        for event in events
        for agent in (event.from_, event.to)
        if event.time - begins[agent] < LEAD - 1e-6
    ]
