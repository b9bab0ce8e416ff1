"""`brakes_for`: a vehicle drives towards another, reacts late, brakes hard and lets it pass.

Without braking it would have hit the other. It brakes harder than 5 m/s^2, to a stop short of the
conflict zone or down to a speed at which it passes behind; how long after the conflict is
perceptible decides how low the path TTC falls.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.constraints import BrakesFor, TimeGap
from scenewright.scene.reaction_behavior import (
    RUNS,
    Reaction,
    sample_reaction,
)
from scenewright.scene.track import STEP
from scenewright.tools.solver.conflicts import Conflict, ConflictSampler, Draw, Response
from scenewright.tools.solver.context import (
    FailureStage,
    SolverContext,
    compute_excess,
    find_contact_nodes,
    find_meetings,
)
from scenewright.tools.solver.impact import find_least_clearance
from scenewright.tools.solver.path_conflict import Intervals, PathConflict, compute_gap
from scenewright.tools.solver.path_ttc import PathTtc, compute_path_ttc
from scenewright.tools.solver.scheduled_agent import PartialSchedule, ScheduledAgent, ScheduledEvent
from scenewright.tools.solver.yielding import compute_passage, find_conflict_zone

_TRIES, _MOST = 40, 6
"""Responses that are drawn; schedules that are offered."""

_DECELERATIONS = (5.8, 7.4)
HARD = (5.2, 7.8)
"""Intended braking, and what must be left of it after smoothing [m/s^2] (SEMANTICS 4, 5)."""

_ABRUPT = 0.9
"""How much more braking is intended per m/s below 6 m/s, as smoothing takes more off [1/s]."""

_KEEPS = (0.15, 0.55)
"""Share of its speed that it keeps where it does not stop."""

CLOSE_TTC, _CLOSE_PET = 1.42, 1.4
"""A near miss needs less than one of these [s], here with a margin (SEMANTICS 4)."""

_CLEARANCE, _LONGEST_PET = 0.3, 7.0
"""What the two keep: least clearance [m]; and longest PET [s]."""

_SLACK = 0.02
"""How far outside of a range a measure may lie [s]: its own resolution."""

_SEEN = 5.5
"""How long before the first crosses behind the second the least TTC may lie [s]."""

_AT_ONCE = 2.8
"""How long before the two come closest the braking may end [s]."""

_HESITATES, _SOFTLY = 0.45, 1.4
"""Share of its speed that a pedestrian keeps who hesitates, and its braking [m/s^2]."""

_BEYOND = 1.5
"""How far above the range a path TTC is still measured, so that a miss can be reported [s]."""


def schedule_hard_braking(
    clause: BrakesFor, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the first brakes for the second at the TTC asked
    for."""
    a, b = context.get_pair(clause, schedule)
    zone = find_conflict_zone(a.candidate, b.candidate)
    pet, asked = context.get_requested_pet(clause), (clause.low + clause.high) / 2
    if not len(zone.i):
        context.note_paths_apart(clause)
        return
    if a.contact is not None or b.contact is not None or a.slowings:
        words = f"one of {clause.first} and {clause.second} has crashed or braked hard before"
        context.note_miss(clause, FailureStage.PATHS, words)
        return
    first = float(zone.s_a[zone.i].min())
    usual = float(np.interp(first, a.motion.s, a.motion.speed))
    if first - asked * usual <= 2.0:
        words = f"a path TTC of {asked:g} s: the way of {clause.first} begins too late for it"
        context.note_miss(clause, FailureStage.PATHS, words)
        return
    draws = _list_draws(clause, schedule, context, b, find_meetings(a, b), usual)
    pets = (0.0, _LONGEST_PET) if pet is None else (pet.low, pet.high)
    sampler = _HardBrakingSampler(
        clause, schedule, context, (a, b), pets, second=0, zone=zone, pet=pet
    )
    yield from islice(sampler.sample(draws), _MOST)


def _list_draws(
    clause: BrakesFor,
    schedule: PartialSchedule,
    context: SolverContext,
    b: ScheduledAgent,
    meetings: Intervals,
    usual: float,
) -> Iterator[Draw]:
    """List offsets at which the two would touch, how hard the first brakes when the path TTC is as
    asked, and whether a pedestrian runs, hesitates or goes on.

    Args:
        usual: speed of the first where the other's path begins [m/s].
    """
    rng, reactions, second = context.rng, context.reactions, str(clause.second)
    asked = reactions.ways.get(second)
    may = second not in schedule.actors and b.candidate.shape.type == "pedestrian"
    may &= not b.slowings and asked in (None, RUNS)
    for _ in range(_TRIES if len(meetings) else 0):
        braking = float(rng.uniform(*_DECELERATIONS)) + _ABRUPT * max(6.0 - usual, 0.0)
        keeps = float(rng.uniform(*_KEEPS)) if rng.random() < 0.5 else 0.0
        # It begins about the TTC asked for before the zone, as from then on that only grows.
        short = rng.uniform(clause.low, clause.high) * usual
        short -= usual**2 * (1.0 - keeps**2) / (2.0 * braking)
        short = float(max(short + rng.uniform(-1.5, 2.0), rng.uniform(0.4, 1.5)))
        brakes = Response(Reaction("brakes", 0.0, braking), keeps, short=short)
        answers: list[tuple[Response, ...]] = [()] if asked is None else []
        if may:
            runs = sample_reaction("pedestrian", rng, kind=RUNS)
            answers.append((Response(runs, 1.0),))
            if asked is None:
                slows = Reaction("stops", runs.after, _SOFTLY)
                answers.append((Response(slows, _HESITATES, kept=0.5),))
        low, high = meetings[int(rng.integers(len(meetings)))].tolist()
        for answer in answers[::-1]:
            yield Draw(float(rng.uniform(low, high)), ((brakes,), answer))


@dataclass(eq=False)
class _HardBrakingSampler(ConflictSampler):
    """Samples conflicts in which the first brakes hard for the second as the clause asks.

    Attributes:
        zone: the conflict zone of the two; pet: the PET asked for besides.
    """

    clause: BrakesFor
    zone: PathConflict = field(kw_only=True)
    pet: TimeGap | None = field(kw_only=True)

    def judge(self, conflict: Conflict) -> PartialSchedule | None:
        """Return the schedule with the near miss; None if it is not as asked."""
        a, b = conflict.pair
        hardest = find_hardest_braking(a)
        if not HARD[0] <= hardest <= HARD[1]:
            words = f"{self.clause.first} is too slow on this movement, its hardest is"
            words = f"braking of more than 5 m/s^2: {words} {hardest:.1f} m/s^2"
            self.note_miss(FailureStage.PLACE, words, off=compute_excess(*HARD, hardest))
            return None
        if not self.context.lenient and _brakes_early(a):
            words = f"{self.clause.first} has been braking on this movement, so none is sudden"
            self.note_miss(FailureStage.KIND, words)
            return None
        nodes = find_contact_nodes(a.candidate, b.candidate)
        near = compute_path_ttc(nodes, a, b, horizon=self.clause.high + _BEYOND)
        if not (self.accepts_ttc(near.least) and self.is_near_miss(a, b, near)):
            return None
        clearance, time, place = find_least_clearance(a, b)
        if clearance < _CLEARANCE or self.schedule.is_too_soon(time, self.clause):
            words = f"the two touch, or come within {_CLEARANCE:g} m, or are not yet free for it"
            self.note_miss(FailureStage.COMPANY, words)
            return None
        if self.pet is None and _crosses(a, b, self.zone) - near.when > _SEEN:
            return None  # long past, the TTC would not be attributed to this encounter
        hard = a.enters + STEP * np.flatnonzero(compute_smooth_acceleration(a) < -3.6)
        if not self.context.lenient and time - hard[-1] > _AT_ONCE:
            return None  # long past, the near miss would not be attributed to the braking
        enters = a.enters + a.motion.find_time_at(float(self.zone.s_a[self.zone.i].min()))
        _, b_out = compute_passage(b.motion, self.zone.s_b[self.zone.j])
        ends, freed = max(enters, time) + 1.0, max(b.enters + b_out, time)
        event = ScheduledEvent(self.clause, time, near.when - 3.0, ends, freed, place)
        return self.schedule.add_event(event, a, b)

    def is_near_miss(self, a: ScheduledAgent, b: ScheduledAgent, near: PathTtc) -> bool:
        """Return whether the PET is as asked, or it or the TTC while braking is small."""
        pet = compute_gap(find_meetings(a, b), b.enters - a.enters)
        off = 0.0 if self.pet is None else compute_excess(self.pet.low, self.pet.high, pet)
        if self.pet is not None and off > _SLACK:
            words = f"a PET of {self.pet.low:g} to {self.pet.high:g} s: the nearest is {pet:.1f} s"
            self.note_miss(FailureStage.COMPANY, words, off=off)
            return False
        if pet <= _CLOSE_PET or find_ttc_while_braking(a, near) <= CLOSE_TTC:
            return True
        words = "a near miss needs a PET of at most 1.5 s, or a path TTC of at most 1.5 s under"
        found = f"the nearest has a PET of {pet:.1f} s and a path TTC of {near.least:.1f} s"
        off = 0.0 if self.pet is not None else pet
        self.note_miss(FailureStage.COMPANY, f"{words} braking: {found}", off=off)
        return False

    def accepts_ttc(self, least: float) -> bool:
        """Return whether the least path TTC is as asked; else note the miss."""
        low, high = self.clause.low, self.clause.high
        off = compute_excess(low, high, least)
        if off > _SLACK and np.isfinite(least):
            extreme, asked = "shortest" if least > high else "longest", (low + high) / 2
            words = f"a path TTC of {asked:g} s: the {extreme} possible is {least:.1f} s"
            self.note_miss(FailureStage.MEASURE, words, off=off)
        return off <= _SLACK

    def note_miss(self, reached: FailureStage, words: str, *, off: float = 0.0) -> None:
        """Note a miss of the clause."""
        self.context.note_miss(self.clause, reached, words, off=off)


def _brakes_early(a: ScheduledAgent) -> bool:
    """Return whether it brakes more than for a curve 1.5 s to 0.5 s before it brakes hard."""
    change = compute_smooth_acceleration(a)
    onset = int(np.argmax(change < -3.4))
    return bool((change[max(onset - 15, 0) : max(onset - 4, 0)] < -2.3).any())


def find_ttc_while_braking(a: ScheduledAgent, near: PathTtc) -> float:
    """Find the least path TTC [s] while braking harder than 4 m/s^2."""
    change = np.interp(near.times - a.enters, a.motion.clock, compute_smooth_acceleration(a))
    return float(near.ttc[change < -4.0].min(initial=np.inf))


def compute_smooth_acceleration(a: ScheduledAgent) -> FloatArray:
    """Compute its acceleration [T] over 0.3 s [m/s^2]."""
    return np.asarray(np.convolve(a.motion.acceleration, np.full(3, 1 / 3), mode="same"))


def find_hardest_braking(a: ScheduledAgent) -> float:
    """Find how hard it brakes at most, over 0.3 s [m/s^2]."""
    return float(-compute_smooth_acceleration(a)[1:-1].min(initial=0.0))


def _crosses(a: ScheduledAgent, b: ScheduledAgent, zone: PathConflict) -> float:
    """Find when [s] the first is where the second has been least long ago."""
    times = []
    for actor, nodes in ((a, zone.s_a[zone.i]), (b, zone.s_b[zone.j])):
        clock = actor.motion.clock
        # Ties in s are a standstill, which ends with the last of them.
        tilt = 1e-7 * np.arange(len(clock))
        times.append(actor.enters + np.interp(nodes, actor.motion.s + tilt, clock))
    return float(times[0][int(np.argmin(times[0] - times[1]))])
