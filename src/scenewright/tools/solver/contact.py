"""`contact`: two agents collide with the conflict type, speed and impact point asked for."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from scenewright.scene.base import RIDERS
from scenewright.scene.constraints import Contact
from scenewright.scene.kinds import find_kind, has_trait, load_function
from scenewright.scene.reaction_behavior import REACTION_TIME, RUNS, Reaction
from scenewright.scene.selection import Slowing
from scenewright.scene.track import STEP
from scenewright.tools.solver.conflicts import Conflict, ConflictSampler, Draw, Pair, Response
from scenewright.tools.solver.context import FailureStage, SolverContext, find_meetings
from scenewright.tools.solver.following import (
    TURNED,
    compute_passing_time,
    plan_lead_braking,
    plan_rear_ends,
)
from scenewright.tools.solver.impact import FirstContact
from scenewright.tools.solver.path_conflict import Intervals
from scenewright.tools.solver.reactions import SEEN_BEFORE, sees
from scenewright.tools.solver.scheduled_agent import (
    PartialSchedule,
    ScheduledAgent,
    ScheduledEvent,
    get_pair,
)

_TRIES, _ROUNDS, _PROMPT, _MANY = 6, 4, 2, 20
"""Offsets that are drawn; rounds of reactions to each, the first of which prompt ones; and offsets
so many that one round is enough."""

_WAYS = ((1.0, 0.0), (0.7, 0.0), (0.45, 0.0), (1.0, 0.65), (0.6, 0.75))
_WAYS_ON_FOOT = ((1.0, 0.0), (0.6, 0.0), (1.0, 0.5))
"""Share of the strength drawn, and of its speed that who reacts keeps."""

_SMOOTHED = 0.4
"""How much smoothing keeps a short slowing above its speed [m/s]."""

_LATE, _BRAKES_LATE = (0.4, 0.7), (4.0, 6.0)
"""Share of the speed left at the impact when braking late; and braking [m/s^2]."""

_DRAWS, _BRAKINGS = 5, (1.0, 7.6)
"""Reaction times that are drawn for a braking down to a speed, and that braking [m/s^2]."""

_SPEED_OFF = 0.4
"""How far the speed at impact may lie from the one asked for [m/s]."""

IN_VAIN = 3.0
"""Two that both have reacted for longer than this before they touch [s] had time to avoid it."""

_FREEZES, _STILL = 1.2, 0.32
"""Longest standstill of a pedestrian before it is struck [s]: who stands longer has stopped; and
the speed below which it stands [m/s]."""

_GONE_BACK = 0.35
"""How far who steps back has gone back at least when it is hit [m]."""


def schedule_contacts(
    clause: Contact, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the clause's two agents collide as asked."""
    kind = find_kind("manoeuvre", clause.cause)
    if kind is not None and kind.template is not None:
        yield from load_function(kind.template, __package__)(clause, schedule, context)
        return
    a, b = context.get_pair(clause, schedule)
    if context.refuse_after_collision(clause, a, b):
        return
    if clause.kind == "rear_end":
        for follower, leader, deltas in plan_rear_ends(a, b, clause, context):
            yield from _schedule_offsets(clause, schedule, context, (follower, leader), deltas)
        return
    meetings = find_meetings(a, b)
    if not len(meetings):
        context.note_paths_apart(clause)
    some, every = (draw(meetings, context) for draw in (_draw_inside, _draw_everywhere))
    ways = [context.reactions.ways.get(name) for name in get_pair(clause)]
    points = clause.point_first or clause.point_second or context.wants_impact_point(clause)
    if points or any(has_trait("reaction", way, "back") for way in ways):
        some = every
    # Which one strikes depends on 0.1 s where one is short, such as a motorcycle.
    passes = [(some, True), (every, True)]
    if context.find_striker(clause) is None and not _needs_striker(clause):
        passes.append((some, False))
    for deltas, strict in passes:
        turned_round = yield from _schedule_offsets(
            clause, schedule, context, (a, b), deltas, strict=strict
        )
        if not turned_round:
            return


def schedule_lead_braking(
    clause: Contact, schedule: PartialSchedule, context: SolverContext
) -> Iterator[PartialSchedule]:
    """List every schedule (lazily) in which the first hits the second, which brakes ahead of it."""
    a, b = context.get_pair(clause, schedule)
    if not context.refuse_after_collision(clause, a, b):
        for follower, leader, deltas in plan_lead_braking(a, b, clause, context):
            yield from _schedule_offsets(clause, schedule, context, (follower, leader), deltas)


def _schedule_offsets(
    clause: Contact,
    schedule: PartialSchedule,
    context: SolverContext,
    pair: Pair,
    deltas: list[float],
    *,
    strict: bool = True,
) -> Generator[PartialSchedule, None, bool]:
    """Schedule those offsets that fit; returns whether all failed, but for the striking agent.

    Args:
        strict: the clause's first agent strikes, also where either may.
    """
    sampler = _ContactSampler(clause, schedule, context, pair, strict=strict)
    scheduled = False
    for found in sampler.sample(_list_draws(clause, context, pair, deltas)):
        scheduled = True
        yield found
    return sampler.turned_round and not scheduled


def _list_draws(
    clause: Contact, context: SolverContext, pair: Pair, deltas: list[float]
) -> Iterator[Draw]:
    """List what to try at each offset: both respond; later ones, as of those who collide more
    respond late; one of them does; last, neither."""
    asked = [context.reactions.ways.get(name) for name in get_pair(clause)]

    def draw() -> list[Reaction]:
        both = zip(get_pair(clause), pair, strict=True)
        return [context.reactions.draw(name, of, context.rng) for name, of in both]

    drawn = draw()
    for n in range(_ROUNDS if len(deltas) <= _MANY else 1):
        # Drawn once a round: a new draw for every offset would favour slow ones.
        ways = (_vary(drawn[0], pair[0], asked[0]), _vary(drawn[1], pair[1], asked[1]))
        yield from (Draw(delta, ways, IN_VAIN if n < _PROMPT else np.inf) for delta in deltas)
        drawn = [
            replace(new, after=max(new.after, old.after))
            for new, old in zip(draw(), drawn, strict=True)
        ]
    for alone in ((ways[0], ()), ((), ways[1]), ((), ())):
        ignored = any(must and not way for way, must in zip(alone, asked, strict=True))
        if not ignored and (any(alone) or context.lenient):
            yield from (Draw(delta, alone) for delta in deltas)


def _vary(drawn: Reaction, of: ScheduledAgent, asked: str | None) -> tuple[Response, ...]:
    """List the reaction as drawn, then weaker ones, as that may be why they touch; then, on foot
    and unasked, the other way to react."""
    away = of.candidate.path.length
    if has_trait("reaction", drawn.kind, "back"):
        return (Response(drawn, 0.0),)
    kinds = [drawn.kind]
    if of.candidate.shape.type == "pedestrian" and asked is None:
        kinds.append("stops" if drawn.hurries else RUNS)
    ways = _WAYS_ON_FOOT if of.candidate.shape.type == "pedestrian" else _WAYS
    return tuple(
        Response(replace(drawn, kind=kind, strength=share * drawn.strength), keeps, away)
        for kind in kinds
        for share, keeps in ways
    )


def _draw_inside(meetings: Intervals, context: SolverContext) -> list[float]:
    """Draw offsets inside the intervals, those near the middle first more often."""
    rng = context.rng
    share = 0.5 + 0.45 * np.sort(rng.uniform(-1, 1, _TRIES))[np.argsort(rng.random(_TRIES))]
    return [float(low + (high - low) * x) for low, high in meetings for x in share]


def _draw_everywhere(meetings: Intervals, context: SolverContext) -> list[float]:
    """Draw offsets all over the intervals, in any order: where one strikes follows from them."""
    every = [np.arange(low, high, STEP) for low, high in meetings]
    return context.rng.permutation(np.concatenate(every)).tolist() if every else []


@dataclass(eq=False)
class _ContactSampler(ConflictSampler):
    """Samples conflicts in which the clause's two agents touch as asked.

    Attributes:
        strict: the clause's first agent strikes, also where either may.
        turned_round: some contact was as asked but for the striking agent.
    """

    clause: Contact
    strict: bool = field(default=True, kw_only=True)
    turned_round: bool = field(default=False, init=False)

    def prepare(self, contact: FirstContact, *, first: bool) -> FirstContact | None:
        """Brake the striking vehicle as asked; None if the contact cannot be as asked."""
        clause, speed = self.clause, self.clause.speed
        braked: FirstContact | None = contact
        a = contact.first
        slower = speed is not None and contact.speed >= speed + _SMOOTHED
        if speed and slower and not a.slowings and a.candidate.shape.type not in RIDERS:
            # It reacts to the other, where the reaction time leaves as much braking as that takes.
            aim = max(speed - _SMOOTHED, 0.5)
            braked = self._brake_late(contact, aim, self._draw_braking(contact, aim))
        if braked is None or (first and self._has_fault(braked)):
            return None
        if not self._is_in_time(braked):
            return None
        if not has_trait("cause", clause.cause, "late") or braked.first.slowings:
            return braked
        aim = braked.speed * float(self.context.rng.uniform(*_LATE))
        later = self._brake_late(braked, aim, None)
        if later is None or self._has_fault(later) or abs(later.time - braked.time) > 0.6:
            words = f"{clause.first} would no longer hit {clause.second} so if it braked hard"
            self.context.note_miss(clause, FailureStage.COMPANY, words)
            return None
        return later

    def judge(self, conflict: Conflict) -> PartialSchedule | None:
        """Return the schedule with the contact of the two; None if it is not as asked."""
        pair, threat = conflict.pair, conflict.threat
        contact = self.context.find_first_contact(*pair)
        if contact is None or contact.time > conflict.latest or self._has_fault(contact):
            return None
        time = contact.time
        if any(_has_stopped(agent, time) or not _is_back(agent, time) for agent in pair):
            return None
        if self.schedule.is_too_soon(time, self.clause) and self.clause.kind != "rear_end":
            return None
        begins = min(time - 3.0, time if threat is None else threat[0] - SEEN_BEFORE)
        event = ScheduledEvent(self.clause, time, begins, time, time, contact.location)
        return self.schedule.add_event(event, *(agent.end_at(time) for agent in pair))

    def _has_fault(self, contact: FirstContact) -> bool:
        striker = self.context.find_striker(self.clause)
        fault = _find_fault(contact, self.clause, striker, strict=self.strict)
        if fault is not None:
            reached, words, off = fault
            self.context.note_miss(self.clause, reached, words, off=off)
            self.turned_round |= reached is FailureStage.ROLES
        return fault is not None

    def _is_in_time(self, contact: FirstContact) -> bool:
        """Return whether the contact comes after earlier events of its agents; else note it.

        A leader that gives way is hit where it stands, once the other has passed.
        """
        clause, schedule, leader = self.clause, self.schedule, contact.second
        if clause.kind == "rear_end" and any(stop.reason == "gives_way" for stop in leader.stops):
            busy, latest = schedule.find_busy_end(clause.first), leader.stops[-1].until + 0.2
            earliest = max(busy + 0.5, compute_passing_time(leader))
        else:
            busy, latest = max(map(schedule.find_busy_end, get_pair(clause))), float("inf")
            earliest = busy + 0.5
        if earliest <= contact.time <= latest:
            return True
        late, pair = earliest - contact.time, f"{clause.first} and {clause.second}"
        words = f"it would come {late:.1f} s before {pair} are free for it"
        if late < 0.0:
            words = f"it would come {contact.time - latest:.1f} s after {clause.second} has gone on"
        self.context.note_miss(clause, FailureStage.COMPANY, words, off=abs(late))
        return False

    def _brake_late(
        self, contact: FirstContact, speed: float, braking: float | None
    ) -> FirstContact | None:
        """Return the contact if the first brakes to `speed` where it would have touched."""
        a, b = contact.pair
        at = a.find_place(contact.time)
        slow = Slowing(at, speed, braking or float(self.context.rng.uniform(*_BRAKES_LATE)))
        return self.context.find_first_contact(a.edit(stops=a.stops, slowings=(slow,)), b)

    def _draw_braking(self, contact: FirstContact, speed: float) -> float | None:
        """Draw a braking [m/s^2], a reaction time after the threat, that leaves this speed at the
        contact [m/s]; None if none does."""
        (a, b), context = contact.pair, self.context
        threat = context.find_threat(self.clause, a, b, until=contact.time)
        if threat is None or not context.reactions.may_react(self.clause.first):
            return None
        if not sees(a, b, threat[0]):
            return None
        there = a.find_place(contact.time)
        for _ in range(_DRAWS):
            onset = threat[0] + REACTION_TIME.sample(context.rng)
            here, before = a.find_place(onset), a.find_speed(onset)
            braking = (before**2 - speed**2) / (2.0 * max(there - here, 1e-3))
            if there > here and _BRAKINGS[0] <= braking <= _BRAKINGS[1]:
                return float(braking)
        return None


def _is_back(of: ScheduledAgent, time: float) -> bool:
    """Return whether who steps back, if it does, has done so by a time [s]."""
    steps = of.candidate.shape.type == "pedestrian" and of.candidate.unevaded is not None
    return not steps or of.find_place(time) > of.slowings[-3].s + _GONE_BACK


def _has_stopped(of: ScheduledAgent, time: float) -> bool:
    """Return whether a pedestrian has stood for long at a time [s], rather than frozen."""
    if of.candidate.shape.type != "pedestrian":
        return False
    last = round((time - of.enters) / STEP)
    recent = of.motion.speed[max(last - round(_FREEZES / STEP), 0) : last]
    return bool(len(recent) and recent.max() <= _STILL)


def _find_fault(
    found: FirstContact, clause: Contact, striker: int | None, *, strict: bool
) -> tuple[FailureStage, str, float] | None:
    """Find why a contact is not the one asked for, and by how much; None if it is.

    Args:
        striker: which of the two must strike: 0, 1, or None where that is not asked for.
    """
    first, second = pair = get_pair(clause)
    if clause.kind not in (None, found.kind):
        kind = found.kind or "none of the kinds for sure"
        return FailureStage.KIND, f"{first} and {second} touch as {kind}", 0.0
    if found.kind == "rear_end" and _is_before_turn(found):
        return FailureStage.PLACE, f"{first} strikes before it turns", 0.0
    if _is_wrong_striker(found, clause, striker, strict=strict):
        strikes, struck = pair if striker == 1 else pair[::-1]
        words = f"{strikes} strikes {struck}, not the other way round"
        return FailureStage.ROLES, words, 0.0
    asked_points = (first, clause.point_first), (second, clause.point_second)
    for n, (name, point) in enumerate(asked_points):
        if point is not None and point not in (seen := found.points[n]):
            there = " or ".join(each.replace("_", " ") for each in seen) or "another place"
            asked = point.replace("_", " ")
            return FailureStage.PLACE, f"a contact at the {asked} of {name}: found at {there}", 0.0
    if clause.speed is not None and abs(found.speed - clause.speed) > _SPEED_OFF:
        extreme = "fastest" if found.speed < clause.speed else "slowest"
        candidate = found.first.candidate
        words = (
            f"a target impact speed of {clause.speed:g} m/s: the {extreme} "
            f"{candidate.subtype or candidate.shape.type} on this movement strikes at "
            f"{found.speed:.1f} m/s"
        )
        return FailureStage.MEASURE, words, abs(found.speed - clause.speed)
    least = 2.5 if found.kind == "pedestrian_strike" else 1.3
    if found.closing < least:
        words = f"a relative speed of {least:g} m/s at contact: they reach {found.closing:.1f} m/s"
        return FailureStage.MEASURE, words, least - found.closing
    return None


def _is_before_turn(contact: FirstContact) -> bool:
    """Whether a contact comes before who turns is seen to turn."""
    heading = contact.first.candidate.path.heading
    if np.abs(heading - heading[0]).max() < TURNED:
        return False
    _, _, at_contact = contact.first.get_pose_at(contact.time)
    return bool(np.cos(at_contact - heading[0]) > np.cos(TURNED - 0.1))


def _is_wrong_striker(
    found: FirstContact, clause: Contact, striker: int | None, *, strict: bool
) -> bool:
    """Return whether the wrong one of the two strikes.

    Where it is not asked for, the clause's first agent does; side by side and head-on it is only
    preferred.
    """
    if striker is not None:
        return found.strikes == (striker == 1)
    return not found.frontal if _needs_striker(clause) else strict and not found.strikes


def _needs_striker(clause: Contact) -> bool:
    """Return whether `first` must be the striking agent."""
    with_front = clause.point_first is None or clause.point_first.startswith("front")
    with_front &= not clause.first.startswith("pedestrian")
    return with_front and clause.kind not in ("sideswipe", "head_on")
