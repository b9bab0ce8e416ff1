"""The truth about a scene: exits of all agents, and the events that the checker observed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.evals.understanding.observation import hash_agents
from scenewright.scene.base import AgentClass, Compass
from scenewright.scene.events import Proof
from scenewright.scene.record import SceneRecord

RELATIONS = ("collision", "yielding", "near_miss")
"""Events that relate two agents, gravest first; following is none (SEMANTICS section 4)."""


@dataclass(frozen=True)
class PairRelation:
    """An event between two agents, by hashed id; of a yielding, `from_` gives way.

    Attributes:
        time: of the event [s]; None in predictions.
    """

    type: str
    from_: str
    to: str
    time: float | None = None

    @property
    def key(self) -> tuple[str, str, str]:
        """What a prediction must get right; the order of agents matters for yielding only."""
        one, two = self.from_, self.to
        if self.type != "yielding":
            one, two = sorted((one, two))
        return (self.type, one, two)


@dataclass(frozen=True)
class Labels:
    """The truth about one scene.

    Attributes:
        exits: side by agent; types, starts: class and first moment [s] by agent.
        relations: every collision, yielding and near miss.
    """

    exits: Mapping[str, Compass]
    types: Mapping[str, AgentClass]
    starts: Mapping[str, float]
    relations: tuple[PairRelation, ...]


def extract_labels(record: SceneRecord, proof: Proof, *, scene: str) -> Labels:
    """Extract the labels of a scene; events between background agents count like any others."""
    codes = hash_agents(scene, (agent.id for agent in record.agents))
    found = [
        PairRelation(event.type, codes[event.from_], codes[event.to], event.time)
        for event in (*proof.events, *proof.incidental)
        if event.type in RELATIONS
    ]
    return Labels(
        exits={codes[agent.id]: agent.exit for agent in record.agents},
        types={codes[agent.id]: agent.type for agent in record.agents},
        starts={codes[agent.id]: agent.spawn_time for agent in record.agents},
        relations=tuple(sorted(found, key=lambda each: each.key)),
    )
