"""Event summary and behavior program (paper 3.4, Eq. 5)."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from scenewright.scene.base import Model
from scenewright.scene.record import SegmentStatus


class Anchor(Model):
    """A grounded map entity on an agent's path, and when the prior track reaches it.

    Attributes:
        s: arc length of the agent's centre there [m].
        time: [s] since scene start; None where the prior never reaches it within the scene.
    """

    id: str
    s: float
    time: float | None


class Stay(Model):
    """A standstill at an anchor that the solver found to work: [from, until] [s].

    A stop of no length is the slowest moment of an agent that gives way without standing.
    """

    anchor: str
    start: float
    until: float
    reason: str


class AgentSummary(Model):
    """Anchors in order of arc length, and what the solver suggests (paper: A^i, T^i)."""

    agent: str
    enters: float
    leaves: float
    anchors: tuple[Anchor, ...]
    stays: tuple[Stay, ...] = ()
    contact: float | None = None

    def suggest_segments(self, duration: float) -> tuple[Segment, ...]:
        """What the solver found: Keep, then Stop and Proceed at every stay, Terminate at a contact.

        A stay that ended before the scene began is no part of it.

        Args:
            duration: of the scene [s].
        """
        now, moving = self.enters, "keep"
        segments: list[Segment] = []
        for stay in self.stays:
            if stay.until <= 0.0:
                continue
            start, until = min(stay.start, self.leaves), min(stay.until, self.leaves)
            segments.append(_build_segment(now, start, stay.anchor, moving))
            if stay.until > stay.start:
                segments.append(_build_segment(start, until, stay.anchor, "stop"))
            now, moving = until, "proceed"
        if self.contact is not None:
            segments.append(_build_segment(now, self.contact, "contact", moving))
            segments.append(_build_segment(self.contact, self.contact, "contact", "terminate"))
        elif self.leaves > now:
            segments.append(_build_segment(now, min(self.leaves, duration), "goal", moving))
        return tuple(segments)


class EventSummary(Model):
    """Structured evidence for the reasoner: per agent anchors and times, per relation figures."""

    duration: float
    agents: tuple[AgentSummary, ...]
    evidence: tuple[dict[str, Any], ...] = ()

    def suggest_segments(self) -> BehaviorProgram:
        """The behavior program that follows from it: what the solver found, for every agent."""
        segments = {agent.agent: agent.suggest_segments(self.duration) for agent in self.agents}
        return BehaviorProgram(segments=segments)


class Segment(Model):
    """One behavioral segment phi = (t, a, s) of an agent (paper Eq. 5)."""

    start: float = Field(ge=0.0, description="[s] since scene start")
    end: float = Field(ge=0.0, description="[s] since scene start")
    anchor: str = Field(description="grounded map entity the segment ends at")
    status: SegmentStatus


class BehaviorProgram(Model):
    """Phi: the segments of every agent, in order of time."""

    segments: dict[str, tuple[Segment, ...]]


def _build_segment(start: float, end: float, anchor: str, status: str) -> Segment:
    return Segment.model_validate(
        {
            "start": round(max(start, 0.0), 3),
            "end": round(max(end, 0.0), 3),
            "anchor": anchor,
            "status": status,
        }
    )
