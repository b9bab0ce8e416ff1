"""The verdict on a scene: relations observed, nothing else happened, motion plausible."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np

from scenewright.compiled import compiled
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event, Finding, Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord, RelationRecord, SceneRecord
from scenewright.scene.track import Shape, Track
from scenewright.tools.relation_checker.account import check_account
from scenewright.tools.relation_checker.certificate import (
    Roles,
    interference,
    is_incidental,
    wrecks,
)
from scenewright.tools.relation_checker.collisions import is_at
from scenewright.tools.relation_checker.conditions import unmet
from scenewright.tools.relation_checker.entries import misplaced
from scenewright.tools.relation_checker.labels import false_journeys, false_labels
from scenewright.tools.relation_checker.motion import FARTHEST, Mover, RoadUser
from scenewright.tools.relation_checker.observation import Observation, observe
from scenewright.tools.relation_checker.plausibility import (
    Licence,
    extremes,
    implausible,
    odd_form,
    off_ground,
    vanished,
)
from scenewright.tools.relation_checker.recording import ROOM, cells
from scenewright.tools.relation_checker.signals import plan_contradictions

PET_TOLERANCE = 0.15
TTC_TOLERANCE = 0.3
IMPACT_TOLERANCE = 1.0
AGES = 3600.0
"""Longer than this [s] no scene is, and nobody waits for one to begin."""
RUNNERS = ("running", "runner")


def check(scene: SceneRecord, intersection: IntersectionMap | None = None) -> Proof:
    """Proves a scene from its final tracks (SEMANTICS sections 1, 4 and 5).

    Segments are not looked at; labels (`scene.events`, entries, exits, movements, goals) decide
    nothing, but one that the tracks or the map contradict is reported as missing. Without a map,
    ground, signals and journeys are not checked.

    Returns:
        The proof; `verified` if every relation asked for is observed with its roles and its cause,
        tied entries lie as they should, who is named as running red does and nobody else, nothing
        else happens and no motion is implausible.

    Raises:
        InputError: values that are not finite, an id twice, an empty track, lengths that differ.
    """
    users = read_users(scene)
    known = {a.id for a in scene.agents}
    _check_ties(scene, known)
    asked = tuple(_known_pair(r, known) for r in scene.relations)
    roles = Roles(
        frozenset(a.id for a in scene.agents if a.role == "foreground").union(*asked),
        frozenset(frozenset(pair) for pair in asked),
    )
    seen = observe(
        users, ground=intersection, signals=scene.signals, asked=asked,
        detailed=frozenset(n for pair in asked for n in pair), until=scene.meta.duration,
    )  # fmt: skip
    asked_for = scene.relations if intersection and scene.signals else _unlit(scene.relations)
    matched, missing = _match(asked_for, seen, intersection)
    return _proof(scene, intersection, seen=seen, roles=roles, matched=matched, missing=missing)


def _proof(
    scene: SceneRecord,
    intersection: IntersectionMap | None,
    *,
    seen: Observation,
    roles: Roles,
    matched: frozenset[int],
    missing: tuple[Finding, ...],
) -> Proof:
    incidental = [k for k, e in enumerate(seen.events)
                  if k not in matched and is_incidental(e, roles)]  # fmt: skip
    events = tuple(e for k, e in enumerate(seen.events) if k not in incidental)
    said, unsaid = check_account(scene, seen.events, seen, intersection)
    missing = (
        *missing,
        *unsaid,
        *false_labels(scene, events, lit=bool(intersection and scene.signals)),
        *(false_journeys(scene, seen.movers, intersection) if intersection else ()),
        *_not_as_tied(scene, seen, intersection),
        *_obedient(scene, seen, intersection, roles),
    )
    unasked = (
        *interference(seen, roles, expected=matched),
        *wrecks(seen, until=scene.meta.duration),
    )
    motion = (*odd_form(scene), *_implausible(scene, seen, intersection, roles))
    red = _red_crossings(scene, seen, intersection, roles)
    return Proof(
        verified=not (missing or unasked or motion or red),
        events=events,
        incidental=tuple(seen.events[k] for k in incidental),
        missing=missing, interference=unasked, implausible=motion, signal_violations=red,
        said=said, figures=_figures(scene, seen, intersection),
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
    if cells(users) > ROOM:
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
    furthest = _largest(xy.ravel(), heading)
    if not math.isfinite(furthest):
        raise InputError(f"agent {agent.id}: trajectory or heading holds NaN or infinity")
    if not math.isfinite(agent.spawn_time):
        raise InputError(f"agent {agent.id}: spawn_time {agent.spawn_time} is not a number")
    if max(abs(agent.spawn_time), step * count) > AGES:
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


@compiled
def _largest(xy: FloatArray, heading: FloatArray) -> float:
    """The largest magnitude of all; infinite where one is not a number."""
    largest = 0.0
    for values in (xy, heading):
        for value in values:
            largest = max(largest, np.inf if np.isnan(value) else abs(value))
    return largest


def _known_pair(relation: RelationRecord, known: set[int]) -> tuple[int, int]:
    pair = relation.from_, relation.to
    for n in pair:
        if n not in known:
            raise InputError(f"relation {relation.type} names agent {n}, which the scene lacks")
    if pair[0] == pair[1]:
        raise InputError(f"relation {relation.type} names agent {pair[0]} twice")
    return pair


def _check_ties(scene: SceneRecord, known: set[int]) -> None:
    for tie in scene.ties:
        for n in (tie.agent, tie.of):
            if n not in known:
                raise InputError(f"ties name agent {n}, which the scene lacks")


def _unlit(relations: Sequence[RelationRecord]) -> tuple[RelationRecord, ...]:
    """Without lights nobody is seen to run red, so that such a cause is not looked for."""
    nobody = {"cause": None, "cause_agent": None}
    return tuple(
        r.model_copy(update=nobody) if r.cause == "red_light_run" else r for r in relations
    )


def _match(
    relations: Sequence[RelationRecord], seen: Observation, intersection: IntersectionMap | None
) -> tuple[frozenset[int], tuple[Finding, ...]]:
    """Positions of the events that realise relations, and the relations without one."""
    events = seen.events
    used: set[int] = set()
    missing: list[Finding] = []
    for relation in relations:
        failures: list[str] = []
        for k, event in enumerate(events):
            if k in used or not _same_roles(relation, event):
                continue
            reason = _falls_short(relation, event) or unmet(relation, event, seen, intersection)
            if reason is None:
                used.add(k)
                break
            failures.append(reason)
        else:
            missing.append(_not_realised(relation, failures, events))
    return frozenset(used), tuple(missing)


def _same_roles(relation: RelationRecord, event: Event) -> bool:
    asked, seen = (relation.from_, relation.to), (event.from_, event.to)
    symmetric = relation.type in ("collision", "near_miss")
    return relation.type == event.type and (asked == seen or (symmetric and asked == seen[::-1]))


def _falls_short(relation: RelationRecord, event: Event) -> str | None:
    """Why an event of the right type and roles is not the one asked for."""
    if relation.kind is not None and event.kind != relation.kind:
        return f"kind {event.kind} observed, {relation.kind} asked for"
    uncaused = _uncaused(relation, event)
    if uncaused is not None:
        return uncaused
    for name, target, seen, tolerance in (
        ("PET", relation.target_pet, event.evidence.get("pet"), PET_TOLERANCE),
        ("path TTC", relation.target_ttc, event.evidence.get("path_ttc"), TTC_TOLERANCE),
        ("impact speed", relation.impact_speed, _impact_speed(relation, event), IMPACT_TOLERANCE),
    ):
        if target is not None and (seen is None or abs(seen - target) > tolerance + 1e-6):
            found = "none" if seen is None else f"{seen:.2f}"
            return f"{name} {found} observed, {target:.2f} +/- {tolerance} asked for"
    return _struck_elsewhere(relation, event)


def _uncaused(relation: RelationRecord, event: Event) -> str | None:
    """Why the cause asked for is not seen; late braking may come on top of a red light run."""
    culprits = {event.cause: event.evidence.get("cause_agent")}
    if "late_brake" in event.evidence:
        culprits["late_brake"] = event.evidence["late_brake"]
    if relation.cause is not None and relation.cause not in culprits:
        return f"cause {event.cause or 'none'} observed, {relation.cause} asked for"
    culprit = culprits.get(relation.cause)
    if relation.cause_agent is not None and culprit != relation.cause_agent:
        return f"{relation.cause} by {culprit} observed, by {relation.cause_agent} asked for"
    return None


def _struck_elsewhere(relation: RelationRecord, event: Event) -> str | None:
    """Where a vehicle was struck, if that is not where it was to be."""
    seen = [event.evidence.get("point_from"), event.evidence.get("point_to")]
    if relation.from_ != event.from_:
        seen.reverse()
    for agent, asked, found in (
        (relation.from_, relation.point_from, seen[0]), (relation.to, relation.point_to, seen[1]),
    ):  # fmt: skip
        if asked is not None and not is_at(asked, found):
            return f"impact at {found or 'no point'} of {agent} observed, {asked} asked for"
    return None


def _impact_speed(relation: RelationRecord, event: Event) -> float | None:
    """Speed of the striking vehicle; of the relation's `from` where both are vehicles."""
    striker = event.evidence.get("speed_from")
    if event.kind == "pedestrian_strike" or relation.from_ == event.from_:
        return striker
    return event.evidence.get("speed_to")


def _not_realised(
    relation: RelationRecord, failures: list[str], events: Sequence[Event]
) -> Finding:
    pair = {relation.from_, relation.to}
    others = [f"{e.type} from {e.from_} to {e.to}" for e in events if {e.from_, e.to} == pair]
    why = "; ".join(failures or [f"observed instead: {o}" for o in others] or ["nothing observed"])
    return Finding(
        rule="relation_not_realised", agents=(relation.from_, relation.to),
        detail=f"{relation.type} from {relation.from_} to {relation.to}: {why}",
    )  # fmt: skip


def _implausible(
    scene: SceneRecord, seen: Observation, intersection: IntersectionMap | None, roles: Roles
) -> tuple[Finding, ...]:
    found: list[Finding] = []
    licences = [_licence(agent, seen.events) for agent in scene.agents]
    for mover, broken in zip(seen.movers, implausible(seen.movers, licences), strict=True):
        found += broken
        found += _outside_scene(mover, scene.meta.duration)
    if intersection is not None:
        hits = (e for e in seen.events if e.type == "collision")
        collided = frozenset(n for e in hits for n in (e.from_, e.to))
        until = scene.meta.duration
        found += vanished(seen.movers, intersection, until=until, collided=collided)
        jaywalkers = frozenset(a.id for a in scene.agents if _jaywalks(a, roles))
        found += off_ground(seen.movers, intersection, jaywalkers=jaywalkers)
    return tuple(found)


def _licence(agent: AgentRecord, events: Sequence[Event]) -> Licence:
    times = tuple(
        e.time
        for e in events
        if e.type in ("collision", "near_miss") and agent.id in (e.from_, e.to)
    )
    return Licence(emergencies=times, running=agent.subtype in RUNNERS)


def _outside_scene(mover: Mover, duration: float) -> list[Finding]:
    if mover.start >= -1e-6 and mover.end <= duration + 0.1 + 1e-6:
        return []
    return [
        Finding(
            rule="outside_scene", agents=(mover.id,), time=mover.end, limit=duration,
            detail=f"{mover.type} {mover.id} is present from {mover.start:.1f} to {mover.end:.1f} "
            f"s; the scene lasts from 0 to {duration:.1f} s",
        )
    ]  # fmt: skip


def _jaywalks(agent: AgentRecord, roles: Roles) -> bool:
    """Only what was asked for is allowed, and nobody asks for anything of the background."""
    return agent.movement == "jaywalking" and agent.id in roles.foreground


def _red_crossings(
    scene: SceneRecord, seen: Observation, intersection: IntersectionMap | None, roles: Roles
) -> tuple[Finding, ...]:
    if intersection is None:
        return ()
    plan = plan_contradictions(scene.signals, intersection, until=scene.meta.duration)
    if not scene.signals:
        return plan
    return plan + tuple(
        Finding(
            rule="red_crossing", agents=(agent.id,), time=round(crossing.time, 3),
            detail=f"{agent.type} {agent.id} passes {crossing.light} on red at "
            f"{crossing.time:.1f} s",
        )
        for agent, mover in zip(scene.agents, seen.movers, strict=True)
        if not (agent.violates_signal and agent.id in roles.foreground)
        and not _jaywalks(agent, roles)
        for crossing in seen.lights.ran_red(mover)
    )  # fmt: skip


def _not_as_tied(
    scene: SceneRecord, seen: Observation, intersection: IntersectionMap | None
) -> tuple[Finding, ...]:
    if intersection is None:
        return ()
    return misplaced(scene.ties, {m.id: m for m in seen.movers}, intersection)


def _obedient(
    scene: SceneRecord, seen: Observation, intersection: IntersectionMap | None, roles: Roles
) -> tuple[Finding, ...]:
    """Agents that were to run a red light and never do."""
    if intersection is None or not scene.signals:
        return ()
    return tuple(
        Finding(
            rule="red_light_not_run", agents=(agent.id,),
            detail=f"{agent.type} {agent.id} was to run a red light and never does",
        )
        for agent, mover in zip(scene.agents, seen.movers, strict=True)
        if agent.violates_signal and agent.id in roles.foreground
        and not seen.lights.ran_red(mover)
    )  # fmt: skip


def _red_runs(seen: Observation) -> list[dict[str, Any]]:
    return [
        {"agent": mover.id, "time": round(crossing.time, 3), "light": crossing.light}
        for mover in seen.movers
        for crossing in seen.lights.ran_red(mover)
    ]


def _figures(
    scene: SceneRecord, seen: Observation, intersection: IntersectionMap | None
) -> dict[str, Any]:
    pairs = [(r.from_, r.to) for r in scene.relations]
    pet = {f"{a}-{b}": seen.pet((a, b)) for a, b in pairs}
    return {
        "agents": len(scene.agents),
        "map_checked": intersection is not None,
        "pet": {k: round(v, 3) for k, v in pet.items() if v is not None},
        "red_light_runs": _red_runs(seen),
        "extremes": extremes(seen.movers),
    }
