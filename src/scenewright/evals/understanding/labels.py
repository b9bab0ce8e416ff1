"""What was to be found out: exits of all agents, and the events that the checker observed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.evals.understanding.observing import agent_codes
from scenewright.scene.base import AgentClass, Compass
from scenewright.scene.events import Proof
from scenewright.scene.record import SceneRecord

RELATIONS = ("collision", "yielding", "near_miss")
"""Events that relate two agents here; following is none (SEMANTICS section 4, normal)."""
SYMMETRIC = ("collision", "near_miss")


@dataclass(frozen=True)
class Relation:
    """An event between two agents, by code; `from_` and `to` in order where it is symmetric.

    Attributes:
        time: of the event [s]; None in predictions.
    """

    type: str
    from_: str
    to: str
    time: float | None = None

    @property
    def key(self) -> tuple[str, str, str]:
        """What must be right: the relation, both agents and, of a yielding, who gives way."""
        pair = sorted((self.from_, self.to)) if self.type in SYMMETRIC else (self.from_, self.to)
        return (self.type, pair[0], pair[1])


@dataclass(frozen=True)
class Labels:
    """The truth about one scene.

    Attributes:
        exits: side by agent; types, starts: class and first moment [s] by agent.
        relations: every collision, yielding and near miss, whoever has them.
    """

    exits: Mapping[str, Compass]
    types: Mapping[str, AgentClass]
    starts: Mapping[str, float]
    relations: tuple[Relation, ...]


def labels_of(record: SceneRecord, proof: Proof, *, scene: str) -> Labels:
    """The labels of a scene; events between background agents count like any others."""
    codes = agent_codes(scene, tuple(agent.id for agent in record.agents))
    found = [
        Relation(event.type, codes[event.from_], codes[event.to], event.time)
        for event in (*proof.events, *proof.incidental)
        if event.type in RELATIONS
    ]
    return Labels(
        exits={codes[agent.id]: agent.exit for agent in record.agents},
        types={codes[agent.id]: agent.type for agent in record.agents},
        starts={codes[agent.id]: agent.spawn_time for agent in record.agents},
        relations=tuple(sorted(found, key=lambda each: each.key)),
    )
