"""What a run happens in: everything a node may use besides its state."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from scenewright.backends import Backend, Call
from scenewright.nodes.prompts import ExampleRetriever, recall_nothing
from scenewright.scene.rejection import Rejection

if TYPE_CHECKING:
    from scenewright.geometry.map_areas import MapAreas
    from scenewright.scene.map import IntersectionMap
    from scenewright.tools.gmm_sampler import Priors
    from scenewright.tools.solver.select import Mode
    from scenewright.tools.trajnet_refiner.bundled import BundledRefiner

RefinerName = Literal["none", "trajnet"]


@dataclass(frozen=True)
class Budgets:
    """How often each retry edge may be taken.

    Attributes:
        generator: fresh samples; as many again in which a red light is run unasked, where that may
            be and no lawful scene came of these.
        misplanned: samples of a plan that the tracks contradict. Of 458 scenes that were made no
            one had any such refusal, so that there is little hope in more.
    """

    planner: int = 2
    filter: int = 2
    reasoner: int = 2
    generator: int = 16
    refiner: int = 5
    misplanned: int = 12


@dataclass(frozen=True)
class RunContext:
    """The world of one run.

    Attributes:
        seed, entropy: roots of all randomness of this scene; the latter comes from its text, so
            that different requests with one seed share nothing.
        learned: the network that refines; None where none shall, or no weights serve.
        draws: M, candidates per agent (paper 3.2).
        log: called with a short line whenever a stage has something to say.
        account: called with what every answer of a model has cost.
        recall: finds accepted answers to requests like this one, for prompts.
        lenient: words that cannot be realised are left out and listed, not refused.
        max_agents: most agents that a scene may hold; None for as many as p_tod gives.
        lawful: a scene in which an agent runs a red light unasked is refused.
    """

    backend: Backend
    ground: MapAreas
    priors: Priors
    seed: int
    entropy: int = 0
    refiner: RefinerName = "none"
    learned: BundledRefiner | None = None
    selection: Mode = "draw"
    draws: int = 16
    budgets: Budgets = field(default_factory=Budgets)
    log: Callable[[str, str], None] = lambda _stage, _message: None
    account: Callable[[Call], None] = lambda _call: None
    recall: ExampleRetriever = recall_nothing
    lenient: bool = False
    max_agents: int | None = None
    lawful: bool = False

    @property
    def intersection(self) -> IntersectionMap:
        """The map."""
        return self.ground.intersection_map

    def make_rng(self, stage: str, rejections: list[Rejection]) -> np.random.Generator:
        """A generator of a stage (or part of one), fresh at every attempt, the same for a run."""
        key = (self.seed, self.entropy, zlib.crc32(stage.encode()), len(rejections))
        return np.random.default_rng(np.random.SeedSequence(key))


class Runtime(Protocol):
    """What the state machine hands a node besides its state: LangGraph's own class, or a like one.

    Nodes do not import it from LangGraph, which takes a second to load: `plan` works without.
    """

    @property
    def context(self) -> RunContext:
        """The world of the run."""
