"""Staging the foreground: spawn times and edits under which every relation happens.

Each pair clause of the constraint language is a target set for delta, the difference of the two
agents' entry times (see `encounter`). Clauses are served in order, depth first: an agent already
placed keeps its time, the other one gets the delta that the clause wants.

    contact    delta inside C(0), the first contact of the wanted kind
    time_gap   delta at the wanted distance outside C(0)
    headway    delta just behind C(0) of a shared lane
    gives_way  `first` is held upstream of the zone until `second` has left it; delta such that,
               unheld, it would have been there while `second` was (SEMANTICS 4, cause)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from scenewright.scene.base import FloatArray, Point
from scenewright.scene.candidates import Candidate, TimeLaw
from scenewright.scene.constraints import Contact, GivesWay, Headway, PairClause, TimeGap
from scenewright.scene.selection import Slowing, Stop
from scenewright.scene.track import STEP
from scenewright.tools.dsl_validator.actor import Actor, shared_times
from scenewright.tools.dsl_validator.impact import FirstContact, first_contact, least_clearance
from scenewright.tools.encounter import (
    Encounter,
    Intervals,
    encounter,
    gap_to,
    meeting_offsets,
)
from scenewright.tools.landmarks import STOP_GAP, Landmarks
from scenewright.tools.signals import Demand
from scenewright.tools.time_law import Hold, Motion, arrival, move

_TRIES = 6
_SPACING = {"vehicle": 0.25, "pedestrian": 0.12}
_MERGE_METRES = 5.0
_STANDS = 1.6
"""Least standstill of who gives way [s], start and end smoothed away included."""

_CAUSE = 1.2
"""How far [s] from the other's time in the zone it would have been there unheld (2 s)."""

_FREE = {"acceleration": 2.0, "braking": 2.0, "lateral": 3.0}
"""Free speed as SEMANTICS section 4 defines it."""

_SMOOTHED = 0.4
"""By how much the smoothing of motion keeps a short slowing above its speed [m/s]."""

_BRAKES = 0.65
"""Share of striking drivers who brake before the impact."""

_ROADSIDE = 2.4
"""How far onto the road a pedestrian may wait: the parking lane's width [m]."""

_FOR_GOOD = 60.0
"""Longer than any scene [s]."""

_SUDDEN, _SUDDEN_BRAKING = (0.62, 0.82), 3.2
"""Where on its way (share of it) a leader stops for no light, and how hard it brakes [m/s^2]."""

_AT_THE_ZONE = 7.0
"""Who waits no farther than this [m] from a conflict zone visibly waits for it."""

_LINGERS = 2.5
"""How much later than it could a leader starts that is hit from behind [s]."""

_RED = 12.0
"""How long the leader of a rear-end would have stood at its red light [s]."""
_UPSTREAM = {"vehicle": 18.0, "pedestrian": 4.3}
"""Farthest before the zone that giving way counts (SEMANTICS 4: 20 m and 5 m, less a margin)."""

_SLOWS = 5.5
"""How long before a stop [s] the light must not explain it."""

Pairing = tuple[str, str]


@dataclass(frozen=True)
class Happening:
    """An event that the staging brings about: when [s] and where.

    Attributes:
        begins, ends: [s] the span that must be seen, and until which `first` is busy with it.
        freed: [s] until when `second` is busy with it.
    """

    clause: PairClause
    time: float
    begins: float
    ends: float
    freed: float
    location: Point

    def shifted(self, seconds: float) -> Happening:
        """The same, later."""
        return replace(
            self,
            time=self.time + seconds,
            begins=self.begins + seconds,
            ends=self.ends + seconds,
            freed=self.freed + seconds,
        )


@dataclass(frozen=True, eq=False)
class Staging:
    """Actors placed so far, and what happens among them."""

    actors: Mapping[str, Actor] = field(default_factory=dict)
    happenings: tuple[Happening, ...] = ()

    def busy_until(self, name: str) -> float:
        """Until when [s] the agent is busy with events so far; -inf if with none."""
        first = [each.ends for each in self.happenings if name == each.clause.first]
        second = [each.freed for each in self.happenings if name == each.clause.second]
        return max([*first, *second], default=-float("inf"))

    def with_event(self, happening: Happening, a: Actor, b: Actor) -> Staging:
        """One event more, and its two actors as they are now."""
        first, second = _pair(happening.clause)
        return Staging({**self.actors, first: a, second: b}, (*self.happenings, happening))

    def shifted(self, seconds: float) -> Staging:
        """Everything later by a multiple of the step."""
        actors = {name: actor.shifted(seconds) for name, actor in self.actors.items()}
        happenings = tuple(each.shifted(seconds) for each in self.happenings)
        return Staging(actors, happenings)


class Stage:
    """Serves pair clauses for one tuple of candidates.

    Args:
        candidates, marks: by agent.
        rng: draws among the many placements that serve a clause.
        lenient: pedestrians may also wait in the middle of the road.
    """

    def __init__(
        self,
        candidates: Mapping[str, Candidate],
        marks: Mapping[str, Landmarks],
        rng: np.random.Generator,
        *,
        lenient: bool = True,
    ) -> None:
        self._candidates = candidates
        self._lenient = lenient
        self._marks = marks
        self._rng = rng
        self._encounters: dict[Pairing, Encounter] = {}

    def play(self, clauses: tuple[PairClause, ...], staging: Staging) -> Iterator[Staging]:
        """Every staging (lazily, several per clause) under which all clauses hold, in order."""
        if not clauses:
            yield staging
            return
        serve: Callable[[PairClause, Staging], Iterator[Staging]] = {
            "contact": self._contact,
            "time_gap": self._time_gap,
            "headway": self._headway,
            "gives_way": self._gives_way,
        }[clauses[0].clause]  # type: ignore[assignment]
        for staged in serve(clauses[0], staging):
            yield from self.play(clauses[1:], staged)

    def _contact(self, clause: Contact, staging: Staging) -> Iterator[Staging]:
        a, b = self._actor(clause.first, staging), self._actor(clause.second, staging)
        if a.contact is not None or b.contact is not None:
            return
        if clause.kind != "rear_end":
            deltas = self._inside(self._meetings(clause, a, b))
            yield from self._touching(clause, staging, a, b, deltas)
            return
        for follower, leader in self._rear_ends(a, b, clause):
            deltas = self._while_standing(follower, leader)
            yield from self._touching(clause, staging, follower, leader, deltas)

    def _touching(
        self,
        clause: Contact,
        staging: Staging,
        a: Actor,
        b: Actor,
        deltas: list[float],
    ) -> Iterator[Staging]:
        for delta in deltas:
            placed_a, placed_b = _place(clause, a, b, delta, staging)
            found = first_contact(placed_a, placed_b)
            if found is not None and clause.speed is not None and not placed_a.slowings:
                placed_a, found = self._down_to(clause.speed, placed_a, placed_b, found)
            if found is None or not _wanted(found, clause):
                continue
            earliest, latest = self._window(clause, placed_b, staging)
            if not earliest <= found.time <= latest:
                continue
            placed_a, found = self._startled(clause, placed_a, placed_b, found)
            end_a, end_b = placed_a.ended(found.time), placed_b.ended(found.time)
            time = found.time
            happening = Happening(clause, time, time - 3.0, time, time, found.location)
            yield staging.with_event(happening, end_a, end_b)

    def _startled(
        self, clause: Contact, a: Actor, b: Actor, found: FirstContact
    ) -> tuple[Actor, FirstContact]:
        """The striking vehicle brakes in the last moment, as drivers do, if it still strikes."""
        kind = a.candidate.route.type
        if kind != "vehicle" or a.slowings or self._rng.random() > _BRAKES:
            return a, found
        speed = found.speed * float(self._rng.uniform(0.55, 0.85))
        braked, again = self._braked(a, b, found, speed)
        if again is None or not _wanted(again, clause) or abs(again.time - found.time) > 0.6:
            return a, found
        return braked, again

    def _down_to(
        self, speed: float, a: Actor, b: Actor, found: FirstContact
    ) -> tuple[Actor, FirstContact | None]:
        """The striking vehicle braked to the speed asked for, if it would be faster."""
        if found.speed < speed + _SMOOTHED:
            return a, found
        return self._braked(a, b, found, max(speed - _SMOOTHED, 0.5))

    def _braked(
        self, a: Actor, b: Actor, found: FirstContact, speed: float
    ) -> tuple[Actor, FirstContact | None]:
        """`a` braking late to `speed` where it would have touched, and its contact then."""
        at = float(a.motion.position(np.array([found.time - a.enters]))[0])
        slow = Slowing(at, speed, float(self._rng.uniform(4.0, 6.0)))
        braked = a.edited(stops=a.stops, slowings=(slow,))
        return braked, first_contact(braked, b)

    def _time_gap(self, clause: TimeGap, staging: Staging) -> Iterator[Staging]:
        a, b = self._actor(clause.first, staging), self._actor(clause.second, staging)
        meetings = self._meetings(clause, a, b)
        for delta in self._outside(meetings, clause.low, clause.high):
            placed_a, placed_b = _place(clause, a, b, delta, staging)
            if not _in_range(clause, gap_to(meetings, placed_b.enters - placed_a.enters)):
                continue
            clearance, time, place = least_clearance(placed_a, placed_b)
            if clearance <= 0.05 or self._too_soon(time, clause, staging):
                continue
            happening = Happening(clause, time, time - 4.0, time + 1.0, time + 1.0, place)
            yield staging.with_event(happening, placed_a, placed_b)

    def _headway(self, clause: Headway, staging: Staging) -> Iterator[Staging]:
        a, b = self._actor(clause.first, staging), self._actor(clause.second, staging)
        pair = self._encounter(*_pair(clause))
        meetings = meeting_offsets(pair, a.free, b.free, c=0.0, exact=True)
        if not len(meetings):
            return
        for gap in self._rng.uniform(clause.low, clause.high, _TRIES):
            placed_a, placed_b = _place(clause, a, b, float(meetings[0, 0] - gap), staging)
            if not _in_range(clause, meetings[0, 0] - (placed_b.enters - placed_a.enters)):
                continue
            placed_a = self._queued(placed_a, placed_b, pair)
            begins = max(placed_a.enters, placed_b.enters)
            if not _follows(placed_a, placed_b):
                continue
            time = begins + 4.0
            happening = Happening(clause, time, begins, time, time, _point(placed_a, time))
            yield staging.with_event(happening, placed_a, placed_b)

    def _queued(self, a: Actor, b: Actor, pair: Encounter) -> Actor:
        """The follower with a standstill behind every one of its leader's, its wreck included."""
        stands = [(stop.s, stop.start, stop.until) for stop in b.stops]
        if b.contact is not None:
            last = float(b.motion.s[-1])
            stands = [each for each in stands if each[0] < last - 1.0]
            stands.append((last, b.contact, b.contact + _FOR_GOOD))
        stops = list(a.stops)
        for s, start, until in stands:
            beside = np.abs(pair.s_b[pair.j] - s) < 0.3
            if not beside.any():
                continue
            behind = float(pair.s_a[pair.i[beside]].min()) - float(self._rng.uniform(1.8, 3.0))
            if behind > 2.0 and all(abs(stop.s - behind) > 1.0 for stop in stops):
                lag = float(self._rng.uniform(0.7, 1.3))
                stops.append(Stop("queue", behind, start, until + lag, "queue"))
        if len(stops) == len(a.stops):
            return a
        return a.edited(stops=tuple(sorted(stops, key=lambda stop: stop.s)))

    def _gives_way(self, clause: GivesWay, staging: Staging) -> Iterator[Staging]:
        a, b = self._actor(clause.first, staging), self._actor(clause.second, staging)
        if a.contact is not None or b.contact is not None:
            return
        zone = self._encounter(clause.first, clause.second).within(0.0)
        zone = zone.first_metres(_MERGE_METRES) if _merging(a, b) else zone
        if not len(zone.i):
            return
        for stop in self._stopping_places(a, zone):
            yield from self._held(clause, staging, zone, stop)

    def _held(
        self, clause: GivesWay, staging: Staging, zone: Encounter, place: tuple[str, Hold]
    ) -> Iterator[Staging]:
        a, b = self._actor(clause.first, staging), self._actor(clause.second, staging)
        anchor, hold = place
        others = tuple(stop for stop in a.stops if abs(stop.s - hold.s) > 0.5)
        stands = arrival(a.candidate, hold, _holds(others, a.enters))
        b_in, b_out = _passage(b.motion, zone.s_b[zone.j])
        a_in, a_out = _unheld(a, hold, stands, zone.s_a[zone.i])
        react = float(self._rng.uniform(0.3, 0.8))
        low = max(stands + _STANDS - react, a_in - _CAUSE) - b_out
        high = min(stands + 5.0 - b_out - react, a_out + _CAUSE - b_in)
        if not np.isfinite(low + high) or low > high:
            return
        for delta in self._rng.uniform(low, high, 3):
            placed_a, placed_b = _place(clause, a, b, float(delta), staging)
            release = placed_b.enters + b_out + react
            start = placed_a.enters + stands
            ahead = float(zone.s_a[zone.i].min()) - hold.s
            stop = Stop(anchor, hold.s, start, release, "gives_way", hold.braking, ahead)
            held = placed_a.edited(stops=_joined(placed_a.stops, stop))
            if not _passes_well(held, placed_b, zone):
                continue
            enters = placed_a.enters + held.motion.time_at(float(zone.s_a[zone.i].min()))
            passed = placed_b.enters + b_out
            spot = _point(held, start)
            happening = Happening(clause, start, start - 5.0, enters, passed, spot)
            yield staging.with_event(happening, held, placed_b)

    def _stopping_places(self, a: Actor, zone: Encounter) -> Iterator[tuple[str, Hold]]:
        """Where to wait: at the stop line or kerb if near enough, else short of the zone."""
        kind = a.candidate.route.type
        first = float(zone.s_a[zone.i].min())
        line = a.marks.line
        turning = a.candidate.route.movement in ("left", "right", "uturn")
        short = first - float(self._rng.uniform(*((0.9, 2.0) if kind == "vehicle" else (0.6, 1.1))))
        places: list[tuple[str, float]] = []
        waits = [s for s in a.stops if s.reason == "gives_way"]
        for stop in waits:
            if 0.3 <= first - stop.s < _UPSTREAM[kind]:
                yield stop.anchor, Hold(stop.s, 0.0, stop.braking)
        if waits:
            return
        if line is not None and line - STOP_GAP <= short and first - line < _UPSTREAM[kind]:
            anchor = "stop_line" if kind == "vehicle" else "kerb"
            places = [(anchor, line - min(STOP_GAP, 0.3 if kind == "pedestrian" else STOP_GAP))]
        free = kind == "vehicle" or self._lenient or line is None or short < line + _ROADSIDE
        if free and (line is None or short > line + 1.0):
            at_zone = ("yield_point", short)
            places = [at_zone, *places] if turning else [*places, at_zone]
        for anchor, s in places:
            for braking in (None, 3.2):
                if s > 2.0:
                    yield anchor, Hold(s, 0.0, braking)

    def _brakes_at_light(self, b: Actor) -> Actor | None:
        """The leader of a rear-end: stands at its red light."""
        if b.marks.line is None or b.marks.group is None:
            return None
        hold = Hold(b.marks.line - STOP_GAP, 0.0)
        start = b.enters + arrival(b.candidate, hold)
        stop = Stop("stop_line", hold.s, start, start + _RED, "red_light")
        return b.edited(stops=(stop,))

    def _rear_ends(self, a: Actor, b: Actor, clause: Contact) -> Iterator[tuple[Actor, Actor]]:
        """The leader stands, and the follower brakes hard but too late to stop behind it."""
        for leader in self._standing_leaders(b):
            follower = self._brakes_late(a, leader, clause)
            if follower is not None:
                yield follower, leader

    def _while_standing(self, follower: Actor, leader: Actor) -> list[float]:
        """Deltas that bring the follower to the leader's rear while the leader stands."""
        stop, touch = leader.stops[-1], follower.slowings[-1].s
        first = stop.start + 0.2
        if stop.reason == "gives_way":
            first = stop.until - _LINGERS - 0.1
        last = min(stop.until - 0.1, first + _RED)
        reaches = follower.motion.time_at(touch)
        return [
            float(leader.enters - (time - reaches))
            for time in self._rng.uniform(first, max(last, first), _TRIES)
        ]

    def _standing_leaders(self, b: Actor) -> Iterator[Actor]:
        """Where it stands already; else at its red light; else braked to a stop on its way."""
        if b.stops:
            lingering = _lingering(b)
            if lingering is not None:
                yield lingering
            return
        at_light = self._brakes_at_light(b)
        if at_light is not None:
            yield at_light
        for share in self._rng.uniform(*_SUDDEN, 2):
            hold = Hold(share * b.candidate.path.length, 0.0, _SUDDEN_BRAKING)
            start = b.enters + arrival(b.candidate, hold)
            until = start + _FOR_GOOD
            stop = Stop("stopping_point", hold.s, start, until, "brakes", _SUDDEN_BRAKING)
            yield b.edited(stops=(stop,))

    def _brakes_late(self, a: Actor, b: Actor, clause: Contact) -> Actor | None:
        shared = self._encounter(clause.first, clause.second).within(0.0)
        standing = np.abs(shared.s_b[shared.j] - b.stops[0].s) < 0.3
        if not standing.any():
            return None
        touch = float(shared.s_a[shared.i[standing]].min())
        speed = clause.speed or float(self._rng.uniform(3.0, 5.5))
        return a.edited(stops=a.stops, slowings=(Slowing(touch, speed, 5.5),))

    def _actor(self, name: str, staging: Staging) -> Actor:
        if name in staging.actors:
            return staging.actors[name]
        return Actor.unplaced(self._candidates[name], self._marks[name])

    def _encounter(self, first: str, second: str) -> Encounter:
        key = (first, second)
        if key not in self._encounters:
            a, b = self._candidates[first], self._candidates[second]
            spacing = (_SPACING[a.route.type], _SPACING[b.route.type])
            self._encounters[key] = encounter(
                a.path, b.path, shapes=(a.shape, b.shape), reach=0.0, spacing=spacing
            )
        return self._encounters[key]

    def _meetings(self, clause: PairClause, a: Actor, b: Actor) -> Intervals:
        pair = self._encounter(*_pair(clause))
        return meeting_offsets(pair, a.motion, b.motion, c=0.0, exact=True)

    def _inside(self, meetings: Intervals) -> list[float]:
        """Deltas spread inside the intervals, those near the middle first more often."""
        share = (
            0.5
            + 0.45 * np.sort(self._rng.uniform(-1, 1, _TRIES))[np.argsort(self._rng.random(_TRIES))]
        )
        return [float(low + (high - low) * x) for low, high in meetings for x in share]

    def _outside(self, meetings: Intervals, low: float, high: float) -> list[float]:
        """Deltas whose distance from all intervals lies in [low, high]."""
        found = []
        for gap in self._rng.uniform(low, high, _TRIES):
            for start, end in meetings:
                found += [float(start - gap), float(end + gap)]
        kept = [delta for delta in found if gap_to(meetings, delta) >= low - 1e-6]
        self._rng.shuffle(kept)
        return kept

    def _window(self, clause: Contact, b: Actor, staging: Staging) -> tuple[float, float]:
        """When [s] the contact may come: after what its agents did before.

        A leader that gives way is hit where it stands, once the other has passed.
        """
        if clause.kind == "rear_end" and any(stop.reason == "gives_way" for stop in b.stops):
            until = b.stops[-1].until
            passed = until - _LINGERS - 0.2
            return max(staging.busy_until(clause.first) + 0.5, passed), until + 0.2
        busy = max(staging.busy_until(name) for name in _pair(clause))
        return busy + 0.5, float("inf")

    def _too_soon(self, time: float, clause: PairClause, staging: Staging) -> bool:
        """A later relation of an agent comes after its earlier ones."""
        return any(time < staging.busy_until(name) + 0.5 for name in _pair(clause))


def passes_first(first: Actor, second: Actor) -> bool:
    """Whether `first` has left the pair's conflict zone before `second` enters it."""
    a, b = first.candidate, second.candidate
    spacing = (_SPACING[a.route.type], _SPACING[b.route.type])
    pair = encounter(a.path, b.path, shapes=(a.shape, b.shape), reach=0.0, spacing=spacing)
    meetings = meeting_offsets(pair, first.motion, second.motion, c=0.0, exact=True)
    delta = second.enters - first.enters
    return bool(len(meetings) and delta >= meetings[:, 1].max())


def _follows(a: Actor, b: Actor) -> bool:
    """Whether `a` drives behind `b` at a headway of 0.7-3.6 s for 3.6 s on end."""
    times = shared_times(a, b)
    if times is None:
        return False
    ahead = b.at(times)[:, :2] - a.at(times)[:, :2]
    gap = np.hypot(*ahead.T) - (a.candidate.shape.length + b.candidate.shape.length) / 2
    clock = STEP * np.arange(len(a.motion.s))
    speed = np.maximum(np.interp(times - a.enters, clock, a.motion.speed), 0.5)
    fits = (gap / speed > 0.7) & (gap / speed < 3.4)
    run = longest = 0
    for each in fits:
        run = run + 1 if each else 0
        longest = max(longest, run)
    return longest >= 36


def demands(actor: Actor, *, violates: bool, until: float) -> tuple[Demand, ...]:
    """What the signal plan must show for this actor: to obey it, or to run its red light."""
    line, group = actor.marks.line, actor.marks.group
    if line is None or group is None:
        return ()
    found = [
        Demand(group, max(stop.start - 2.0, 0.0), min(stop.until, actor.contact or until), ("red",))
        for stop in actor.stops
        if stop.reason == "red_light"
    ]
    crosses = actor.enters + actor.motion.time_at(line)
    if not np.isfinite(crosses) or crosses > until or crosses < -25.0:
        return tuple(found)
    if violates:
        return (*found, Demand(group, crosses - 0.5, crosses + 1.0, ("red",)))
    waits = [stop.start - _SLOWS for stop in actor.stops if abs(stop.s - line) < 2.0]
    begins = min([crosses - 0.2, *waits])
    return (*found, Demand(group, begins, crosses + 0.5, ("green",)))


def _wanted(found: FirstContact, clause: Contact) -> bool:
    if clause.kind not in (None, found.kind):
        return False
    if clause.speed is not None and abs(found.speed - clause.speed) > 0.9:
        return False
    if clause.kind not in ("sideswipe", "head_on") and not found.frontal:
        return False  # `first` is named as the one who strikes
    least = 2.5 if found.kind == "pedestrian_strike" else 1.3
    return found.closing >= least


def _in_range(clause: TimeGap | Headway, gap: float) -> bool:
    """Whether the gap is as asked, to the step; one between two already placed may not be."""
    return clause.low - STEP <= gap <= clause.high + STEP


def _passes_well(held: Actor, other: Actor, zone: Encounter) -> bool:
    """The yield as edited: clear of the other by 0.4 m, PET between 0.6 and 7 s, hold in force."""
    clearance, _, _ = least_clearance(held, other)
    meetings = meeting_offsets(zone, held.motion, other.motion, c=0.0, exact=True)
    pet = gap_to(meetings, other.enters - held.enters)
    return clearance >= 0.4 and 0.6 <= pet <= 7.0


def _place(
    clause: PairClause, a: Actor, b: Actor, delta: float, staging: Staging
) -> tuple[Actor, Actor]:
    """Both actors with o_b - o_a = delta (to the step); who is on stage already stays put."""
    delta = round(delta, 1)
    first, second = _pair(clause)
    if first in staging.actors and second not in staging.actors:
        return a, b.shifted(a.enters + delta - b.enters)
    if second in staging.actors and first not in staging.actors:
        return a.shifted(b.enters - delta - a.enters), b
    if first in staging.actors:
        return a, b
    return a, b.shifted(a.enters + delta - b.enters)


def _joined(stops: tuple[Stop, ...], stop: Stop) -> tuple[Stop, ...]:
    """One standstill at one place, as long as the longer of the two needs."""
    same = [each for each in stops if abs(each.s - stop.s) <= 0.5]
    rest = tuple(each for each in stops if each not in same)
    if not same:
        return tuple(sorted((*rest, stop), key=lambda each: each.s))
    until = max(stop.until, *(each.until for each in same))
    return tuple(sorted((*rest, replace(same[0], until=until)), key=lambda each: each.s))


def _holds(stops: tuple[Stop, ...], enters: float) -> tuple[Hold, ...]:
    return tuple(Hold(stop.s, stop.until - enters, stop.braking) for stop in stops)


def _passage(motion: Motion, nodes: FloatArray) -> tuple[float, float]:
    """Local times [s] of reaching the first and leaving the last of the nodes."""
    return motion.time_at(float(nodes.min())), motion.time_at(float(nodes.max()))


def _unheld(a: Actor, hold: Hold, stands: float, nodes: FloatArray) -> tuple[float, float]:
    """Local times [s] of reaching and leaving the zone, free from where it began to slow.

    It began at the last moment at which it still drove its approach speed (less 0.3 m/s).
    """
    motion = move(a.candidate, holds=(replace(hold, release=stands + 9.0),))
    until = int(stands / STEP)
    speed, s = motion.speed[: until + 1], motion.s[: until + 1]
    reach = 40.0 if a.candidate.route.type == "vehicle" else 5.0
    approach = float(speed[s >= hold.s - 1.5 * reach].max())
    begin = int(np.nonzero(speed >= approach - min(0.3, 0.3 * approach))[0][-1])
    law = TimeLaw(speed=approach, **_FREE)
    free = move(replace(a.candidate, time_law=law))
    shift = STEP * begin - free.time_at(float(s[begin]))
    first, last = _passage(free, nodes)
    return first + shift, last + shift


def _lingering(leader: Actor) -> Actor | None:
    """A leader slow to start after giving way; one that waits at red stays as it is.

    None for one that waits far from the zone: hit there, it could have waited for anybody.
    """
    last = leader.stops[-1]
    if last.reason != "gives_way":
        return leader
    if last.ahead is None or last.ahead > _AT_THE_ZONE:
        return None
    return leader.edited(stops=(*leader.stops[:-1], replace(last, until=last.until + _LINGERS)))


def _merging(a: Actor, b: Actor) -> bool:
    """Whether the two go on in one lane after the zone."""
    if "pedestrian" in (a.candidate.route.type, b.candidate.route.type):
        return False
    return a.candidate.route.exit == b.candidate.route.exit


def _point(actor: Actor, time: float) -> Point:
    x, y, _ = actor.at(np.array([time]))[0]
    return float(x), float(y)


def _pair(clause: PairClause) -> Pairing:
    return clause.first, str(clause.second)
