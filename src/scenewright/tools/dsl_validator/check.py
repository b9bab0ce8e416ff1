"""Unary clauses, checked on a candidate (paper 3.3, constraint validator)."""

from __future__ import annotations

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.geometry.map_areas import MapAreas
from scenewright.scene.candidates import Candidate
from scenewright.scene.constraints import (
    AgentFigure,
    AgentMotion,
    MinLength,
    NoReaction,
    OnRoad,
    OnWalkable,
    PassesThrough,
    Reacts,
    RunsRed,
    RunsYellow,
    SpeedBetween,
    UnaryClause,
)
from scenewright.scene.kinds import list_kinds
from scenewright.scene.rejection import Rejection

_ON_ROAD, _ON_WALKABLE = 0.995, 0.999
"""Stricter than the 98 % of SEMANTICS section 5: a standstill weighs a spot many times, most of
all a pedestrian's."""

_JUNCTION_RADIUS = 6.0

_EVERY = 2
"""Points of a path of which one is looked at, a metre apart."""


def check(
    candidate: Candidate, clause: UnaryClause, *, landmarks: Landmarks, map_areas: MapAreas
) -> tuple[Rejection, ...]:
    """Empty if the candidate satisfies the clause, else why it does not."""
    problem = _find_problem(candidate, clause, landmarks, map_areas)
    if problem is None:
        return ()
    return (
        Rejection(
            stage="waypoint_filter",
            code="no_surviving_combination",
            agents=(clause.agent,),
            detail=f"{clause.agent}: {problem}",
        ),
    )


def _find_problem(
    candidate: Candidate, clause: UnaryClause, landmarks: Landmarks, map_areas: MapAreas
) -> str | None:
    xy = candidate.path.xy[::_EVERY]
    match clause:
        case OnRoad():
            return _describe_excess(
                map_areas.compute_road_share(xy), _ON_ROAD, "of its path on the road"
            )
        case OnWalkable():
            strays = [
                name for name, _, _ in landmarks.crosswalks if name != landmarks.own_crosswalk
            ]
            if strays:
                return f"strays onto the {strays[0]}"
            if landmarks.steps_on > 1:
                return "steps onto its crosswalk more than once"
            return _describe_excess(
                map_areas.compute_walkable_share(xy), _ON_WALKABLE, "of its path on walkable area"
            )
        case MinLength():
            return _describe_excess(candidate.path.length, clause.metres, "m of path")
        case SpeedBetween():
            inside = clause.low <= candidate.time_law.speed <= clause.high
            return None if inside else f"free speed {candidate.time_law.speed:.1f} m/s"
        case PassesThrough():
            return None if _is_satisfied(candidate, clause, landmarks) else "does not pass there"
        case AgentFigure():
            return None  # of the motion in the scene, which the solver measures
        case RunsRed() | RunsYellow():
            return None if landmarks.group else "there is no red light on its way to run"
        case NoReaction() | Reacts():
            return None  # of the motion in the scene, which the checker looks at
        case AgentMotion():
            return _find_missing_place(clause, landmarks)


def _find_missing_place(clause: AgentMotion, landmarks: Landmarks) -> str | None:
    """What a motion needs on the way of the agent, and the way lacks."""
    traits = next(kind.traits for kind in list_kinds("motion") if kind.clause == clause.clause)
    if "at_light" in traits and not landmarks.group:
        return "there is no light on its way"
    return "does not cross the road" if "on_road" in traits and landmarks.line is None else None


def _describe_excess(value: float, limit: float, what: str) -> str | None:
    return None if value >= limit else f"only {value:.3g} {what}, at least {limit:g}"


def _is_satisfied(candidate: Candidate, clause: PassesThrough, landmarks: Landmarks) -> bool:
    if clause.region == "crosswalk":
        return any(name == f"{clause.leg}:crosswalk" for name, _, _ in landmarks.crosswalks)
    if clause.region == "leg":
        route = candidate.route
        return clause.leg in (route.entry, route.exit, route.crosswalk)
    return bool((np.hypot(*candidate.path.xy.T) < _JUNCTION_RADIUS).any())
