"""What the later stages make of words that no field of the plan holds."""

from __future__ import annotations

from pydantic import Field

from scenewright.scene.base import AgentId, Model
from scenewright.scene.constraints import Clause


class Unserved(Model):
    """Words of the instruction that no part of the scene represents.

    Attributes:
        entry: index of the words in `SocialGraph.said`.
        note: the reason.
    """

    entry: int = Field(ge=0)
    note: str


class AddedClause(Model):
    """A clause that words ask for beside those that follow from the plan.

    Attributes:
        entry: index of the words in `SocialGraph.said`.
    """

    entry: int = Field(ge=0)
    clause: Clause


class AddedClauses(Model):
    """What the waypoint filter made of the words left to it."""

    clauses: tuple[AddedClause, ...] = ()
    unserved: tuple[Unserved, ...] = ()


class AddedStop(Model):
    """A standstill that words ask for, on an agent's own way.

    Attributes:
        entry: index of the words in `SocialGraph.said`.
        place: an anchor on the way of `agent`; ahead: how far before it the agent stands [m].
        lasts: how long it stands [s].
        start, until: when it stands in the scene [s]; None before the tracks are known.
    """

    entry: int = Field(ge=0)
    agent: AgentId
    place: str
    ahead: float = Field(ge=0.0, le=30.0)
    lasts: float = Field(ge=1.0, le=10.0)
    start: float | None = None
    until: float | None = None


class AddedStops(Model):
    """What the event reasoner made of the words left to it."""

    stops: tuple[AddedStop, ...] = ()
    unserved: tuple[Unserved, ...] = ()
