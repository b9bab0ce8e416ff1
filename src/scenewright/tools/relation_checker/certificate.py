"""The certificate of no other interaction (SEMANTICS section 4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from scenewright.scene.events import Event, Finding
from scenewright.tools.relation_checker.collisions import measure_impact
from scenewright.tools.relation_checker.contact import compute_gap_at, compute_gaps_at
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.following import LaneGaps
from scenewright.tools.relation_checker.pushes import find_strike
from scenewright.tools.relation_checker.trajectory import Trajectory

MIN_CLEARANCE = 0.5
FOREGROUND_PET = 1.5
BACKGROUND_PET = 1.0
STANDING_GAP = 1.0
HEADWAY = 0.8
WRECK_ENDS_WITHIN = 0.2
ROUNDING = 2e-3

Pair = frozenset[int]


@dataclass(frozen=True)
class AgentRoles:
    """The foreground agents, and pairs of agents, by ids.

    Attributes:
        bound: pairs that a relation binds.
        chained: the first and the last of three in a chain collision, which one more parts.
    """

    foreground: frozenset[int]
    bound: frozenset[Pair]
    chained: frozenset[Pair] = frozenset()


def check_interference(
    observed: SceneObservation, roles: AgentRoles, *, expected: frozenset[int]
) -> tuple[Finding, ...]:
    """Everything that happens and was not asked for.

    Args:
        expected: positions in `observed.events` of the events that realise a relation.
    """
    found = [
        Finding(
            rule=f"unasked_{e.type}", agents=(e.from_, e.to), time=e.time,
            detail=f"{e.type} of {e.from_} and {e.to} at {e.time:.1f} s, "
            "which no relation asks for",
        )
        for k, e in enumerate(observed.events)
        if k not in expected and not is_incidental(e, roles)
    ]  # fmt: skip
    found += find_contacts(observed)
    near, table = observed.near, observed.grid.table
    for row in np.flatnonzero(near.least < MIN_CLEARANCE - ROUNDING).tolist():
        first, second = (observed.tracks[k] for k in table.pairs[row])
        walking = not (first.is_vehicle or second.is_vehicle)
        if walking or frozenset((first.id, second.id)) in roles.bound or row in near.contacts:
            continue
        begin, count = table.common[row]
        closest = int(np.argmin([compute_gap_at(table, row, k) for k in range(count)]))
        found.append(_report_measured(
            "clearance", (first, second), time=float(table.times[begin + closest]),
            value=float(near.least[row]), limit=MIN_CLEARANCE, unit="m apart",
        ))  # fmt: skip
    for encounter in observed.encounters:
        first, second = observed.tracks[encounter.first], observed.tracks[encounter.second]
        pair = frozenset((first.id, second.id))
        limit = FOREGROUND_PET if pair & roles.foreground else BACKGROUND_PET
        if pair not in roles.bound and encounter.pet <= limit:
            found.append(_report_measured(
                "pet", (first, second), value=encounter.pet, limit=limit, unit="s PET",
                time=max(encounter.first_time, encounter.second_time),
            ))  # fmt: skip
    for lane in observed.lanes:
        found += _check_queueing(lane, observed.tracks, roles)
    return tuple(found)


def is_incidental(event: Event, roles: AgentRoles) -> bool:
    """A follow; between unbound background agents, a yield or a near miss with PET > 1 s; between
    the ends of a chain a near miss."""
    if event.type == "follow":
        return True
    pair = frozenset((event.from_, event.to))
    if pair in roles.chained:
        return event.type == "near_miss"
    if pair & roles.foreground or pair in roles.bound:
        return False
    if event.type == "yielding":
        return float(event.evidence.get("pet", np.inf)) > BACKGROUND_PET
    return event.type == "near_miss" and float(event.evidence.get("pet", 0.0)) > BACKGROUND_PET


def find_contacts(observed: SceneObservation) -> Iterator[Finding]:
    """Contacts that are no collision: at spawn, or slower than 1 m/s."""
    collided = {frozenset((e.from_, e.to)) for e in observed.events if e.type == "collision"}
    for row, contact in observed.near.contacts.items():
        first, second = (observed.tracks[k] for k in observed.grid.table.pairs[row])
        if frozenset((first.id, second.id)) not in collided:
            how, speed = "overlap from the start", ""
            if not contact.initial:
                hit = measure_impact(first, second, time=contact.time)
                how = "touch"
                speed = f" at {hit.relative_speed:.1f} m/s, too slowly for a collision"
            overlap = max(-float(observed.near.least[row]), 0.0)
            deep = f"; they overlap by up to {overlap:.2f} m" if overlap >= 0.01 else ""
            yield Finding(
                rule="contact", agents=(first.id, second.id), time=round(contact.time, 3),
                measured=0.0,
                detail=f"agents {first.id} and {second.id} {how} at {contact.time:.1f} s"
                f"{speed}{deep}",
            )  # fmt: skip


def _check_queueing(
    lane: LaneGaps, tracks: tuple[Trajectory, ...], roles: AgentRoles
) -> Iterator[Finding]:
    follower = tracks[lane.follower]
    standing = (lane.leader >= 0) & (lane.speed <= 0.3) & (lane.gap < STANDING_GAP - 0.02)
    moving = (lane.leader >= 0) & (lane.speed > 0.3) & (lane.headway < HEADWAY - 0.02)
    if not follower.is_vehicle or not (standing | moving).any():
        return
    bound = np.array([frozenset((follower.id, m.id)) in roles.bound for m in tracks])
    standing, moving = (mask & ~bound[lane.leader] for mask in (standing, moving))
    for mask, values, limit, rule, unit in (
        (standing, lane.gap, STANDING_GAP, "standing_gap", "m behind"),
        (moving, lane.headway, HEADWAY, "headway", "s behind"),
    ):
        if mask.any():
            k = int(np.argmin(np.where(mask, values, np.inf)))
            yield _report_measured(
                rule, (follower, tracks[lane.leader[k]]), time=float(lane.times[k]),
                value=float(values[k]), limit=limit, unit=unit,
            )  # fmt: skip


def _report_measured(
    rule: str,
    pair: tuple[Trajectory, Trajectory],
    *,
    time: float,
    value: float,
    limit: float,
    unit: str,
) -> Finding:
    first, second = pair
    return Finding(
        rule=rule, agents=(first.id, second.id), time=round(time, 3), measured=round(value, 3),
        limit=limit,
        detail=f"agents {first.id} and {second.id}: {value:.2f} {unit} at {time:.1f} s; "
        f"at least {limit:.2f}",
    )  # fmt: skip


def check_wrecks(
    observed: SceneObservation, *, until: float, pushed: frozenset[int] = frozenset()
) -> tuple[Finding, ...]:
    """After a collision both tracks end within 0.2 s, and everyone else keeps 0.5 m from them.

    Args:
        until: end of the scene [s]; the last footprints stay as obstacles up to then.
        pushed: agents that a collision pushes into another, which ends them.
    """
    tracks = observed.by_id
    found: list[Finding] = []
    for event in (e for e in observed.events if e.type == "collision"):
        for n in (event.from_, event.to):
            if n in pushed and event == find_strike(n, observed.events):
                continue
            track, after = tracks[n], tracks[n].end - event.time
            if track.end > event.time + WRECK_ENDS_WITHIN + 1e-6:
                found.append(Finding(
                    rule="wreck_drives_on", agents=(n,), time=event.time,
                    measured=round(after, 3), limit=WRECK_ENDS_WITHIN,
                    detail=f"{track.type} {n} goes on for {after:.1f} s after its "
                    f"collision at {event.time:.1f} s; at most {WRECK_ENDS_WITHIN} s",
                ))  # fmt: skip
            found += check_wreck_clearance(track, observed.tracks, {event.from_, event.to}, until)
    return tuple(found)


def check_wreck_clearance(
    wreck: Trajectory, tracks: Sequence[Trajectory], involved: set[int], until: float
) -> Iterator[Finding]:
    """Agents that come within 0.5 m of a wreck after its track has ended."""
    x, y = wreck.xy[-1].tolist()
    for other in tracks:
        west, south, east, north = other.bounds
        away = max(west - x, x - east, south - y, y - north) - other.reach - wreck.reach
        there = other.times[(other.times > wreck.end + 1e-6) & (other.times <= until + 1e-6)]
        if other.id in involved or not len(there) or away > MIN_CLEARANCE:
            continue
        gaps = compute_gaps_at(wreck, other, times=there)
        k = int(gaps.argmin())
        if gaps[k] < MIN_CLEARANCE - ROUNDING:
            yield _report_measured(
                "wreck_clearance", (other, wreck), time=float(there[k]),
                value=max(float(gaps[k]), 0.0), limit=MIN_CLEARANCE, unit="m from the wreck",
            )  # fmt: skip
