"""Standing objects on the final tracks: nobody touches one unasked, they hide as asked, and agents
go round them, wait behind them or hit them as asked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.events import EVENT_OF_RELATION, Event, Finding
from scenewright.scene.kinds import get_kind, has_trait, load_function
from scenewright.scene.map import IntersectionMap
from scenewright.scene.objects import EncounterRecord, ObjectRecord, SightRecord, name_door
from scenewright.scene.record import SceneRecord
from scenewright.scene.social import get_figure
from scenewright.tools.relation_checker.certificate import WRECK_ENDS_WITHIN, check_wreck_clearance
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.footprints import (
    BoolArray,
    Box,
    compute_corners,
    compute_gaps,
    compute_offsets,
)
from scenewright.tools.relation_checker.line_of_sight import Sighting, find_first_visible
from scenewright.tools.relation_checker.planar import Area, geos
from scenewright.tools.relation_checker.trajectory import FARTHEST, Trajectory, find_runs
from scenewright.tools.relation_checker.yielding import STANDING

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
    names = [scene_object.id for scene_object in scene.objects]
    if len(set(names)) != len(names):
        raise InputError("objects: an id occurs twice")
    for scene_object in scene.objects:
        figures = (
            scene_object.length,
            scene_object.width,
            scene_object.x,
            scene_object.y,
            scene_object.heading,
        )
        if not all(math.isfinite(value) and abs(value) <= FARTHEST for value in figures):
            raise InputError(f"{scene_object.id}: a position or size is no usable number")
        if scene_object.since is not None and not 0.0 <= scene_object.since <= scene.meta.duration:
            raise InputError(
                f"{scene_object.id}: it opens at {scene_object.since:g} s, outside of the scene"
            )
        if not (0.1 <= scene_object.width <= 30.0 and 0.1 <= scene_object.length <= 30.0):
            raise InputError(f"{scene_object.id}: length and width must be 0.1 to 30 m")
    known = {agent.id for agent in scene.agents}
    for sight in scene.sights:
        stands = {sight.object, sight.between or sight.object} <= set(names)
        if not {sight.observer, sight.subject} <= known or not stands:
            raise InputError(f"sights name {sight.object} or an agent, which the scene lacks")
        if sight.observer == sight.subject:
            raise InputError(f"sights name agent {sight.observer} twice")
    met = [encounter.agent for encounter in scene.encounters]
    if (
        not {encounter.object for encounter in scene.encounters} <= set(names)
        or not set(met) <= known
    ):
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
    for scene_object in objects:
        for track in tracks:
            if (track.id, scene_object.id) in asked:
                continue
            time = find_contact(scene_object, track)
            if time is not None:
                what = (
                    f"{track.type} {track.id} touches {scene_object.id} ({scene_object.kind}) "
                    f"at {time:.1f} s"
                )
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
    outlines = {scene_object.id: _make_outline(scene_object) for scene_object in objects}
    found = [
        _report_place(a, f"overlaps {b.id}")
        for a, b in combinations(objects, 2)
        if outlines[a.id].intersection(outlines[b.id]).area > 1e-4
    ]
    if intersection_map is None or not objects:
        return tuple(found)
    crosswalks = [geos.Polygon(crosswalk.polygon) for crosswalk in intersection_map.crosswalks]
    areas = (*intersection_map.road, *intersection_map.walkable)
    ground = geos.unary_union([geos.Polygon(a.exterior, a.holes) for a in areas])
    for scene_object in objects:
        outline = outlines[scene_object.id]
        if any(outline.intersection(area).area > 1e-4 for area in crosswalks):
            found.append(_report_place(scene_object, "stands on a crosswalk"))
        elif outline.intersection(ground).area < 0.95 * outline.area:
            found.append(_report_place(scene_object, "stands off the road and the sidewalks"))
        elif scene_object.kind == "door" and not any(
            outline.distance(outlines[o.id]) <= AT_SIDE
            for o in objects if o.kind == "parked" and scene_object.id == name_door(o.id)
        ):  # fmt: skip
            found.append(_report_place(scene_object, "is at no parked vehicle"))
        elif scene_object.lane is not None and not _is_outermost(scene_object, intersection_map):
            found.append(
                _report_place(scene_object, f"does not stand in the {scene_object.lane} lane")
            )
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


def _make_outline(each: ObjectRecord) -> Area:
    place = np.array([(each.x, each.y)]), np.array([each.heading])
    return geos.Polygon(compute_corners(*place, length=each.length, width=each.width)[0])


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


_Sightings = tuple[Sighting | None, Sighting | None]
"""The first sighting past everything, and past the named object alone."""


def _measure(
    scene: SceneRecord,
    observed: SceneObservation,
    sight: SightRecord,
    event: Event,
    left_hand: bool,
) -> _Sightings:
    pair = observed.by_id[sight.observer], observed.by_id[sight.subject]
    high = {a.id for a in scene.agents if a.type == "vehicle" and a.subtype != "motorcycle"}
    others = [t for t in observed.tracks if t.id in high - {sight.observer, sight.subject}]
    alone = [scene_object for scene_object in scene.objects if scene_object.id == sight.object]

    def look(objects: Sequence[ObjectRecord], vehicles: Sequence[Trajectory]) -> Sighting | None:
        return find_first_visible(
            *pair, objects=objects, vehicles=vehicles, until=event.time, left_hand=left_hand
        )

    return look(scene.objects, others), look(alone, ())


def _find_fault(sight: SightRecord, event: Event, measured: _Sightings | None) -> str | None:
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
    one, two = ({scene_object.id: scene_object for scene_object in scene.objects}[name] for name in
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


IN_LINE = 0.1
"""Largest angle of a heading straight at an object [rad]; with more the agent is swerving."""
HEADS_FOR = 5
"""Samples for which it does at least, one after the other (0.5 s)."""
AHEAD = 40.0
"""How far ahead an object is in the way of a vehicle heading straight at it [m]."""
MOVES = 2.0
"""Least speed of a vehicle heading for an object [m/s]."""
WAITS = 2.0
"""Least standstill of a vehicle waiting behind an object [s]."""
WAITING_GAP = (0.3, 6.0)
"""How far behind it [m]."""
STRIKES = 1.0
"""Least speed of a collision with an object [m/s]."""
MOVED_OVER = 0.3
"""Least lateral distance when passing an object [m]."""

SHORT = (0.0, 2.0)
"""How far from an object who stops short of it stands [m]."""
BRAKES_HARD, NEAR_TTC = 3.4, 1.5
"""Braking [m/s^2] and time to contact [s] of a near miss with what stands (SEMANTICS 4)."""
PULLS_OUT_GAP = (0.3, 12.0)
"""How far behind an object who waits and then goes round it stands [m]."""
OPENS = (0.2, 1.5)
"""How long before the contact the door of a dooring opens [s]."""

Measured = dict[str, Any]


def check_encounters(
    scene: SceneRecord, observed: SceneObservation
) -> tuple[list[Measured], tuple[Finding, ...]]:
    """What was measured of every encounter asked for, and what is not as asked."""
    tracks = observed.by_id
    objects = {scene_object.id: scene_object for scene_object in scene.objects}
    figures: list[Measured] = []
    findings: list[Finding] = []
    for encounter in scene.encounters:
        track, until = tracks[encounter.agent], scene.meta.duration
        kind = get_kind("encounter", encounter.how)
        things = [objects[encounter.object]]
        if has_trait("encounter", encounter.how, "door"):
            things = [o for o in scene.objects if o.id == name_door(encounter.object)]
        if has_trait("encounter", encounter.how, "behind_agent"):
            others = [
                o for o in scene.encounters if o.object == encounter.object and o != encounter
            ]
            standing = [tracks[o.agent] for o in others if has_trait("encounter", o.how, "stands")]
            # Where their tracks end, as something that stands.
            things = [
                ObjectRecord(
                    id=f"agent {other.id}", kind="stalled", height="high", length=other.length,
                    width=other.width, x=float(other.xy[-1, 0]), y=float(other.xy[-1, 1]),
                    heading=float(other.heading[-1]),
                )
                for other in standing
            ]  # fmt: skip
        # The first that was measured, else the last fault.
        found: Measured | str = "no agent stands, or no door opens, that it could meet"
        for thing in things:
            found = load_function(str(kind.observe), __package__)(track, thing, until)
            if not isinstance(found, str):
                found = _find_figure_fault(encounter, found) or found
                break
        if isinstance(found, str):
            detail = f"agent {encounter.agent} {kind.shown} {encounter.object}: {found}"
            rule = "encounter_not_realised"
            findings.append(Finding(rule=rule, agents=(encounter.agent,), detail=detail))
            continue
        figures.append(
            {"agent": encounter.agent, "object": encounter.object, "how": encounter.how, **found}
        )
        if has_trait("encounter", encounter.how, "ends"):
            findings += check_wreck_clearance(
                track, observed.tracks, {track.id}, scene.meta.duration
            )
    return figures, tuple(findings)


def _find_figure_fault(each: EncounterRecord, found: Measured) -> str | None:
    """Why the figure asked for is not met, in words; None if it is, or none is asked for."""
    if each.figure is None:
        return None
    own, (low, high) = get_figure(each.how), each.figure
    if low - 1e-6 <= found[own.name] <= high + 1e-6:
        return None
    measured = f"{own.name} {found[own.name]:.2f} {own.unit}"
    return f"{measured}; asked for {low:g} to {high:g} {own.unit}"


def list_asked_hits(scene: SceneRecord) -> frozenset[tuple[int, str]]:
    """Agents and the objects that they are to hit."""
    return frozenset(
        (e.agent, name_door(e.object) if has_trait("encounter", e.how, "door") else e.object)
        for e in scene.encounters
        if has_trait("encounter", e.how, "ends")
    )


def measure_passing(
    track: Trajectory, thing: ObjectRecord, _: float, *, least: float = MOVES
) -> Measured | str:
    """It drives straight at the object, then moves over and passes beside it untouched.

    Args:
        least: least speed at which it drives at it [m/s].
    """
    place, facing = np.array((thing.x, thing.y)), np.array(thing.heading)
    along, aside = compute_offsets(track.xy, place, facing)
    half = (track.length + thing.length) / 2
    beside = np.flatnonzero((np.abs(along) < half) & (np.abs(aside) < 6.0))
    if not len(beside) or along[0] > -half or along[-1] < half:
        return "it does not come from behind it and drive on ahead of it"
    runs = find_runs(_heads_for(track, thing, moving=least > 0.0)[: beside[0]])
    lasting = runs[runs[:, 1] - runs[:, 0] >= HEADS_FOR]
    if not len(lasting):
        return "it never drives straight at it, so it is not in its way"
    heads = int(lasting[-1, 1]) - 1
    gaps = measure_gaps(track.xy, track.heading, track.box, thing)
    k = int(gaps.argmin())
    moved = float(np.abs(aside[beside] - aside[heads]).max())
    if gaps[k] <= 0.0:
        return f"it touches it at {track.times[k]:.1f} s"
    if moved < MOVED_OVER:
        return f"it moves over by {moved:.2f} m only; at least {MOVED_OVER:g} m"
    return {
        "time": round(float(track.times[k]), 3), "clearance": round(float(gaps[k]), 3),
        "moved_over": round(moved, 3),
    }  # fmt: skip


def measure_late_passing(track: Trajectory, thing: ObjectRecord, _: float) -> Measured | str:
    """It stands behind the object, heading for it, and then passes beside it untouched."""
    passing = measure_passing(track, thing, 0.0, least=0.0)
    if isinstance(passing, str):
        return passing
    gaps = measure_gaps(track.xy, track.heading, track.box, thing)
    ahead = _heads_for(track, thing, moving=False)
    low, high = PULLS_OUT_GAP
    stands = (track.speed <= STANDING) & ahead & (gaps >= low) & (gaps <= high)
    stands &= track.times < passing["time"]
    waits = 0.1 * int(stands.sum())
    if waits < 1.0:
        return f"it stands behind it for {waits:.1f} s; at least 1 s"
    if float(track.speed[: int(stands.argmax()) + 1].max()) < MOVES:
        return "it has not been driving"
    return {**passing, "waits": round(waits, 3)}


def measure_short_stop(track: Trajectory, thing: ObjectRecord, until: float) -> Measured | str:
    """It comes at the object, brakes hard when a contact is near, and stands just short of it."""
    waiting = measure_waiting(track, thing, until)
    if isinstance(waiting, str):
        return waiting
    if not SHORT[0] < waiting["gap"] <= SHORT[1]:
        return f"it stands {waiting['gap']:.1f} m from it; less than {SHORT[1]:g} m is just short"
    hard = (track.acceleration <= -BRAKES_HARD) & _heads_for(track, thing)
    close = measure_gaps(track.xy, track.heading, track.box, thing)[hard] / track.speed[hard]
    if not len(close) or close.min() > NEAR_TTC:
        return "it does not brake hard for it at the last moment"
    return {**waiting, "path_ttc": round(float(close.min()), 3),
            "braking": round(float(-track.acceleration.min()), 3)}  # fmt: skip


def measure_waiting(track: Trajectory, thing: ObjectRecord, until: float) -> Measured | str:
    """It drives up to the object and stands behind it, heading for it, until the scene ends."""
    standing = track.speed <= STANDING
    moving = np.flatnonzero(~standing)
    if not len(moving) or not standing[-1]:
        return "it does not come to stand behind it and stay there"
    first = int(moving[-1]) + 1
    lasts = float(track.times[-1] - track.times[first])
    gap = float(measure_gaps(track.xy, track.heading, track.box, thing)[first])
    if lasts < WAITS or track.end < until - 0.2:
        return f"it stands for {lasts:.1f} s at the end; at least {WAITS:g} s"
    if not _heads_for(track, thing, moving=False)[first]:
        return "what it stands behind is not that, as it is not ahead of it"
    if not WAITING_GAP[0] <= gap <= WAITING_GAP[1]:
        return f"it stands {gap:.1f} m from it"
    if float(track.speed[: first + 1].max()) < MOVES:
        return "it has not been driving"
    return {"time": round(float(track.times[first]), 3), "gap": round(gap, 3)}


def measure_hit(track: Trajectory, thing: ObjectRecord, _: float) -> Measured | str:
    """It drives into the object, and ends there."""
    time = find_contact(thing, track)
    if time is None:
        return "it never touches it"
    if time <= track.start + 1e-6:
        return "it touches it from the beginning"
    before = int(np.searchsorted(track.times, time - 1e-6, side="right")) - 1
    speed = float(track.speed[max(before - 1, 0) : before + 1].max())
    if speed < STRIKES:
        return f"it touches it at {speed:.1f} m/s; at least {STRIKES:g} m/s"
    if track.end > time + WRECK_ENDS_WITHIN + 1e-6:
        return f"it goes on for {track.end - time:.1f} s; at most {WRECK_ENDS_WITHIN} s"
    return {"time": round(time, 3), "speed": round(speed, 3)}


def measure_dooring(track: Trajectory, thing: ObjectRecord, until: float) -> Measured | str:
    """A door opens beside its way, clear of it, and it rides into that at once."""
    hit = measure_hit(track, thing, until)
    if isinstance(hit, str):
        return hit
    if thing.since is None:
        return "the door stands open from the beginning"
    opened = hit["time"] - thing.since
    if not OPENS[0] <= opened <= OPENS[1]:
        return (
            f"the door opens {opened:.1f} s before; a door that opens too late does so "
            f"{OPENS[0]:g} to {OPENS[1]:g} s before"
        )
    return {**hit, "opened": round(opened, 3)}


def _heads_for(track: Trajectory, thing: ObjectRecord, *, moving: bool = True) -> BoolArray:
    """[N] whether the way straight ahead, as wide as the agent, meets the object."""
    ahead, aside = compute_offsets(np.array((thing.x, thing.y)), track.xy, track.heading)
    turn = thing.heading - track.heading
    # Half of the width of the object as seen along the way.
    half = (thing.length * np.abs(np.sin(turn)) + thing.width * np.abs(np.cos(turn))) / 2
    meets = (ahead > 0.0) & (ahead <= AHEAD) & (np.abs(aside) < half + track.width / 2)
    meets &= np.abs(np.sin(turn)) <= IN_LINE
    return np.asarray(meets & (track.speed >= MOVES) if moving else meets)
