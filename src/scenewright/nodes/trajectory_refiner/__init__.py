"""Stage 5, trajectory refiner: edited priors, then learned refinement (paper 3.5, Eq. 6-7)."""

from __future__ import annotations

from typing import TypedDict

from langgraph.runtime import Runtime

from scenewright.memory.state import Tracks
from scenewright.nodes.context import RunContext
from scenewright.scene.behavior import BehaviorProgram, EventSummary
from scenewright.scene.selection import Selection
from scenewright.tools.segment_editor import edit

NOT_REFINED = "none: the edited priors are final, no learned model ran"


class RefinerReads(TypedDict):
    """Channels read."""

    selection: Selection
    summary: EventSummary
    behavior: BehaviorProgram


class RefinerWrites(TypedDict):
    """Channels written."""

    edited: Tracks
    refined: Tracks
    refinement: str


def refine_trajectories(state: RefinerReads, *, runtime: Runtime[RunContext]) -> RefinerWrites:
    """Edits every selected prior by its segments; refinement passes the tracks on unchanged."""
    selection = state["selection"]
    anchors = {
        agent.agent: {anchor.id: anchor.s for anchor in agent.anchors}
        for agent in state["summary"].agents
    }
    edited = {}
    for name, agent in selection.agents.items():
        segments = state["behavior"].segments[name]
        track = edit(agent, segments, anchors[name], duration=selection.duration)
        if track is not None:
            edited[name] = track
    runtime.context.tell("trajectory_refiner", f"{len(edited)} tracks, refiner none")
    return {"edited": edited, "refined": edited, "refinement": NOT_REFINED}
