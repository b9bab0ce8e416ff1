"""`brakes_for`: a vehicle drives towards another, reacts late, brakes hard and lets it pass.

Without braking it would have hit the other. It brakes harder than 5 m/s^2, to a stop short of the
conflict zone or down to a speed at which it passes behind; the onset of braking decides how
low the path TTC falls. So for one braking after the other all offsets are measured, and those
with the path TTC asked for are kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from scenewright.geometry.driving_profile import StopCommand, compute_arrival
from scenewright.scene.base import FloatArray
from scenewright.scene.constraints import BrakesFor, TimeGap
from scenewright.scene.reaction_behavior import RUNS, sample_reaction
from scenewright.scene.selection import Slowing, Stop
from scenewright.scene.track import STEP
from scenewright.tools.solver.context import FOR_GOOD, SolverContext, compute_excess
from scenewright.tools.solver.impact import find_least_clearance
from scenewright.tools.solver.nearest_miss import FailureStage
from scenewright.tools.solver.path_conflict import PathConflict, compute_gap
from scenewright.tools.solver.path_ttc import PathTtc, compute_path_ttc
from scenewright.tools.solver.reactions import find_speed, find_threat, run_on, slow_down
from scenewright.tools.solver.schedule import PartialSchedule, ScheduledEvent
from scenewright.tools.solver.scheduled_agent import ScheduledAgent
from scenewright.tools.solver.yielding import compute_passage, find_conflict_zone

_MANOEUVRES, _OFFSETS, _FAILURES = 6, 2, 4
"""Brakings that are tried; offsets kept of each, and those after which it is given up."""

_DECELERATIONS = (5.8, 7.4)
HARD = (5.2, 7.8)
"""Intended braking, and what must be left of it after smoothing [m/s^2] (SEMANTICS 4, 5)."""

_ABRUPT = 0.9
"""How much more braking is intended per m/s below 6 m/s, as smoothing takes more off [1/s]."""

CLOSE_TTC, _CLOSE_PET = 1.42, 1.4
"""A near miss needs less than one of these [s], here with a margin (SEMANTICS 4)."""

_CLEARANCE, _LONGEST_PET = 0.3, 7.0
"""What the two keep: least clearance [m]; and longest PET [s]."""

_SLACK = 0.02
"""How far outside of a range a measure may lie [s]: its own resolution."""

_STANDS = 0.9
"""Least standstill of an agent that brakes to a stop [s]."""

_SEEN = 5.5
"""How long before the first crosses behind the second the least TTC may lie [s]."""

_AT_ONCE = 2.8
"""How long before the two come closest the braking may end [s]."""

_HESITATES, _SOFTLY = 0.45, 1.4
"""Share of its speed that a pedestrian keeps who hesitates, and its braking [m/s^2]."""

_BEYOND = 1.5
"""How far above the range a path TTC is still measured, so that a miss can be reported [s]."""


@dataclass(frozen=True)
class _BrakingManeuver:
    """A braking to `speed` [m/s] at arc length `s` [m]; the zone begins `ahead` [m] of it."""

    s: float
    speed: float
    braking: float
    ahead: float

    @property
    def stops(self) -> bool:
        """Whether it ends at rest."""
        return self.speed == 0.0


def schedule_hard_braking(
    clause: BrakesFor, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the first brakes for the second at the TTC asked
    for."""
    a, b = context.get_pair(clause, schedule)
    zone = find_conflict_zone(clause, a, b, context)
    if not len(zone.i):
        words = f"the paths of {clause.first} and {clause.second} never touch"
        context.note_miss(clause, FailureStage.PATHS, words)
    elif a.contact is not None or b.contact is not None or a.slowings:
        words = f"one of {clause.first} and {clause.second} has crashed or braked hard before"
        context.note_miss(clause, FailureStage.PATHS, words)
    else:
        yield from _HardBraking(clause, schedule, context, a, b, zone).schedule_all()


@dataclass(frozen=True, eq=False)
class _HardBraking:
    """One clause about two agents that do not brake yet, `a` for `b`."""

    clause: BrakesFor
    schedule: PartialSchedule
    context: SolverContext
    a: ScheduledAgent
    b: ScheduledAgent
    zone: PathConflict

    def schedule_all(self) -> Iterator[PartialSchedule]:
        hard = list(self.list_maneuvers())
        if not hard:
            words = f"the way of {self.clause.first} begins too late for it"
            self.note_miss(FailureStage.PATHS, f"a path TTC of {self.asked:g} s: {words}")
        # A hard braking after earlier braking is no surprise: sudden ones come first.
        warned = {each: _brakes_early(_apply_braking(self.a, each)) for each in hard}
        for manoeuvre in sorted(hard, key=warned.__getitem__):
            if warned[manoeuvre] and not self.context.lenient:
                words = f"{self.clause.first} has been braking on this movement, so none is sudden"
                self.note_miss(FailureStage.KIND, words)
                continue
            yield from self.schedule_maneuver(manoeuvre)

    def list_maneuvers(self) -> Iterator[_BrakingManeuver]:
        """List stops short of the zone and slowings before it, as different as possible.

        Braking begins about the TTC asked for before the zone, as from then on it only grows.
        """
        rng, first = self.context.rng, float(self.zone.s_a[self.zone.i].min())
        usual = float(np.interp(first, self.a.motion.s, self.a.motion.speed))
        for _ in range(_MANOEUVRES):
            braking = float(rng.uniform(*_DECELERATIONS)) + _ABRUPT * max(6.0 - usual, 0.0)
            speed = usual * float(rng.uniform(0.15, 0.55)) if rng.random() < 0.5 else 0.0
            short = self.asked * usual - (usual**2 - speed**2) / (2.0 * braking)
            short = max(short + float(rng.uniform(-1.5, 2.0)), float(rng.uniform(0.4, 1.5)))
            if first - short > 2.0:
                yield _BrakingManeuver(first - short, speed, braking, short)

    def schedule_maneuver(self, how: _BrakingManeuver) -> Iterator[PartialSchedule]:
        """Schedule every offset at which this braking leads to the TTC asked for, up to a
        number."""
        braked = _apply_braking(self.a, how)
        hardest = find_hardest_braking(braked)
        if not HARD[0] <= hardest <= HARD[1]:
            words = f"{self.clause.first} is too slow on this movement, its hardest is"
            words = f"braking of more than 5 m/s^2: {words} {hardest:.1f} m/s^2"
            self.note_miss(FailureStage.PLACE, words, off=compute_excess(*HARD, hardest))
            return
        tried = [0, 0]
        for delta in self.context.rng.permutation(self.list_collision_offsets()).tolist():
            pair = self.schedule.place(self.clause, braked, self.b, delta)
            if not self.accepts_ttc(self.compute_path_ttc(*pair).least):
                continue
            free, b = self.schedule.place(self.clause, self.a, self.b, delta)
            ways = (self.schedule_passage(how, free, way) for way in self.list_reactions(free, b))
            scheduled = next(filter(None, ways), None)
            if scheduled is not None:
                yield scheduled
            tried[scheduled is None] += 1
            if tried[0] >= _OFFSETS or tried[1] >= _FAILURES:
                return

    def list_collision_offsets(self) -> FloatArray:
        """List offsets at which the two would collide without braking; the given one if both are
        placed."""
        if {self.clause.first, self.clause.second} <= set(self.schedule.actors):
            return np.array([self.b.enters - self.a.enters])
        meetings = self.context.find_meeting_intervals(self.clause, self.a, self.b)
        steps = [np.arange(low, high, STEP) for low, high in meetings.tolist()]
        return np.concatenate([np.empty(0), *steps])

    def list_reactions(self, free: ScheduledAgent, b: ScheduledAgent) -> Iterator[ScheduledAgent]:
        """List a pedestrian running out of the way or hesitating, as it perceives the other, and
        last as it is."""
        context, name = self.context, str(self.clause.second)
        bound = name in self.schedule.actors or not context.reactions.may_react(name)
        asked = context.reactions.ways.get(name)
        if asked not in (None, RUNS) or self.clause.first in context.reactions.ways:
            return
        if b.candidate.shape.type == "pedestrian" and not bound and not b.slowings:
            meets = find_least_clearance(free, b)[1]
            threat = find_threat(context.find_path_conflict(self.clause), free, b, until=meets)
            how = sample_reaction("pedestrian", context.rng, kind=RUNS)
            onset = np.inf if threat is None else threat[0] + how.after
            if onset < meets:
                beyond = float(self.zone.s_b[self.zone.j].max()) + 1.0
                runs = run_on(b, onset=onset, acceleration=how.strength, until=beyond)
                less = _HESITATES * find_speed(b, onset)
                slows = slow_down(b, onset=onset, braking=_SOFTLY, speed=less, kept=0.5)
                for each in (runs,) if asked else (runs, slows):
                    yield from () if each is None else self.list_shifts(free, b, each)
        yield from () if asked else (b,)

    def list_shifts(
        self, free: ScheduledAgent, b: ScheduledAgent, reacted: ScheduledAgent
    ) -> Iterator[ScheduledAgent]:
        """List the pedestrian reacting, later or sooner by what that gains or costs, and as it is;
        unreacting the two would collide."""
        meetings = self.context.find_meeting_intervals(self.clause, self.a, self.b)
        first = float(self.zone.s_b[self.zone.j].min())
        gained = round(b.motion.find_time_at(first) - reacted.motion.find_time_at(first), 1)
        for late in (gained, 0.0):
            if compute_gap(meetings, b.enters + late - free.enters) == 0.0:
                yield reacted.shift(late)

    def schedule_passage(
        self, how: _BrakingManeuver, free: ScheduledAgent, b: ScheduledAgent
    ) -> PartialSchedule | None:
        """Schedule the maneuver with the other moving like this; None if no near miss."""
        _, b_out = compute_passage(b.motion, self.zone.s_b[self.zone.j])
        if how.stops and not np.isfinite(b_out):
            self.note_miss(FailureStage.COMPANY, f"{self.clause.second} stays in the way")
            return None
        a = self.release(free, b, how, b.enters + b_out + float(self.context.rng.uniform(0.3, 1.0)))
        near = self.compute_path_ttc(a, b)
        if not (self.is_near_miss(a, b, near) and self.accepts_ttc(near.least)):
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
        ends, freed = max(enters, time) + 1.0, max(b.enters + b_out, time)
        event = ScheduledEvent(self.clause, time, near.when - 3.0, ends, freed, place)
        return self.schedule.add_event(event, a, b)

    def release(
        self, free: ScheduledAgent, b: ScheduledAgent, how: _BrakingManeuver, release: float
    ) -> ScheduledAgent:
        """Hold a stopped vehicle until then, or until the PET asked for."""
        a = _apply_braking(free, how, until=release)
        if self.pet is None or not how.stops:
            return a
        later = (self.pet.low + self.pet.high) / 2 - self.compute_pet(a, b)
        return _apply_braking(free, how, until=release + later) if np.isfinite(later) else a

    def is_near_miss(self, a: ScheduledAgent, b: ScheduledAgent, near: PathTtc) -> bool:
        """Return whether `second` is first and the PET as asked, or it or the braking TTC small."""
        meetings = self.context.find_meeting_intervals(self.clause, a, b)
        if not len(meetings) or b.enters - a.enters >= meetings[:, 0].min():
            words = f"{self.clause.first} cannot brake so that {self.clause.second} passes first"
            self.note_miss(FailureStage.COMPANY, words, off=_LONGEST_PET)
            return False
        pet = self.compute_pet(a, b)
        off = 0.0 if self.pet is None else compute_excess(self.pet.low, self.pet.high, pet)
        if self.pet is not None and off > _SLACK:
            words = f"a PET of {self.pet.low:g} to {self.pet.high:g} s: the nearest is {pet:.1f} s"
            self.note_miss(FailureStage.COMPANY, words, off=off)
            return False
        if pet <= _CLOSE_PET or (
            pet <= _LONGEST_PET and find_ttc_while_braking(a, near) <= CLOSE_TTC
        ):
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
            extreme = "shortest" if least > high else "longest"
            words = f"a path TTC of {self.asked:g} s: the {extreme} possible is {least:.1f} s"
            self.note_miss(FailureStage.MEASURE, words, off=off)
        return off <= _SLACK

    def compute_path_ttc(self, a: ScheduledAgent, b: ScheduledAgent) -> PathTtc:
        horizon = self.clause.high + _BEYOND
        return compute_path_ttc(self.context.find_path_conflict(self.clause), a, b, horizon=horizon)

    def compute_pet(self, a: ScheduledAgent, b: ScheduledAgent) -> float:
        return compute_gap(
            self.context.find_meeting_intervals(self.clause, a, b), b.enters - a.enters
        )

    @property
    def asked(self) -> float:
        """The middle of the range [s]."""
        return (self.clause.low + self.clause.high) / 2

    @property
    def pet(self) -> TimeGap | None:
        """The PET asked for besides."""
        return self.context.get_requested_pet(self.clause)

    def note_miss(self, reached: FailureStage, words: str, *, off: float = 0.0) -> None:
        self.context.note_miss(self.clause, reached, words, off=off)


def _apply_braking(
    a: ScheduledAgent, how: _BrakingManeuver, *, until: float | None = None
) -> ScheduledAgent:
    """Apply the braking; a stopped vehicle stands until then [s], else longer than any scene."""
    if not how.stops:
        return a.edit(stops=a.stops, slowings=(Slowing(how.s, how.speed, how.braking),))
    start = a.enters + compute_arrival(a.candidate, StopCommand(how.s, 0.0, how.braking))
    until = a.enters + FOR_GOOD if until is None else max(until, start + _STANDS)
    stop = Stop("yield_point", how.s, start, until, "gives_way", how.braking, how.ahead)
    earlier = [each for each in a.stops if abs(each.s - how.s) > 0.5]
    return a.edit(stops=tuple(sorted((*earlier, stop), key=lambda each: each.s)))


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
