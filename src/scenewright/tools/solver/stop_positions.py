"""Stop positions of a yielding agent: its line or kerb, or as far short of the zone as observed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenewright.geometry.driving_profile import StopCommand
from scenewright.geometry.landmarks import STOP_GAP, Landmarks
from scenewright.scene.constraints import GivesWay
from scenewright.scene.yielding_behavior import sample_quantiles
from scenewright.tools.solver.context import SolverContext
from scenewright.tools.solver.path_conflict import PathConflict
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_USUAL_GAP = {"vehicle": (0.9, 2.0), "pedestrian": (0.6, 1.1)}
"""From the centre's place to the zone [m] where no agent was observed."""

_GAPS = {"vehicle": (0.8, 8.0), "pedestrian": (0.5, 3.9)}
"""Least and greatest distance from the front to the zone in which agents stop [m]; one that keeps
farther off stops at the line."""

_KERB_GAP, _LINE_GAPS = 0.3, (0.8, 1.9)
"""From the kerb, and from the stop line [m], to an agent that waits there."""

_PAST_LINE = 2.5
"""Less than this beyond its stop line [m] no agent waits."""

_EDGE, _PAST_EDGE = 0.9, 0.35
"""How much of the crosswalk it crossed an agent that waits to turn may have before its front, and
how far from there it stands if it would stand further back [m]."""

_ROADSIDE = 2.4
"""How far onto the road a pedestrian may wait: the parking lane's width [m]."""

UPSTREAM = {"vehicle": 18.0, "pedestrian": 4.3}
"""Farthest before the zone that giving way counts (SEMANTICS 4: 20 m and 5 m, less a margin)."""


def list_stop_positions(
    clause: GivesWay,
    a: ScheduledAgent,
    b: ScheduledAgent,
    zone: PathConflict,
    context: SolverContext,
) -> Iterator[tuple[str, StopCommand]]:
    """List where to wait: at the stop line or kerb if near enough, else short of the zone."""
    kind = a.candidate.route.type
    first = float(zone.s_a[zone.i].min())
    waits = [stop for stop in a.stops if stop.reason == "gives_way" and not stop.rolls]
    for stop in waits:
        if 0.3 <= first - stop.s < UPSTREAM[kind]:
            yield stop.anchor, StopCommand(stop.s, 0.0, stop.braking)
    if waits:
        return
    short_of_line = _KERB_GAP if kind == "pedestrian" else STOP_GAP
    if kind == "vehicle" and context.get_yielding(clause) is not None:
        short_of_line = float(context.rng.uniform(*_LINE_GAPS))
    places = _list_places(clause, a, first, context, short_of_line)
    if kind == "vehicle":
        seen = context.get_yielding(clause) is not None
        places = _move_off_crosswalks(places, a, b, first, short_of_line, seen=seen)
    for anchor, s in places:
        for braking in (None, 3.2):
            if s > 2.0:
                yield anchor, StopCommand(s, 0.0, braking)


def _list_places(
    clause: GivesWay, a: ScheduledAgent, first: float, context: SolverContext, line_gap: float
) -> list[tuple[str, float]]:
    """List anchors and arc lengths [m] to stop at, those to try first at the front.

    Args:
        first: where the zone begins [m]; line_gap: how far from its line an agent stops [m].
    """
    kind, line = a.candidate.route.type, a.landmarks.line
    gaps = _draw_distances(clause, a, context)
    ahead = [("yield_point", first - gap) for gap in gaps if gap <= _GAPS[kind][1]]
    nearest = first - min(gaps)
    places: list[tuple[str, float]] = []
    if line is not None:
        ahead = [place for place in ahead if place[1] > line + 1.0]
        if kind == "pedestrian" and not context.lenient:
            ahead = [place for place in ahead if place[1] < line + _ROADSIDE]
        if line - STOP_GAP <= nearest and first - line < UPSTREAM[kind]:
            anchor = "stop_line" if kind == "vehicle" else "kerb"
            places = [(anchor, line - line_gap)]
    turning = a.candidate.route.movement in ("left", "right", "uturn")
    near = turning and gaps[0] <= _GAPS[kind][1]
    return [*ahead[:1], *places, *ahead[1:]] if near else [*places, *ahead]


def _draw_distances(clause: GivesWay, a: ScheduledAgent, context: SolverContext) -> list[float]:
    """Draw distances from the zone to stop at [m]: as observed, then as is usual."""
    kind = a.candidate.route.type
    usual = float(context.rng.uniform(*_USUAL_GAP[kind]))
    behavior = context.get_yielding(clause)
    if behavior is None or context.get_requested_pet(clause) is not None:
        return [usual]
    gaps = [max(sample_quantiles(behavior.gap, context.rng), _GAPS[kind][0]) for _ in range(2)]
    # An agent that turns on green drives on into the intersection before it waits.
    turning = a.candidate.route.movement != "straight" and a.landmarks.group is not None
    return [*((min(gap, _GAPS[kind][1]) if turning else gap) for gap in gaps), usual]


def _move_off_crosswalks(
    places: list[tuple[str, float]],
    a: ScheduledAgent,
    b: ScheduledAgent,
    first: float,
    line_gap: float,
    *,
    seen: bool,
) -> list[tuple[str, float]]:
    """Move stops before any crosswalk that the other does not walk on.

    Args:
        first: where the zone begins [m]; line_gap: how far from its line an agent stops [m].
        seen: whether giving way was observed here.
    """
    found: list[tuple[str, float]] = []
    line, (landmarks, creeps) = a.landmarks.line, _find_creep_place(a, b, seen=seen)
    for named, wished in places:
        anchor, s = named, landmarks.move_off_crosswalks(wished, own=b.landmarks.own_crosswalk)
        if s < wished and s < creeps <= first - _GAPS["vehicle"][0]:
            s = creeps
        if line is not None and s < wished and s < line + _PAST_LINE:
            # An agent that would stop between its line and a crosswalk stops at its line.
            anchor, s = "stop_line", line - line_gap
        near = any(abs(s - other) < 1.0 for _, other in found)
        if first - s < UPSTREAM["vehicle"] and not near:
            found.append((anchor, s))
    return found


def _find_creep_place(
    a: ScheduledAgent, b: ScheduledAgent, *, seen: bool
) -> tuple[Landmarks, float]:
    """Find the landmarks of an agent turning on green, and the first place past its crosswalk [m].

    No pedestrian walks over the crosswalk it crossed while its light is green; so it may wait with
    its rear on it, and its front at the far edge. For other agents there is no such place
    (infinite).
    """
    landmarks, line, length = a.landmarks, a.landmarks.line, a.candidate.shape.length
    turn, walks = a.candidate.route.movement, b.candidate.route.type == "pedestrian"
    # An agent that turns right and lets a vehicle pass waits at its line.
    waits = turn in ("left", "uturn") or (turn == "right" and walks)
    by = next((each for each in landmarks.crosswalks if line is not None and each[1] >= line), None)
    if not (seen and waits and landmarks.group is not None and by is not None):
        return landmarks, np.inf
    rest = tuple(each for each in landmarks.crosswalks if each is not by)
    shorter = (by[0], by[1], max(by[2] - length - _EDGE, by[1]))
    return replace(landmarks, crosswalks=(shorter, *rest)), shorter[2] + _PAST_EDGE
