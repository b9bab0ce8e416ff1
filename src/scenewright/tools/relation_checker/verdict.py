"""The verdict on a scene: relations observed, nothing else happened, motion plausible."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.events import Event, Finding, Proof
from scenewright.scene.kinds import has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord, RelationRecord, SceneRecord
from scenewright.scene.track import Shape, Track
from scenewright.tools.relation_checker.certificate import (
    AgentRoles,
    check_interference,
    check_wrecks,
    is_incidental,
)
from scenewright.tools.relation_checker.collisions import is_impact_at
from scenewright.tools.relation_checker.conditions import find_unmet_condition, list_passing_orders
from scenewright.tools.relation_checker.events import SceneObservation, observe
from scenewright.tools.relation_checker.external_events import MOST_PAIR_SAMPLES, count_pair_samples
from scenewright.tools.relation_checker.groups import (
    check_groups,
    find_group_events,
    list_group_pairs,
    list_groups,
)
from scenewright.tools.relation_checker.labels import (
    RUNNERS,
    find_false_behavior,
    find_false_journeys,
    find_false_labels,
    find_false_metadata,
)
from scenewright.tools.relation_checker.legs import check_ties
from scenewright.tools.relation_checker.liveness import check_liveness
from scenewright.tools.relation_checker.measured import MeasuredFigures
from scenewright.tools.relation_checker.motions import check_motions
from scenewright.tools.relation_checker.objects import (
    check_contacts,
    check_encounters,
    check_places,
    check_sights,
    list_asked_hits,
    read_objects,
)
from scenewright.tools.relation_checker.plausibility import (
    AllowedExceptions,
    check_ends,
    check_form,
    check_ground,
    check_motion_limits,
    find_extremes,
    list_late_beginnings,
)
from scenewright.tools.relation_checker.pushes import cut_pushed, list_chained, list_pushed
from scenewright.tools.relation_checker.reactions import (
    Sights,
    find_avoidability,
    find_false_reactions,
    find_reactions,
)
from scenewright.tools.relation_checker.signals import check_signal_plan
from scenewright.tools.relation_checker.trajectory import FARTHEST, RoadUser, Trajectory

PET_TOLERANCE = 0.15
TTC_TOLERANCE = 0.3
IMPACT_TOLERANCE = 0.5
LATEST = 3600.0
"""Longest scene, and longest wait for one to begin [s]."""


def check(
    scene: SceneRecord, intersection_map: IntersectionMap | None = None, *, labelled: bool = False
) -> Proof:
    """Proves a scene from its final tracks (SEMANTICS sections 1, 4 and 5).

    Labels (`scene.events`, journeys, waypoints, segments, names, the time of day) decide nothing,
    but one that the tracks, the map or another label contradict is reported as missing. Without a
    map, ground, signals and journeys are not checked.

    Args:
        labelled: whether the scene has its rows of events; if not, an empty list is none.

    Returns:
        The proof; `verified` if every relation asked for is observed with its roles and its cause,
        tied entries lie as they should, the named red-light runners run red and no others, nothing
        else happens and no motion is implausible.

    Raises:
        InputError: values that are not finite, an id twice, an empty track, lengths that differ.
    """
    users = read_users(scene)
    read_objects(scene)
    known = {a.id for a in scene.agents}
    _check_names(scene, known)
    asked = tuple((r.from_, r.to) for r in scene.relations)
    groups = list_groups(scene.agents)
    bound = [each for pair in asked for each in list_group_pairs(pair, groups)]
    roles = AgentRoles(
        frozenset(a.id for a in scene.agents if a.role == "foreground").union(*asked),
        frozenset(frozenset(pair) for pair in bound),
        list_chained(scene.relations),
    )
    observed = observe(
        users, intersection_map=intersection_map, signals=scene.signals, asked=bound,
        detailed=frozenset(n for pair in bound for n in pair), until=scene.meta.duration,
        timely=scene.meta.rules is not None,
    )  # fmt: skip
    asked_for = scene.relations
    if not (intersection_map and scene.signals):
        # Without lights no agent runs red, so that such a cause is not looked for.
        no_cause = {"cause": None, "cause_agent": None}
        asked_for = tuple(
            r.model_copy(update=no_cause) if has_trait("cause", r.cause, "red_light") else r
            for r in asked_for
        )
    matched, missing = _match_events(asked_for, observed, intersection_map)
    matched |= find_group_events(scene.relations, observed.events, groups) if groups else matched
    return _build_proof(
        scene, intersection_map, observed=observed, roles=roles, matched=matched, missing=missing,
        labelled=labelled,
    )  # fmt: skip


def _build_proof(
    scene: SceneRecord,
    intersection_map: IntersectionMap | None,
    *,
    observed: SceneObservation,
    roles: AgentRoles,
    matched: frozenset[int],
    missing: tuple[Finding, ...],
    labelled: bool,
) -> Proof:
    incidental = [k for k, e in enumerate(observed.events)
                  if k not in matched and is_incidental(e, roles)]  # fmt: skip
    events = tuple(e for k, e in enumerate(observed.events) if k not in incidental)
    matching = [observed.events[k] for k in sorted(matched)]
    left_hand = intersection_map is not None and intersection_map.left_hand_traffic
    sights, unhidden = check_sights(scene, matching, observed, left_hand=left_hand)
    encounters, unmet = check_encounters(scene, observed)
    rules = scene.meta.rules is not None
    pushed = list_pushed(scene.relations)
    driven = cut_pushed(observed.tracks, observed.events, pushed)
    views = Sights(scene.objects, observed.tracks, left_hand)
    reacts = rules or any(agent.reaction for agent in scene.agents)
    reactions = find_reactions(scene, matching, views) if reacts else []
    avoidability = find_avoidability(matching, views, pushed=pushed) if rules else []
    lit = bool(intersection_map and scene.signals)
    asked = MeasuredFigures(observed.events, observed, intersection_map)
    short, measures = asked.find_shortfalls(scene.measures)
    red, never = _check_lights(scene, observed, intersection_map, roles)
    journeys: tuple[Finding, ...] = ()
    ties: tuple[Finding, ...] = ()
    if intersection_map is not None:
        journeys = find_false_journeys(scene, observed.tracks, intersection_map)
        ties = check_ties(scene.ties, observed.by_id, intersection_map)
    missing = (
        *missing,
        *unhidden,
        *unmet,
        *short,
        *(find_false_labels(scene, events, lit=lit) if scene.events or labelled else ()),
        *find_false_metadata(scene, intersection_map),
        *find_false_behavior(scene, observed.tracks, events, intersection_map),
        *journeys,
        *ties,
        *never,
        *check_motions(scene.agents, observed, intersection_map),
        *check_groups(scene.agents, observed),
        *find_false_reactions(scene, reactions),
    )
    unasked = (
        *check_interference(observed, roles, expected=matched),
        *check_wrecks(observed, until=scene.meta.duration, pushed=pushed),
        *check_contacts(scene.objects, observed.tracks, asked=list_asked_hits(scene)),
    )
    motion = (
        *check_form(scene),
        *check_places(scene.objects, intersection_map),
        *_check_motion(scene, observed, intersection_map, roles, matching, driven),
    )

    figures = {
        "first_visible": sights, "encounters": encounters, "measures": measures,
        "reactions": reactions, "avoidability": avoidability,
        "late_beginnings": list_late_beginnings(observed.tracks, matching) if rules else [],
    }  # fmt: skip
    return Proof(
        verified=not (missing or unasked or motion or red),
        events=events,
        incidental=tuple(observed.events[k] for k in incidental),
        missing=missing, interference=unasked, implausible=motion, signal_violations=red,
        figures=_collect_figures(scene, observed, intersection_map, roles.foreground, driven)
        | {name: rows for name, rows in figures.items() if rows},
    )  # fmt: skip


def read_users(scene: SceneRecord) -> tuple[RoadUser, ...]:
    """The agents of a scene as road users.

    Raises:
        InputError: see `check`.
    """
    if not (math.isfinite(scene.meta.step) and scene.meta.step > 0):
        raise InputError(f"meta.step must be a positive number of seconds, got {scene.meta.step}")
    if not math.isfinite(scene.meta.duration):
        raise InputError(f"meta.duration must be a number of seconds, got {scene.meta.duration}")
    users = tuple(_read_user(agent, scene.meta.step) for agent in scene.agents)
    if count_pair_samples(users) > MOST_PAIR_SAMPLES:
        raise InputError(f"{len(users)} agents are too many for one scene")
    return users


def _read_user(agent: AgentRecord, step: float) -> RoadUser:
    count = len(agent.trajectory)
    xy = np.fromiter(chain.from_iterable(agent.trajectory), np.float64, 2 * count).reshape(-1, 2)
    heading = np.array(agent.heading, dtype=np.float64)
    if len(xy) == 0:
        raise InputError(f"agent {agent.id} has an empty trajectory")
    if len(xy) != len(heading):
        raise InputError(
            f"agent {agent.id} has {len(xy)} positions but {len(heading)} headings; give one each"
        )
    furthest = float(np.abs(np.append(xy, heading)).max())
    if not math.isfinite(furthest):
        raise InputError(f"agent {agent.id}: trajectory or heading holds NaN or infinity")
    if not math.isfinite(agent.spawn_time):
        raise InputError(f"agent {agent.id}: spawn_time {agent.spawn_time} is not a number")
    if max(abs(agent.spawn_time), step * count) > LATEST:
        raise InputError(
            f"agent {agent.id}: {count} positions from {agent.spawn_time:g} s on are no scene; "
            "times are seconds since its start"
        )
    if furthest > FARTHEST:
        raise InputError(
            f"agent {agent.id}: a position or heading is too far off; they are metres and radians"
        )
    shape = Shape(agent.type, agent.length, agent.width)
    return RoadUser(agent.id, Track(xy, heading, agent.spawn_time, step), shape)


def _check_names(scene: SceneRecord, known: set[int]) -> None:
    """Refuses ties, measures and relations that name agents whom the scene lacks."""
    for tie in scene.ties:
        for n in (tie.agent, tie.of):
            if n not in known:
                raise InputError(f"ties name agent {n}, which the scene lacks")
    for measure in scene.measures:
        if not {measure.agent, measure.agent if measure.other is None else measure.other} <= known:
            raise InputError(f"measure {measure.kind} names an agent that the scene lacks")
    for relation in scene.relations:
        for n in (relation.from_, relation.to):
            if n not in known:
                raise InputError(f"relation {relation.type} names agent {n}, which the scene lacks")
        if relation.from_ == relation.to:
            raise InputError(f"relation {relation.type} names agent {relation.to} twice")


def _match_events(
    relations: Sequence[RelationRecord],
    observed: SceneObservation,
    intersection_map: IntersectionMap | None,
) -> tuple[frozenset[int], tuple[Finding, ...]]:
    """Positions of the events that realise relations, and the relations without one."""
    events = observed.events
    used: set[int] = set()
    missing: list[Finding] = []
    for relation in relations:
        failures: list[str] = []
        orders = {(relation.from_, relation.to)}
        directed = has_trait("collision", relation.kind, "directed")
        if relation.type in ("collision", "near_miss") and not directed:
            orders.add((relation.to, relation.from_))
        for k, event in enumerate(events):
            named = relation.type == event.type and (event.from_, event.to) in orders
            if k in used or not named:
                continue
            reason = _find_shortfall(relation, event) or find_unmet_condition(
                relation, event, observed, intersection_map
            )
            if reason is None:
                used.add(k)
                break
            failures.append(reason)
        else:
            pair = {relation.from_, relation.to}
            others = [
                f"observed instead: {e.type} from {e.from_} to {e.to}"
                for e in events if {e.from_, e.to} == pair
            ]  # fmt: skip
            why = "; ".join(failures or others or ["nothing observed"])
            missing.append(Finding(
                rule="relation_not_realised", agents=(relation.from_, relation.to),
                detail=f"{relation.type} from {relation.from_} to {relation.to}: {why}",
            ))  # fmt: skip
    return frozenset(used), tuple(missing)


def _find_shortfall(relation: RelationRecord, event: Event) -> str | None:
    """Why an event of the right type and roles is not the one asked for."""
    if relation.kind is not None and event.kind != relation.kind:
        return f"kind {event.kind} observed, {relation.kind} asked for"
    # Late braking may come on top of a red light run.
    culprits = {event.cause: event.evidence.get("cause_agent")}
    if "late_brake" in event.evidence:
        culprits["late_brake"] = event.evidence["late_brake"]
    if relation.cause is not None and relation.cause not in culprits:
        return f"cause {event.cause or 'none'} observed, {relation.cause} asked for"
    culprit = culprits.get(relation.cause)
    if relation.cause_agent is not None and culprit != relation.cause_agent:
        return f"{relation.cause} by {culprit} observed, by {relation.cause_agent} asked for"
    pet, ttc = event.evidence.get("pet"), event.evidence.get("path_ttc")
    # Of the striking vehicle; of the relation's `from` where both are vehicles.
    striker = event.kind == "pedestrian_strike" or relation.from_ == event.from_
    speed = event.evidence.get("speed_from" if striker else "speed_to")
    for name, target, value, tolerance in (
        ("PET", relation.target_pet, pet, PET_TOLERANCE),
        ("path TTC", relation.target_ttc, ttc, TTC_TOLERANCE),
        ("impact speed", relation.impact_speed, speed, IMPACT_TOLERANCE),
    ):
        if target is not None and (value is None or abs(value - target) > tolerance + 1e-6):
            found = "none" if value is None else f"{value:.2f}"
            return f"{name} {found} observed, {target:.2f} +/- {tolerance} asked for"
    points = [event.evidence.get("point_from"), event.evidence.get("point_to")]
    if relation.from_ != event.from_:
        points.reverse()
    sides = (relation.from_, relation.point_from), (relation.to, relation.point_to)
    for (agent, asked), point in zip(sides, points, strict=True):
        if asked is not None and not is_impact_at(asked, point):
            return f"impact at {point or 'no point'} of {agent} observed, {asked} asked for"
    return None


def _check_motion(
    scene: SceneRecord,
    observed: SceneObservation,
    intersection_map: IntersectionMap | None,
    roles: AgentRoles,
    matching: Sequence[Event],
    driven: Sequence[Trajectory],
) -> tuple[Finding, ...]:
    """What is wrong with the motion, the ends and the ground of all; `driven`: without pushes."""
    found: list[Finding] = []
    serious = [e for e in observed.events if e.type in ("collision", "near_miss")]
    exceptions = [
        AllowedExceptions(
            emergencies=tuple(e.time for e in serious if agent.id in (e.from_, e.to)),
            running=agent.subtype in RUNNERS or has_trait("motion", agent.motion, "running"),
        )
        for agent in scene.agents
    ]
    last = scene.meta.duration
    for track, broken in zip(observed.tracks, check_motion_limits(driven, exceptions), strict=True):
        found += broken
        if track.start < -1e-6 or track.end > last + 0.1 + 1e-6:
            found.append(Finding(
                rule="outside_scene", agents=(track.id,), time=track.end, limit=last,
                detail=f"{track.type} {track.id} is present from {track.start:.1f} to "
                f"{track.end:.1f} s; the scene lasts from 0 to {last:.1f} s",
            ))  # fmt: skip
    if intersection_map is not None:
        hits = (e for e in observed.events if e.type == "collision")
        collided = frozenset(n for e in hits for n in (e.from_, e.to))
        collided |= {agent for agent, _ in list_asked_hits(scene)}
        found += check_ends(
            observed.tracks, intersection_map, until=last, collided=collided,
            foreground=roles.foreground, events=matching, objects=scene.objects,
        )  # fmt: skip
        jaywalkers = frozenset(a.id for a in scene.agents if _jaywalks(a, roles))
        found += check_ground(observed.tracks, intersection_map, jaywalkers=jaywalkers)
    if scene.meta.rules == 3 and scene.meta.driven_by is None:  # a drive may hold others up
        background = {agent.id for agent in scene.agents} - roles.foreground
        found += check_liveness(observed, background=background)
    return tuple(found)


def _jaywalks(agent: AgentRecord, roles: AgentRoles) -> bool:
    """Only what was asked for is allowed, and nothing is asked of the background."""
    return agent.movement == "jaywalking" and agent.id in roles.foreground


def _check_lights(
    scene: SceneRecord,
    observed: SceneObservation,
    intersection_map: IntersectionMap | None,
    roles: AgentRoles,
) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """A wrong signal plan and unasked runs of red lights; and agents that run none though asked."""
    if intersection_map is None:
        return (), ()
    wrong = [*check_signal_plan(scene.signals, intersection_map, until=scene.meta.duration)]
    never = []
    for agent, track in zip(scene.agents, observed.tracks, strict=True) if scene.signals else ():
        runs = observed.lights.find_red_crossings(track)
        asked, named = agent.violates_signal and agent.id in roles.foreground, (agent.id,)
        if asked and not runs:
            detail = f"{agent.type} {agent.id} was to run a red light and never does"
            never.append(Finding(rule="red_light_not_run", agents=named, detail=detail))
        wrong += [
            Finding(
                rule="red_crossing", agents=named, time=round(crossing.time, 3),
                detail=f"{agent.type} {agent.id} passes {crossing.light} on red at "
                f"{crossing.time:.1f} s",
            )
            for crossing in (() if asked or _jaywalks(agent, roles) else runs)
        ]  # fmt: skip
    return tuple(wrong), tuple(never)


def _collect_figures(
    scene: SceneRecord,
    observed: SceneObservation,
    intersection_map: IntersectionMap | None,
    foreground: frozenset[int],
    driven: Sequence[Trajectory],
) -> dict[str, Any]:
    pairs = [(r.from_, r.to) for r in scene.relations]
    pet = {f"{a}-{b}": observed.pet((a, b)) for a, b in pairs}
    red_runs = [
        {"agent": track.id, "time": round(crossing.time, 3), "light": crossing.light}
        for track in observed.tracks
        for crossing in observed.lights.find_red_crossings(track)
    ]
    # Red lights may be run by agents allowed to, although no word of the request asks for it.
    asked = any(each.became == "runs_red" for each in scene.said)
    asked |= any(has_trait("cause", relation.cause, "red_light") for relation in scene.relations)
    unasked = red_runs if red_runs and not asked and scene.meta.rules is not None else None
    return {
        "agents": len(scene.agents),
        "map_checked": intersection_map is not None,
        "pet": {k: round(v, 3) for k, v in pet.items() if v is not None},
        "passing_orders": list_passing_orders(observed, foreground),
        "red_light_runs": red_runs,
        "extremes": find_extremes(driven),
    } | ({"unasked_red_light_runs": unasked} if unasked else {})
