"""Conflicts by sampling: two that would touch on present courses, and react (SEMANTICS 8).

How either responds is drawn, and an offset of their entry times at which they would touch. From
when the conflict is perceptible each responds a reaction time later; the offset is then moved to
where the two, responding, still touch, or miss one another by the PET asked for. As they perceive
one another at another moment there, both respond anew, until the offset fits. Who asked for the
conflict judges what has come of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Protocol

import numpy as np

from scenewright.scene.constraints import PairClause
from scenewright.scene.kinds import get_kind, has_trait
from scenewright.scene.reaction_behavior import ASIDE, REACTION_TIME, Reaction
from scenewright.scene.selection import Slowing
from scenewright.scene.track import STEP
from scenewright.tools.solver.context import SolverContext
from scenewright.tools.solver.impact import FirstContact, find_first_contact
from scenewright.tools.solver.path_conflict import Intervals
from scenewright.tools.solver.reactions import (
    SLOWS_FOR,
    find_place,
    find_speed,
    find_threat,
    find_usual_braking,
    run_on,
    sees,
    slow_down,
    step_back,
    swerve_away,
)
from scenewright.tools.solver.scheduled_agent import PartialSchedule, ScheduledAgent, get_pair
from scenewright.tools.solver.yielding import find_conflict_zone, hold_at
from scenewright.work_limit import count_work

_OFFSETS_A_DRAW = 4
"""Offsets that are tried with one draw of responses."""

_PAIRS_SOLVED = 4
"""Pairs of responses for which another offset is solved for."""

_UNLAWFUL = 3
"""Conflicts that the lights never allow after which other paths and speeds are tried."""

_WEAKEST = {"vehicle": 1.3, "cyclist": 1.2, "scooter": 1.2, "pedestrian": 1.0}
"""Braking below this [m/s^2] is hardly a reaction."""

_LEAST_SPEED = {"vehicle": 0.5, "cyclist": 0.5, "scooter": 0.5, "pedestrian": 0.1}
"""Speed that it brakes down to at most [m/s]."""

_LEAST_CHANGE = {"vehicle": 0.7, "cyclist": 0.6, "scooter": 0.6, "pedestrian": 0.3}
"""By how much a reaction must change the speed at least to be seen [m/s]."""

_HARDER = 0.95
"""How much harder who brakes anyway must brake to be seen to react [m/s^2]."""

_TOO_LATE = 0.4
"""A reaction that would begin later than this before the contact [s] does not count."""

_SHIFT = 2.5
"""How much later than without reactions a contact may come [s]."""

_YIELDS = 0.58
"""Who keeps less than that share of its speed gives way (SEMANTICS 4), unless it brakes harsher
than `_HARSH` or the PET is shorter than `_NARROW`."""

_HARSH, _NARROW = 5.3, 0.44
"""Braking [m/s^2], and PET [s], of a near miss and no yield."""

_COMES = 2.0
"""How far who brakes short of the other's path comes at least [m]."""

_STANDS = 0.9
"""Its least standstill [s]."""

_SETS_OFF = (0.3, 1.0)
"""How long after the other has passed it sets off [s]."""

_INTO, _DEEP = (0.05, 0.5), (0.7, 2.2)
"""How far in the other's way a pedestrian turns round: one that is missed, one that is hit [m]."""

_CLEAR = 0.2
"""How far out of its way it is afterwards at least, if it is missed [m]."""

_RESTS = (0.4, 0.9)
"""How long it stands after that [s]."""

Pair = tuple[ScheduledAgent, ScheduledAgent]
_Changed = tuple[ScheduledAgent, "Response | None"]
"""An agent as it responds, if it does."""


@dataclass(frozen=True)
class Response:
    """How one of the two responds.

    Attributes:
        keeps: share of its speed that it keeps where it slows.
        kept: how far it stays slow [m]; None: until the other's path begins.
        short: how far short of the other's path the first has braked, whenever that begins [m];
            keeping nothing it stands there until the other has passed. None: it brakes when it
            reacts.
    """

    reaction: Reaction
    keeps: float
    kept: float | None = None
    short: float | None = None

    @property
    def gives_way(self) -> bool:
        """Whether it counts as giving way if it passes second with time to spare."""
        slows = not (self.reaction.hurries or has_trait("reaction", self.reaction.kind, "back"))
        return slows and self.keeps < _YIELDS and self.reaction.strength < _HARSH


@dataclass(frozen=True)
class Draw:
    """An offset o_b - o_a [s] at which the two would touch, and the ways in which they may respond.

    Attributes:
        ways: of either, the first that fits is taken; none: it does not respond.
        within: longest time from the later response to their contact [s].
    """

    delta: float
    ways: tuple[tuple[Response, ...], tuple[Response, ...]]
    within: float = np.inf


@dataclass(frozen=True)
class Conflict:
    """Two that respond to one another.

    Attributes:
        pair: as they respond; unaware: as they would move on, and touch.
        threat: from when to when the conflict of the unaware two is perceptible [s], if it is.
        latest: until when they must touch [s], if that is asked for.
    """

    pair: Pair
    unaware: FirstContact
    threat: tuple[float, float] | None
    latest: float


Judge = Callable[[Conflict], PartialSchedule | None]


class Prepare(Protocol):
    """Changes two as placed, which touch as found; None if that does not fit."""

    def __call__(self, pair: Pair, found: FirstContact, *, first: bool) -> Pair | None:
        """Return the two as changed; `first`: at the offset drawn, not at one solved for."""


@dataclass(eq=False)
class ConflictSampler:
    """Samples conflicts of a clause's two agents.

    Attributes:
        pair: the two, not yet placed to one another.
        judge: builds the schedule of a conflict that is as wanted.
        pets: range of the PET at which they miss one another [s]; None: they touch.
        second: which of the two passes second (0, 1), where only one may.
        prepare: changes the two as placed before they respond; None if that does not fit.
    """

    clause: PairClause
    schedule: PartialSchedule
    context: SolverContext
    pair: Pair
    judge: Judge
    pets: tuple[float, float] | None = None
    second: int | None = None
    prepare: Prepare | None = None
    _taken: set[float] = field(default_factory=set, init=False)
    _faulty: set[float] = field(default_factory=set, init=False)
    _steps: int = field(default=0, init=False)
    _unlawful: int = field(default=0, init=False)
    _seed: int = field(default=0, init=False)

    def sample(self, draws: Iterable[Draw]) -> Iterator[PartialSchedule]:
        """List schedules (lazily) with conflicts as wanted, one a draw at most."""
        for draw in draws:
            found = self.settle(draw)
            if found is not None:
                yield found
            elif self._unlawful >= _UNLAWFUL:
                return

    @cached_property
    def _meetings(self) -> Intervals:
        return self.context.find_meeting_intervals(self.clause, *self.pair)

    def settle(self, draw: Draw) -> PartialSchedule | None:
        """Find an offset at which the two respond as drawn and `judge` takes what comes of it."""
        delta, tried = draw.delta, set(self._taken)
        self._seed = int(self.context.rng.integers(1 << 32))  # responses stay alike at all offsets
        for n in range(_OFFSETS_A_DRAW):
            a, b = self.schedule.place(self.clause, *self.pair, delta)
            delta = round(b.enters - a.enters, 1)
            if delta in tried or (n == 0 and delta in self._faulty):
                return None
            tried.add(delta)
            self._steps += 1
            count_work(self._steps % 4 == 0)  # four take as long as other steps of the search
            unaware = find_first_contact(a, b, left_hand=self.context.left_hand)
            if unaware is not None and self.prepare is not None:
                prepared = self.prepare((a, b), unaware, first=n == 0)
                if prepared is None:
                    unaware = None
                elif prepared != (a, b):
                    a, b = prepared
                    unaware = find_first_contact(a, b, left_hand=self.context.left_hand)
            if unaware is None:
                if n == 0:
                    self._faulty.add(delta)
                return None
            found, other = self._respond(draw, (a, b), unaware)
            if found is not None:
                self._taken.add(delta)
                if self.context.do_lights_allow(found):
                    return found
                self._unlawful += 1
                return None
            if other is None:
                return None
            delta = other
        return None

    def _respond(
        self, draw: Draw, pair: Pair, contact: FirstContact
    ) -> tuple[PartialSchedule | None, float | None]:
        """Make the two respond: the schedule that fits; else an offset at which they might."""
        lead = self.context.reactions.hidden.get(frozenset(get_pair(self.clause)))
        until = contact.time
        threat = find_threat(
            self.context.find_path_conflict(self.clause), *pair, until=until, lead=lead
        )
        own = [self._list_ways(k, draw.ways[k], pair, threat, until) for k in (0, 1)]
        both = [
            (own[0][k], own[1][n])
            for k, n in sorted(product(*(range(len(each)) for each in own)), key=sum)
        ]
        if bool(draw.ways[0]) != bool(draw.ways[1]):  # else the other could have responded
            both = [each for each in both if each[0][1] or each[1][1]]

        def judge(ways: tuple[_Changed, _Changed]) -> PartialSchedule | None:
            (a, how_a), (b, how_b) = ways
            afters = [each.reaction.after for each in (how_a, how_b) if each is not None]
            onset = np.inf if threat is None or not afters else threat[0] + max(afters)
            latest = min(until + _SHIFT, onset + draw.within)
            return self.judge(Conflict((a, b), contact, threat, latest))

        if self.pets is None:
            found = next(filter(None, map(judge, both)), None)
            if found is not None:
                return found, None
        delta = pair[1].enters - pair[0].enters
        for ways in both[:_PAIRS_SOLVED]:
            (a, how_a), (b, how_b) = ways
            after = self.context.find_evaded_meetings(self.clause, a, b)
            targets = self._list_targets(after, (how_a, how_b))
            if any(low - 1e-6 <= delta <= high + 1e-6 for low, high in targets):
                found = None if self.pets is None else judge(ways)
                if found is not None:
                    return found, None
            elif targets:
                low, high = targets[int(self.context.rng.integers(len(targets)))]
                return None, float(self.context.rng.uniform(low, high))
        return None, None

    def _list_targets(
        self, after: Intervals, ways: tuple[Response | None, Response | None]
    ) -> list[tuple[float, float]]:
        """List ranges of offsets [s] at which the two would touch unaware, and responding as they
        do now touch or miss one another as asked.

        Args:
            after: offsets at which they would touch if they responded so.
        """
        if not len(after) or not len(self._meetings):
            return []
        if self.pets is None:
            both = product(self._meetings.tolist(), after.tolist())
            ranges = [(max(a, c), min(b, d)) for (a, b), (c, d) in both]
            return [(low, high) for low, high in ranges if high - low > STEP]
        least, most = self.pets
        backs = any(how and has_trait("reaction", how.reaction.kind, "back") for how in ways)
        # Who steps back lets the other pass between where it was and where it will be.
        met = after if backs else np.array([after[:, 0].min(), after[:, 1].max()])
        free = np.concatenate(([-np.inf], met.ravel(), [np.inf])).reshape(-1, 2)
        narrow = [backs or bool(how and how.gives_way) for how in ways]
        pets = [min(most, _NARROW) if each else most for each in narrow]
        low, high = float(self._meetings[:, 0].min()), float(self._meetings[:, 1].max())
        ranges = list[tuple[float, float]]()
        for begin, end in (free if self.second is None else free[[-self.second]]).tolist():
            inside = max(begin + least, low + STEP), min(end - least, high - STEP)
            # Shortly before a meeting the first passes second, shortly after one the other.
            sides = (end - pets[0], end), (begin, begin + pets[1])
            ranges += [(max(a, inside[0]), min(b, inside[1])) for a, b in sides]
        return [(a, b) for a, b in ranges if a <= b]

    def _list_ways(
        self,
        k: int,
        ways: tuple[Response, ...],
        pair: Pair,
        threat: tuple[float, float] | None,
        until: float,
    ) -> list[_Changed]:
        """List one of the two responding, each way that is seen; as it is, if it perceives nothing.

        None where it would have to, and cannot.
        """
        of, other, asked = (
            pair[k],
            pair[1 - k],
            get_pair(self.clause)[k] in self.context.reactions.ways,
        )
        blind = threat is None or of.slowings or not sees(of, other, threat[0])
        if blind or not self.context.reactions.may_react(get_pair(self.clause)[k]) or not ways:
            return [(of, None)]
        begin = 0.0 if threat is None else threat[0]
        found, late = list[_Changed](), 0
        for each in ways:
            if self.pets is None and begin + each.reaction.after > until - _TOO_LATE:
                late += 1
                continue
            changed = self._change(k, each, pair, begin, until)
            if changed is not None and _is_seen(of, changed, begin, until):
                found.append((changed, each))
        return [(of, None)] if late == len(ways) and not asked else found

    def _change(
        self, k: int, response: Response, pair: Pair, begin: float, until: float
    ) -> ScheduledAgent | None:
        """Apply the response; None where it changes nothing.

        Args:
            begin: when the conflict is perceptible; until: when the two would touch [s].
        """
        of, reaction, kind = pair[k], response.reaction, pair[k].candidate.shape.type
        paths = self.context.find_path_conflict(self.clause)
        nodes = (paths.s_a[paths.i], paths.s_b[paths.j])[k]
        onset, rng = begin + reaction.after, np.random.default_rng([self._seed, k])
        if response.short is not None:
            return self._brake_short(pair, response, response.short, rng)
        if has_trait("reaction", reaction.kind, "back"):
            return self._step_back(of, reaction, float(nodes.min()), begin, until, rng)
        usual, before = find_usual_braking(of, begin, onset), find_speed(of, onset)
        least = _WEAKEST[kind] + usual
        if reaction.hurries:
            beyond = float(nodes.max()) + 1.0 if response.kept is None else of.candidate.path.length
            return run_on(of, onset=onset, acceleration=max(reaction.strength, least), until=beyond)
        speed = max(_LEAST_SPEED[kind], response.keeps * before)
        if response.kept is not None:
            speed = max(_LEAST_SPEED[kind], min(speed, before - SLOWS_FOR * least))
        braking = max(min(reaction.strength + usual, (before - speed) / SLOWS_FOR), least)
        kept = response.kept or max(float(nodes.min()) - find_place(of, onset), 1.0)
        changed = slow_down(of, onset=onset, braking=braking, speed=speed, kept=kept)
        if changed is not None and reaction.swerves:
            aside = float(rng.uniform(*ASIDE))
            return swerve_away(changed, of, pair[1 - k], onset=onset, meets=until, by=aside)
        return changed

    def _brake_short(
        self, pair: Pair, response: Response, short: float, rng: np.random.Generator
    ) -> ScheduledAgent | None:
        """Brake the first so far short of the other's path [m], to a stop until that has passed or
        to a lower speed; None where its way begins too late."""
        (a, b), braking = pair, response.reaction.strength
        zone = find_conflict_zone(self.clause, a, b, self.context)
        first = float(zone.s_a[zone.i].min())
        passed = b.enters + b.motion.find_time_at(float(zone.s_b[zone.j].max()))
        s, usual = first - short, float(np.interp(first, a.motion.s, a.motion.speed))
        if s <= _COMES or not np.isfinite(passed):
            return None
        if response.keeps > 0.0:
            return a.edit(stops=a.stops, slowings=(Slowing(s, response.keeps * usual, braking),))
        stop = a.build_stop(s, "gives_way", braking=braking, anchor="yield_point")
        until = max(passed + float(rng.uniform(*_SETS_OFF)), stop.start + _STANDS)
        wanted = self.context.get_requested_pet(self.clause)
        return hold_at(a, b, replace(stop, until=until, ahead=short), zone, wanted, least=_STANDS)

    def _step_back(
        self,
        of: ScheduledAgent,
        how: Reaction,
        zone: float,
        begin: float,
        until: float,
        rng: np.random.Generator,
    ) -> ScheduledAgent | None:
        """Make the pedestrian step back with a foot or more in the other's way, which begins at
        `zone` [m]; None unless that is a reaction time after `begin` [s]."""
        hit = self.pets is None
        into = float(rng.uniform(*(_DEEP if hit else _INTO)))
        at, speed = zone + into, find_speed(of, until)
        onset = of.enters + of.motion.find_time_at(at - speed**2 / (2.0 * how.strength))
        if not REACTION_TIME.least <= onset - begin <= REACTION_TIME.most:
            return None
        own = get_kind("reaction", how.kind).ranges
        back = float(rng.uniform(*own["backwards"]))
        return step_back(
            of, at=at, back=back if hit else max(back, into + _CLEAR), braking=how.strength,
            speed=float(rng.uniform(*own["speed"])), rests=float(rng.uniform(*_RESTS)),
        )  # fmt: skip


def _is_seen(before: ScheduledAgent, after: ScheduledAgent, begin: float, until: float) -> bool:
    """Return whether a response to what is perceptible from `begin` on shows by a time [s]."""
    clock = min(before.motion.clock, after.motion.clock, key=len)
    times = clock[clock <= until - before.enters]
    n = len(times)
    most = float(np.abs(after.motion.speed[:n] - before.motion.speed[:n]).max(initial=0.0))
    seen = most >= _LEAST_CHANGE[before.candidate.shape.type]
    if before.candidate.shape.type == "pedestrian" or not seen:
        return seen
    since = after.motion.acceleration[:n][times > begin - before.enters]
    usual = find_usual_braking(before, begin, begin)
    return bool(len(since)) and float(since.min()) < -usual - _HARDER
