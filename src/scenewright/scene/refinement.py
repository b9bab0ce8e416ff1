"""What the refiner did to each agent of a scene, and why it did no more."""

from __future__ import annotations

from pydantic import Field

from scenewright.scene.base import Model


class AgentRefinement(Model):
    """One agent.

    Attributes:
        share: how much of what the network proposed was taken, mean over its free motion; 0 where
            the edited prior was kept.
        refusals: how often the checker named it while these tracks were tried.
        reason: why the edited prior was kept; None where it was not.
    """

    share: float = Field(ge=0.0, le=1.0)
    refusals: int = Field(default=0, ge=0)
    reason: str | None = None


class Refinement(Model):
    """Refinement of all agents.

    Attributes:
        refiner: what ran: `none` or `trajnet`; note: the same in words.
        weights: first digits of the weights' SHA-256; None where none ran.
        attempt: how often these tracks were refined, 1 for once; retries: the same without the
            first ones, over the whole run.
        agents: by name; empty where nothing ran.
    """

    refiner: str
    note: str
    weights: str | None = None
    attempt: int = 1
    retries: int = 0
    agents: dict[str, AgentRefinement] = Field(default_factory=dict)

    @property
    def may_retry(self) -> bool:
        """Return whether the share of an agent could still be reduced."""
        return any(agent.share > 0 for agent in self.agents.values())
