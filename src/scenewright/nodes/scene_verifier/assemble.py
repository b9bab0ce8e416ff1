"""Final tracks, segments and signal plan as one scene record (paper A.2)."""

from __future__ import annotations

import hashlib
from typing import Any

from scenewright.memory.state import Tracks
from scenewright.scene.account import number_agents
from scenewright.scene.base import FloatArray, Point
from scenewright.scene.behavior import BehaviorProgram
from scenewright.scene.candidates import AssignedPattern, CandidateSet, RoleAssignment
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.kinds import has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.objects import EncounterRecord, SightRecord
from scenewright.scene.plan_fields import join_fields, list_fields
from scenewright.scene.record import (
    AgentRecord,
    MeasureRecord,
    RelationRecord,
    SceneMeta,
    SceneRecord,
    SegmentRecord,
    SignalRecord,
    TieRecord,
)
from scenewright.scene.relations import get_pattern
from scenewright.scene.selection import SelectedAgent, Selection
from scenewright.scene.social import (
    DEFAULT_LEAD,
    AskedReaction,
    Motion,
    RelationEdge,
    SocialGraph,
)
from scenewright.scene.track import STEP, Track
from scenewright.tools.map_grounding.signal_plan import SignalClock, build_signal_records


def assemble(
    instruction: str,
    graph: SocialGraph,
    pool: CandidateSet,
    selection: Selection,
    behavior: BehaviorProgram,
    tracks: Tracks,
    *,
    intersection_map: IntersectionMap,
    seed: int,
    pins: FrozenAgents | None = None,
) -> SceneRecord:
    """The scene without its events, which only the checker may write.

    Agents are numbered from 1, those of the social graph first; those of an earlier version keep
    their numbers.
    """
    names = tuple(tracks)
    numbers = {name: number for number, name in enumerate(names, start=1)}
    numbers = numbers if pins is None else pins.assign_numbers(names)
    motions = {agent.id: agent.motion for agent in graph.agents}
    reactions = {agent.id: agent.reaction for agent in graph.agents}
    agents = tuple(
        _build_agent_record(
            numbers[name],
            selection.agents[name],
            tracks[name],
            behavior,
            motion=motions.get(selection.agents[name].group or name),
            reaction=reactions.get(name),
            group=numbers.get(selection.agents[name].group or ""),
        )
        for name in numbers
    )
    return SceneRecord(
        meta=_build_meta(
            instruction, graph, pool, selection, intersection_map=intersection_map, seed=seed
        ),
        agents=agents,
        events=(),
        relations=_build_relation_records(graph, pool.cast, numbers),
        ties=tuple(
            TieRecord(agent=numbers[tie.agent], of=numbers[tie.of], side=tie.side)
            for tie in graph.ties
        ),
        measures=build_measure_records(graph, numbers),
        signals=_build_signal_records(selection, intersection_map),
        said=number_agents(graph.said, numbers),
        objects=selection.objects,
        sights=_list_sights(graph, numbers),
        encounters=tuple(
            EncounterRecord(
                agent=numbers[met.agent], object=each.id, how=met.encounter, figure=met.figure
            )
            for each in graph.objects
            for met in each.list_meetings()
        ),
    )


def _list_sights(graph: SocialGraph, numbers: dict[str, int]) -> tuple[SightRecord, ...]:
    """Every line of sight that an object is to block."""
    return tuple(
        SightRecord(
            observer=numbers[scene_object.hidden_from],
            subject=numbers[scene_object.hides],
            object=scene_object.id,
            lead=scene_object.lead or DEFAULT_LEAD,
            between=next((o.id for o in graph.objects if o.beyond == scene_object.id), None),
        )
        for scene_object in graph.objects
        if scene_object.hides is not None and scene_object.hidden_from is not None
    )


def _build_meta(
    instruction: str,
    graph: SocialGraph,
    pool: CandidateSet,
    selection: Selection,
    *,
    intersection_map: IntersectionMap,
    seed: int,
) -> SceneMeta:
    minutes, fields, plan = round(pool.hour * 60) % 1440, list_fields(graph), None
    if instruction == join_fields(
        fields
    ):  # it is but the text of a plan; stages may close accounts
        said = tuple(field.value for field in fields if field.section == "said")
        plan = graph.model_copy(update={"said": said})
    return SceneMeta(
        scene_id=compute_scene_id(instruction, intersection_map.name, seed),
        map_id=intersection_map.map_id,
        timestamp=minutes * 60.0,
        user_prompt=instruction,
        intersection=intersection_map.name,
        step=STEP,
        duration=selection.duration,
        time_of_day=f"{minutes // 60:02d}:{minutes % 60:02d}",
        density=graph.context.density,
        seed=seed,
        rules=3,
        plan=plan,
    )


def compute_scene_id(instruction: str, intersection: str, seed: int) -> str:
    """A name for the scene that depends on its request alone."""
    key = f"{intersection}\n{seed}\n{instruction}".encode("utf-8", "surrogatepass")
    return hashlib.sha256(key).hexdigest()[:16]


def _build_agent_record(
    number: int,
    agent: SelectedAgent,
    track: Track,
    behavior: BehaviorProgram,
    *,
    reaction: AskedReaction | None,
    motion: Motion | None,
    group: int | None,
) -> AgentRecord:
    candidate, route = agent.candidate, agent.candidate.route
    segments = tuple(
        SegmentRecord(start=s.start, end=s.end, anchor=s.anchor, status=s.status)
        for s in behavior.segments[agent.name]
    )
    # Thousands of points that our own arrays hold: read back from a file they are looked at again.
    return AgentRecord.model_construct(
        id=number,
        type=candidate.shape.type,
        spawn_time=track.start,
        goal=_round_points(candidate.path.xy[-1:])[0],
        trajectory=_round_points(track.xy),
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
        waypoints=_round_points(candidate.waypoints),
        violates_signal=agent.violates,
        motion=motion,
        reaction=reaction,
        group=group,
    )


def _round_points(xy: FloatArray) -> tuple[Point, ...]:
    x, y = xy.round(3).T.tolist()
    return tuple(zip(x, y, strict=True))


def _build_relation_records(
    graph: SocialGraph, cast: RoleAssignment, numbers: dict[str, int]
) -> tuple[RelationRecord, ...]:
    """What was asked for, and what the file of the pattern that plays it demands besides."""
    played = {pattern.edge: pattern for pattern in cast.patterns}
    return tuple(
        RelationRecord.model_validate(
            {
                **_describe_sides(edge, played[index], numbers),
                "cause_agent": find_culprit(edge, graph, numbers),
                "target_pet": edge.target_pet,
                "target_ttc": edge.target_ttc,
                "impact_speed": edge.impact_speed,
                **_list_demands(edge, played[index], numbers),
            }
        )
        for index, edge in enumerate(graph.relations)
    )


def build_measure_records(graph: SocialGraph, numbers: dict[str, int]) -> tuple[MeasureRecord, ...]:
    """The figures asked for, of the agents with these numbers."""
    return tuple(
        MeasureRecord(
            kind=measure.kind,
            agent=numbers[measure.agent],
            other=None if measure.other is None else numbers[measure.other],
            low=measure.low,
            high=measure.high,
        )
        for measure in graph.measures
    )


def _describe_sides(
    edge: RelationEdge, played: AssignedPattern, numbers: dict[str, int]
) -> dict[str, Any]:
    """The agents asked for and their roles; the striking agent is first where its kind says so."""
    sides = [(edge.from_, edge.point_from), (edge.to, edge.point_to)]
    kind = edge.kind or get_pattern(played.pattern).proof.kind
    if kind in ("rear_end", "pedestrian_strike") and edge.from_ != played.from_:
        sides.reverse()
    (first, point_from), (second, point_to) = sides
    return {
        "from": numbers[first],
        "to": numbers[second],
        "point_from": point_from,
        "point_to": point_to,
    }


def _list_demands(
    edge: RelationEdge, played: AssignedPattern, numbers: dict[str, int]
) -> dict[str, Any]:
    """What the relation's file wants to see; the text may ask for more, or for other figures."""
    pattern = get_pattern(played.pattern)
    roles = {"from": numbers[played.from_], "to": numbers[played.to]}
    brakes = edge.brakes
    severe = brakes or edge.target_pet is not None
    by_file = roles[pattern.order] if pattern.order and not brakes else None
    striker = None if pattern.striker is None else roles[pattern.striker]
    striker = striker if edge.strikes is None else numbers[edge.strikes]
    return {
        "type": pattern.proof.event,
        "kind": edge.kind or pattern.proof.kind,
        "cause": edge.cause or pattern.proof.cause,
        "manoeuvre": pattern.manoeuvre,
        "zone": pattern.zone,
        "first": by_file if edge.first is None else numbers[edge.first],
        **({} if striker is None else {"strikes": striker}),
        "within": {} if severe else pattern.compute_bounds(),
    }


def find_culprit(edge: RelationEdge, graph: SocialGraph, numbers: dict[str, int]) -> int | None:
    """The agent that causes the event: the one that runs red, the vehicle that brakes late."""
    pair = (graph.agent(edge.from_), graph.agent(edge.to))
    found: list[int] = []
    if has_trait("cause", edge.cause, "red_light"):
        found = [numbers[agent.id] for agent in pair if agent.runs_red]
    elif has_trait("cause", edge.cause, "late"):
        vehicles = [agent.id for agent in pair if agent.type == "vehicle"]
        found = [numbers[name] for name in [edge.braker or "", *vehicles] if name][:1]
    return found[0] if len(found) == 1 else None


def _build_signal_records(
    selection: Selection, intersection_map: IntersectionMap
) -> tuple[SignalRecord, ...]:
    if intersection_map.signals is None or selection.signal_offset is None:
        return ()
    clock = SignalClock(intersection_map.signals, selection.signal_offset)
    return build_signal_records(clock, intersection_map=intersection_map, until=selection.duration)
