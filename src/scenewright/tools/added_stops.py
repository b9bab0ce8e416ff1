"""Standstills that words ask for ("hesitates", "stops twice"), put into the selected motions.

An agent that stands on its way to what the solver found for it enters the scene as much earlier as
it loses: it comes to its own stop, to its event or to its contact when it was to. Behind these it
simply loses the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from operator import itemgetter

import numpy as np

from scenewright.errors import Rejected
from scenewright.geometry.driving_profile import StopCommand, compute_arrival, compute_motion
from scenewright.geometry.map_areas import MapAreas
from scenewright.scene.behavior import Anchor
from scenewright.scene.rejection import Rejection, RejectionCode
from scenewright.scene.remaining import AddedStop, AddedStops
from scenewright.scene.selection import SelectedAgent, Selection, Stop
from scenewright.scene.track import STEP
from scenewright.tools.event_summary import summarise
from scenewright.tools.segment_editor import get_motion_edits, make_stop_command

ASKED = "asked"
"""Reason of a standstill that words ask for."""

_APART = 1.0
"""Least way between two standstills [m]."""

_IN_VIEW = 0.2
"""How long before the standstill, and after it, the agent is to be seen [s]."""

_AT = 0.1
"""So near a place an agent has come to it [m]."""


def place_stops(
    added: AddedStops, selection: Selection, *, map_areas: MapAreas
) -> tuple[AddedStops, Selection]:
    """The standstills with their times, and the selection in which the agents keep them.

    Raises:
        Rejected: `unknown_anchor`, or `segment_off_track` where the tracks have no room for one;
            not repairable where other tracks might.
    """
    if not added.stops:
        return added, selection
    anchors = {
        agent.agent: agent.anchors for agent in summarise(selection, map_areas=map_areas).agents
    }
    agents: dict[str, SelectedAgent] = dict(selection.agents)
    placed: dict[int, Stop] = {}
    for name in dict.fromkeys(stop.agent for stop in added.stops):
        own = [stop for stop in added.stops if stop.agent == name]
        located = ((_find_arc_length(each, anchors[name]), each) for each in own)
        asked = sorted(located, key=itemgetter(0))
        agents[name], stops = _add_stops(agents[name], asked, selection)
        placed |= {id(each): stop for (_, each), stop in zip(asked, stops, strict=True)}
    done = tuple(
        stop.model_copy(
            update={
                "start": round(placed[id(stop)].start, 2),
                "until": round(placed[id(stop)].until, 2),
            }
        )
        for stop in added.stops
    )
    return added.model_copy(update={"stops": done}), replace(selection, agents=agents)


def _find_arc_length(stop: AddedStop, anchors: Sequence[Anchor]) -> float:
    """Where on its path the agent is to stand [m]; on another sample, at an anchor of that kind."""
    for name in (str, _get_anchor_kind):
        for anchor in anchors:
            if name(anchor.id) == name(stop.place):
                return anchor.s - stop.ahead
    known = ", ".join(anchor.id for anchor in anchors)
    raise _build_refusal("unknown_anchor", stop.agent, f"has no anchor {stop.place!r}, but {known}")


def _get_anchor_kind(anchor: str) -> str:
    """ "yield_point" of "yield_point@34.6", "stop" of "south:stop"."""
    name = anchor.partition("@")[0]
    return name.partition(":")[2] or name


@dataclass(frozen=True)
class _Due:
    """A place on an agent's path that it is to reach when it does now."""

    s: float
    at_red: bool = False


def _add_stops(
    agent: SelectedAgent, asked: Sequence[tuple[float, AddedStop]], selection: Selection
) -> tuple[SelectedAgent, list[Stop]]:
    """The agent with the standstills, which are in order of place, and these."""
    known = [_find_known_stop(agent, s) for s, _ in asked]
    if all(known):  # an agent that stays as it was in an earlier version
        return agent, [stop for stop in known if stop is not None]
    _refuse_crowded(agent, [s for s, _ in asked])
    due = _list_due_places(agent, selection)
    before = [(s, each.lasts) for s, each in asked if s < due[0].s] if due else []
    after = [(s, each.lasts) for s, each in asked[len(before) :]]
    _refuse_between(agent, due, after)
    holds, lost = _plan_holds_before(agent, before, due)
    held = _shift_agent(agent, holds, lost)
    held = _hold_after(held, after)
    stops = [stop for stop in held.stops if stop.reason == ASKED]
    _refuse_unseen(agent, stops, selection.duration)
    return held, stops


def _find_known_stop(agent: SelectedAgent, s: float) -> Stop | None:
    return next((t for t in agent.stops if t.reason == ASKED and abs(t.s - s) < _APART), None)


def _list_due_places(agent: SelectedAgent, selection: Selection) -> list[_Due]:
    """Where it stands in view, and where it is when it meets others, in order of place."""
    editing = get_motion_edits(agent)
    motion = compute_motion(agent.candidate, holds=editing.holds, slowings=editing.slowings)
    found = [
        _Due(stop.s, stop.at_red) for stop in agent.stops if not stop.rolls and stop.until > 0.0
    ]
    times = [event.time for event in selection.events if agent.name in event.agents]
    times += [] if agent.contact is None else [agent.contact]
    places = motion.compute_positions(np.array(times) - agent.enters).tolist()
    found += [_Due(s) for s in places]
    return sorted(found, key=lambda each: each.s)


def _plan_holds_before(
    agent: SelectedAgent, asked: Sequence[tuple[float, float]], due: Sequence[_Due]
) -> tuple[list[StopCommand], float]:
    """Holds in local time ahead of the first place that is due, and the time lost there [s].

    The time lost is a multiple of the step; the last hold makes up for the rest.
    """
    if not asked:
        return [], 0.0
    editing = get_motion_edits(agent)
    holds: list[StopCommand] = []
    for s, lasts in asked:
        stands = _find_standing_time(agent, s, [*editing.holds, *holds])
        holds.append(StopCommand(s, stands + lasts))
    place = due[0].s - _AT
    unheld = compute_motion(agent.candidate, holds=editing.holds, slowings=editing.slowings)
    held_up = compute_motion(
        agent.candidate, holds=(*holds, *editing.holds), slowings=editing.slowings
    )
    lost = held_up.find_time_at(place) - unheld.find_time_at(place)
    whole = STEP * ceil(lost / STEP - 1e-6)
    holds[-1] = replace(holds[-1], release=holds[-1].release + whole - lost)
    return holds, whole


def _shift_agent(agent: SelectedAgent, holds: Sequence[StopCommand], lost: float) -> SelectedAgent:
    """The agent that enters so much earlier and stands at the holds; what it waited for before the
    scene begins was earlier as well."""
    enters = round(agent.enters - lost, 1)
    earlier = [
        replace(stop, start=stop.start - lost, until=stop.until - lost)
        if stop.until <= 0.0 and not stop.rolls
        else stop
        for stop in agent.stops
    ]
    upstream = [make_stop_command(each, enters) for each in earlier if each.until <= 0.0]
    for hold in holds:
        stands = _find_standing_time(agent, hold.s, [*upstream, *holds])
        earlier.append(
            Stop(ASKED, hold.s, start=enters + stands, until=enters + hold.release, reason=ASKED)
        )
    return replace(agent, enters=enters, stops=tuple(sorted(earlier, key=lambda each: each.s)))


def _find_standing_time(agent: SelectedAgent, s: float, holds: Sequence[StopCommand]) -> float:
    """When the agent comes to stand at an arc length [s since it enters], after holds before it."""
    upstream = tuple(hold for hold in holds if hold.s < s)
    return compute_arrival(agent.candidate, StopCommand(s, 0.0), upstream)


def _hold_after(agent: SelectedAgent, asked: Sequence[tuple[float, float]]) -> SelectedAgent:
    """The agent that stands behind everything that is due, and is so much later from there on."""
    for s, lasts in asked:
        start = agent.enters + _find_standing_time(agent, s, get_motion_edits(agent).holds)
        stop = Stop(ASKED, s, start=start, until=start + lasts, reason=ASKED)
        agent = replace(agent, stops=tuple(sorted((*agent.stops, stop), key=lambda each: each.s)))
    return agent


def _refuse_crowded(agent: SelectedAgent, places: Sequence[float]) -> None:
    """Standstills lie on the way, apart from one another and from those that are there."""
    taken = [stop.s for stop in agent.stops if not stop.rolls and stop.until > 0.0]
    for s in places:
        if not _APART < s < agent.candidate.path.length - _APART:
            raise _build_refusal(
                "segment_off_track", agent.name, f"has no way {s:.1f} m along its path"
            )
        if any(abs(s - other) < _APART for other in taken):
            raise _build_refusal(
                "segment_off_track", agent.name,
                f"stands {s:.1f} m along its way already; put the stop at least {_APART:g} m away",
            )  # fmt: skip
        taken.append(s)


def _refuse_between(
    agent: SelectedAgent, due: Sequence[_Due], after: Sequence[tuple[float, float]]
) -> None:
    """No standstill lies between two places that are due at their times."""
    if not due:
        return
    for s, _ in after:
        if s < due[-1].s or agent.contact is not None:
            passed = [each for each in due if each.s <= s]
            raise _build_refusal(
                "segment_off_track", agent.name,
                f"has no time to stand {s:.1f} m along its way, after {passed[-1].s:.1f} m and "
                "before what it is in; put the stop before the first",
                # Another sample may have it come on green.
                repairable=not any(each.at_red for each in passed),
            )  # fmt: skip


def _refuse_unseen(agent: SelectedAgent, stops: Sequence[Stop], duration: float) -> None:
    for stop in stops:
        if stop.start < _IN_VIEW or stop.until > duration - _IN_VIEW:
            raise _build_refusal(
                "segment_off_track", agent.name,
                f"would stand from {stop.start:.1f} to {stop.until:.1f} s of {duration:g} s",
                repairable=False,
            )  # fmt: skip


def _build_refusal(
    code: RejectionCode, agent: str, what: str, *, repairable: bool = True
) -> Rejected:
    return Rejected(
        Rejection(
            stage="event_reasoner",
            code=code,
            agents=(agent,),
            detail=f"{agent} {what}",
            repairable=repairable,
        )
    )
