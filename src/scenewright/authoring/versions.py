"""Versions: the first from an instruction, the next from the one before and what is to change."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from scenewright.authoring.apply_edits import Revision, build_revision
from scenewright.authoring.attempts import generate_attempts
from scenewright.errors import Unsatisfiable
from scenewright.graph.run import ProgressCallback, Scene
from scenewright.intersections import load_map
from scenewright.nodes.context import Budgets
from scenewright.scene.edits import Edit
from scenewright.scene.frozen_agents import FrozenAgents, PreviousAgent, PreviousVersion
from scenewright.scene.plan_file import PlanFile
from scenewright.scene.record import SceneRecord
from scenewright.scene.social import SocialGraph
from scenewright.tools.account import find_unasked_changes

_PINNED = Budgets(planner=0, filter=1, reasoner=1, generator=1)
_MOST_TRIES = 10
"""Attempts with frozen agents before all agents are drawn anew."""

_UNPINNED = Budgets(generator=5)
"""Of an attempt in which all agents, or those of the background, are drawn."""


Make = Callable[..., Scene]
"""`synthesize` with all that the versions of a thread share."""


@dataclass(frozen=True, eq=False)
class EditResult:
    """A verified version.

    Attributes:
        graph: what it shows; earlier: what later versions may be built on.
        moved: agents that changed though the edit does not name them; gone, come likewise.
        longer: how much longer the scene lasts than before [s].
        by_hand: agents whose stop or time is as given; let_go: those whose is no longer.
    """

    scene: Scene
    graph: SocialGraph
    earlier: PreviousVersion
    pace: Mapping[str, float] = field(default_factory=dict)
    moved: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()
    come: tuple[str, ...] = ()
    longer: float = 0.0
    by_hand: tuple[str, ...] = ()
    let_go: tuple[str, ...] = ()


def begin(asked: str | PlanFile, make: Make) -> EditResult:
    """The first version, from an instruction or a plan (see `synthesize` for what it raises)."""
    scene = make(asked)
    return EditResult(scene, scene.state["social_graph"], build_previous_version(scene))


def change(
    text: str,
    edits: tuple[Edit, ...],
    make: Make,
    *,
    intersection: str,
    before: SocialGraph,
    earlier: PreviousVersion,
    record: SceneRecord,
    pace: Mapping[str, float],
    by_hand: Sequence[str],
    log: ProgressCallback,
) -> EditResult:
    """The next version: as little else as possible is other than before.

    Args:
        text: everything said so far, for the scene's prompt.
        before: the social graph so far; record: the scene so far.
        pace, by_hand: paces as given, and agents whose stops and times were given.

    Raises:
        Rejected: the edits contradict the scene or the map.
        Unsatisfiable: no verified scene was found with any set of freed agents.
        BackendFault: the backend failed for good.
    """
    revision = build_revision(
        earlier, before, edits, intersection_map=load_map(intersection), pace=pace
    )
    trial = _Trial(partial(make, text), revision, log)
    refused = Unsatisfiable("there is nothing to try")
    for pins in generate_attempts(revision):
        if trial.is_idle(pins, refused):
            continue
        found = trial.solve_revision(pins)
        if isinstance(found, Scene):
            words = found.record.meta.texts[-1] * any(edit.edit != "call_agent" for edit in edits)
            if unasked := find_unasked_changes(record, found.record, words):
                refused = Unsatisfiable(f"more would change than was said: {'; '.join(unasked)}")
                continue
            return _build_result(found, revision, record, by_hand)
        refused = found
    raise refused


class _Trial:
    """One edit, tried with pins that get looser."""

    def __init__(self, make: Make, revision: Revision, log: ProgressCallback) -> None:
        self._make, self._revision, self._log = make, revision, log
        self._tries = 0

    def is_idle(self, pins: FrozenAgents, refused: Unsatisfiable) -> bool:
        """Whether these pins need not be tried after that refusal."""
        if pins.known:
            return self._tries >= _MOST_TRIES
        return pins.background != self._revision.background and "no room" not in str(refused)

    def solve_revision(self, firm: FrozenAgents) -> Scene | Unsatisfiable:
        """A verified scene; else why there is none, also without those that were in the way."""
        pins: FrozenAgents | None = firm
        refused = Unsatisfiable("no agent can stop there and do the same")
        while pins is not None:
            self._tries += 1
            count = len(pins.earlier.agents)
            self._log("session", f"trying with {len(pins.same)} of {count} agents as they are")
            settled = pins.known and pins.background is not None
            budgets = _PINNED if settled else _UNPINNED
            try:
                scene = self._make(planned=self._revision.graph, pinned=pins, budgets=budgets)
            except Unsatisfiable as error:
                refused, pins = error, _loosen(pins, self._revision, error)
            else:
                return scene if _has_given_stops(scene, self._revision) else refused
        return refused


def _has_given_stops(scene: Scene, revision: Revision) -> bool:
    """Whether the agents whose stop was moved by hand stand at the given place."""
    chosen = scene.state["selection"].agents
    return all(
        name in chosen
        and {round(stop.s, 2) for stop in agent.stops}
        <= {round(s.s, 2) for s in chosen[name].stops}
        for name, agent in revision.amended.items()
        if name in revision.by_hand
    )


def _loosen(pins: FrozenAgents, revision: Revision, refused: Unsatisfiable) -> FrozenAgents | None:
    """The frozen agents without the background agents in the way; None if no agent was."""
    foreground = {agent.id for agent in revision.graph.agents}
    blamed = {name for each in refused.rejections for name in each.agents} - foreground
    blamed &= pins.fixed.keys()
    return pins.release(blamed) if blamed else None


def build_previous_version(scene: Scene) -> PreviousVersion:
    """What a later version needs of this one."""
    state = scene.state
    selection, behavior, tracks = state["selection"], state["behavior"], state["refined"]
    return PreviousVersion(
        agents={
            agent.name: PreviousAgent(
                agent.id,
                selection.agents[agent.name],
                behavior.segments[agent.name],
                tracks[agent.name],
            )
            for agent in scene.record.agents
        },
        patterns=state["candidates"].cast.patterns,
        hour=state["candidates"].hour,
        duration=selection.duration,
        signal_offset=selection.signal_offset,
        events=selection.events,
        objects=selection.objects,
    )


def _build_result(
    scene: Scene, revision: Revision, before: SceneRecord, by_hand: Sequence[str]
) -> EditResult:
    """The version, and the agents that differ from before."""
    old = {agent.name: agent for agent in before.agents}
    new = {agent.name: agent for agent in scene.record.agents}
    unlike = [name for name, each in new.items() if name in old and old[name] != each]
    let_go = [n for n in by_hand if n in unlike and n not in revision.by_hand]
    as_given = {n for n in (*by_hand, *revision.by_hand) if n in new and n not in let_go}
    return EditResult(
        scene=scene,
        graph=revision.graph,
        earlier=build_previous_version(scene),
        pace=revision.pace,
        moved=tuple(name for name in unlike if name not in revision.named),
        gone=tuple(n for n in old if n not in new and n not in revision.named),
        come=tuple(name for name in new if name not in old),
        longer=scene.record.meta.duration - before.meta.duration,
        by_hand=tuple(sorted(as_given)),
        let_go=tuple(let_go),
    )
