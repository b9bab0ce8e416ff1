"""Final tracks, segments and signal plan as one scene record (paper A.2)."""

from __future__ import annotations

import hashlib

from scenewright.memory.state import Tracks
from scenewright.scene.base import FloatArray, Point
from scenewright.scene.behavior import BehaviorProgram
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.events import EVENT_OF_RELATION
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import (
    AgentRecord,
    RelationRecord,
    SceneMeta,
    SceneRecord,
    SegmentRecord,
    SignalRecord,
)
from scenewright.scene.selection import SelectedAgent, Selection
from scenewright.scene.social import SocialGraph
from scenewright.scene.track import STEP, Track
from scenewright.tools.signals import SignalClock, plan_records


def assemble(
    instruction: str,
    graph: SocialGraph,
    pool: CandidateSet,
    selection: Selection,
    behavior: BehaviorProgram,
    tracks: Tracks,
    *,
    on: IntersectionMap,
    seed: int,
) -> SceneRecord:
    """The scene without its events, which only the checker may write.

    Agents are numbered from 1, those of the social graph first.
    """
    numbers = {name: number for number, name in enumerate(tracks, start=1)}
    agents = tuple(
        _agent(numbers[name], selection.agents[name], tracks[name], behavior) for name in numbers
    )
    return SceneRecord(
        meta=_meta(instruction, graph, pool, selection, on=on, seed=seed),
        agents=agents,
        events=(),
        relations=_relations(graph, numbers),
        signals=_signals(selection, on),
    )


def _meta(
    instruction: str,
    graph: SocialGraph,
    pool: CandidateSet,
    selection: Selection,
    *,
    on: IntersectionMap,
    seed: int,
) -> SceneMeta:
    minutes = round(pool.hour * 60) % 1440
    return SceneMeta(
        scene_id=scene_id(instruction, on.name, seed),
        map_id=on.map_id,
        timestamp=minutes * 60.0,
        user_prompt=instruction,
        intersection=on.name,
        step=STEP,
        duration=selection.duration,
        time_of_day=f"{minutes // 60:02d}:{minutes % 60:02d}",
        density=graph.context.density,
        seed=seed,
    )


def scene_id(instruction: str, intersection: str, seed: int) -> str:
    """A name for the scene that depends on its request alone."""
    key = f"{intersection}\n{seed}\n{instruction}".encode("utf-8", "surrogatepass")
    return hashlib.sha256(key).hexdigest()[:16]


def _agent(
    number: int, agent: SelectedAgent, track: Track, behavior: BehaviorProgram
) -> AgentRecord:
    candidate, route = agent.candidate, agent.candidate.route
    segments = tuple(
        SegmentRecord(start=s.start, end=s.end, anchor=s.anchor, status=s.status)
        for s in behavior.segments[agent.name]
    )
    return AgentRecord(
        id=number,
        type=route.type,
        spawn_time=track.start,
        goal=_point(candidate.path.xy[-1]),
        trajectory=_points(track.xy),
        role=agent.role,
        name=agent.name,
        subtype=agent.candidate.subtype,
        entry=route.entry,
        exit=route.exit,
        movement=route.movement,
        crosswalk=route.crosswalk,
        route=route.id,
        heading=tuple(track.heading.round(4).tolist()),
        length=candidate.shape.length,
        width=candidate.shape.width,
        segments=segments,
        waypoints=_points(candidate.waypoints),
        violates_signal=agent.violates,
    )


def _points(xy: FloatArray) -> tuple[Point, ...]:
    return tuple((x, y) for x, y in xy.round(3).tolist())


def _point(xy: FloatArray) -> Point:
    x, y = xy.round(3).tolist()
    return x, y


def _relations(graph: SocialGraph, numbers: dict[str, int]) -> tuple[RelationRecord, ...]:
    return tuple(
        RelationRecord.model_validate(
            {
                "type": EVENT_OF_RELATION[edge.type],
                "from": numbers[edge.from_],
                "to": numbers[edge.to],
                "kind": edge.kind,
                "target_pet": edge.target_pet,
                "target_ttc": edge.target_ttc,
                "impact_speed": edge.impact_speed,
            }
        )
        for edge in graph.relations
    )


def _signals(selection: Selection, on: IntersectionMap) -> tuple[SignalRecord, ...]:
    if on.signals is None or selection.signal_offset is None:
        return ()
    clock = SignalClock(on.signals, selection.signal_offset)
    return plan_records(clock, on=on, until=selection.duration)
