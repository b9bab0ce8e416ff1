"""Figures asked for of a schedule: how they are measured, and whether they are in range."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from scenewright.scene.constraints import AgentFigure, Contact, PairFigure
from scenewright.scene.measures import get_unit
from scenewright.scene.track import STEP
from scenewright.tools.dsl_validator.parse import format_clause
from scenewright.tools.solver.context import compute_excess
from scenewright.tools.solver.hard_braking import compute_smooth_acceleration
from scenewright.tools.solver.impact import locate
from scenewright.tools.solver.scheduled_agent import (
    PartialSchedule,
    ScheduledAgent,
    ScheduledEvent,
    compute_bumper_gaps,
    get_shared_times,
)

FigureClause = AgentFigure | PairFigure

_STANDING, _BRIEF = 0.3, 0.5
"""Slower than this is standing [m/s]; a shorter standstill does not count [s]."""

_FOLLOWS = (0.5, 4.0)
"""Headways of a follower [s] (SEMANTICS 4)."""

_FRONT = 0.3
"""How far behind the foremost point a contact still counts as frontal [m]."""


def find_unmet_figure(
    figures: Iterable[FigureClause], schedule: PartialSchedule, *, timed: bool
) -> tuple[FigureClause, float] | None:
    """Find the first figure out of range, and by how much; infinite if it does not occur.

    An agent that no relation binds is seated later, with the background; the checker measures it.

    Args:
        timed: the schedule is in scene time, so figures of scene time are measured too.
    """
    for clause in figures:
        unbound = isinstance(clause, AgentFigure) and clause.agent not in schedule.actors
        if unbound or (clause.clause == "time" and not timed):
            continue
        values = compute_figures(clause, schedule, timed=timed)
        off = max((compute_excess(clause.low, clause.high, v) for v in values), default=np.inf)
        if off > 1e-9:
            return clause, float(off)
    return None


def describe_miss(clause: FigureClause, off: float) -> str:
    """Describe which figure cannot be met, and by how much."""
    if not np.isfinite(off):
        return f"{format_clause(clause)}: there is no such moment in the scene"
    unit = get_unit(clause.clause)
    return f"{format_clause(clause)}: the nearest possible is {off:.2g} {unit} off"


def compute_figures(
    clause: FigureClause, schedule: PartialSchedule, *, timed: bool
) -> tuple[float, ...]:
    """Compute the values that must lie in the clause's range; none where no such event occurs."""
    if isinstance(clause, AgentFigure):
        actor = schedule.actors.get(clause.agent)
        return () if actor is None else _compute_agent_figure(clause, actor, timed=timed)
    a, b = (schedule.actors.get(name) for name in (clause.first, clause.second))
    pair = {clause.first, clause.second}
    events = [e for e in schedule.events if {e.clause.first, e.clause.second} == pair]
    if a is None or b is None or not events:
        return ()
    event = next((e for e in events if isinstance(e.clause, Contact)), events[0])
    match clause.clause:
        case "time":
            return (event.time,)
        case "time_headway" | "gap":
            return _compute_following(a, b, in_metres=clause.clause == "gap")
        case "contact_speed":  # over the last tenth of a second of a motion that ends there
            s = a.motion.s
            return (float((s[-2] - s[-3]) / STEP) if len(s) > 2 else 0.0,)
        case "ttc":
            return ((clause.low + clause.high) / 2,)  # the checker measures it
        case _:
            return _compute_impact_share(clause, a, b, event)


def _compute_agent_figure(
    clause: AgentFigure, actor: ScheduledAgent, *, timed: bool
) -> tuple[float, ...]:
    line, stands = actor.landmarks.line, _list_stands(actor)[:1]
    first = max(round(-actor.enters / STEP), 0) if timed else 0  # sample that is visible
    match clause.clause:
        case "kept_speed":  # the highest that is kept for a second
            speed, window = actor.motion.speed[first:], round(1.0 / STEP)
            if len(speed) <= window:
                return ()
            kept = np.lib.stride_tricks.sliding_window_view(speed, window).min(axis=1)
            return (float(kept.max()),)
        case "line_speed":
            at = np.inf if line is None else actor.motion.find_time_at(line)
            return (actor.motion.find_speed_at(at),) if np.isfinite(at) else ()
        case "braking" | "acceleration":
            change = compute_smooth_acceleration(actor)[first + 1 : -1]
            return (float((-change if clause.clause == "braking" else change).max(initial=0.0)),)
        case "wait":
            return tuple(until - start for start, until, _ in stands)
        case _:  # from the front to the next stop line, kerb or crosswalk ahead [m]
            marks = [begins for _, begins, _ in actor.landmarks.crosswalks]
            marks += [] if line is None else [line]
            ahead = [mark - s for _, _, s in stands for mark in marks if mark - s > -0.05]
            return (min(ahead),) if ahead else ()


def _list_stands(actor: ScheduledAgent) -> list[tuple[float, float, float]]:
    """List standstills: start, end [s], arc length [m]; first the yielding one, or the longest."""
    slow = np.concatenate(([False], actor.motion.speed <= _STANDING, [False]))
    edges = np.flatnonzero(slow[1:] != slow[:-1]).reshape(-1, 2)
    found = [
        (actor.enters + STEP * begin, actor.enters + STEP * (end - 1), float(actor.motion.s[begin]))
        for begin, end in edges.tolist()
        if STEP * (end - 1 - begin) >= _BRIEF
    ]
    waits = [stop.start for stop in actor.stops if stop.reason == "gives_way"]
    if waits:
        return sorted(found, key=lambda each: min(abs(each[0] - start) for start in waits))
    return sorted(found, key=lambda each: each[0] - each[1])


def _compute_following(
    a: ScheduledAgent, b: ScheduledAgent, *, in_metres: bool
) -> tuple[float, ...]:
    """Compute least and median headway [s], or gap [m], of the longest stretch of car-following."""
    times = get_shared_times(a, b)
    if times is None:
        return ()
    gap = compute_bumper_gaps(a, b, times)
    speed = np.interp(times - a.enters, a.motion.clock, a.motion.speed)
    headway = gap / np.maximum(speed, 1e-6)
    follows = (headway >= _FOLLOWS[0]) & (headway <= _FOLLOWS[1]) & (speed > 1.0)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], follows, [False])))).reshape(-1, 2)
    begin, end = max(edges.tolist(), key=lambda run: run[1] - run[0], default=(0, 0))
    values = (gap if in_metres else headway)[begin:end]
    return (float(values.min()), float(np.median(values))) if len(values) else ()


def _compute_impact_share(
    clause: PairFigure, a: ScheduledAgent, b: ScheduledAgent, event: ScheduledEvent
) -> tuple[float, ...]:
    """Compute where on the first agent the contact lies [%]: across its front, or along its
    side."""
    pose, shape = a.get_pose_at(event.time), a.candidate.shape
    along, across = locate(pose, event.location)
    at_front = along >= shape.length / 2 - _FRONT
    if clause.clause == "side_point":
        share = 0.5 - along / shape.length
        return () if at_front else (100.0 * float(np.clip(share, 0.0, 1.0)),)
    from_left = float(np.clip(0.5 - across / shape.width, 0.0, 1.0))
    left = clause.clause == "front_point_left"
    if clause.clause == "front_point":
        # Who is less far to the left of the first than before comes from its left.
        before = b.get_pose_at(event.time - 0.3)[:2]
        left = locate(pose, before)[1] > locate(pose, b.get_pose_at(event.time)[:2])[1]
    return (100.0 * (from_left if left else 1.0 - from_left),) if at_front else ()
