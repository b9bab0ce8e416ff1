"""What an edit leaves alone: agents of an earlier version, and how firmly they stay."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

from scenewright.scene.base import AgentClass
from scenewright.scene.behavior import Segment
from scenewright.scene.candidates import AssignedPattern
from scenewright.scene.map_elements import Route
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.selection import PlannedEvent, SelectedAgent
from scenewright.scene.track import Track


@dataclass(frozen=True, eq=False)
class PreviousAgent:
    """One agent of an earlier version.

    Attributes:
        number: its id in scene.json.
        agent: as selected; segments: of the behavior program; track: as refined.
    """

    number: int
    agent: SelectedAgent
    segments: tuple[Segment, ...]
    track: Track


@dataclass(frozen=True, eq=False)
class PreviousVersion:
    """The products of a verified version that a later one can be built on.

    Attributes:
        agents: all its agents, by name, in the order of their numbers.
        patterns: how its relations are played, by their place in the social graph.
        hour: time of day [h].
        duration: of the scene [s]; signal_offset: scene time 0 in the signal programme [s].
        events: what the selection brings about; objects: what stands.
    """

    agents: Mapping[str, PreviousAgent]
    patterns: tuple[AssignedPattern, ...]
    hour: float
    duration: float
    signal_offset: float | None
    events: tuple[PlannedEvent, ...]
    objects: tuple[ObjectRecord, ...] = ()

    @property
    def first_event(self) -> float | None:
        """When the first thing asked for happens [s]; None where nothing does."""
        return min((event.time for event in self.events), default=None)


@dataclass(frozen=True, eq=False)
class FrozenAgents:
    """How firmly agents of an earlier version stay while the scene is solved again.

    Attributes:
        earlier: the version that they come from.
        fixed: these stay in time and place; those not in `same` were changed by hand.
        same: those of `fixed` that stay bit for bit.
        placed: path and entry time stay, standstills and the end are open.
        offered: the path is offered before others, the time is open.
        patterns: of relations that stay, by their place in the new social graph.
        background: how many background agents of each class there shall be; None: as the graph and
            the hour have it.
        hour: time of day [h].
        lights: whether the signal programme keeps its offset, and the scene its length.
        pace: share of the drawn free speed by name, of agents asked to be slower or faster.
    """

    earlier: PreviousVersion
    background: Mapping[AgentClass, int] | None
    hour: float
    fixed: Mapping[str, SelectedAgent] = field(default_factory=dict)
    same: frozenset[str] = frozenset()
    placed: Mapping[str, SelectedAgent] = field(default_factory=dict)
    offered: Mapping[str, SelectedAgent] = field(default_factory=dict)
    patterns: Mapping[int, AssignedPattern] = field(default_factory=dict)
    lights: bool = True
    pace: Mapping[str, float] = field(default_factory=dict)

    @property
    def known(self) -> dict[str, SelectedAgent]:
        """All agents that keep a path, by name."""
        return {**self.offered, **self.placed, **self.fixed}

    @property
    def routes(self) -> dict[str, Route]:
        """The routes that are settled, by name."""
        return {name: agent.candidate.route for name, agent in self.known.items()}

    def assign_numbers(self, names: tuple[str, ...]) -> dict[str, int]:
        """Ids for scene.json: earlier agents keep theirs, others get the next ones."""
        taken = {name: each.number for name, each in self.earlier.agents.items()}
        kept = {name: taken[name] for name in names if name in taken}
        following = max(taken.values(), default=0) + 1
        fresh = (name for name in names if name not in kept)
        return kept | {name: number for number, name in enumerate(fresh, start=following)}

    def release(self, names: Collection[str]) -> FrozenAgents:
        """The same, but these do not stay."""
        fixed = {name: agent for name, agent in self.fixed.items() if name not in names}
        return replace(self, fixed=fixed, same=self.same - set(names))


def without_edits(agent: SelectedAgent) -> SelectedAgent:
    """Return the agent as it would move alone: only red lights hold it, and it evades nobody."""
    stops, candidate = tuple(stop for stop in agent.stops if stop.at_red), agent.candidate
    if candidate.unevaded is not None:
        candidate = replace(candidate, path=candidate.unevaded, unevaded=None)
    return replace(agent, candidate=candidate, stops=stops, slowings=(), contact=None)
