"""`gives_way`: an agent is held upstream of the conflict zone until the other has left it.

The offset is such that, without stopping, it would have been there while the other was
(SEMANTICS 4, cause). It stops at its line or kerb, or as far short of the zone as observed, or only
slows as far as that takes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from scenewright.geometry.driving_profile import (
    Motion,
    StopCommand,
    compute_arrival,
    compute_motion,
)
from scenewright.geometry.landmarks import STOP_GAP, Landmarks
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Candidate, DrivingProfile
from scenewright.scene.constraints import GivesWay, TimeGap
from scenewright.scene.reaction_behavior import YieldingBehavior, sample_quantiles
from scenewright.scene.selection import Stop
from scenewright.scene.track import STEP
from scenewright.tools.segment_editor import make_stop_command
from scenewright.tools.solver.context import FailureStage, SolverContext, find_contact_nodes
from scenewright.tools.solver.impact import find_least_clearance
from scenewright.tools.solver.path_conflict import (
    PathConflict,
    compute_gap,
    find_conflict_intervals,
)
from scenewright.tools.solver.scheduled_agent import (
    PartialSchedule,
    ScheduledAgent,
    ScheduledEvent,
)

MERGE_METRES = 5.0
"""How much of a shared lane belongs to the conflict zone (SEMANTICS 4)."""

_STANDS = 1.6
"""Least standstill of a yielding agent [s], including its smoothed start and end."""

_PAUSES, _LONGEST, _USUAL = {"vehicle": 0.2, "pedestrian": 1.0}, 11.0, 5.0
"""The same where short standstills were observed; longest standstills, and the usual where none
were observed [s]."""

_REACTS, _SOONEST = (0.3, 0.8), -1.5
"""From the other's leaving to the start [s]: where none was observed; and the soonest of all."""

_MOVES_BY, _MOVING = 3.6, {"vehicle": 1.0, "pedestrian": 0.5}
"""How long after the other has left [s] the yielding agent must be moving (SEMANTICS: 4 s), that
is, at more than this [m/s]."""

_ROLLS, _SLOWEST, _SMOOTHED = 4, 0.15, 0.25
"""Draws for a rolling yield; least speed that it slows to, and what smoothing adds to it [m/s]."""

_SLOW = 0.42
"""Largest share of the free speed at which slowing counts as giving way (SEMANTICS: half)."""

_ON = 0.4
"""How long a pedestrian is on its crosswalk when a vehicle that stops for it begins to slow [s]."""

_BEFORE = 0.5
"""How long before it slows a vehicle must be visible [s]."""

_NO_LATER, _AWAITED, _THERE = 0.15, 4.0, 0.8
"""How long after the other has left the slowest moment may be (SEMANTICS 8: 0.5 s), how long
before the other comes to the zone the stop begins at the earliest (stated), and how long the other
is in the scene by the time of slowing for it [s]."""

_WAVES = {"vehicle": 0.5, "pedestrian": 0.2, "cyclist": 0.5, "scooter": 0.5}
"""Differences of speed below that [m/s] are no slowing, and begin none."""

_APPROACH = {"vehicle": 40.0, "pedestrian": 5.0, "cyclist": 40.0, "scooter": 40.0}
"""The approach speed is the highest on so long a way before an agent slows [m] (SEMANTICS 4)."""

_CAUSE, _CAUSE_SEEN = 1.2, 1.7
"""How far [s] from the other's time in the zone it would have been there without stopping (2 s):
where no standstill was observed, and where it was."""

_SETS_OFF = 4.5
"""Least distance [m] from a red light at which an agent set off to where it gives way: it must have
been moving at 2 m/s (SEMANTICS)."""

_FREE = DrivingProfile(1.0, acceleration=2.0, braking=2.0, lateral=3.0, foresight=0.0)
"""Free speed as SEMANTICS section 4 defines it."""

_CLEARANCE, _PETS = 0.4, (0.6, 7.0)
"""Limits of a yield: least clearance [m], range of its PET [s]."""

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

_UPSTREAM = {"vehicle": 18.0, "pedestrian": 4.3}
"""Farthest before the zone that giving way counts (SEMANTICS 4: 20 m and 5 m, less a margin)."""


def schedule_yields(
    clause: GivesWay, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the first gives way to the second."""
    a, b = context.get_pair(clause, schedule)
    if context.refuse_after_collision(clause, a, b):
        return
    zone = find_conflict_zone(a.candidate, b.candidate)
    if not len(zone.i):
        context.note_paths_apart(clause)
        return
    words = f"{clause.first} has no place to wait near where {clause.second} passes"
    context.note_miss(clause, FailureStage.PATHS, words)
    yields = _Yields(clause, schedule, context, a, b, zone)
    yield from yields.schedule_rolling()
    for anchor, hold in yields.list_stop_positions():
        if _gets_going(a, hold.s):
            yield from yields.schedule_held(anchor, hold)


def find_conflict_zone(a: Candidate, b: Candidate) -> PathConflict:
    """Find the nodes of the pair's conflict zone."""
    zone = find_contact_nodes(a, b)
    merge = a.route.exit == b.route.exit and "pedestrian" not in (a.route.type, b.route.type)
    return zone.keep_first_metres(MERGE_METRES) if merge else zone


@dataclass(frozen=True, eq=False)
class _Yields:
    """How the first, `a`, may give way to the second, `b`, at their conflict zone."""

    clause: GivesWay
    schedule: PartialSchedule
    context: SolverContext
    a: ScheduledAgent
    b: ScheduledAgent
    zone: PathConflict

    @cached_property
    def nodes(self) -> FloatArray:
        """Where the first is in the zone [m]."""
        return self.zone.s_a[self.zone.i]

    @cached_property
    def first(self) -> float:
        """Where the zone begins on the way of the first [m]."""
        return float(self.nodes.min())

    @cached_property
    def passage(self) -> tuple[float, float]:
        """Local times [s] at which the second enters and leaves the zone."""
        return compute_passage(self.b.motion, self.zone.s_b[self.zone.j])

    @cached_property
    def wanted(self) -> TimeGap | None:
        """The PET asked for."""
        return self.context.get_requested_pet(self.clause)

    @cached_property
    def behavior(self) -> YieldingBehavior | None:
        """How such agents were observed to give way here."""
        return self.context.get_yielding(self.clause)

    @property
    def kind(self) -> str:
        """Class of the first."""
        return self.a.candidate.route.type

    def schedule_held(self, anchor: str, hold: StopCommand) -> Iterator[PartialSchedule]:
        """Schedule the first waiting at a place until the other has left the zone."""
        a, rng, (_, b_out) = self.a, self.context.rng, self.passage
        others = tuple(stop for stop in a.stops if abs(stop.s - hold.s) > 0.5)
        earlier = _build_commands(others, a.enters)
        stands = compute_arrival(a.candidate, hold, earlier)
        unheld = _compute_unheld(a, hold, stands, self.nodes, earlier)
        takes = self._compute_time_to_zone(hold, stands)
        picks_up = _MOVING[self.kind] / a.candidate.time_law.acceleration
        latest = min(_MOVES_BY - picks_up, _PETS[1] - takes - 0.3)
        for seen, lasts in self._draw_timings(takes, latest):
            low, high = self._find_offsets(unheld, stands)
            react, least, longest = seen, _STANDS, _USUAL
            if lasts is not None:
                # An agent that could not have come so early stands as long by starting later.
                missing = max(stands + lasts - seen - b_out - high, 0.0)
                react = max(min(seen + missing, latest), seen)
                least, longest = _PAUSES[self.kind], _LONGEST
            low = max(stands + least - react - b_out, low)
            high = min(stands + longest - react - b_out, high)
            if not np.isfinite(low + high) or low > high:
                self._note_no_cause(low, high, stands + least - react - b_out)
                continue
            delta = float(rng.uniform(low, high))
            if lasts is not None:
                delta = min(max(stands + lasts - react - b_out, low), high)
            placed, other = self.schedule.place(self.clause, a, self.b, delta)
            start = placed.enters + stands
            until = max(other.enters + b_out + react, start + least)
            ahead = self.first - hold.s
            stop = Stop(anchor, hold.s, start, until, "gives_way", hold.braking, ahead)
            held = hold_at(placed, other, stop, self.zone, self.wanted)
            if self._passes_well(held, other):
                yield self._add_yield(held, other, start, unheld)

    def schedule_rolling(self) -> Iterator[PartialSchedule]:
        """Schedule the first slowing so far that the other has left the zone when it arrives there.

        As often as observed, where nothing else may depend on its stop.
        """
        behavior, bound = self.behavior, {*self.context.busy, *self.schedule.actors}
        if behavior is None or self.wanted or self.clause.first in bound:
            return
        rng, (_, b_out), marks = self.context.rng, self.passage, self.b.landmarks
        if rng.random() >= behavior.rolls:
            return
        for _ in range(_ROLLS):
            s = self.a.landmarks.move_off_crosswalks(
                self.first - max(sample_quantiles(behavior.place, rng), 0.5),
                own=marks.own_crosswalk,
            )
            margin = max(sample_quantiles(behavior.margin, rng), _PETS[0] + 0.2)
            found = self._slow_down(s, sample_quantiles(behavior.pace, rng))
            if found is None:
                continue
            rolling, unheld = found
            low, high = self._find_offsets(unheld, rolling.stops[-1].start - rolling.enters)
            enters = rolling.motion.find_time_at(self.first)
            delta = min(max(enters - b_out - margin, low), high)
            if low > high or not np.isfinite(delta) or enters - b_out - delta < _PETS[0]:
                continue
            placed, other = self.schedule.place(self.clause, rolling, self.b, delta)
            if self._passes_well(placed, other):
                yield self._add_yield(placed, other, placed.stops[-1].start, unheld)

    def list_stop_positions(self) -> Iterator[tuple[str, StopCommand]]:
        """List where to wait: at the stop line or kerb if near enough, else short of the zone."""
        a, kind, rng = self.a, self.kind, self.context.rng
        waits = [stop for stop in a.stops if stop.reason == "gives_way" and not stop.rolls]
        for stop in waits:
            if 0.3 <= self.first - stop.s < _UPSTREAM[kind]:
                yield stop.anchor, StopCommand(stop.s, 0.0, stop.braking)
        if waits:
            return
        short_of_line = _KERB_GAP if kind == "pedestrian" else STOP_GAP
        if kind == "vehicle" and self.behavior is not None:
            short_of_line = float(rng.uniform(*_LINE_GAPS))
        places = self._list_places(short_of_line)
        if kind == "vehicle":
            places = self._move_off_crosswalks(places, short_of_line)
        for anchor, s in places:
            for braking in (None, 3.2):
                if s > 2.0:
                    yield anchor, StopCommand(s, 0.0, braking)

    def _list_places(self, line_gap: float) -> list[tuple[str, float]]:
        """List anchors and arc lengths [m] to stop at, those to try first at the front.

        Args:
            line_gap: how far from its line an agent stops [m].
        """
        kind, line, first = self.kind, self.a.landmarks.line, self.first
        gaps = self._draw_distances()
        ahead = [("yield_point", first - gap) for gap in gaps if gap <= _GAPS[kind][1]]
        nearest = first - min(gaps)
        places: list[tuple[str, float]] = []
        if line is not None:
            ahead = [place for place in ahead if place[1] > line + 1.0]
            if kind == "pedestrian" and not self.context.lenient:
                ahead = [place for place in ahead if place[1] < line + _ROADSIDE]
            if line - STOP_GAP <= nearest and first - line < _UPSTREAM[kind]:
                anchor = "stop_line" if kind == "vehicle" else "kerb"
                places = [(anchor, line - line_gap)]
        turning = self.a.candidate.route.movement in ("left", "right", "uturn")
        near = turning and gaps[0] <= _GAPS[kind][1]
        return [*ahead[:1], *places, *ahead[1:]] if near else [*places, *ahead]

    def _draw_distances(self) -> list[float]:
        """Draw distances from the zone to stop at [m]: as observed, then as is usual."""
        kind, rng = self.kind, self.context.rng
        usual = float(rng.uniform(*_USUAL_GAP[kind]))
        if self.behavior is None or self.wanted is not None:
            return [usual]
        gaps = [max(sample_quantiles(self.behavior.gap, rng), _GAPS[kind][0]) for _ in range(2)]
        # An agent that turns on green drives on into the intersection before it waits.
        turns = self.a.candidate.route.movement != "straight"
        if turns and self.a.landmarks.group is not None:
            gaps = [min(gap, _GAPS[kind][1]) for gap in gaps]
        return [*gaps, usual]

    def _move_off_crosswalks(
        self, places: list[tuple[str, float]], line_gap: float
    ) -> list[tuple[str, float]]:
        """Move stops before any crosswalk that the other does not walk on.

        Args:
            line_gap: how far from its line an agent stops [m].
        """
        found: list[tuple[str, float]] = []
        line, own = self.a.landmarks.line, self.b.landmarks.own_crosswalk
        landmarks, creeps = _find_creep_place(self.a, self.b, seen=self.behavior is not None)
        for named, wished in places:
            anchor, s = named, landmarks.move_off_crosswalks(wished, own=own)
            if s < wished and s < creeps <= self.first - _GAPS["vehicle"][0]:
                s = creeps
            if line is not None and s < wished and s < line + _PAST_LINE:
                # An agent that would stop between its line and a crosswalk stops at its line.
                anchor, s = "stop_line", line - line_gap
            near = any(abs(s - other) < 1.0 for _, other in found)
            if self.first - s < _UPSTREAM["vehicle"] and not near:
                found.append((anchor, s))
        return found

    def _draw_timings(self, takes: float, latest: float) -> Iterator[tuple[float, float | None]]:
        """Draw how soon it starts once the other has left, and how long it stood [s].

        As observed, or as the PET asked for needs it; else, so that it fits best: at once, besides
        the observed values, that would replace the long standstills.

        Args:
            takes: from its start to the zone; latest: it may start and still count as giving way
                [s].
        """
        rng, behavior = self.context.rng, self.behavior
        if self.wanted is not None:
            yield from [((self.wanted.low + self.wanted.high) / 2 - takes, None)] * 3
            return
        if behavior is not None:
            lasts = sample_quantiles(behavior.stands, rng)
            for _ in range(2):
                seen = sample_quantiles(behavior.reacts, rng)
                yield float(np.clip(seen, _SOONEST, max(latest, _SOONEST))), lasts
        if behavior is None or self.context.lenient:
            react = float(rng.uniform(*_REACTS))
            yield from [(react, None)] * (3 if behavior is None else 2)

    def _find_offsets(self, unheld: _UnheldMotion, slowest: float) -> tuple[float, float]:
        """Find the differences of entry times [s] at which the other is the cause (SEMANTICS 4).

        It is in the scene when `first` begins to slow, has not long left the zone when that is
        slowest, and is no longer away from it then than agents wait; or is on its crosswalk before.

        Args:
            slowest: local time of the standstill's beginning, or of the lowest speed [s].
        """
        b_in, b_out = self.passage
        marks, seen = self.b.landmarks, self.behavior is not None
        high = unheld.leaves + (_CAUSE_SEEN if seen else _CAUSE) - b_in
        soonest = slowest + _AWAITED - b_in
        if self.b.candidate.route.type == "pedestrian" and marks.line is not None:
            # It is on the crosswalk when the yielding agent begins to slow.
            on = unheld.begins - self.b.motion.find_time_at(marks.line) - _ON
            soonest = max(soonest, on)
            if seen and marks.own_crosswalk is not None:
                high = max(high, on)
        low = max(unheld.enters - _CAUSE - b_out, slowest - b_out - _NO_LATER)
        return low, min(high, soonest, unheld.begins - _THERE)

    def _slow_down(self, s: float, pace: float) -> tuple[ScheduledAgent, _UnheldMotion] | None:
        """Slow the agent to a share `pace` of its approach speed at `s` [m]; None if that is no
        yield."""
        a = self.a
        if s <= 2.0 or self.first - s >= _UPSTREAM[self.kind] or not _gets_going(a, s):
            return None
        stop, earlier = StopCommand(s, 0.0), _build_commands(a.stops, a.enters)
        arrives = compute_arrival(a.candidate, stop, earlier)
        unheld = _compute_unheld(a, stop, arrives, self.nodes, earlier)
        free = float(np.interp(s, unheld.free.s, unheld.free.speed))
        speed = max(min(pace * unheld.approach, _SLOW * free) - _SMOOTHED, _SLOWEST)
        hold = StopCommand(s, 0.0, speed=speed)
        at = compute_arrival(a.candidate, hold, earlier)
        time, ahead = at + a.enters, self.first - s
        slowest = Stop("yield_point", s, time, time, "gives_way", None, ahead, speed)
        rolling = a.edit(stops=(*a.stops, slowest))
        if rolling.motion.find_speed_at(at) > (_SLOW + 0.04) * free:
            return None
        return rolling, _compute_unheld(a, hold, at, self.nodes, earlier)

    def _compute_time_to_zone(self, hold: StopCommand, stands: float) -> float:
        """Compute how long it takes from its release to the zone [s]."""
        release = stands + _STANDS
        motion = compute_motion(self.a.candidate, holds=(replace(hold, release=release),))
        return motion.find_time_at(self.first) - release

    def _add_yield(
        self, held: ScheduledAgent, other: ScheduledAgent, start: float, unheld: _UnheldMotion
    ) -> PartialSchedule:
        """Add the yield to the schedule; `start` is when it is slowest [s]."""
        enters = held.enters + held.motion.find_time_at(self.first)
        begins = min(held.enters + unheld.begins, start) - _BEFORE
        freed, place = other.enters + self.passage[1], held.get_pose_at(start)[:2]
        event = ScheduledEvent(self.clause, start, begins, enters, freed, place)
        return self.schedule.add_event(event, held, other)

    def _passes_well(self, held: ScheduledAgent, other: ScheduledAgent) -> bool:
        """Return whether the yield has 0.4 m clearance and a PET between 0.6 and 7 s, or as
        asked."""
        low, high = _PETS if self.wanted is None else (self.wanted.low, self.wanted.high)
        clearance, _, _ = find_least_clearance(held, other)
        pet = _compute_pet(held, other, self.zone)
        if clearance >= _CLEARANCE and low - 0.02 <= pet <= high + 0.02:
            return True
        if clearance < _CLEARANCE:
            words = f"{max(clearance, 0.0):.1f} m clear of {self.clause.second}"
            words = f"{self.clause.first} keeps only {words}"
            self.context.note_miss(self.clause, FailureStage.PLACE, words)
        else:
            self._note_pet(pet, low, high)
        return False

    def _note_no_cause(self, low: float, high: float, by_standing: float) -> None:
        first, second = self.clause.first, self.clause.second
        words = f"{first}, unheld, would not have met {second}, so it has no reason"
        self.context.note_miss(self.clause, FailureStage.ROLES, words)
        if self.wanted is not None and np.isfinite(low + high):
            longer = low - high if by_standing >= low else high - low
            middle = (self.wanted.low + self.wanted.high) / 2
            self._note_pet(middle + longer, self.wanted.low, self.wanted.high)

    def _note_pet(self, pet: float, low: float, high: float) -> None:
        """Note that only this PET [s] was possible."""
        words = f"a PET of {low:g} to {high:g} s after the yield: it is {pet:.1f} s"
        if self.wanted is not None:
            asked, extreme = (low + high) / 2, "shortest" if pet > high else "longest"
            words = f"a PET of {asked:g} s after the yield: the {extreme} possible is {pet:.1f} s"
        off = max(low - pet, pet - high)
        self.context.note_miss(self.clause, FailureStage.MEASURE, words, off=off)


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
    by = next(
        (
            crosswalk
            for crosswalk in landmarks.crosswalks
            if line is not None and crosswalk[1] >= line
        ),
        None,
    )
    if not (seen and waits and landmarks.group is not None and by is not None):
        return landmarks, np.inf
    rest = tuple(crosswalk for crosswalk in landmarks.crosswalks if crosswalk is not by)
    shorter = (by[0], by[1], max(by[2] - length - _EDGE, by[1]))
    return replace(landmarks, crosswalks=(shorter, *rest)), shorter[2] + _PAST_EDGE


def _gets_going(a: ScheduledAgent, s: float) -> bool:
    """Return whether it drives fast enough before `s` [m], if it comes from a red light."""
    return all(s - stop.s > _SETS_OFF for stop in a.stops if stop.at_red)


def hold_at(
    a: ScheduledAgent,
    b: ScheduledAgent,
    stop: Stop,
    zone: PathConflict,
    wanted: TimeGap | None,
    *,
    least: float = _STANDS,
) -> ScheduledAgent:
    """Hold the first at a stop, until then or until the PET wanted; for a least time [s]."""
    held = a.edit(stops=_join_stops(a.stops, stop))
    later = 0.0 if wanted is None else (wanted.low + wanted.high) / 2 - _compute_pet(held, b, zone)
    if later == 0.0 or not np.isfinite(later):
        return held
    until = max(stop.until + later, stop.start + least)
    return a.edit(stops=_join_stops(a.stops, replace(stop, until=until)))


def _compute_pet(held: ScheduledAgent, other: ScheduledAgent, zone: PathConflict) -> float:
    meetings = find_conflict_intervals(zone, held.motion, other.motion)
    return compute_gap(meetings, other.enters - held.enters)


def _join_stops(stops: tuple[Stop, ...], stop: Stop) -> tuple[Stop, ...]:
    """Join a stop to others: one standstill at one place, as long as the longer of the two
    needs."""
    same = [each for each in stops if abs(each.s - stop.s) <= 0.5]
    rest = tuple(each for each in stops if each not in same)
    if not same:
        return tuple(sorted((*rest, stop), key=lambda each: each.s))
    until = max(stop.until, *(each.until for each in same))
    return tuple(sorted((*rest, replace(same[0], until=until, speed=0.0)), key=lambda each: each.s))


def _build_commands(stops: tuple[Stop, ...], enters: float) -> tuple[StopCommand, ...]:
    return tuple(make_stop_command(stop, enters) for stop in stops)


def compute_passage(motion: Motion, nodes: FloatArray) -> tuple[float, float]:
    """Compute local times [s] of reaching the first and leaving the last of the nodes."""
    return motion.find_time_at(float(nodes.min())), motion.find_time_at(float(nodes.max()))


@dataclass(frozen=True, eq=False)
class _UnheldMotion:
    """Motion of a yielding agent without its stop, free from where it began to slow.

    Attributes:
        enters, leaves: local times [s] of reaching and leaving the zone.
        begins: when it begins to slow [s]; approach: its speed then [m/s].
        free: the motion, not in its times.
    """

    enters: float
    leaves: float
    begins: float
    approach: float
    free: Motion


def _compute_unheld(
    a: ScheduledAgent,
    hold: StopCommand,
    stands: float,
    nodes: FloatArray,
    others: tuple[StopCommand, ...],
) -> _UnheldMotion:
    """Compute it from where it begins to slow, at the highest speed on the way there.

    Where it stood before (at `others`), it approaches from there.
    """
    kind = a.candidate.route.type
    earlier = tuple(each for each in others if each.s < hold.s)
    motion = compute_motion(a.candidate, holds=(*earlier, replace(hold, release=stands + 9.0)))
    until = int(stands / STEP)
    speed, s = motion.speed[: until + 1], motion.s[: until + 1]
    begin = _find_slowing_start(speed, _WAVES[kind])
    since = max([s[begin] - _APPROACH[kind], *(each.s + 0.1 for each in earlier)])
    approach = float(speed[: begin + 1][s[: begin + 1] >= min(since, s[begin])].max())
    law = replace(_FREE, speed=approach)
    free = compute_motion(replace(a.candidate, time_law=law), holds=earlier)
    shift = STEP * begin - free.find_time_at(float(s[begin]))
    first, last = compute_passage(free, nodes)
    return _UnheldMotion(first + shift, last + shift, STEP * begin, approach, free)


def _find_slowing_start(speed: FloatArray, waves: float) -> int:
    """Find the sample from which on an agent slows to the last one, but for smaller waves.

    Args:
        speed: [T] [m/s]; waves: differences of speed that are not regarded [m/s].
    """
    top = 0.0
    for first in range(len(speed) - 1, -1, -1):
        if speed[first] < top - waves:
            break
        top = max(top, float(speed[first]))
    return int(np.flatnonzero(speed >= top - 0.6 * waves)[-1])
