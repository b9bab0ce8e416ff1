"""Changes to one agent's motion by hand: where it stands, how long, when it comes."""

from __future__ import annotations

from dataclasses import replace

from scenewright.errors import Rejected
from scenewright.geometry.driving_profile import StopCommand, compute_arrival
from scenewright.scene.rejection import Rejection
from scenewright.scene.selection import SelectedAgent, Stop

_LEAST_STAND = 1.6
"""A standstill lasts at least so long [s], its smoothed ends included."""


def move_stop(agent: SelectedAgent, metres: float) -> SelectedAgent:
    """The agent standing that much further along its path; Rejected if it stands nowhere."""
    stop = _find_stop(agent)
    s = stop.s + metres
    if not 2.0 < s < agent.candidate.path.length - 1.0:
        raise build_rejection(agent.name, f"has no room to stop {metres:+g} m from where it does")
    others = tuple(each for each in agent.stops if each is not stop)
    holds = tuple(StopCommand(each.s, each.until - agent.enters, each.braking) for each in others)
    stands = (
        compute_arrival(agent.candidate, StopCommand(s, 0.0, stop.braking), holds) + agent.enters
    )
    ahead = None if stop.ahead is None else stop.ahead - metres
    moved = replace(
        stop,
        anchor="yield_point",
        s=s,
        start=stands,
        until=max(stop.until, stands + _LEAST_STAND),
        ahead=ahead,
    )
    return replace(agent, stops=_sort_stops(*others, moved))


def extend_stop(agent: SelectedAgent, seconds: float) -> SelectedAgent:
    """The agent standing that much longer; Rejected if it stands nowhere or would not stand.

    An agent that slows down without standing stands that long where it was slowest.
    """
    rolling = _find_slowest(agent)
    if rolling is not None and seconds > 0.0:
        others = tuple(each for each in agent.stops if each is not rolling)
        holds = tuple(StopCommand(e.s, e.until - agent.enters, e.braking) for e in others)
        stands = compute_arrival(agent.candidate, StopCommand(rolling.s, 0.0), holds) + agent.enters
        until = stands + max(seconds, _LEAST_STAND)
        full = replace(rolling, start=stands, until=until, speed=0.0)
        return replace(agent, stops=_sort_stops(*others, full))
    stop = _find_stop(agent)
    until = stop.until + seconds
    if until < stop.start + _LEAST_STAND:
        raise build_rejection(
            agent.name, f"stands for {stop.until - stop.start:.1f} s, which leaves nothing"
        )
    others = tuple(each for each in agent.stops if each is not stop)
    return replace(agent, stops=_sort_stops(*others, replace(stop, until=until)))


def move_time(agent: SelectedAgent, seconds: float) -> SelectedAgent:
    """The agent doing the same that much later, to the step.

    The light's times stay: an agent that came from a red light then comes on green.
    """
    seconds = round(seconds, 1)
    if agent.role == "foreground" and any(stop.at_red for stop in agent.stops):
        # Without its wait at red, as late as before where it gives way, or at its line.
        free = tuple(stop for stop in agent.stops if not stop.at_red)
        last = free[0] if free else agent.stops[-1]
        reaches = compute_arrival(agent.candidate, StopCommand(last.s, 0.0, last.braking))
        at = last.start if free else last.until
        return move_time(replace(agent, enters=round(at - reaches, 1), stops=free), seconds)
    stops = tuple(
        replace(each, start=each.start + seconds, until=each.until + seconds)
        for each in agent.stops
    )
    contact = None if agent.contact is None else agent.contact + seconds
    push = None if agent.push is None else agent.push.shift(seconds)
    enters = round(agent.enters + seconds, 1)
    return replace(agent, enters=enters, stops=stops, contact=contact, push=push)


def _find_stop(agent: SelectedAgent) -> Stop:
    """Where it gives way; else, of the others, where they stand at all."""
    stops = [each for each in agent.stands if each.reason == "gives_way"] or agent.stands
    rolling = _find_slowest(agent)
    if rolling is not None:
        where = "" if rolling.ahead is None else f", {rolling.ahead:.1f} m before the other's way"
        raise build_rejection(
            agent.name,
            f"gives way without standing: it slows to {rolling.speed:.1f} m/s{where}; say 'make it "
            "stop' first, and then where or how long",
        )
    if not stops:
        but = " but at its light" if agent.stops else ""
        raise build_rejection(
            agent.name, f"gives way to no agent and stands nowhere in this scene{but}"
        )
    return stops[0]


def _find_slowest(agent: SelectedAgent) -> Stop | None:
    """The slowest place of an agent that gives way without standing; None for all other agents."""
    yields = [each for each in agent.stops if each.reason == "gives_way"]
    return yields[0] if yields and all(each.rolls for each in yields) else None


def _sort_stops(*stops: Stop) -> tuple[Stop, ...]:
    return tuple(sorted(stops, key=lambda each: each.s))


def build_rejection(name: str, what: str) -> Rejected:
    """The rejection of a change by hand that cannot be."""
    return Rejected(
        Rejection(
            stage="scene_planner", code="contradictory", agents=(name,), detail=f"{name} {what}"
        )
    )
