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
    """A standstill at an anchor that the solver found to work: [from, until] [s]."""

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


class EventSummary(Model):
    """Structured evidence for the reasoner: per agent anchors and times, per relation figures."""

    duration: float
    agents: tuple[AgentSummary, ...]
    evidence: tuple[dict[str, Any], ...] = ()


class Segment(Model):
    """One behavioral segment phi = (t, a, s) of an agent (paper Eq. 5)."""

    start: float = Field(ge=0.0, description="[s] since scene start")
    end: float = Field(ge=0.0, description="[s] since scene start")
    anchor: str = Field(description="grounded map entity the segment ends at")
    status: SegmentStatus


class BehaviorProgram(Model):
    """Phi: the segments of every agent, in order of time."""

    segments: dict[str, tuple[Segment, ...]]
