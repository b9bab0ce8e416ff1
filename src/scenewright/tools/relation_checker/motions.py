"""Whether agents move as they were asked to, seen on their tracks by the observer of each kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from scenewright.scene.events import Finding
from scenewright.scene.kinds import Kind, get_kind, load_function
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.signals import SignalPlan
from scenewright.tools.relation_checker.trajectory import Trajectory


@dataclass(frozen=True)
class SeenMotion:
    """An agent's track, and what else shows how it moves; whether it ends in a collision."""

    kind: Kind
    track: Trajectory
    lights: SignalPlan
    intersection_map: IntersectionMap
    struck: bool = False


def check_motions(
    agents: Sequence[AgentRecord],
    observed: SceneObservation,
    intersection_map: IntersectionMap | None,
) -> tuple[Finding, ...]:
    """A finding for every agent that does not move as it was asked to."""
    if intersection_map is None:
        return ()
    tracks = {track.id: track for track in observed.tracks}
    return tuple(
        Finding(
            rule="motion_not_seen", agents=(agent.id,),
            detail=f"agent {agent.id} was to move so: {agent.motion}; its track does not show it",
        )
        for agent in agents
        if agent.motion is not None
        and describe_motion(agent.motion, tracks[agent.id], observed, intersection_map) is None
    )  # fmt: skip


def describe_motion(
    motion: str, track: Trajectory, observed: SceneObservation, intersection_map: IntersectionMap
) -> str | None:
    """What a track shows of a motion; None if it does not."""
    kind = get_kind("motion", motion)
    if track.type not in kind.agents:
        return None
    struck = any(e.type == "collision" and track.id in (e.from_, e.to) for e in observed.events)
    seen = SeenMotion(kind, track, observed.lights, intersection_map, struck)
    return cast("str | None", load_function(str(kind.observe), __package__)(seen))
