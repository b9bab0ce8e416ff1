"""Red lights: who waits at one before the first event, who runs one, and what lights must show.

A random arrival meets red as often as the light shows it. So a vehicle of which only a yield
is asked starts from a standstill that often, first in its lane; the event then happens
on its way from there. Who runs red passes its line on red, before its other events.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.candidates import Candidate
from scenewright.scene.constraints import GivesWay, Headway, PairClause
from scenewright.scene.map import IntersectionMap
from scenewright.scene.selection import Stop
from scenewright.tools.map_grounding.route_meetings import share_green
from scenewright.tools.map_grounding.signal_plan import SignalDemand, get_phases
from scenewright.tools.solver.entry_times import LINE_GAP, START_LAG, build_red_light_stop
from scenewright.tools.solver.scheduled_agent import (
    PartialSchedule,
    ScheduledAgent,
    ScheduledEvent,
    get_pair,
)

_SEEN = 0.6
"""Least time from the beginning of the scene to the run [s]."""

_LONE = (6.0, 19.0)
"""When an agent without other relations runs red [s]."""

_ROOM_TO_COME, _LEAST_WAIT = 3.0, 2.0
"""Least way [m] before its place at the line; shortest wait there until green [s]."""

_SLOWS = 5.5
"""How long before a stop [s] the light must not explain it."""

_YELLOW = 0.7
"""Least time since a light turned yellow for an agent that passes it then [s]."""


def runs_in_time(name: str, schedule: PartialSchedule, *, until: float) -> bool:
    """Return whether the agent passes its line in the scene, and before its last event."""
    return _SEEN <= compute_line_time(schedule.actors[name]) <= until and runs_first(name, schedule)


def runs_first(name: str, schedule: PartialSchedule) -> bool:
    """Return whether the agent passes its line before its last event, at any scene time."""
    own = [event for event in schedule.events if name in get_pair(event.clause)]
    latest = max((_find_latest_cause(each, name) for each in own), default=float("inf"))
    return compute_line_time(schedule.actors[name]) <= latest


def compute_line_time(actor: ScheduledAgent) -> float:
    """Compute the scene time [s] at which the agent passes its line; inf if it never does."""
    if actor.landmarks.line is None or actor.landmarks.group is None:
        return float("inf")
    return actor.enters + actor.motion.find_time_at(actor.landmarks.line)


def add_red_light_runners(
    schedule: PartialSchedule,
    candidates: Mapping[str, tuple[Candidate, Landmarks]],
    rng: np.random.Generator,
) -> PartialSchedule:
    """Add all agents that run red without another relation to the schedule."""
    actors = dict(schedule.actors)
    for name, built in candidates.items():
        if name not in actors:
            actor = ScheduledAgent.build_unplaced(*built)
            line = compute_line_time(actor)
            if np.isfinite(line):
                actors[name] = actor.shift(float(rng.uniform(*_LONE)) - line)
    return PartialSchedule(actors, schedule.events)


def _find_latest_cause(event: ScheduledEvent, name: str) -> float:
    """Find until when [s] running red can have caused the event."""
    match event.clause:
        case GivesWay(second=second):
            return event.freed if second == name else event.ends
        case Headway():
            return float("inf")
    return event.time


def draw_red_light_starts(
    candidates: Mapping[str, Candidate],
    landmarks: Mapping[str, Landmarks],
    clauses: Collection[PairClause],
    *,
    intersection_map: IntersectionMap,
    chances: Mapping[str, float],
    rng: np.random.Generator,
) -> dict[str, ScheduledAgent]:
    """Draw the foreground agents, by name, that start from a red light, entering at time 0.

    Args:
        clauses: all that bind two agents.
        chances: how likely these start so; others do as often as their light is red.
    """
    found: dict[str, ScheduledAgent] = {}
    for name, candidate in candidates.items():
        group, program = landmarks[name].group, intersection_map.signals
        if program is None or group is None or candidate.route.type != "vehicle":
            continue
        bonds = [clause for clause in clauses if name in get_pair(clause)]
        # With two that wait, the light would settle when both start.
        others = (other for each in bonds for other in get_pair(each))
        if not _yields_on_green(bonds, candidates, intersection_map) or not found.keys().isdisjoint(
            others
        ):
            continue
        _, shown = get_phases(program, group, ("red",))
        red = float(
            sum(p.duration for p, is_red in zip(program.phases, shown, strict=True) if is_red)
        )
        if rng.random() < chances.get(name, red / program.cycle):
            waiting = _wait_at_red(candidate, landmarks[name], float(rng.uniform(0.0, red)), rng)
            found |= {} if waiting is None else {name: waiting}
    return found


def _yields_on_green(
    bonds: Collection[PairClause],
    candidates: Mapping[str, Candidate],
    intersection_map: IntersectionMap,
) -> bool:
    """Return whether these are only yields, between two that have green together."""
    return bool(bonds) and all(
        isinstance(bond, GivesWay)
        and share_green(
            candidates[bond.first].route,
            candidates[bond.second].route,
            intersection_map=intersection_map,
        )
        for bond in bonds
    )


def _wait_at_red(
    candidate: Candidate, landmarks: Landmarks, red: float, rng: np.random.Generator
) -> ScheduledAgent | None:
    """Let the candidate wait with so much red [s] left at its line; None if it has no room to
    come."""
    s = (landmarks.line or 0.0) - float(rng.uniform(*LINE_GAP))
    if s < _ROOM_TO_COME:
        return None
    actor = ScheduledAgent.build_unplaced(candidate, landmarks)
    stop = build_red_light_stop(actor, s)
    until = stop.start + max(red, _LEAST_WAIT) + float(rng.uniform(*START_LAG))
    return actor.hold_at_lights((replace(stop, until=until),))


def list_signal_demands(
    actor: ScheduledAgent, *, violates: bool, until: float, yellow: bool = False
) -> tuple[SignalDemand, ...]:
    """List what the signal plan must show for this agent: to obey it, or to run its light."""
    line, group = actor.landmarks.line, actor.landmarks.group
    if line is None or group is None:
        return ()
    found = [_demand_red(stop, actor, group, until) for stop in actor.stops if stop.at_red]
    crosses = actor.enters + actor.motion.find_time_at(line)
    if not np.isfinite(crosses) or crosses > until or crosses < -25.0:
        return tuple(found)
    if yellow:
        return (*found, SignalDemand(group, crosses - _YELLOW, crosses + 0.3, ("yellow",)))
    if violates:
        # An agent that slows at a light that is not green waits for the light.
        slows = [stop.start for stop in actor.stops if stop.reason == "gives_way" and stop.s < line]
        found += [SignalDemand(group, start - _SLOWS, start + 0.3, ("green",)) for start in slows]
        return (*found, SignalDemand(group, crosses - 0.5, crosses + 0.4, ("red",)))
    near = [stop for stop in actor.stops if abs(stop.s - line) < 2.0]
    waits = [stop.start - _SLOWS for stop in near if not stop.at_red]
    starts = [stop.until - START_LAG[0] for stop in near if stop.at_red]
    begins = min([crosses - 0.2, *waits, *starts])
    return (*found, SignalDemand(group, begins, crosses + 0.5, ("green",)))


def _demand_red(stop: Stop, actor: ScheduledAgent, group: str, until: float) -> SignalDemand:
    """Demand red from before the agent slows for its stop until it is hit, or the light changes.

    Where it has started before the scene begins, red just before that.
    """
    turns = stop.until - START_LAG[1]
    if actor.contact is not None and actor.contact <= stop.until:
        turns = actor.contact
    ends = min(turns, until)
    return SignalDemand(group, min(max(stop.start - 2.0, 0.0), ends), ends, ("red",))
