"""Foreground vehicles that wait at red before the first event, and set off at green.

A random arrival meets red as often as the light shows it. So a vehicle of which only a yield
is asked starts from a standstill that often, first in its lane; the event then happens
on its way from there. `foreground.list_signal_demands` says what such a wait asks of the lights.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.candidates import Candidate
from scenewright.scene.constraints import GivesWay, PairClause
from scenewright.scene.map import IntersectionMap, SignalProgram
from scenewright.tools.map_grounding.grounding import share_green
from scenewright.tools.map_grounding.signal_plan import get_phases
from scenewright.tools.solver.entry_times import LINE_GAP, START_LAG, build_red_light_stop
from scenewright.tools.solver.schedule import get_pair
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_ROOM_TO_COME, _LEAST_WAIT = 3.0, 2.0
"""Least way [m] before its place at the line; shortest wait there until green [s]."""


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
        bonds = [each for each in clauses if name in get_pair(each)]
        # Where another one waits already, the light would settle when both start.
        together = any(other in found for each in bonds for other in get_pair(each))
        if together or not _yields_on_green(bonds, candidates, intersection_map):
            continue
        red = _compute_red_duration(program, group)
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
        isinstance(each, GivesWay)
        and share_green(
            candidates[each.first].route,
            candidates[each.second].route,
            intersection_map=intersection_map,
        )
        for each in bonds
    )


def _compute_red_duration(program: SignalProgram, group: str) -> float:
    """Compute how long the group shows red in a cycle [s]."""
    _, shown = get_phases(program, group, ("red",))
    return float(sum(each.duration for each, red in zip(program.phases, shown, strict=True) if red))


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
