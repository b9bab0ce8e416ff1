"""`contact`: two agents collide with the conflict type, speed and impact point asked for."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from scenewright.scene.base import RIDERS
from scenewright.scene.constraints import Contact
from scenewright.scene.kinds import find_kind, has_trait, load_function
from scenewright.scene.reaction_behavior import Reaction
from scenewright.scene.selection import Slowing
from scenewright.scene.track import STEP
from scenewright.tools.solver.context import SolverContext
from scenewright.tools.solver.impact import FirstContact, find_first_contact
from scenewright.tools.solver.nearest_miss import FailureStage
from scenewright.tools.solver.path_conflict import Intervals
from scenewright.tools.solver.reacted_collision import (
    IN_VAIN,
    draw_braking_to,
    draw_later,
    measure_warning,
    react_in_vain,
    solve_offsets,
)
from scenewright.tools.solver.reactions import SEEN_BEFORE, find_threat
from scenewright.tools.solver.rear_end import (
    TURNED,
    compute_passing_time,
    plan_rear_ends,
)
from scenewright.tools.solver.schedule import PartialSchedule, ScheduledEvent, get_pair
from scenewright.tools.solver.scheduled_agent import ScheduledAgent
from scenewright.tools.solver.stepping_back import (
    find_one_stepping_back,
    schedule_struck_steps_back,
)
from scenewright.work_limit import count_work

_TRIES, _ROUNDS, _PROMPT = 6, 5, 2
"""Offsets that are drawn; rounds in which some are solved for at which both may react; and of these
the first ones, in which neither reacts long before."""

_MOST_STEPS = 3
"""Schedules with a step back that are offered."""

_SMOOTHED = 0.4
"""How much smoothing keeps a short slowing above its speed [m/s]."""

_LATE = (0.4, 0.7)
"""Share of the speed left at the impact when braking late."""

_SPEED_OFF = 0.4
"""How far the speed at impact may lie from the one asked for [m/s]."""


_Failed = tuple[ScheduledAgent, ScheduledAgent, FirstContact]
"""Two that would touch, but not if both reacted."""


@dataclass(frozen=True)
class _Trial:
    """An offset o_b - o_a [s] to try, and how the two react.

    Attributes:
        both: all that perceive the other react; else one of them suffices.
        within: longest time from the later reaction to their contact [s].
        solved: for those reactions: how they would touch without them does not matter.
    """

    delta: float
    drawn: tuple[Reaction, Reaction]
    both: bool
    within: float = np.inf
    solved: bool = False


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
    back = find_one_stepping_back(clause, context)
    if back is not None:
        wanted = _make_test(clause, context.find_striker(clause), strict=True)
        hits = schedule_struck_steps_back(clause, schedule, context, (a, b), back, wanted)
        yield from islice(hits, _MOST_STEPS)
        return
    if clause.kind != "rear_end":
        meetings = context.find_meeting_intervals(clause, a, b)
        if not len(meetings):
            words = f"the paths of {clause.first} and {clause.second} never touch"
            context.note_miss(clause, FailureStage.PATHS, words)
        some = _draw_offsets_inside(clause, meetings, context)
        turned_round = yield from schedule_offsets(clause, schedule, context, (a, b), some)
        if turned_round:
            # Which one strikes depends on 0.1 s where one is short, such as a motorcycle.
            every = _draw_offsets_everywhere(meetings, context)
            failed = yield from schedule_offsets(clause, schedule, context, (a, b), every)
            if failed and context.find_striker(clause) is None and not _needs_striker(clause):
                yield from schedule_offsets(clause, schedule, context, (a, b), some, strict=False)
        return
    for follower, leader, deltas in plan_rear_ends(a, b, clause, context):
        yield from schedule_offsets(clause, schedule, context, (follower, leader), deltas)


def schedule_offsets(
    clause: Contact,
    schedule: PartialSchedule,
    context: SolverContext,
    pair: tuple[ScheduledAgent, ScheduledAgent],
    deltas: list[float],
    *,
    strict: bool = True,
) -> Generator[PartialSchedule, None, bool]:
    """Schedule those offsets that fit; returns whether all failed, but for the striking agent.

    Args:
        strict: the clause's first agent strikes, also where either may.
    """
    striker = context.find_striker(clause)
    is_wanted = _make_test(clause, striker, strict=strict)
    scheduled = turned_round = False
    # Drawn once: a new draw for every offset would favour slow ones, as those collide.
    one, two = get_pair(clause)
    drawn = (
        context.reactions.draw(one, pair[0], context.rng),
        context.reactions.draw(two, pair[1], context.rng),
    )
    taken, failed = set[float](), list[_Failed]()
    tried = 0
    for trial in _list_trials(clause, context, deltas, drawn, failed):
        both, delta = trial.both, trial.delta
        if delta in taken:
            continue
        a, b = schedule.place(clause, *pair, delta)
        found = find_first_contact(a, b, left_hand=context.left_hand)
        if found is not None and clause.speed is not None and not a.slowings:
            a, found = _brake_to_impact_speed(clause, a, b, found, context)
        if found is None:
            continue
        tried += 1
        count_work(tried % 4 == 0)  # four of them take as long as other steps of the search
        fault = _find_fault(found, clause, a, striker, strict=strict)
        if fault is not None and not trial.solved:
            reached, words, off = fault
            context.note_miss(clause, reached, words, off=off)
            turned_round |= reached is FailureStage.ROLES
            continue
        if not _is_in_time(found, clause, b, schedule, context):
            continue
        a, found = _brake_in_last_moment(clause, a, b, found, context)
        if has_trait("cause", clause.cause, "late") and not a.slowings:
            words = f"{clause.first} would no longer hit {clause.second} so if it braked hard"
            context.note_miss(clause, FailureStage.COMPANY, words)
            continue
        reacted = react_in_vain(
            clause, context, (a, b), trial.drawn, found, is_wanted, both=both, within=trial.within
        )
        if reacted is None and both:
            failed.append((a, b, found))
        if (reacted is None and both) or (reacted is not None and not is_wanted(*reacted)):
            continue
        if reacted is None and not context.lenient:
            words = f"{clause.first} and {clause.second} would not touch so if they reacted"
            context.note_miss(clause, FailureStage.COMPANY, words)
            continue
        scheduled = True
        taken.add(delta)
        yield _add_contact(clause, schedule, context, (a, b, found), reacted or (a, b, found))
    return turned_round and not scheduled


def _add_contact(
    clause: Contact,
    schedule: PartialSchedule,
    context: SolverContext,
    unaware: _Failed,
    reacted: _Failed,
) -> PartialSchedule:
    """The schedule with the contact of two as they react to one another.

    Args:
        unaware: the two and their contact if neither reacted, which says when the threat begins.
    """
    a, b, found = unaware
    threat = find_threat(context.find_path_conflict(clause), a, b, until=found.time)
    a, b, found = reacted
    time = found.time
    begins = min(time - 3.0, time if threat is None else threat[0] - SEEN_BEFORE)
    event = ScheduledEvent(clause, time, begins, time, time, found.location)
    return schedule.add_event(event, a.end_at(time), b.end_at(time))


def _list_trials(
    clause: Contact,
    context: SolverContext,
    deltas: list[float],
    drawn: tuple[Reaction, Reaction],
    failed: list[_Failed],
) -> Iterator[_Trial]:
    """List what to try: both react, or, last, at least one of them.

    Args:
        failed: gets those at which both cannot, from which others are solved for: with the
            reactions drawn, then with later ones.
    """
    yield from (_Trial(delta, drawn, both=True, within=IN_VAIN) for delta in deltas)
    reactions = drawn
    for n in range(_ROUNDS if failed else 0):
        within = IN_VAIN if n < _PROMPT else np.inf
        a, b, found = min(failed, key=lambda each: measure_warning(clause, context, *each))
        solved = solve_offsets(clause, context, (a, b), reactions, found)
        yield from (_Trial(delta, reactions, True, within, solved=True) for delta in solved)
        names, (one, two) = get_pair(clause), reactions
        reactions = draw_later(names[0], one, a, context), draw_later(names[1], two, b, context)
    yield from (_Trial(delta, drawn, both=False) for delta in deltas)


def _draw_offsets_inside(
    clause: Contact, meetings: Intervals, context: SolverContext
) -> list[float]:
    """Draw offsets inside the intervals, those near the middle first more often.

    Where the vehicles strike follows from the offset, so a point asked for has all of them tried.
    """
    rng = context.rng
    if clause.point_first or clause.point_second or context.wants_impact_point(clause):
        return _draw_offsets_everywhere(meetings, context)
    share = 0.5 + 0.45 * np.sort(rng.uniform(-1, 1, _TRIES))[np.argsort(rng.random(_TRIES))]
    return [float(low + (high - low) * x) for low, high in meetings for x in share]


def _draw_offsets_everywhere(meetings: Intervals, context: SolverContext) -> list[float]:
    """Draw offsets all over the intervals, in any order."""
    every = [np.arange(low, high, STEP) for low, high in meetings]
    return context.rng.permutation(np.concatenate(every)).tolist() if every else []


def _is_in_time(
    found: FirstContact,
    clause: Contact,
    b: ScheduledAgent,
    schedule: PartialSchedule,
    context: SolverContext,
) -> bool:
    """Return whether the contact comes after earlier events of its agents, and note if it does not.

    A leader that gives way is hit where it stands, once the other has passed.
    """
    if clause.kind == "rear_end" and any(stop.reason == "gives_way" for stop in b.stops):
        busy, latest = schedule.find_busy_end(clause.first), b.stops[-1].until + 0.2
        earliest = max(busy + 0.5, compute_passing_time(b))
    else:
        busy, latest = max(map(schedule.find_busy_end, get_pair(clause))), float("inf")
        earliest = busy + 0.5
    if earliest <= found.time <= latest:
        return True
    late = earliest - found.time
    words = f"it would come {late:.1f} s before {clause.first} and {clause.second} are free for it"
    if late < 0.0:
        words = f"it would come {found.time - latest:.1f} s after {clause.second} has gone on"
    context.note_miss(clause, FailureStage.COMPANY, words, off=abs(late))
    return False


def _brake_in_last_moment(
    clause: Contact,
    a: ScheduledAgent,
    b: ScheduledAgent,
    found: FirstContact,
    context: SolverContext,
) -> tuple[ScheduledAgent, FirstContact]:
    """Make the striking vehicle brake hard in the last moment where that is asked for."""
    asked = has_trait("cause", clause.cause, "late")
    if a.candidate.shape.type != "vehicle" or a.slowings or not asked:
        return a, found
    speed = found.speed * float(context.rng.uniform(*_LATE))
    braked, again = _brake_late(a, b, found, speed, context)
    if (
        again is None
        or _find_fault(again, clause, a, context.find_striker(clause)) is not None
        or abs(again.time - found.time) > 0.6
    ):
        return a, found
    return braked, again


def _brake_to_impact_speed(
    clause: Contact,
    a: ScheduledAgent,
    b: ScheduledAgent,
    found: FirstContact,
    context: SolverContext,
) -> tuple[ScheduledAgent, FirstContact | None]:
    """Brake the striking vehicle to the speed asked for, if it would be faster.

    It reacts to the other, where the reaction time leaves as much braking as that takes.
    """
    speed = clause.speed or 0.0
    if found.speed < speed + _SMOOTHED or a.candidate.shape.type in RIDERS:
        return a, found
    aim = max(speed - _SMOOTHED, 0.5)
    braking = draw_braking_to(clause, context, (a, b), found, aim)
    return _brake_late(a, b, found, aim, context, braking)


def _brake_late(
    a: ScheduledAgent,
    b: ScheduledAgent,
    found: FirstContact,
    speed: float,
    context: SolverContext,
    braking: float | None = None,
) -> tuple[ScheduledAgent, FirstContact | None]:
    """Return `a` braking late to `speed` where it would have touched, and its contact then."""
    at = float(a.motion.compute_positions(np.array([found.time - a.enters]))[0])
    slow = Slowing(at, speed, braking or float(context.rng.uniform(4.0, 6.0)))
    braked = a.edit(stops=a.stops, slowings=(slow,))
    return braked, find_first_contact(braked, b, left_hand=context.left_hand)


def _make_test(
    clause: Contact, striker: int | None, *, strict: bool
) -> Callable[[ScheduledAgent, ScheduledAgent, FirstContact], bool]:
    """Build a test of whether the contact of two placed agents is the one asked for."""

    def is_wanted(a: ScheduledAgent, _b: ScheduledAgent, found: FirstContact) -> bool:
        return _find_fault(found, clause, a, striker, strict=strict) is None

    return is_wanted


def _find_fault(
    found: FirstContact,
    clause: Contact,
    a: ScheduledAgent,
    striker: int | None,
    *,
    strict: bool = False,
) -> tuple[FailureStage, str, float] | None:
    """Find why a contact is not the one asked for, and by how much; None if it is.

    Args:
        striker: which of the two must strike: 0, 1, or None where that is not asked for.
    """
    first, second = pair = get_pair(clause)
    if clause.kind not in (None, found.kind):
        kind = found.kind or "none of the kinds for sure"
        return FailureStage.KIND, f"{first} and {second} touch as {kind}", 0.0
    if found.kind == "rear_end" and _is_before_turn(a, found):
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
        words = (
            f"a target impact speed of {clause.speed:g} m/s: the {extreme} "
            f"{a.candidate.subtype or a.candidate.shape.type} on this movement strikes at "
            f"{found.speed:.1f} m/s"
        )
        return FailureStage.MEASURE, words, abs(found.speed - clause.speed)
    least = 2.5 if found.kind == "pedestrian_strike" else 1.3
    if found.closing < least:
        words = f"a relative speed of {least:g} m/s at contact: they reach {found.closing:.1f} m/s"
        return FailureStage.MEASURE, words, least - found.closing
    return None


def _is_before_turn(a: ScheduledAgent, found: FirstContact) -> bool:
    """Whether a contact comes before who turns is seen to turn."""
    heading = a.candidate.path.heading
    if np.abs(heading - heading[0]).max() < TURNED:
        return False
    at_contact = float(a.get_poses(np.array([found.time]))[0][2])
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
