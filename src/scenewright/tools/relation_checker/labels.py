"""What a scene says of itself, held against its tracks: events, journeys, waypoints, segments.

Labels prove nothing, but who trains on a scene trains on them, so a false one is as bad as a false
track.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import AgentClass, Compass, FloatArray
from scenewright.scene.events import EVENT_OF_RELATION, Event, Finding
from scenewright.scene.kinds import has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.objects import OBJECT_SIZES, ObjectRecord
from scenewright.scene.record import AgentRecord, EventRecord, SceneRecord
from scenewright.scene.track import VEHICLE_SIZES
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.legs import find_entry_leg, find_exit_leg
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.plausibility import EDGE, SIZE
from scenewright.tools.relation_checker.trajectory import Trajectory, find_runs
from scenewright.tools.relation_checker.yielding import STANDING

LABEL_TIME = 0.3
LABEL_PLACE = 1.5
GOAL = 15.0
"""How far a goal may lie beside the goal regions of its class (of a vehicle: on its exit) [m]."""
BACKWARDS = 1.0
"""How far a pedestrian may end behind its start, from its entry towards its exit [m]."""
SYMMETRIC = ("collision", "near_miss")
"""Kinds of collision in which which party strikes is part of what was asked for."""

_TOWARDS: dict[Compass, complex] = {
    "east": 1, "northeast": 1 + 1j, "north": 1j, "northwest": 1j - 1,
    "west": -1, "southwest": -1 - 1j, "south": -1j, "southeast": 1 - 1j,
}  # fmt: skip


def find_false_labels(
    scene: SceneRecord, events: Sequence[Event], *, lit: bool
) -> tuple[Finding, ...]:
    """Rows of `scene.events` without an event, and events without a row.

    Args:
        events: what the proof will show, without what is incidental.
        lit: whether the lights were looked at; if not, a red light run cannot be borne out.
    """
    if not scene.events and not events:
        detail = "events is empty; where nothing happens it has one row of the type normal"
        return (Finding(rule="label_missing", agents=(), detail=detail),)
    asked: set[tuple[str, int, int]] = {
        (r.type, r.from_, r.to)
        for r in scene.relations
        if not has_trait("collision", r.kind, "directed")
    }
    left = list(events)
    found: list[Finding] = []
    for label in scene.events:
        if label.type == "normal" and not events and len(scene.events) == 1:
            continue
        borne_out = (e for e in left if _matches_event(label, e, asked, lit=lit))
        event = next(borne_out, None)
        if event is None:
            found.append(Finding(
                rule="label_contradicted",
                agents=tuple(n for n in (label.from_, label.to) if n is not None),
                time=label.time if label.time is not None and math.isfinite(label.time) else None,
                detail=f"the label {label.type} of {label.from_} and {label.to} at {label.time} s "
                "is not borne out by the tracks",
            ))  # fmt: skip
        else:
            left.remove(event)
    for event in left:
        what = f"{event.type} of {event.from_} and {event.to} at {event.time:.1f} s"
        found.append(Finding(
            rule="label_missing", agents=(event.from_, event.to), time=event.time,
            detail=f"no label names the {what}",
        ))  # fmt: skip
    return tuple(found)


def _matches_event(
    label: EventRecord, event: Event, asked: set[tuple[str, int, int]], *, lit: bool
) -> bool:
    if label.type != event.type or label.kind != event.kind:
        return False
    if label.cause != event.cause and (lit or not has_trait("cause", label.cause, "red_light")):
        return False
    orders = [(event.from_, event.to)]
    if event.type in SYMMETRIC and (event.type, event.to, event.from_) in asked:
        orders.append((event.to, event.from_))
    if (label.from_, label.to) not in orders or label.time is None or label.location is None:
        return False
    late, off = abs(label.time - event.time), math.dist(label.location, event.location)
    return late <= LABEL_TIME and off <= LABEL_PLACE


def find_false_journeys(
    scene: SceneRecord, tracks: Sequence[Trajectory], intersection_map: IntersectionMap
) -> tuple[Finding, ...]:
    """Agents whose route, entry, exit, movement or goal the map or their track contradicts.

    A map without routes says nothing about them.
    """
    if not intersection_map.routes:
        return ()
    routes, found = get_ground_raster(intersection_map).routes, list[Finding]()
    for agent, track in zip(scene.agents, tracks, strict=True):
        kind, reasons = _find_route_class(agent), list[str]()
        if agent.route not in routes:
            reasons.append(f"the map has no route {agent.route}")
        elif routes[agent.route] != (
            kind, agent.entry, agent.exit, agent.movement, agent.crosswalk
        ):  # fmt: skip
            reasons.append(f"its labels are not those of its route {agent.route}")
        if not _is_goal_near_exit(agent, intersection_map):
            x, y = agent.goal
            reasons.append(f"its goal {x:.0f}, {y:.0f} is none of its exit")
        if kind == "vehicle":
            for word, label, seen in (
                ("comes from", agent.entry, find_entry_leg(track, intersection_map)),
                ("leaves to", agent.exit, find_exit_leg(track, intersection_map)),
            ):
                if seen is not None and seen != label:
                    reasons.append(f"it {word} the {seen}, its label says {label}")
        elif not has_trait("motion", agent.motion, "returns"):
            way = _TOWARDS[agent.exit] - _TOWARDS[agent.entry]
            east, north = (track.xy[-1] - track.xy[0]).tolist()
            if way != 0 and (east * way.real + north * way.imag) / abs(way) < -BACKWARDS:
                reasons.append(
                    f"it walks from its exit {agent.exit} towards its entry {agent.entry}"
                )
        found += [
            Finding(
                rule="journey_contradicted", agents=(agent.id,),
                detail=f"{agent.type} {agent.id}: {reason}",
            )
            for reason in reasons
        ]  # fmt: skip
    return tuple(found)


def _find_route_class(agent: AgentRecord) -> AgentClass:
    """Whose ways an agent takes: those of vehicles, or, on a crosswalk, those of pedestrians."""
    if agent.type not in ("cyclist", "scooter"):
        return agent.type
    return "vehicle" if agent.crosswalk is None else "pedestrian"


def _is_goal_near_exit(agent: AgentRecord, intersection_map: IntersectionMap) -> bool:
    """Whether a goal is one of its exit; jaywalkers may be bound for any place beside the road.

    So may riders on a crosswalk at the edge of the map, to which they follow the sidewalk.
    """
    x, y = agent.goal
    leaves_map = max(abs(x), abs(y)) >= intersection_map.extent - EDGE
    rides_on = agent.type != "pedestrian" and agent.crosswalk is not None and leaves_map
    if agent.movement == "jaywalking" or rides_on:
        return not get_ground_raster(intersection_map).road.contains(np.array([(x, y)]))[0]
    return any(
        west - GOAL <= x <= east + GOAL and south - GOAL <= y <= north + GOAL
        for kind, leg, (west, south, east, north) in get_ground_raster(intersection_map).goals
        if kind == _find_route_class(agent) and (leg == agent.exit or kind == "pedestrian")
    )


RUNNERS = ("running", "runner")
"""Subtypes of pedestrians."""
_CLOCK = re.compile(r"([01]\d|2[0-3]):([0-5]\d)")
_SEEN_OVER = frozenset({"bin", "door", "motorcycle"})
"""Kinds and subtypes of objects that do not block the view."""
_CUT = "…"
"""Stands in a prompt for words of a long conversation that were left out."""


def find_false_metadata(
    scene: SceneRecord, intersection_map: IntersectionMap | None
) -> tuple[Finding, ...]:
    """What contradicts the map, or another part of the same file."""
    named = {number for entry in scene.said for number in entry.agents}
    bound = named.union(*({relation.from_, relation.to} for relation in scene.relations))
    rows: list[tuple[tuple[int, ...], str]] = []
    rows += [((), detail) for detail in _check_meta(scene, intersection_map)]
    for agent in scene.agents:
        who, own = f"{agent.type} {agent.id}", (agent.id,)
        if agent.role == "background" and agent.id in bound:
            rows.append((own, f"{who} was asked for and is called background"))
        if not re.fullmatch(rf"{agent.type}-[1-9]\d*", agent.name):
            detail = f"{who} has the name {agent.name!r}, not one like {agent.type}-1"
            rows.append((own, detail))
        known = {"pedestrian": RUNNERS, "vehicle": VEHICLE_SIZES}.get(agent.type, ())
        if agent.subtype is not None and agent.subtype not in known:
            rows.append((own, f"there is no {agent.type} of the subtype {agent.subtype!r}"))
    rows += [((), detail) for each in scene.objects for detail in _check_object(each)]
    first: dict[str, int] = {}
    for agent in scene.agents:
        other = first.setdefault(agent.name, agent.id)
        if other != agent.id:
            detail = f"agents {other} and {agent.id} have the same name {agent.name!r}"
            rows.append(((other, agent.id), detail))
    # What the account says was asked for stands among the relations.
    asked = {
        (relation.type, frozenset((relation.from_, relation.to))) for relation in scene.relations
    }
    for entry in scene.said:
        event = EVENT_OF_RELATION.get(entry.value or "") if entry.became == "relation" else None
        if event is not None and (event, frozenset(entry.agents)) not in asked:
            detail = f"'{entry.words}' asks for {event}; relations has none of these agents"
            rows.append((entry.agents, detail))
    rule = "metadata_contradicted"
    return tuple(Finding(rule=rule, agents=agents, detail=detail) for agents, detail in rows)


def _check_meta(scene: SceneRecord, intersection_map: IntersectionMap | None) -> Iterator[str]:
    """The map and the time are those named; the account's words stand where it has them."""
    if intersection_map is not None and scene.meta.map_id != intersection_map.map_id:
        yield (
            f"map_id is {scene.meta.map_id}; that of {intersection_map.name} is "
            f"{intersection_map.map_id}"
        )
    time = _CLOCK.fullmatch(scene.meta.time_of_day)
    if time is None:
        yield f"time_of_day {scene.meta.time_of_day!r} is no time such as 08:00"
    elif not 0.0 <= scene.meta.timestamp - 3600 * int(time[1]) - 60 * int(time[2]) < 60.0:
        yield (
            f"timestamp {scene.meta.timestamp:g} s after midnight is not at "
            f"{scene.meta.time_of_day}"
        )
    prompt = scene.meta.user_prompt
    for entry in scene.said if _CUT not in prompt else ():
        if entry.end and prompt[entry.start : entry.end].casefold() != entry.words.casefold():
            yield f"the instruction does not say {entry.words!r} where the account has it"


def _check_object(each: ObjectRecord) -> Iterator[str]:
    """An object has about the size of its kind, and blocks the view as its kind does."""
    if each.kind in OBJECT_SIZES:
        sizes = [OBJECT_SIZES[each.kind]]
    elif each.subtype is None:
        sizes = list(VEHICLE_SIZES.values())
    else:
        sizes = [size for name, size in VEHICLE_SIZES.items() if name == each.subtype]
    ratios = [(each.length / length, each.width / width) for length, width in sizes]
    if not any(max(abs(a - 1), abs(b - 1)) <= SIZE for a, b in ratios):
        what = f"{each.kind} {each.subtype or ''}".strip()
        yield f"{each.id}, a {what}, measures {each.length:g} x {each.width:g} m"
    if (each.height == "low") != bool(_SEEN_OVER & {each.kind, each.subtype}):
        yield f"{each.id}, a {each.subtype or each.kind}, is not {each.height}"


ASIDE = 2.0
"""How far a track may lie beside the way through the waypoints [m]."""
UNEVEN = 0.35
"""By which share two neighbouring waypoints may be nearer or further apart than usual."""
UNEVEN_ROUND = 0.55
"""The same where a U-turn bends the way between two of them: they are even along that."""
_GOAL_WITHIN = 2.0
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
        encounter.agent
        for encounter in scene.encounters
        if has_trait("encounter", encounter.how, "ends")
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
    if math.dist(points[-1], agent.goal) > _GOAL_WITHIN:
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
    own = [walk.area for walk in walks if walk.crosswalk.leg == agent.crosswalk]
    if own and not any(geos.intersects(area, geos.LineString(points)) for area in own):
        yield f"its waypoints do not lead over the {agent.crosswalk} crosswalk"
    if len(track.xy) < 2:
        return
    west, south, east, north = track.bounds
    for walk in walks:
        low_x, low_y, high_x, high_y = walk.bounds
        away = west > high_x or east < low_x or south > high_y or north < low_y
        if away or walk.crosswalk.leg == agent.crosswalk:
            continue
        if float(geos.intersection(walk.area, geos.LineString(track.xy)).length) > 1.0:
            yield f"it walks on the {walk.crosswalk.leg} crosswalk, not the {agent.crosswalk} one"


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
            stands = find_runs(speed <= STANDING) if speed.min(initial=np.inf) <= STANDING else ()
            stood = max((0.1 * float(end - begin) for begin, end in stands), default=0.0)
            if stood > LONGEST_STAND:
                yield f"it stands for {stood:.1f} s of the segment {segment.status}"
        if segment.status == "stop" and len(speed) > 10 and speed.min() > slow:
            yield f"it never goes below {speed.min():.1f} m/s in a segment 'stop'"
