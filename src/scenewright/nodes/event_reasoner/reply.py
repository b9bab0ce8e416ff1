"""What the reasoner may be told: reply models and their schemas for a scene, and what they must be.

A summary names places that the map has. Segments end at such places, in
order of time, and hold what the relation files want of each role.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import get_args

from pydantic import BaseModel, ConfigDict, Field

from scenewright.errors import Rejected
from scenewright.nodes.schema import Schema, closed, listed, one_of, shared
from scenewright.scene.behavior import AgentSummary, BehaviorProgram, EventSummary, Segment
from scenewright.scene.record import SegmentStatus
from scenewright.scene.rejection import Rejection, RejectionCode
from scenewright.scene.track import STEP

SUMMARY = "summary: "
"""How refusals of a summary begin, to tell them from those of the segments."""

_LATEST = 3600.0
_MOST_SEGMENTS = 8


class SummaryReply(BaseModel):
    """By agent: the places that matter, in the order of its way."""

    model_config = ConfigDict(extra="forbid")

    anchors: dict[str, tuple[str, ...]]


class SegmentReply(BaseModel):
    """A segment as told; one that names no start begins where the one before it ends."""

    model_config = ConfigDict(extra="forbid")

    anchor: str
    status: SegmentStatus
    start: float | None = Field(default=None, ge=0.0, le=_LATEST)
    end: float = Field(ge=0.0, le=_LATEST)


class BehaviorReply(BaseModel):
    """By agent: its segments, in order of time."""

    model_config = ConfigDict(extra="forbid")

    segments: dict[str, tuple[SegmentReply, ...]]

    def read(self, summary: EventSummary) -> BehaviorProgram:
        """The program; agents of whom nothing is said keep to what the solver found.

        Raises:
            Rejected: `malformed_reply` for an agent that is not there.
        """
        agents = {each.agent: each for each in summary.agents}
        for name in self.segments:
            if name not in agents:
                raise refused("malformed_reply", name, "is not in the scene")
        told = {name: _chained(each, agents[name]) for name, each in self.segments.items()}
        found = {
            name: told[name] if name in told else agent.suggest_segments(summary.duration)
            for name, agent in agents.items()
        }
        return BehaviorProgram(segments=found)


def _chained(told: Sequence[SegmentReply], agent: AgentSummary) -> tuple[Segment, ...]:
    now, found = max(agent.enters, 0.0), []
    for each in told:
        start = now if each.start is None else each.start
        found.append(Segment(start=start, end=each.end, anchor=each.anchor, status=each.status))
        now = each.end
    return tuple(found)


def summary_schema(agents: Sequence[AgentSummary]) -> Schema:
    """The reply's schema: each agent has its own places."""
    lists = {each.agent: _places_of(each) for each in agents}
    return closed({"anchors": closed(lists, required=lists)}, required=("anchors",))


def _places_of(agent: AgentSummary) -> Schema:
    names = [anchor.id for anchor in agent.anchors]
    return listed(one_of(names), least=1, most=max(len(names), 1))


def behavior_schema(agents: Sequence[AgentSummary], duration: float) -> Schema:
    """The reply's schema: each agent has its own places and times (paper Eq. 5)."""
    lists = {each.agent: _segments_of(each, duration) for each in agents}
    shown = closed(lists, required=lists)
    defs = {"status": one_of(get_args(SegmentStatus))}
    return closed({"segments": shown}, required=("segments",), defs=defs)


def _segments_of(agent: AgentSummary, duration: float) -> Schema:
    places = [anchor.id for anchor in agent.anchors]
    places += [] if agent.contact is None else ["contact"]
    segment = {
        "anchor": one_of(places),
        "status": shared("status"),
        "end": {"type": "number", "enum": _times_of(agent, duration)},
    }
    return listed(closed(segment, required=segment), least=1, most=_MOST_SEGMENTS)


def _times_of(agent: AgentSummary, duration: float) -> list[float]:
    """Every time at which its segments may end [s]: places alone are passed within one."""
    times = {agent.leaves, agent.contact}
    times |= {time for stay in agent.stays for time in (stay.start, min(stay.until, agent.leaves))}
    found = sorted(time for time in times if time is not None and 0.0 <= time <= duration)
    return found or [duration]


def places_of(
    told: Mapping[str, Sequence[str]], agents: Sequence[AgentSummary]
) -> dict[str, tuple[str, ...]]:
    """By agent the places told, each once and in the order of its way, which is known.

    Raises:
        Rejected: with code, agent and reason: of every agent asked about there are places, among
            them those at which it stands.
    """
    known = {each.agent: each for each in agents}
    for name in told:
        if name not in known:
            raise refused("malformed_reply", name, "is not asked about", of=SUMMARY)
    return {each.agent: _its_places(each, told.get(each.agent, ())) for each in agents}


def _its_places(agent: AgentSummary, places: Sequence[str]) -> tuple[str, ...]:
    order = [anchor.id for anchor in agent.anchors]
    if not places:
        raise refused("malformed_reply", agent.agent, "has no anchors", of=SUMMARY)
    for place in places:
        if place not in order:
            raise refused("unknown_anchor", agent.agent, f"has no anchor {place!r}", of=SUMMARY)
    for stay in agent.stays:
        if stay.anchor not in places:
            what = f"stands at {stay.anchor}, which is left out"
            raise refused("malformed_reply", agent.agent, what, of=SUMMARY)
    return tuple(sorted(set(places), key=order.index))


def check_segments(
    agent: AgentSummary, segments: tuple[Segment, ...] | None, owed: Sequence[str]
) -> None:
    """Every agent has segments that realise its relations, on anchors that exist, in order.

    Raises:
        Rejected: with code, agent and reason.
    """
    name = agent.agent
    if not segments:
        raise refused("malformed_reply", name, "has no segments")
    known = {anchor.id for anchor in agent.anchors}
    for segment in segments:
        # A contact is a moment: one may go until it or end at it, but not wait there.
        at_contact = segment.anchor == "contact" and segment.status != "stop"
        if segment.anchor not in known and not at_contact:
            raise refused("unknown_anchor", name, f"has no anchor {segment.anchor!r}")
        if segment.end < segment.start:
            raise refused("times_not_increasing", name, f"ends before {segment.start:g} s")
        if segment.status == "terminate" and segment.start < max(agent.enters, 0.0) + 2 * STEP:
            raise refused("times_not_increasing", name, "ends before it has been seen")
    for before, after in pairwise(segments):
        if after.start < before.end - 1e-6:
            raise refused("times_not_increasing", name, f"overlaps at {after.start:g} s")
    statuses = [segment.status for segment in segments]
    for status in owed:
        if status not in statuses and not _excused(status, statuses, agent):
            raise refused("malformed_reply", name, f"has no {status}, which its role demands")


def _excused(status: str, statuses: Sequence[str], agent: AgentSummary) -> bool:
    """Who stands to the end never goes on, who stands from the start never went before.

    Who gives way without standing has no stop.
    """
    if status == "stop":
        return any(stay.until <= stay.start for stay in agent.stays)
    if status == "proceed":
        return statuses[-1] in ("stop", "terminate")
    return status == "keep" and statuses[0] == "stop"


def refused(code: RejectionCode, agent: str, what: str, *, of: str = "") -> Rejected:
    """A refusal that names an agent."""
    return Rejected(
        Rejection(stage="event_reasoner", code=code, agents=(agent,), detail=f"{of}{agent} {what}")
    )
