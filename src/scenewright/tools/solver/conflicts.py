"""Conflicts by sampling: two that would touch on present courses, and react (SEMANTICS 8).

How either responds is drawn, and an offset of their entry times at which they would touch. From
when the conflict is perceptible each responds a reaction time later; the offset is then moved to
where the two, responding, still touch, or miss one another by the PET asked for. As they perceive
one another at another moment there, both respond anew, until the offset fits. Who asked for the
conflict judges what has come of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np

from scenewright.scene.constraints import PairClause
from scenewright.scene.kinds import get_kind, has_trait
from scenewright.scene.reaction_behavior import ASIDE, REACTION_TIME, Reaction
from scenewright.scene.selection import Slowing
from scenewright.scene.track import STEP
from scenewright.tools.solver.context import SolverContext, find_contact_nodes, find_meetings
from scenewright.tools.solver.impact import FirstContact
from scenewright.tools.solver.path_conflict import Intervals
from scenewright.tools.solver.reactions import (
    SLOWS_FOR,
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
Threat = tuple[float, float] | None
"""From when to when a conflict is perceptible [s]; None: it never is."""
_Answer = tuple[ScheduledAgent, "Response | None"]
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
    def goes_back(self) -> bool:
        """Whether it goes backwards, out of the other's way."""
        return has_trait("reaction", self.reaction.kind, "back")

    @property
    def gives_way(self) -> bool:
        """Whether it counts as giving way if it passes second with time to spare."""
        slows = not (self.reaction.hurries or self.goes_back)
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
        pair: as they respond.
        threat: from when to when the conflict is perceptible [s] if they move on, if it is.
        latest: until when they must touch [s], if that is asked for.
    """

    pair: Pair
    threat: Threat
    latest: float


@dataclass(eq=False)
class ConflictSampler(ABC):
    """Samples conflicts of a clause's two agents; each kind of clause judges what comes of them.

    Attributes:
        pair: the two, not yet placed to one another.
        pets: range of the PET at which they miss one another [s]; None: they touch.
        second: which of the two passes second (0, 1), where only one may.
    """

    clause: PairClause
    schedule: PartialSchedule
    context: SolverContext
    pair: Pair
    pets: tuple[float, float] | None = None
    second: int | None = None
    _taken: set[float] = field(default_factory=set, init=False)
    _faulty: set[float] = field(default_factory=set, init=False)
    _steps: int = field(default=0, init=False)
    _unlawful: int = field(default=0, init=False)
    _seed: int = field(default=0, init=False)

    @abstractmethod
    def judge(self, conflict: Conflict) -> PartialSchedule | None:
        """Return the schedule with the conflict; None if it is not as the clause asks."""

    def prepare(self, contact: FirstContact, *, first: bool) -> FirstContact | None:  # noqa: ARG002
        """Change the two that would touch before they respond; None if the contact does not fit.

        Args:
            first: at the offset drawn, not at one solved for.
        """
        return contact

    def sample(self, draws: Iterable[Draw]) -> Iterator[PartialSchedule]:
        """List schedules (lazily) with conflicts as wanted, one a draw at most."""
        for draw in draws:
            found = self._settle(draw)
            if found is not None:
                yield found
            elif self._unlawful >= _UNLAWFUL:
                return

    @cached_property
    def _meetings(self) -> Intervals:
        return find_meetings(*self.pair)

    def _settle(self, draw: Draw) -> PartialSchedule | None:
        """Find an offset at which the two respond as drawn and `judge` takes what comes of it."""
        delta: float | None = draw.delta
        tried = set(self._taken)
        self._seed = int(self.context.rng.integers(1 << 32))  # responses stay alike at all offsets
        for n in range(_OFFSETS_A_DRAW):
            if delta is None:
                return None
            a, b = self.schedule.place(self.clause, *self.pair, delta)
            delta = round(b.enters - a.enters, 1)
            if delta in tried or (n == 0 and delta in self._faulty):
                return None
            tried.add(delta)
            self._steps += 1
            count_work(self._steps % 4 == 0)  # four take as long as other steps of the search
            contact = self.context.find_first_contact(a, b)
            prepared = None if contact is None else self.prepare(contact, first=n == 0)
            if prepared is None:
                if n == 0:
                    self._faulty.add(delta)
                return None
            found, other = self._respond(draw, prepared)
            if found is not None:
                self._taken.add(delta)
                if self.context.do_lights_allow(found):
                    return found
                self._unlawful += 1
                return None
            delta = other
        return None

    def _respond(
        self, draw: Draw, contact: FirstContact
    ) -> tuple[PartialSchedule | None, float | None]:
        """Make the two respond: the schedule that fits; else an offset at which they might."""
        threat = self.context.find_threat(self.clause, *contact.pair, until=contact.time)
        both = self._combine_answers(draw, contact, threat)
        if self.pets is None:
            for answers in both:
                found = self._judge_answers(draw, contact, threat, answers)
                if found is not None:
                    return found, None
        delta, rng = contact.second.enters - contact.first.enters, self.context.rng
        for answers in both[:_PAIRS_SOLVED]:
            targets = self._list_targets(answers)
            if any(low - 1e-6 <= delta <= high + 1e-6 for low, high in targets):
                if self.pets is not None:
                    found = self._judge_answers(draw, contact, threat, answers)
                    if found is not None:
                        return found, None
            elif targets:
                low, high = targets[int(rng.integers(len(targets)))]
                return None, float(rng.uniform(low, high))
        return None, None

    def _combine_answers(
        self, draw: Draw, contact: FirstContact, threat: Threat
    ) -> list[tuple[_Answer, _Answer]]:
        """List the ways in which the two answer a threat, each way with each of the other's."""
        answers = [self._list_answers(k, draw.ways[k], contact, threat) for k in (0, 1)]
        ranks = sorted(product(*(range(len(answer)) for answer in answers)), key=sum)
        both = [(answers[0][k], answers[1][n]) for k, n in ranks]
        if bool(draw.ways[0]) != bool(draw.ways[1]):  # else the other could have responded
            both = [each for each in both if each[0][1] or each[1][1]]
        return both

    def _judge_answers(
        self,
        draw: Draw,
        contact: FirstContact,
        threat: Threat,
        answers: tuple[_Answer, _Answer],
    ) -> PartialSchedule | None:
        """Judge what the two do, who must touch soon after the later of their responses."""
        (a, how_a), (b, how_b) = answers
        afters = [how.reaction.after for how in (how_a, how_b) if how is not None]
        onset = np.inf if threat is None or not afters else threat[0] + max(afters)
        latest = min(contact.time + _SHIFT, onset + draw.within)
        return self.judge(Conflict((a, b), threat, latest))

    def _list_targets(self, answers: tuple[_Answer, _Answer]) -> list[tuple[float, float]]:
        """List ranges of offsets [s] at which the two would touch unaware, and responding as they
        do now touch or miss one another as asked."""
        (a, how_a), (b, how_b) = answers
        after = find_meetings(a, b)
        if not len(after) or not len(self._meetings):
            return []
        if self.pets is not None:
            return self._list_misses(after, self.pets, (how_a, how_b))
        both = product(self._meetings.tolist(), after.tolist())
        ranges = [(max(low, least), min(high, most)) for (low, high), (least, most) in both]
        return [(low, high) for low, high in ranges if high - low > STEP]

    def _list_misses(
        self,
        after: Intervals,
        pets: tuple[float, float],
        ways: tuple[Response | None, Response | None],
    ) -> list[tuple[float, float]]:
        """List ranges of offsets [s] at which the two miss one another by these PETs.

        Args:
            after: offsets at which they would touch, responding so.
        """
        least, most = pets
        backs = any(how is not None and how.goes_back for how in ways)
        # Who steps back lets the other pass between where it was and where it will be.
        met = after if backs else np.array([after[:, 0].min(), after[:, 1].max()])
        free = np.concatenate(([-np.inf], met.ravel(), [np.inf])).reshape(-1, 2)
        narrow = [backs or (how is not None and how.gives_way) for how in ways]
        mosts = [min(most, _NARROW) if each else most for each in narrow]
        low, high = float(self._meetings[:, 0].min()), float(self._meetings[:, 1].max())
        ranges = list[tuple[float, float]]()
        for begin, end in (free if self.second is None else free[[-self.second]]).tolist():
            inside = max(begin + least, low + STEP), min(end - least, high - STEP)
            # Shortly before a meeting the first passes second, shortly after one the other.
            sides = (end - mosts[0], end), (begin, begin + mosts[1])
            ranges += [(max(a, inside[0]), min(b, inside[1])) for a, b in sides]
        return [(a, b) for a, b in ranges if a <= b]

    def _list_answers(
        self, k: int, ways: tuple[Response, ...], contact: FirstContact, threat: Threat
    ) -> list[_Answer]:
        """List one of the two responding, each way that is seen; as it is, if it perceives nothing.

        None where it would have to, and cannot.
        """
        agent, name = contact.pair[k], get_pair(self.clause)[k]
        reactions = self.context.reactions
        if threat is None or agent.slowings or not sees(agent, contact.pair[1 - k], threat[0]):
            return [(agent, None)]
        if not reactions.may_react(name) or not ways:
            return [(agent, None)]
        begin = threat[0]
        answers, late = list[_Answer](), 0
        for how in ways:
            if self.pets is None and begin + how.reaction.after > contact.time - _TOO_LATE:
                late += 1
                continue
            changed = self._change(k, how, contact, begin)
            if changed is not None and _is_seen(agent, changed, begin, contact.time):
                answers.append((changed, how))
        return [(agent, None)] if late == len(ways) and name not in reactions.ways else answers

    def _change(
        self, k: int, response: Response, contact: FirstContact, begin: float
    ) -> ScheduledAgent | None:
        """Apply the response; None where it changes nothing.

        Args:
            begin: when the conflict is perceptible [s].
        """
        agent, reaction = contact.pair[k], response.reaction
        kind, rng = agent.candidate.shape.type, np.random.default_rng([self._seed, k])
        paths = find_contact_nodes(contact.first.candidate, contact.second.candidate)
        nodes = (paths.s_a[paths.i], paths.s_b[paths.j])[k]
        onset = begin + reaction.after
        if response.short is not None:
            return self._brake_short(contact.pair, response, response.short, rng)
        if response.goes_back:
            return self._step_back(agent, reaction, float(nodes.min()), begin, contact.time, rng)
        usual, before = find_usual_braking(agent, begin, onset), agent.find_speed(onset)
        least = _WEAKEST[kind] + usual
        if reaction.hurries:
            beyond = float(nodes.max()) + 1.0
            if response.kept is not None:
                beyond = agent.candidate.path.length
            return run_on(
                agent, onset=onset, acceleration=max(reaction.strength, least), until=beyond
            )
        speed = max(_LEAST_SPEED[kind], response.keeps * before)
        if response.kept is not None:
            speed = max(_LEAST_SPEED[kind], min(speed, before - SLOWS_FOR * least))
        braking = max(min(reaction.strength + usual, (before - speed) / SLOWS_FOR), least)
        kept = response.kept or max(float(nodes.min()) - agent.find_place(onset), 1.0)
        changed = slow_down(agent, onset=onset, braking=braking, speed=speed, kept=kept)
        if changed is not None and reaction.swerves:
            aside, other = float(rng.uniform(*ASIDE)), contact.pair[1 - k]
            return swerve_away(changed, agent, other, onset=onset, meets=contact.time, by=aside)
        return changed

    def _brake_short(
        self, pair: Pair, response: Response, short: float, rng: np.random.Generator
    ) -> ScheduledAgent | None:
        """Brake the first so far short of the other's path [m], to a stop until that has passed or
        to a lower speed; None where its way begins too late."""
        (a, b), braking = pair, response.reaction.strength
        zone = find_conflict_zone(a.candidate, b.candidate)
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
        at, speed = zone + into, of.find_speed(until)
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
