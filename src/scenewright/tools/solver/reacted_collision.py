"""Collisions in which both react, too late or too weakly (SEMANTICS 8)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from scenewright.scene.constraints import Contact
from scenewright.scene.reaction_behavior import (
    ASIDE,
    REACTION_TIME,
    RUNS,
    Reaction,
)
from scenewright.scene.track import STEP
from scenewright.tools.solver.context import SolverContext
from scenewright.tools.solver.evasions import swerve_away
from scenewright.tools.solver.impact import FirstContact, find_first_contact
from scenewright.tools.solver.reactions import (
    SLOWS_FOR,
    find_speed,
    find_threat,
    find_usual_braking,
    run_on,
    sees,
    slow_down,
)
from scenewright.tools.solver.schedule import get_pair
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_DRAWS = 5
"""Reaction times that are drawn for a braking down to a speed."""

_SOLVED = 4
"""Offsets that are solved for at once."""

_WAYS = ((1.0, 0.0), (0.7, 0.0), (0.45, 0.0), (1.0, 0.65), (0.6, 0.75))
_WAYS_ON_FOOT = {"stops": ((1.0, 0.0), (1.0, 0.5)), RUNS: ((1.0, 0.0), (0.6, 0.0))}
"""Share of the strength drawn, and of its speed that it keeps: too weak or too short a reaction may
be why the two collide."""

_WEAKEST = {"vehicle": 1.3, "cyclist": 1.2, "scooter": 1.2, "pedestrian": 1.0}
"""Braking below this [m/s^2] is hardly a reaction."""

_SHIFT = 2.5
"""How much later than without reactions the contact may come [s]."""

_LEFT, _STANDS = 0.5, 0.1
"""Speed that a vehicle, and a pedestrian, brakes down to if it is not hit before [m/s]."""

_BRAKINGS = (1.0, 7.6)
"""Braking with which a speed at contact may be reached [m/s^2]."""

_TOO_LATE = 0.4
"""A reaction that would begin later than this before the contact [s] does not count."""

_HARDER = 0.95
"""By how much who brakes anyway must brake harder to be seen to react [m/s^2]."""

_SEEN = {"vehicle": 0.7, "cyclist": 0.6, "scooter": 0.6, "pedestrian": 0.3}
"""By how much a reaction must change the speed at least [m/s]."""

IN_VAIN = 3.0
"""Two that both have reacted for longer than this before they touch [s] had time to avoid it."""

_FREEZES = 1.2
"""Longest standstill of a pedestrian before it is struck [s]: who stands longer has stopped."""
_STILL = 0.32
"""Slower than this [m/s] it stands."""

Reacted = tuple[ScheduledAgent, ScheduledAgent, FirstContact]


def react_in_vain(
    clause: Contact,
    context: SolverContext,
    pair: tuple[ScheduledAgent, ScheduledAgent],
    drawn: tuple[Reaction, Reaction],
    found: FirstContact,
    wanted: Callable[[ScheduledAgent, ScheduledAgent, FirstContact], bool],
    *,
    both: bool,
    within: float = np.inf,
) -> Reacted | None:
    """Make the two react; return them and their contact; None if no reactions leave it as asked.

    Args:
        drawn: how each of the two reacts, if it perceives the other.
        found: their contact if they did not react.
        wanted: whether a contact is the one asked for.
        both: all that perceive the other react; else one of them suffices.
        within: longest time from the later reaction to their contact [s].
    """
    threats = _find_threats(clause, context, pair, found)
    if not any(threats):
        return *pair, found
    asked = [name in context.reactions.ways for name in get_pair(clause)]
    ways = [_list_ways(pair, k, threats[k], drawn[k], found.time, asked[k]) for k in (0, 1)]
    onsets = [t + how.after for t, how in zip(threats, drawn, strict=True) if t is not None]
    latest = max(onsets) + within
    if not both:
        ways = [own if asked[k] else [*own, pair[k]] for k, own in enumerate(ways)]
    # The strongest first; those in which one alone reacts last.
    order = sorted(product(range(len(ways[0])), range(len(ways[1]))), key=sum)
    chosen = [(ways[0][one], ways[1][two]) for one, two in order]
    for after in sorted(chosen, key=lambda each: pair[0] in each or pair[1] in each):
        if after == pair:
            continue
        contact = find_first_contact(*after, left_hand=context.left_hand)
        if contact is None or contact.time > min(found.time + _SHIFT, latest):
            continue
        if any(_has_stopped(each, contact.time) for each in after):
            continue
        if wanted(*after, contact):
            return *after, contact
    return None


def solve_offsets(
    clause: Contact,
    context: SolverContext,
    pair: tuple[ScheduledAgent, ScheduledAgent],
    drawn: tuple[Reaction, Reaction],
    found: FirstContact,
) -> list[float]:
    """Find offsets o_b - o_a [s] at which the two touch unreacting and reacting, if they react as
    they would at their offset now; the strongest reactions first."""
    threats = _find_threats(clause, context, pair, found)
    asked = [name in context.reactions.ways for name in get_pair(clause)]
    ways = [_list_ways(pair, k, threats[k], drawn[k], found.time, asked[k]) for k in (0, 1)]
    unreacted, offsets = context.find_meeting_intervals(clause, *pair), list[float]()
    for one, two in sorted(product(range(len(ways[0])), range(len(ways[1]))), key=sum):
        after = (ways[0][one], ways[1][two])
        if after == pair:
            return []
        reacted = context.find_evaded_meetings(clause, *after)
        for (a, b), (c, d) in product(unreacted.tolist(), reacted.tolist()):
            low, high = max(a, c), min(b, d)
            if high - low > STEP:
                offsets.append(float(context.rng.uniform(low, high)))
    return list(dict.fromkeys(round(each, 1) for each in offsets))[:_SOLVED]


def measure_warning(
    clause: Contact,
    context: SolverContext,
    a: ScheduledAgent,
    b: ScheduledAgent,
    found: FirstContact,
) -> float:
    """Measure for how long [s] the two perceive one another before they touch; inf if never."""
    begins = [each for each in _find_threats(clause, context, (a, b), found) if each is not None]
    return found.time - min(begins, default=-np.inf)


def draw_later(name: str, drawn: Reaction, of: ScheduledAgent, context: SolverContext) -> Reaction:
    """Draw another reaction, no sooner: of those who collide more reacted late."""
    again = context.reactions.draw(name, of, context.rng)
    return replace(again, after=max(again.after, drawn.after))


def _has_stopped(of: ScheduledAgent, time: float) -> bool:
    """Return whether a pedestrian has stood for long at a time [s], rather than frozen."""
    if of.candidate.shape.type != "pedestrian":
        return False
    last = round((time - of.enters) / STEP)
    recent = of.motion.speed[max(last - round(_FREEZES / STEP), 0) : last]
    return bool(len(recent) and recent.max() <= _STILL)


def draw_braking_to(
    clause: Contact,
    context: SolverContext,
    pair: tuple[ScheduledAgent, ScheduledAgent],
    found: FirstContact,
    speed: float,
) -> float | None:
    """Compute the braking [m/s^2] that leaves this speed at the contact; None if none does.

    Args:
        speed: at the contact [m/s].
    """
    begin = _find_threats(clause, context, pair, found)[0]
    if begin is None:
        return None
    a = pair[0]
    for _ in range(_DRAWS):
        local = np.array([begin + REACTION_TIME.sample(context.rng), found.time]) - a.enters
        here, there = a.motion.compute_positions(local).tolist()
        before = a.motion.find_speed_at(float(local[0]))
        braking = (before**2 - speed**2) / (2.0 * max(there - here, 1e-3))
        if there > here and _BRAKINGS[0] <= braking <= _BRAKINGS[1]:
            return float(braking)
    return None


def _find_threats(
    clause: Contact,
    context: SolverContext,
    pair: tuple[ScheduledAgent, ScheduledAgent],
    found: FirstContact,
) -> tuple[float | None, float | None]:
    """Find from when on either perceives the other [s]; None if it does not, or must not react."""
    names = get_pair(clause)
    lead = context.reactions.hidden.get(frozenset(names))
    threat = find_threat(context.find_path_conflict(clause), *pair, until=found.time, lead=lead)

    def begin(k: int) -> float | None:
        if threat is None or not context.reactions.may_react(names[k]) or pair[k].slowings:
            return None
        return threat[0] if sees(pair[k], pair[1 - k], threat[0]) else None

    return begin(0), begin(1)


def _list_ways(
    pair: tuple[ScheduledAgent, ScheduledAgent],
    k: int,
    begin: float | None,
    drawn: Reaction,
    until: float,
    asked: bool,
) -> list[ScheduledAgent]:
    """List the agent reacting as drawn, then less, then, on foot and unasked, in the other way.

    Args:
        k: which of the two; begin: when it perceives the other [s], if it does.
        until: when they touch [s]; asked: the text says how it reacts.
    """
    of = pair[k]
    if begin is None or begin + drawn.after > until - _TOO_LATE:
        return [] if asked else [of]
    kinds: list[str] = [drawn.kind]
    if of.candidate.shape.type == "pedestrian" and not asked:
        kinds.append("stops" if drawn.hurries else RUNS)
    ways = [
        _react(of, replace(drawn, kind=kind, strength=share * drawn.strength), begin, keeps)
        for kind in kinds
        for share, keeps in _WAYS_ON_FOOT.get(kind, _WAYS)
    ]
    if drawn.swerves:
        moved = [
            swerve_away(each, of, pair[1 - k], onset=begin + drawn.after, meets=until, by=aside)
            for each in ways
            for aside in (ASIDE[1], ASIDE[0])
        ]
        ways = [each for each in moved if each is not None]
    return [each for each in ways if _is_seen(of, each, begin, until)]


def _is_seen(before: ScheduledAgent, after: ScheduledAgent, begin: float, until: float) -> bool:
    """Return whether a reaction to what is perceptible from `begin` on shows by a time [s]."""
    clock = min(before.motion.clock, after.motion.clock, key=len)
    times = clock[clock <= until - before.enters]
    n = len(times)
    most = float(np.abs(after.motion.speed[:n] - before.motion.speed[:n]).max(initial=0.0))
    seen = most >= _SEEN[before.candidate.shape.type]
    if before.candidate.shape.type == "pedestrian" or not seen:
        return seen
    since = after.motion.acceleration[:n][times > begin - before.enters]
    usual = find_usual_braking(before, begin, begin)
    return bool(len(since)) and float(since.min()) < -usual - _HARDER


def _react(of: ScheduledAgent, how: Reaction, begin: float, keeps: float) -> ScheduledAgent:
    """Apply the agent's reaction; the same agent where that changes nothing.

    Args:
        keeps: share of its speed that it keeps.
    """
    kind, onset = of.candidate.shape.type, begin + how.after
    usual, before = find_usual_braking(of, begin, onset), find_speed(of, onset)
    strength = max(how.strength, _WEAKEST[kind]) + usual
    if how.hurries:
        end = of.candidate.path.length
        runner = run_on(of, onset=onset, acceleration=strength, until=end)
        if runner is not None:
            return runner
    least = max(_STANDS if kind == "pedestrian" else _LEFT, keeps * before)
    strength = min(strength, max((before - least) / SLOWS_FOR, _WEAKEST[kind] + usual))
    kept = of.candidate.path.length
    return slow_down(of, onset=onset, braking=strength, speed=least, kept=kept) or of
