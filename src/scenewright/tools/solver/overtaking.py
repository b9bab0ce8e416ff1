"""`passes_beside`: one overtakes another in its lane, both moving, with a least lateral
distance."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scenewright.scene.constraints import PassesBeside
from scenewright.tools.solver.context import SolverContext, compute_excess
from scenewright.tools.solver.impact import find_least_clearance
from scenewright.tools.solver.nearest_miss import FailureStage
from scenewright.tools.solver.schedule import PartialSchedule, ScheduledEvent
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_WHERE, _TRIES = (0.2, 0.6), 6
"""Share of the overtaken one's path at which it may be, and how many places are tried."""

_FASTER, _MOVING = 1.3, 1.5
"""By how much the overtaker is faster, and how fast the other is, at the least [m/s]."""


def schedule_overtakings(
    clause: PassesBeside, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the first overtakes the second as the clause says."""
    a, b = context.get_pair(clause, schedule)
    if schedule.has_event(clause):
        return
    for share in context.rng.uniform(*_WHERE, _TRIES):
        delta = _find_offset(a, b, float(share) * b.candidate.path.length)
        if delta is None:
            words = f"{clause.first} is not faster than {clause.second} where it would pass"
            context.note_miss(clause, FailureStage.MEASURE, words)
            continue
        placed = schedule.place(clause, a, b, delta)
        clearance, time, place = find_least_clearance(*placed)
        if not clause.low <= clearance <= clause.high:
            words = f"{clause.first} passes at {clearance:.1f} m"
            off = compute_excess(clause.low, clause.high, clearance)
            context.note_miss(clause, FailureStage.MEASURE, words, off=off)
            continue
        if schedule.is_too_soon(time, clause):
            words = f"{clause.first} and {clause.second} are not yet free for it"
            context.note_miss(clause, FailureStage.COMPANY, words)
            continue
        event = ScheduledEvent(clause, time, time - 3.0, time + 1.0, time + 1.0, place)
        yield schedule.add_event(event, *placed)


def _find_offset(a: ScheduledAgent, b: ScheduledAgent, s: float) -> float | None:
    """Find o_b - o_a [s] at which both are abreast where b is at `s` [m]; None if a is no
    faster."""
    x, y, _ = b.get_pose(s)
    path = a.candidate.path
    abreast = float(path.s[int(np.hypot(*(path.xy - (x, y)).T).argmin())])
    times = a.motion.find_time_at(abreast), b.motion.find_time_at(s)
    if not np.isfinite(times).all():
        return None
    speeds = a.motion.find_speed_at(times[0]), b.motion.find_speed_at(times[1])
    if speeds[1] < _MOVING or speeds[0] - speeds[1] < _FASTER:
        return None
    return times[0] - times[1]
