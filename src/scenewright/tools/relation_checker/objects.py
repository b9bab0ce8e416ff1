"""Standing objects on the final tracks: no agent touches one; they hide as asked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.events import EVENT_OF_RELATION, Event, Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.objects import ObjectRecord, SightRecord, name_door
from scenewright.scene.record import SceneRecord
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.footprints import Box, compute_gaps
from scenewright.tools.relation_checker.line_of_sight import Sighting, find_first_visible
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.trajectory import FARTHEST, Trajectory

CONTACT = 1e-3
FINE = 0.02
"""Steps [s] at which a track near an object is looked at, so that it cuts no corner unseen."""
AT_SIDE = 0.1
"""How far a door may be from the side of its vehicle [m]."""
HIDDEN = 0.5
"""Least time that a hidden agent is out of sight [s]."""
LEAD_SLACK = 0.02
"""How far beside its bounds the time of free sight before an event may be measured [s]."""


def read_objects(scene: SceneRecord) -> tuple[ObjectRecord, ...]:
    """The objects of a scene.

    Raises:
        InputError: an id twice, a size that is none, a line of sight that names what is not there.
    """
    names = [each.id for each in scene.objects]
    if len(set(names)) != len(names):
        raise InputError("objects: an id occurs twice")
    for each in scene.objects:
        figures = (each.length, each.width, each.x, each.y, each.heading)
        if not all(math.isfinite(value) and abs(value) <= FARTHEST for value in figures):
            raise InputError(f"{each.id}: a position or size is no usable number")
        if each.since is not None and not 0.0 <= each.since <= scene.meta.duration:
            raise InputError(f"{each.id}: it opens at {each.since:g} s, outside of the scene")
        if not (0.1 <= each.width <= 30.0 and 0.1 <= each.length <= 30.0):
            raise InputError(f"{each.id}: length and width must be 0.1 to 30 m")
    known = {agent.id for agent in scene.agents}
    for sight in scene.sights:
        stands = {sight.object, sight.between or sight.object} <= set(names)
        if not {sight.observer, sight.subject} <= known or not stands:
            raise InputError(f"sights name {sight.object} or an agent, which the scene lacks")
        if sight.observer == sight.subject:
            raise InputError(f"sights name agent {sight.observer} twice")
    met = [each.agent for each in scene.encounters]
    if not {each.object for each in scene.encounters} <= set(names) or not set(met) <= known:
        raise InputError("encounters name an object or an agent that the scene lacks")
    if len(set(met)) < len(met):
        raise InputError("encounters name an agent twice")
    return scene.objects


def check_contacts(
    objects: Sequence[ObjectRecord],
    tracks: Sequence[Trajectory],
    *,
    asked: frozenset[tuple[int, str]] = frozenset(),
) -> tuple[Finding, ...]:
    """Every track that touches an object; none may but where that is asked for."""
    found = []
    for each in objects:
        for track in tracks:
            if (track.id, each.id) in asked:
                continue
            time = find_contact(each, track)
            if time is not None:
                what = f"{track.type} {track.id} touches {each.id} ({each.kind}) at {time:.1f} s"
                found.append(Finding(
                    rule="object_contact", agents=(track.id,), time=round(time, 3), measured=0.0,
                    detail=what,
                ))  # fmt: skip
    return tuple(found)


def find_contact(each: ObjectRecord, track: Trajectory) -> float | None:
    """When a track first touches an object [s]."""
    reach = math.hypot(each.length, each.width) / 2 + track.reach
    # Between two samples no agent comes nearer than half a step.
    steps = float(track.steps.max()) if len(track.steps) else 0.0
    away = np.hypot(track.xy[:, 0] - each.x, track.xy[:, 1] - each.y)
    near = np.flatnonzero(away <= reach + steps)
    if not len(near):
        return None
    times = np.arange(track.times[near[0]] - 0.1, track.times[near[-1]] + 0.1, FINE)
    times = times[(times >= track.start - 1e-9) & (times <= track.end + 1e-9)]
    times = times if each.since is None else times[times >= each.since]
    if not len(times):
        return None
    touching = np.flatnonzero(measure_gaps(*track.at(times), track.box, each) <= CONTACT)
    return float(times[touching[0]]) if len(touching) else None


def measure_gaps(xy: FloatArray, heading: FloatArray, box: Box, each: ObjectRecord) -> FloatArray:
    """[N] distance of a footprint at N places from an object [m]."""
    place = np.array([(each.x, each.y)]), np.array([each.heading])
    return compute_gaps(xy, heading, box, *place, (each.length / 2, each.width / 2, 0.0))


def check_places(
    objects: Sequence[ObjectRecord], intersection_map: IntersectionMap | None
) -> tuple[Finding, ...]:
    """Objects that overlap, stand on a crosswalk or off the ground of the map."""
    outlines = {each.id: _make_outline(each) for each in objects}
    found = [
        _report_place(a, f"overlaps {b.id}")
        for a, b in combinations(objects, 2)
        if outlines[a.id].intersection(outlines[b.id]).area > 1e-4
    ]
    if intersection_map is None or not objects:
        return tuple(found)
    crosswalks = [geos.Polygon(each.polygon) for each in intersection_map.crosswalks]
    areas = (*intersection_map.road, *intersection_map.walkable)
    ground = geos.unary_union([geos.Polygon(a.exterior, a.holes) for a in areas])
    for each in objects:
        outline = outlines[each.id]
        if any(outline.intersection(area).area > 1e-4 for area in crosswalks):
            found.append(_report_place(each, "stands on a crosswalk"))
        elif outline.intersection(ground).area < 0.95 * outline.area:
            found.append(_report_place(each, "stands off the road and the sidewalks"))
        elif each.kind == "door" and not any(
            outline.distance(outlines[o.id]) <= AT_SIDE
            for o in objects if o.kind == "parked" and each.id == name_door(o.id)
        ):  # fmt: skip
            found.append(_report_place(each, "is at no parked vehicle"))
        elif each.lane is not None and not _is_outermost(each, intersection_map):
            found.append(_report_place(each, f"does not stand in the {each.lane} lane"))
    return tuple(found)


def _is_outermost(each: ObjectRecord, intersection_map: IntersectionMap) -> bool:
    """Whether no lane of the same leg and direction lies on that side of where it stands."""
    lanes = [lane for lane in intersection_map.lanelets if lane.kind in ("approach", "exit")]
    here = geos.Point(each.x, each.y)
    outlines = [(lane, geos.Polygon([*lane.left, *lane.right[::-1]])) for lane in lanes]
    own = next((lane for lane, outline in outlines if outline.contains(here)), None)
    if own is None:
        return False
    turn = math.pi / 2 if each.lane == "left" else -math.pi / 2
    reach = 4.0 * math.cos(each.heading + turn), 4.0 * math.sin(each.heading + turn)
    beside = geos.Point(each.x + reach[0], each.y + reach[1])
    return not any(
        lane is not own
        and (lane.kind, lane.leg) == (own.kind, own.leg)
        and outline.contains(beside)
        for lane, outline in outlines
    )


def _make_outline(each: ObjectRecord) -> Any:
    cos, sin = math.cos(each.heading), math.sin(each.heading)
    length, width = each.length / 2, each.width / 2
    return geos.Polygon([
        (each.x + a * length * cos - b * width * sin, each.y + a * length * sin + b * width * cos)
        for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))
    ])  # fmt: skip


def _report_place(each: ObjectRecord, what: str) -> Finding:
    return Finding(rule="object_place", agents=(), detail=f"{each.id} ({each.kind}) {what}")


def check_sights(
    scene: SceneRecord, events: Sequence[Event], observed: SceneObservation, *, left_hand: bool
) -> tuple[list[dict[str, Any]], tuple[Finding, ...]]:
    """What was measured of every line of sight that was to be blocked, and what is not so.

    The pedestrian must be seen first within the asked time before what the relation of the two
    became, past everything high; and before that the named object alone must hide it.
    """
    figures: list[dict[str, Any]] = []
    findings: list[Finding] = []
    for sight in scene.sights:
        # The event that realises the relation of the two.
        both = {sight.observer, sight.subject}
        asked = {r.type for r in scene.relations if {r.from_, r.to} == both}
        known = set(EVENT_OF_RELATION.values()) & asked
        event = next((e for e in events if {e.from_, e.to} == both and e.type in known), None)
        measured = None if event is None else _measure(scene, observed, sight, event, left_hand)
        fault = "the two have no event" if event is None else _find_fault(sight, event, measured)
        fault = fault or _find_wrong_gap(scene, observed, sight)
        if fault is not None:
            detail = (
                f"{sight.object} should hide agent {sight.subject} from agent {sight.observer}: "
                f"{fault}"
            )
            pair = sight.observer, sight.subject
            findings.append(Finding(rule="sight_not_blocked", agents=pair, detail=detail))
        if event is not None and measured is not None and measured[0] is not None:
            figures.append({
                "observer": sight.observer, "subject": sight.subject, "object": sight.object,
                "first_visible": round(measured[0].time, 3),
                "before_event": round(event.time - measured[0].time, 3),
                "hidden_for": measured[0].hidden_for,
            })  # fmt: skip
    return figures, tuple(findings)


Measured = tuple[Sighting | None, Sighting | None]
"""The first sighting past everything, and past the named object alone."""


def _measure(
    scene: SceneRecord,
    observed: SceneObservation,
    sight: SightRecord,
    event: Event,
    left_hand: bool,
) -> Measured:
    pair = observed.by_id[sight.observer], observed.by_id[sight.subject]
    high = {a.id for a in scene.agents if a.type == "vehicle" and a.subtype != "motorcycle"}
    others = [t for t in observed.tracks if t.id in high - {sight.observer, sight.subject}]
    alone = [each for each in scene.objects if each.id == sight.object]

    def look(objects: Sequence[ObjectRecord], vehicles: Sequence[Trajectory]) -> Sighting | None:
        return find_first_visible(
            *pair, objects=objects, vehicles=vehicles, until=event.time, left_hand=left_hand
        )

    return look(scene.objects, others), look(alone, ())


def _find_fault(sight: SightRecord, event: Event, measured: Measured | None) -> str | None:
    whole, alone = measured or (None, None)
    if whole is None or alone is None:
        return "it is never in sight before the event"
    low, high = sight.lead
    lead = event.time - whole.time
    if not low - LEAD_SLACK <= lead <= high + LEAD_SLACK:
        return f"first visible {lead:.2f} s before the event; asked for {low:g} to {high:g} s"
    if alone.hidden_for < HIDDEN - 1e-6:
        return f"hidden by {sight.object} for {alone.hidden_for:.1f} s only; at least {HIDDEN:g} s"
    return None


WIDEST = 6.0
"""Largest distance of two objects between which an agent can step out [m]."""


def _find_wrong_gap(
    scene: SceneRecord, observed: SceneObservation, sight: SightRecord
) -> str | None:
    """Why the pedestrian does not come out between the two objects that it was to."""
    if sight.between is None:
        return None
    one, two = ({each.id: each for each in scene.objects}[name] for name in
                (sight.object, sight.between))  # fmt: skip
    track = observed.by_id[sight.subject]
    gap = float(_make_outline(one).distance(_make_outline(two)))
    across = np.array([two.x - one.x, two.y - one.y])
    offsets = track.xy - (one.x, one.y)
    side = np.sign(across[0] * offsets[:, 1] - across[1] * offsets[:, 0])
    share = offsets @ across / float(across @ across)
    passes = (np.diff(side) != 0) & (share[:-1] > 0.0) & (share[:-1] < 1.0)
    if gap <= WIDEST and passes.any():
        return None
    return f"it does not come out between {one.id} and {two.id}, {gap:.1f} m apart"
