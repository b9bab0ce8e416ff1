"""Standing objects around the scheduled foreground: their places and what they hide.

An object is placed once the foreground is scheduled: clear of all agents' paths and, where it is to
hide a pedestrian, so that the driver first sees it as long before the event as asked.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from itertools import combinations
from typing import Any

import numpy as np

from scenewright.geometry.spline import sample_poses
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.candidates import Candidate
from scenewright.scene.map import IntersectionMap
from scenewright.scene.objects import ObjectRecord, get_subtype
from scenewright.scene.social import DEFAULT_LEAD, ObjectNode
from scenewright.scene.track import STEP, Shape
from scenewright.tools.map_grounding.object_places import Side, find_places, make_footprint
from scenewright.tools.solver.context import compute_excess
from scenewright.tools.solver.path_conflict import compute_clearance
from scenewright.tools.solver.scheduled_agent import (
    PartialSchedule,
    ScheduledAgent,
    get_pair,
    get_shared_times,
)
from scenewright.work_limit import count_work

EYE_BEHIND_FRONT, EYE_ASIDE = 0.4, 0.25
"""Where a driver's eye is: share of the length behind the front, of the width off the middle."""

STAYS_FREE = 0.3
"""How long [s] a line of sight must stay free to count."""


def find_lead(
    driver: ScheduledAgent,
    walker: ScheduledAgent,
    objects: Sequence[ObjectRecord],
    *,
    event: float,
    left_hand: bool,
) -> tuple[float, float] | None:
    """Find how long before an event [s] the line of sight is first free, and how long it was not.

    None where it never is before the event.
    """
    times = get_shared_times(driver, walker)
    if times is None:
        return None
    times = times[(times > -STEP / 2) & (times <= event)]
    free = ~find_blocked(
        compute_eyes(driver, times, left_hand=left_hand), compute_marks(walker, times), objects
    )
    steps = round(STAYS_FREE / STEP)
    lasting = np.convolve(free, np.ones(steps + 1))[steps:] > steps + 0.5
    if not lasting.any():
        return None
    first = int(np.argmax(lasting))
    return float(event - times[first]), STEP * first


def compute_eyes(driver: ScheduledAgent, times: FloatArray, *, left_hand: bool) -> FloatArray:
    """Compute the driver's eye [N, 2] at scene times [s]."""
    x, y, heading = driver.get_poses(times).T
    shape = driver.candidate.shape
    ahead = (0.5 - EYE_BEHIND_FRONT) * shape.length
    aside = EYE_ASIDE * shape.width * (-1 if left_hand else 1)
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack((x + ahead * cos - aside * sin, y + ahead * sin + aside * cos), axis=1)


def compute_marks(walker: ScheduledAgent, times: FloatArray) -> FloatArray:
    """Compute what is looked for [N, 5, 2]: the middle, and four points of the rim of a pedestrian
    or the corners of a rider."""
    x, y, heading = walker.get_poses(times).T
    shape = walker.candidate.shape
    if shape.type == "pedestrian":
        ends = shape.length / 2 * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
        return np.asarray(np.stack((x, y), axis=1)[:, None, :] + ends)
    ends = np.array([(0, 0), (1, 1), (1, -1), (-1, -1), (-1, 1)]) / 2
    ahead, aside = (ends * (shape.length, shape.width)).T
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    return np.stack(
        (x[:, None] + cos * ahead - sin * aside, y[:, None] + sin * ahead + cos * aside), axis=-1
    )


def find_blocked(
    eyes: FloatArray, targets: FloatArray, objects: Sequence[ObjectRecord]
) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return [N] whether a high object blocks every line from the eye [N, 2] to the points looked
    for [N, M, 2]."""
    met = np.zeros(targets.shape[:2], dtype=np.bool_)
    start = eyes[:, None, :]
    for box in (scene_object for scene_object in objects if scene_object.height == "high"):
        # A segment meets a rectangle where it is within both of its slabs at once.
        cos, sin = np.cos(box.heading), np.sin(box.heading)
        turn, half = np.array([(cos, -sin), (sin, cos)]), np.array([box.length, box.width]) / 2
        one, way = (start - np.array([box.x, box.y])) @ turn, (targets - start) @ turn
        way = np.where(np.abs(way) < 1e-9, 1e-9, way)
        enter, leave = np.sort(np.stack(((-half - one) / way, (half - one) / way)), axis=0)
        met |= np.maximum(enter.max(axis=-1), 0.0) <= np.minimum(leave.min(axis=-1), 1.0)
    return np.asarray(met.all(axis=1))


geos: Any = import_module("shapely")

CLEARANCE = {"vehicle": 0.15, "cyclist": 0.15, "scooter": 0.15, "pedestrian": 0.1}
"""How far paths keep from standing objects [m]."""

_APART = 0.5
"""Between two objects [m]."""

_SPARE = 0.05
"""How far inside the bounds asked for the lead is kept [s]."""

_HIDDEN = 0.5
"""Least time that a pedestrian is out of sight [s]; with less, nothing hides it."""

_BESIDE = 6.0
"""How near a pedestrian's path is to the object that it steps out from behind [m]."""

_BETWEEN = 6.0
"""Widest gap between two vehicles from which a pedestrian steps [m]."""

_NODE = 0.4
"""Spacing at which a path is sampled [m]."""


class ObjectPlacer:
    """Places the standing objects of a plan on a map.

    Args:
        nodes: what the plan asks for.
    """

    def __init__(
        self,
        nodes: Sequence[ObjectNode],
        intersection_map: IntersectionMap,
        rng: np.random.Generator,
    ) -> None:
        self._map, self._rng = intersection_map, rng
        own = (node for node in nodes if node.met_by is None)
        self._nodes = sorted(own, key=lambda each: (each.hides is None, each.beyond is None))
        self._met: dict[str, ObjectRecord] = {}
        self._doors: dict[str, tuple[ObjectRecord, float]] = {}
        self._kept: dict[str, ObjectRecord] = {}
        self._places: dict[tuple[str, Compass, Side], tuple[ObjectRecord, ...]] = {}
        self._nearest: dict[str, float] = {}

    def keep_earlier(self, earlier: Sequence[ObjectRecord]) -> None:
        """Keep objects of an earlier version where they stood, if that still fits."""
        self._kept = {each.id: each for each in earlier}

    def get_kept(self, name: str) -> ObjectRecord | None:
        """Return where an object of an earlier version stood."""
        return self._kept.get(name)

    def block_paths(
        self,
        met: Mapping[str, ObjectRecord],
        doors: Mapping[str, tuple[ObjectRecord, float]],
    ) -> None:
        """Place these objects where agents, by name, meet them.

        Args:
            doors: doors that agents ride into, and how long before that they open [s].
        """
        self._met, self._doors = dict(met), dict(doors)

    def place(self, schedule: PartialSchedule) -> tuple[ObjectRecord, ...] | str:
        """The objects, in the plan's order; or which of them finds no place, in words."""
        placed = list({each.id: each for each in self._met.values()}.values())
        for name, actor in schedule.actors.items():
            own = self._met[name].id if name in self._met else None
            others = [each for each in placed if each.id != own]
            if is_in_way(actor.candidate, others):
                return f"{others[0].id} stands in the way of {name}"
        if any(not _keeps_apart(a, [b]) for a, b in combinations(placed, 2)):
            return "two objects stand in one place"
        for node in self._nodes:
            if node.id in {each.id for each in placed}:
                continue
            partner = next((each for each in self._nodes if each.beyond == node.id), None)
            found = self._find_free(node, schedule, placed, partner)
            if not found:
                if node.hides is None:
                    return f"{node.id} ({node.kind}) finds no place clear of all agents' paths"
                low, high = node.lead or DEFAULT_LEAD
                hidden = f"{node.hides} from {node.hidden_from} until {low:g} to {high:g} s before"
                return f"no place of {node.id} hides {hidden}"
            placed += found
        for door in self._list_doors(schedule):
            for name, actor in schedule.actors.items():
                if name not in self._doors and is_in_way(actor.candidate, (door,)):
                    return f"{door.id} opens in the way of {name}"
            placed.append(door)
        return tuple(sorted(placed, key=lambda each: each.id))

    def describe_nearest(self) -> str:
        """Say how near to what was asked for a pedestrian could be hidden; empty if it could."""
        near = (self._nearest.get(node.id) for node in self._nodes if node.hides is not None)
        off = [f"{lead:.1f} s" for lead in near if lead is not None]
        return f"; the nearest seen was {', '.join(off)}" if off else ""

    def _list_doors(self, schedule: PartialSchedule) -> Iterator[ObjectRecord]:
        """List the doors, each from when it opens."""
        for name, (door, opens) in self._doors.items():
            contact = schedule.actors[name].contact if name in schedule.actors else None
            if door.since is not None:
                yield door
            elif contact is not None:
                yield door.model_copy(update={"since": round(contact - opens, 2)})

    def _find_free(
        self,
        node: ObjectNode,
        schedule: PartialSchedule,
        placed: Sequence[ObjectRecord],
        partner: ObjectNode | None,
    ) -> tuple[ObjectRecord, ...]:
        """Place the object out of all agents' way, with its partner; empty if there is no place."""
        paths = [actor.candidate for actor in schedule.actors.values()]
        for place in self._list_places(node, schedule, placed):
            if any(is_in_way(path, (place,)) for path in paths):
                continue
            if partner is None:
                return (place,)
            second = self._find_free(partner, schedule, (*placed, place), None)
            if second:
                return place, *second
        return ()

    @property
    def hides_pedestrian(self) -> bool:
        """Return whether an object is to hide a pedestrian."""
        return any(node.hides is not None for node in self._nodes)

    def _list_places(
        self, node: ObjectNode, schedule: PartialSchedule, others: Sequence[ObjectRecord]
    ) -> Iterator[ObjectRecord]:
        """List places in random order: of those that hide the given pedestrian, if any."""
        kept = self._kept.get(node.id)
        same = kept and (kept.kind, kept.subtype) == (node.kind, get_subtype(node))
        if kept and same and _keeps_apart(kept, others) and self._hides(node, kept, schedule):
            yield kept
        if node.beyond is not None:
            yield from self._list_places_beyond(node, schedule, others)
            return
        for leg, side in self._list_sides(node, schedule):
            places = self._find_places(node, leg, side)
            if node.hides is not None and places:
                places = self._keep_beside(places, schedule, node.hides)
            for k in self._rng.permutation(len(places)):
                count_work()
                if _keeps_apart(places[k], others) and self._hides(node, places[k], schedule):
                    yield places[k]

    def _keep_beside(
        self, places: Sequence[ObjectRecord], schedule: PartialSchedule, walker: str
    ) -> tuple[ObjectRecord, ...]:
        """Keep the places near a walker's path with their middle in nobody's way, all at once."""
        middles = geos.points([(place.x, place.y) for place in places])
        half = np.array([(place.length, place.width) for place in places]) / 2
        kept = np.ones(len(places), dtype=np.bool_)
        for name, actor in schedule.actors.items():
            away = geos.distance(geos.LineString(actor.candidate.path.xy), middles)
            kept &= away >= half[:, 1] + actor.candidate.shape.width / 2
            if name == walker:
                kept &= away <= _BESIDE + np.hypot(*half.T)
        return tuple(each for each, near in zip(places, kept.tolist(), strict=True) if near)

    def _list_places_beyond(
        self, node: ObjectNode, schedule: PartialSchedule, others: Sequence[ObjectRecord]
    ) -> Iterator[ObjectRecord]:
        """List places beyond a pedestrian's path, those nearest to the object that hides it
        first."""
        hiding = next(each for each in self._nodes if each.id == node.beyond)
        first = next(each for each in others if each.id == node.beyond)
        path = geos.LineString(schedule.actors[str(hiding.hides)].candidate.path.xy)
        around = geos.Point(first.x, first.y)
        for leg, side in self._list_sides(hiding, schedule):
            places = self._find_places(node, leg, side)
            away = [float(geos.distance(around, geos.Point(p.x, p.y))) for p in places]
            for k in np.argsort(away):
                count_work()
                between = geos.LineString([(first.x, first.y), (places[k].x, places[k].y)])
                gap = geos.distance(make_footprint(first), make_footprint(places[k]))
                fits = geos.crosses(between, path) and gap <= _BETWEEN
                if fits and _keeps_apart(places[k], others):
                    yield places[k]

    def _list_sides(
        self, node: ObjectNode, schedule: PartialSchedule
    ) -> Iterator[tuple[Compass, Side]]:
        sides: tuple[Side, ...] = ("entry", "exit") if node.side is None else (node.side,)
        legs = [leg.name for leg in self._map.legs if node.leg in (None, leg.name)]
        if node.hides is not None and node.hidden_from is not None:
            vehicle = schedule.actors[node.hidden_from].candidate.route
            walker = schedule.actors[node.hides].candidate.route
            beside = walker.crosswalk if walker.movement == "jaywalking" else vehicle.entry
            legs = [leg for leg in legs if leg == beside]
            sides = tuple(s for s in sides if getattr(vehicle, s) == beside)
        found = [(leg, side) for leg in legs for side in sides]
        yield from (found[k] for k in self._rng.permutation(len(found)))

    def _find_places(self, node: ObjectNode, leg: Compass, side: Side) -> tuple[ObjectRecord, ...]:
        key = node.id, leg, side
        if key not in self._places:
            self._places[key] = find_places(node, self._map, leg=leg, side=side)
        return self._places[key]

    def _hides(self, node: ObjectNode, place: ObjectRecord, schedule: PartialSchedule) -> bool:
        """Return whether the driver first sees the pedestrian as asked; True where none is
        hidden."""
        if node.hides is None or node.hidden_from is None:
            return True
        pair = {node.hides, node.hidden_from}
        times = [event.time for event in schedule.events if set(get_pair(event.clause)) == pair]
        if not times:  # the interaction was settled in an earlier version, as was the place
            return place is self._kept.get(node.id)
        driver, walker = schedule.actors[node.hidden_from], schedule.actors[node.hides]
        way = geos.LineString(walker.candidate.path.xy)
        if geos.distance(way, make_footprint(place)) > _BESIDE:
            return False
        found = find_lead(
            driver, walker, (place,), event=min(times), left_hand=self._map.left_hand_traffic
        )
        low, high = node.lead or DEFAULT_LEAD
        if found is None or found[1] < _HIDDEN:
            return False
        nearest = self._nearest.get(node.id, np.inf)
        self._nearest[node.id] = min(
            found[0], nearest, key=lambda lead: compute_excess(low, high, lead)
        )
        return low + _SPARE <= found[0] <= high - _SPARE


def is_in_way(
    candidate: Candidate, objects: Sequence[ObjectRecord], *, margin: float | None = None
) -> bool:
    """Return whether an agent on a candidate's path would touch an object, or come too near to it.

    Args:
        margin: how near is too near [m]; None: as usual for its class.
    """
    return any(_comes_near(candidate, scene_object, margin) for scene_object in objects)


def make_sweep(candidate: Candidate, each: ObjectRecord, s: FloatArray) -> FloatArray:
    """Compute the distance [N] of the candidate to an object, by arc length of its centre [m]."""
    return _compute_gaps(sample_poses(candidate.path, s), candidate.shape, each)


def _comes_near(candidate: Candidate, each: ObjectRecord, margin: float | None) -> bool:
    shape, path = candidate.shape, candidate.path
    margin = CLEARANCE[shape.type] if margin is None else margin
    reach = (np.hypot(each.length, each.width) + np.hypot(shape.length, shape.width)) / 2 + margin
    every = max(int(_NODE / float(path.s[1] - path.s[0])), 1)
    poses = np.column_stack((path.xy, path.heading))[::every]
    near = np.hypot(poses[:, 0] - each.x, poses[:, 1] - each.y) <= reach
    return bool(near.any() and _compute_gaps(poses[near], shape, each).min() < margin)


def _compute_gaps(poses: FloatArray, shape: Shape, each: ObjectRecord) -> FloatArray:
    """Compute the distance [N] of a footprint at poses [N, 3] to an object [m]."""
    place = np.array([[each.x, each.y, each.heading]]).repeat(len(poses), axis=0)
    box = Shape(type="vehicle", length=each.length, width=each.width)
    return compute_clearance(poses, place, shapes=(shape, box))


def _keeps_apart(place: ObjectRecord, others: Sequence[ObjectRecord]) -> bool:
    outline = make_footprint(place)
    return all(geos.distance(outline, make_footprint(each)) >= _APART for each in others)
