"""Replies of a model to the reasoner: their models, their schema for a scene, their checks.

Standstills are given for words that ask for them. Segments end at places of the map, in order of
time, fit the selected tracks, and hold what the relation files want of each role.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from pydantic import Field

from scenewright.errors import Rejected
from scenewright.nodes.remaining import list_unserved
from scenewright.nodes.schema import (
    Schema,
    build_array,
    build_enum,
    build_integer,
    build_number,
    build_object,
    build_reference,
)
from scenewright.scene.base import Model
from scenewright.scene.behavior import AgentSummary, EventSummary, Segment
from scenewright.scene.record import SegmentStatus
from scenewright.scene.rejection import Rejection, RejectionCode
from scenewright.scene.remaining import AddedStop, AddedStops
from scenewright.scene.selection import SelectedAgent
from scenewright.scene.track import STEP
from scenewright.tools.segment_editor import compute_edited_motion

_LATEST = 3600.0
_MOST_STOPS = 8
_SOON, _NEAR = 0.5, 1.0
"""How far a segment may be off its track: in time [s], and on the way [m]."""
_THERE = 0.1
"""So near its place an agent has come to stand [m]."""


class SegmentReply(Model):
    """A segment as given; one that names no start begins where the one before it ends."""

    anchor: str
    status: SegmentStatus
    start: float | None = Field(default=None, ge=0.0, le=_LATEST)
    end: float = Field(ge=0.0, le=_LATEST)


class StopReply(Model):
    """A standstill and the number of the words that ask for it."""

    words: int
    agent: str
    place: str
    ahead: float = Field(default=0.0, ge=0.0, le=30.0)
    lasts: float = Field(ge=1.0, le=10.0)


class StopsReply(Model):
    """Standstills for the remaining words; `cannot` has the numbers of those that none shows."""

    stops: tuple[StopReply, ...] = Field(default=(), max_length=_MOST_STOPS)
    cannot: tuple[int, ...] = Field(default=(), max_length=40)

    def read(self, entries: Sequence[int], agents: Sequence[AgentSummary]) -> AddedStops:
        """The standstills by entry of the account.

        Args:
            entries: of the words, in the order of their numbers.
            agents: those that the request names.

        Raises:
            Rejected: `malformed_reply`, `unknown_anchor`: words of no number or of which nothing
                is said, an agent or a place that is not there.
        """
        unserved = list_unserved(
            [stop.words for stop in self.stops], self.cannot, entries,
            stage="event_reasoner", note="no standstill shows this",
        )  # fmt: skip
        known = {agent.agent: [anchor.id for anchor in agent.anchors] for agent in agents}
        for stop in self.stops:
            if stop.agent not in known:
                raise build_rejection("malformed_reply", stop.agent, "is not asked about")
            if stop.place not in known[stop.agent]:
                raise build_rejection("unknown_anchor", stop.agent, f"has no anchor {stop.place!r}")
        return AddedStops(
            stops=tuple(
                AddedStop(entry=entries[stop.words - 1], **stop.model_dump(exclude={"words"}))
                for stop in self.stops
            ),
            unserved=unserved,
        )


def build_stops_schema(agents: Sequence[AgentSummary], count: int) -> Schema:
    """The reply's schema: each agent has its own places.

    Args:
        count: of the words, which are numbered from 1.
    """
    forms = []
    for agent in agents:
        if agent.anchors:
            form = {
                "words": build_reference("words"),
                "agent": build_enum((agent.agent,)),
                "place": build_enum(anchor.id for anchor in agent.anchors),
                "ahead": build_number(0, 30),
                "lasts": build_number(1, 10),
            }
            forms.append(build_object(form, required=form))
    stops = build_array(forms[0] if len(forms) == 1 else {"anyOf": forms}, most=_MOST_STOPS)
    keys = {"stops": stops, "cannot": build_array(build_reference("words"), most=count)}
    return build_object(keys, required=keys, defs={"words": build_integer(1, count)})


def chain_segments(
    replies: Mapping[str, Sequence[SegmentReply]], summary: EventSummary
) -> dict[str, tuple[Segment, ...]]:
    """By agent the segments given; one without a start begins where the one before it ends.

    Raises:
        Rejected: `malformed_reply` for an agent that is not there.
    """
    agents = {agent.agent: agent for agent in summary.agents}
    for name in replies:
        if name not in agents:
            raise build_rejection("malformed_reply", name, "is not in the scene")
    return {name: _chain(each, agents[name]) for name, each in replies.items()}


def _chain(replies: Sequence[SegmentReply], agent: AgentSummary) -> tuple[Segment, ...]:
    now, found = max(agent.enters, 0.0), []
    for reply in replies:
        start = now if reply.start is None else reply.start
        found.append(Segment(start=start, end=reply.end, anchor=reply.anchor, status=reply.status))
        now = reply.end
    return tuple(found)


def check_track(
    summary: AgentSummary, segments: tuple[Segment, ...], agent: SelectedAgent, duration: float
) -> None:
    """A Stop stands at its place in its time, and a Terminate ends where the agent then is.

    Args:
        duration: of the scene [s].

    Raises:
        Rejected: `segment_off_track`, with the time at which the agent gets there. Segments at
            anchors that are not there are left to `check_segments`.
    """
    places = {anchor.id: anchor.s for anchor in summary.anchors}
    if any(segment.status == "stop" and segment.anchor not in places for segment in segments):
        return
    motion = compute_edited_motion(agent, segments, places, duration=duration)
    for segment in segments:
        if segment.status == "stop" and segment.end > segment.start:
            comes = agent.enters + motion.find_time_at(places[segment.anchor] - _THERE)
            # A stay that began before the scene is clamped to its beginning.
            if abs(max(comes, 0.0) - segment.start) > _SOON:
                what = (
                    f"stands at {segment.anchor} from {segment.start:g} s, "
                    f"but comes at {comes:.1f} s"
                )
                raise build_rejection("segment_off_track", summary.agent, what)
        if segment.status != "terminate":
            continue
        what = ""
        if segment.anchor == "contact" and summary.contact is not None:
            if abs(segment.start - summary.contact) > 2 * STEP:
                what = f"ends at {segment.start:g} s, but its contact is at {summary.contact:g} s"
        elif segment.anchor in places:
            is_at = float(motion.compute_positions(np.array(segment.start - agent.enters)))
            away = abs(is_at - places[segment.anchor])
            if away > _NEAR:
                what = (
                    f"ends at {segment.anchor} at {segment.start:g} s, "
                    f"but is {away:.1f} m away then"
                )
        if what:
            raise build_rejection("segment_off_track", summary.agent, what)


def check_segments(
    agent: AgentSummary, segments: tuple[Segment, ...] | None, owed: Sequence[str]
) -> None:
    """Every agent has segments that realise its relations, on anchors that exist, in order.

    Raises:
        Rejected: with code, agent and reason.
    """
    name = agent.agent
    if not segments:
        raise build_rejection("malformed_reply", name, "has no segments")
    known = {anchor.id for anchor in agent.anchors}
    for segment in segments:
        # A contact is a moment: one may go until it or end at it, but not wait there.
        at_contact = segment.anchor == "contact" and segment.status != "stop"
        if segment.anchor not in known and not at_contact:
            raise build_rejection("unknown_anchor", name, f"has no anchor {segment.anchor!r}")
        if segment.end < segment.start:
            raise build_rejection("times_not_increasing", name, f"ends before {segment.start:g} s")
        if segment.status == "terminate" and segment.start < max(agent.enters, 0.0) + 2 * STEP:
            raise build_rejection("times_not_increasing", name, "ends before it has been seen")
    for before, after in pairwise(segments):
        if after.start < before.end - 1e-6:
            raise build_rejection("times_not_increasing", name, f"overlaps at {after.start:g} s")
    statuses = [segment.status for segment in segments]
    for status in owed:
        if status not in statuses and not _is_excused(status, statuses, agent):
            raise build_rejection(
                "malformed_reply", name, f"has no {status}, which its role demands"
            )


def _is_excused(status: str, statuses: Sequence[str], agent: AgentSummary) -> bool:
    """An agent that stands to the end never goes on; one that stands first never went before.

    An agent that gives way without standing has no stop.
    """
    if status == "stop":
        return any(stay.until <= stay.start for stay in agent.stays)
    if status == "proceed":
        return statuses[-1] in ("stop", "terminate")
    return status == "keep" and statuses[0] == "stop"


def build_rejection(code: RejectionCode, agent: str, what: str) -> Rejected:
    """A refusal that names an agent."""
    return Rejected(
        Rejection(stage="event_reasoner", code=code, agents=(agent,), detail=f"{agent} {what}")
    )
