"""Waypoints, crosswalks and segments of agents, held against their tracks.

What a scene leaves empty it does not claim.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event, Finding
from scenewright.scene.kinds import has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.trajectory import Trajectory
from scenewright.tools.relation_checker.yielding import STANDING

ASIDE = 2.0
"""How far a track may lie beside the way through the waypoints [m]."""
UNEVEN = 0.35
"""By which share two neighbouring waypoints may be nearer or further apart than usual."""
UNEVEN_ROUND = 0.55
"""The same where a U-turn bends the way between two of them: they are even along that."""
GOAL = 2.0
"""How far the last waypoint may lie from the goal [m]."""
LATE = 1.5
"""By how much segments and track may begin apart [s]; how they end, refining decides."""
LONGEST_STAND = 1.5
"""Longest standstill of an agent that keeps on or proceeds [s]."""
ROLLING, STROLLING = 1.5, 0.7
"""Highest speed that counts as a stop [m/s]; the second for pedestrians."""


def find_false_behavior(
    scene: SceneRecord,
    tracks: Sequence[Trajectory],
    events: Sequence[Event],
    intersection_map: IntersectionMap | None,
) -> tuple[Finding, ...]:
    """Agents whose waypoints, crosswalk or segments their track does not bear out."""
    collided = {n for e in events if e.type == "collision" for n in (e.from_, e.to)}
    collided |= {
        each.agent for each in scene.encounters if has_trait("encounter", each.how, "ends")
    }
    return tuple(
        Finding(rule=rule, agents=(agent.id,), detail=f"{agent.type} {agent.id}: {reason}")
        for agent, track in zip(scene.agents, tracks, strict=True)
        for rule, reasons in (
            ("waypoints_contradicted", _check_waypoints(agent, track, intersection_map)),
            ("segments_contradicted", _check_segments(agent, track, agent.id in collided)),
        )
        for reason in reasons
    )


def _check_waypoints(
    agent: AgentRecord, track: Trajectory, intersection_map: IntersectionMap | None
) -> Iterator[str]:
    if len(agent.waypoints) < 2:
        return
    points = np.array(agent.waypoints, dtype=np.float64)
    least = UNEVEN_ROUND if agent.movement == "uturn" else UNEVEN
    even, shortest, longest, usual, off = _measure_waypoints(points, track.xy, track.s, least)
    if not even:
        yield f"its waypoints are {shortest:.1f} to {longest:.1f} m apart, not evenly spaced"
    if off > usual / 2 + ASIDE:
        yield f"its track is {off:.1f} m from the nearest of its waypoints"
    if math.dist(points[-1], agent.goal) > GOAL:
        yield "its last waypoint is not its goal"
    if intersection_map is not None and agent.movement == "crossing":
        yield from _check_crosswalk(agent, track, points, intersection_map)


@compiled
def _measure_waypoints(
    points: FloatArray, xy: FloatArray, s: FloatArray, least: float
) -> tuple[bool, float, float, float, float]:
    """Whether points [K, 2] are evenly spaced, the least, largest and median distance between two.

    And how far any position [N, 2] is from the nearest of them [m]. Even are also those that are so
    along a track that bends, as in a roundabout; beyond its ends the straight distances stay.
    """
    steps, along = np.empty(len(points) - 1), np.empty(len(points) - 1)
    for k in range(len(steps)):
        steps[k] = np.hypot(points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1])
        way = s[_find_nearest(points[k + 1], xy)[0]] - s[_find_nearest(points[k], xy)[0]]
        along[k] = max(way, steps[k])
    off = 0.0
    for n in range(len(xy)):
        off = max(off, _find_nearest(xy[n], points)[1])
    even = _is_even(steps, least) or _is_even(along, least)
    return even, steps.min(), steps.max(), float(np.median(steps)), np.sqrt(off)


@compiled
def _is_even(steps: FloatArray, least: float) -> bool:
    usual = np.median(steps)
    longest, shortest = (1 + UNEVEN) * usual + 0.1, (1 - least) * usual - 0.1
    return bool(steps.max() <= longest and steps.min() >= shortest)


@compiled
def _find_nearest(place: FloatArray, among: FloatArray) -> tuple[int, float]:
    """Which of points [M, 2] is nearest to a place [2], the first of them, and how far, squared."""
    least, nearest = np.inf, 0
    for m in range(len(among)):
        apart = (place[0] - among[m, 0]) ** 2 + (place[1] - among[m, 1]) ** 2
        if apart < least:
            least, nearest = apart, m
    return nearest, least


def _check_crosswalk(
    agent: AgentRecord, track: Trajectory, points: FloatArray, intersection_map: IntersectionMap
) -> Iterator[str]:
    walks = get_ground_raster(intersection_map).crosswalks
    own = [each.area for each in walks if each.crosswalk.leg == agent.crosswalk]
    if own and not any(geos.intersects(area, geos.LineString(points)) for area in own):
        yield f"its waypoints do not lead over the {agent.crosswalk} crosswalk"
    if len(track.xy) < 2:
        return
    west, south, east, north = track.bounds
    for each in walks:
        low_x, low_y, high_x, high_y = each.bounds
        away = west > high_x or east < low_x or south > high_y or north < low_y
        if away or each.crosswalk.leg == agent.crosswalk:
            continue
        if float(geos.intersection(each.area, geos.LineString(track.xy)).length) > 1.0:
            yield f"it walks on the {each.crosswalk.leg} crosswalk, not the {agent.crosswalk} one"


def _check_segments(agent: AgentRecord, track: Trajectory, collided: bool) -> Iterator[str]:
    segments = agent.segments
    if not segments:
        return
    if any(before.end != after.start for before, after in pairwise(segments)):
        yield "its segments do not follow one another"
    if abs(segments[0].start - track.start) > LATE:
        yield f"its segments begin at {segments[0].start:.1f} s, its track at {track.start:.1f} s"
    if (segments[-1].status == "terminate") != collided:
        yield "a collision and a segment 'terminate' at the end come together or not at all"
    slow = STROLLING if track.type == "pedestrian" else ROLLING
    for segment in segments:
        if segment.end < segment.start:
            yield f"a segment ends at {segment.end:.1f} s before it begins at {segment.start:.1f} s"
        first = int(track.times.searchsorted(segment.start - 1e-6))
        speed = track.speed[first : track.times.searchsorted(segment.end + 1e-6, side="right")]
        if segment.status in ("keep", "proceed"):
            stood = 0.1 * _count_longest_stand(speed)
            if stood > LONGEST_STAND:
                yield f"it stands for {stood:.1f} s of the segment {segment.status}"
        if segment.status == "stop" and len(speed) > 10 and speed.min() > slow:
            yield f"it never goes below {speed.min():.1f} m/s in a segment 'stop'"


@compiled
def _count_longest_stand(speed: FloatArray) -> int:
    """Samples of the longest stretch in which it stands."""
    longest = run = 0
    for each in speed:
        run = run + 1 if each <= STANDING else 0
        longest = max(longest, run)
    return longest
