"""Chain collisions: an agent struck from behind that goes on into the one ahead of it.

SEMANTICS 4 ends both tracks of a collision within 0.2 s of their contact. An agent that a relation
says is pushed is in two collisions: the 0.2 s count from the second, and between the two it may
move as the impact explains, which is held against the conservation of momentum.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from scenewright.scene.events import Event
from scenewright.scene.kinds import has_trait
from scenewright.scene.record import RelationRecord
from scenewright.scene.track import STEP, VEHICLE_MASSES, VEHICLE_SIZES
from scenewright.tools.relation_checker.contact import estimate_velocity_before
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.trajectory import Trajectory

WITHIN = 1.0
"""Longest time between the two collisions [s]."""
STOOD = 0.05
"""How far an agent that stands may move in half a second [m]."""
RESTITUTION = 0.3
BRAKING = 8.0
"""Hardest braking after the impact [m/s^2]."""
TIMED = 0.03
"""How exactly the times of contacts are known [s]."""
SAME_SIZE = 0.05
"""By how much the length of a subtype may differ [m]."""


def list_pushed(relations: Sequence[RelationRecord]) -> frozenset[int]:
    """The agents that are said to be pushed into another."""
    return frozenset(
        relation.from_
        for relation in relations
        if has_trait("manoeuvre", relation.manoeuvre, "chain")
    )


def list_chained(relations: Sequence[RelationRecord]) -> frozenset[frozenset[int]]:
    """Who strikes the pushed agent, and into whom that is pushed."""
    return frozenset(
        frozenset((first.from_, second.to))
        for second in relations
        if has_trait("manoeuvre", second.manoeuvre, "chain")
        for first in relations
        if first.type == "collision" and first.to == second.from_
    )


def find_strike(agent: int, events: Sequence[Event]) -> Event | None:
    """The collision in which an agent is struck from behind shortly before another one."""
    hits = [e for e in events if e.type == "collision" and agent in (e.from_, e.to)]
    for event in hits:
        later = [e for e in hits if e is not event and 0.0 < e.time - event.time <= WITHIN]
        if event.to == agent and event.kind == "rear_end" and later:
            return event
    return None


def cut_pushed(
    tracks: Sequence[Trajectory], events: Sequence[Event], pushed: Collection[int]
) -> tuple[Trajectory, ...]:
    """The tracks, those of pushed agents up to the impact alone, as what follows is no driving."""

    def cut(track: Trajectory) -> Trajectory:
        struck = find_strike(track.id, events) if track.id in pushed else None
        if struck is None:
            return track
        count = max(int((struck.time - TIMED - track.start) / STEP) + 1, 1)
        return replace(track, xy=track.xy[:count], heading=track.heading[:count])

    return tuple(map(cut, tracks))


def describe_push(
    pushed: Trajectory, _second: Trajectory, event: Event, observed: SceneObservation
) -> str | None:
    """How an agent that stood is struck from behind and pushed on; None if the tracks do not show
    it, or show a motion that the masses do not explain."""
    struck = find_strike(pushed.id, observed.events)
    if struck is None or struck.time >= event.time:
        return None
    times = np.array([struck.time - 0.6, struck.time - 0.1, event.time])
    before, at_impact, after = pushed.at(times)[0]
    if float(np.hypot(*(at_impact - before))) > STOOD:
        return None
    striker = observed.by_id[struck.from_]
    lasts = event.time - struck.time
    moved = float(np.hypot(*(after - at_impact)))
    # Momentum is conserved: from no restitution and hard braking to some restitution and none.
    speed = float(np.hypot(*estimate_velocity_before(striker, time=struck.time)))
    light, heavy = _list_masses(striker), _list_masses(pushed)
    least = speed * min(light) / (min(light) + max(heavy))
    most = speed * (1.0 + RESTITUTION) * max(light) / (max(light) + min(heavy))
    stands = min(max(lasts - TIMED, 0.0), least / BRAKING)
    low, high = least * stands - BRAKING * stands**2 / 2, most * (lasts + TIMED)
    if not low <= moved <= high:
        return None
    return (
        f"agent {striker.id} pushes agent {pushed.id} {moved:.1f} m on in {lasts:.2f} s; "
        f"{low:.1f} to {high:.1f} m follow from their masses"
    )


def _list_masses(track: Trajectory) -> list[float]:
    """Masses [kg] of the subtypes that are nearest in length; several share one size."""
    off = {name: abs(size[0] - track.length) for name, size in VEHICLE_SIZES.items()}
    nearest = min(off.values()) + SAME_SIZE
    return [VEHICLE_MASSES[name] for name, each in off.items() if each <= nearest]
