"""Collisions in which both react, too late or too weakly (SEMANTICS 8)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from scenewright.scene.constraints import Contact
from scenewright.scene.reaction_behavior import REACTION_TIME, Reaction, ReactionKind
from scenewright.scene.track import STEP
from scenewright.tools.solver.context import SolverContext
from scenewright.tools.solver.impact import FirstContact, find_first_contact
from scenewright.tools.solver.reactions import find_threat, run_on, sees, slow_down
from scenewright.tools.solver.schedule import get_pair
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_DRAWS = 5
"""Reaction times that are drawn for a braking down to a speed."""

_SHARES = (1.0, 0.7, 0.45)
"""Shares of the braking drawn: too weak a braking may be why the two collide."""

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

_SEEN = {"vehicle": 0.7, "cyclist": 0.6, "scooter": 0.6, "pedestrian": 0.3}
"""By how much a reaction must change the speed at least [m/s]."""

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
) -> Reacted | None:
    """Make the two react; return them and their contact; None if no reactions leave it as asked.

    Args:
        drawn: how each of the two reacts, if it perceives the other.
        found: their contact if they did not react.
        wanted: whether a contact is the one asked for.
        both: all that perceive the other react; else one of them suffices.
    """
    threats = _find_threats(clause, context, pair, found)
    if not any(threats):
        return *pair, found
    ways = [_list_ways(pair[k], threats[k], drawn[k], found.time) for k in (0, 1)]
    if not both:
        ways = [[*own, each] for own, each in zip(ways, pair, strict=True)]
    for one, two in sorted(product(range(len(ways[0])), range(len(ways[1]))), key=sum):
        after = (ways[0][one], ways[1][two])
        if after == pair:
            continue
        contact = find_first_contact(*after, left_hand=context.left_hand)
        if contact is None or contact.time - found.time > _SHIFT:
            continue
        if any(_has_stopped(each, contact.time) for each in after):
            continue
        if wanted(*after, contact):
            return *after, contact
    return None


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
        before = float(
            np.interp(float(local[0]), STEP * np.arange(len(a.motion.s)), a.motion.speed)
        )
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
    of: ScheduledAgent, begin: float | None, drawn: Reaction, until: float
) -> list[ScheduledAgent]:
    """List the agent reacting as drawn, then more weakly, then, on foot, in the other way.

    Args:
        begin: when it perceives the other [s], if it does; until: when they touch [s].
    """
    if begin is None or begin + drawn.after > until - _TOO_LATE:
        return [of]
    kinds: list[ReactionKind] = [drawn.kind]
    if of.candidate.shape.type == "pedestrian":
        kinds.append("stops" if drawn.kind == "runs" else "runs")
    ways = [
        _react(of, replace(drawn, kind=kind), begin, share) for kind in kinds for share in _SHARES
    ]
    return [each for each in ways if _is_seen(of, each, until)]


def _is_seen(before: ScheduledAgent, after: ScheduledAgent, until: float) -> bool:
    """Return whether a reaction changes the speed visibly by a time [s]."""
    clock = STEP * np.arange(min(len(before.motion.s), len(after.motion.s)))
    times = clock[clock <= until - before.enters]
    n = len(times)
    most = float(np.abs(after.motion.speed[:n] - before.motion.speed[:n]).max(initial=0.0))
    return most >= _SEEN[before.candidate.shape.type]


def _react(of: ScheduledAgent, how: Reaction, begin: float, share: float) -> ScheduledAgent:
    """Apply the agent's reaction; the same agent where that changes nothing."""
    kind, onset = of.candidate.shape.type, begin + how.after
    strength = max(share * how.strength, _WEAKEST[kind]) + _find_braking(of, onset)
    if how.kind == "runs":
        end = of.candidate.path.length
        runner = run_on(of, onset=onset, acceleration=strength, until=end)
        if runner is not None:
            return runner
    least = _STANDS if kind == "pedestrian" else _LEFT
    kept = of.candidate.path.length
    return slow_down(of, onset=onset, braking=strength, speed=least, kept=kept) or of


def _find_braking(of: ScheduledAgent, time: float) -> float:
    """Compute how hard it brakes anyway at a time, for a bend or a light [m/s^2]."""
    if of.candidate.shape.type == "pedestrian":
        return 0.0
    change = np.gradient(of.motion.speed, STEP)
    at = min(max(round((time - of.enters) / STEP), 0), len(change) - 1)
    return max(float(-change[at]), 0.0)
