"""A drive as a scene: the motion of all agents, with the relation checker's proof of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from scenewright.driving.single_drive import Drive
from scenewright.driving.world import list_ego_points
from scenewright.scene.base import FloatArray, Point
from scenewright.scene.digest import digest_scene
from scenewright.scene.events import Event, Proof
from scenewright.scene.record import AgentRecord, EventRecord, RelationRecord, SceneRecord
from scenewright.tools.relation_checker import check


@dataclass(frozen=True, eq=False)
class DrivenScene:
    """What was driven, as scenes are written, and what the checker finds in it.

    Attributes:
        record: scene.json; proof: the relation checker's verdict on it.
        dropped: relations whose agents had not both entered when the drive ended.
    """

    record: SceneRecord
    proof: Proof
    dropped: tuple[RelationRecord, ...]

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """Everything observed, in order of time."""
        found = (*self.proof.events, *self.proof.incidental)
        return tuple(sorted(found, key=lambda event: event.time))


def build_driven_scene(drive: Drive) -> DrivenScene:
    """The scene that a drive made.

    The account of words, waypoints and segments are those of the recorded scene and are left out.
    """
    one = drive.scenario
    agents = [each for k in range(len(one.record.agents)) if (each := _drive_agent(drive, k))]
    there = {agent.id for agent in agents}
    kept = [each for each in one.record.relations if {each.from_, each.to} <= there]
    record = one.record.model_copy(update={
        "meta": _describe(drive),
        "agents": tuple(agents),
        "events": (),
        "relations": tuple(kept),
        "ties": tuple(t for t in one.record.ties if {t.agent, t.of} <= there),
        "measures": tuple(
            m for m in one.record.measures if {m.agent, m.other or m.agent} <= there
        ),
        "sights": tuple(s for s in one.record.sights if {s.observer, s.subject} <= there),
        "encounters": tuple(e for e in one.record.encounters if e.agent in there),
        "said": (),
        "signals": _cut_signals(drive),
    })  # fmt: skip
    record = _write_events(record, check(record, one.intersection_map))
    proof = check(record, one.intersection_map, labelled=True)
    proof = proof.model_copy(update={"scene_digest": digest_scene(record)})
    dropped = tuple(each for each in one.record.relations if each not in kept)
    return DrivenScene(record, proof, dropped)


def _describe(drive: Drive) -> Any:
    meta, one = drive.scenario.record.meta, drive.scenario
    return meta.model_copy(update={
        "scene_id": f"{meta.scene_id}-{drive.policy}"[:80].replace(":", "-"),
        "driven_by": drive.policy,
        "duration": round(drive.world.step * one.step, 3),
    })  # fmt: skip


def _drive_agent(drive: Drive, k: int) -> AgentRecord | None:
    """The agent with its driven track; None if it was never there."""
    one = drive.scenario
    xy, heading, there = _collect_track(drive, k)
    steps = np.flatnonzero(there)
    if not len(steps):
        return None
    part = slice(steps[0], steps[-1] + 1)
    return one.record.agents[k].model_copy(update={
        "spawn_time": round(float(steps[0]) * one.step, 3),
        "trajectory": _convert_to_points(xy[part]),
        "heading": tuple(np.unwrap(heading[part]).round(4).tolist()),
        "waypoints": (),
        "segments": (),
    })  # fmt: skip


def _collect_track(drive: Drive, k: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Positions, headings and presence of an agent from the scene's first step to the last."""
    one, world = drive.scenario, drive.world
    xy, heading = one.xy[k, : one.start], one.heading[k, : one.start]
    there = one.present[k, : one.start]
    if k == one.ego:
        points = list_ego_points(world.history)
        driven = points[:, :2], points[:, 2], np.ones(len(points), dtype=bool)
    else:
        driven = (
            np.array([now.xy[k] for now in world.record]),
            np.array([now.heading[k] for now in world.record]),
            np.array([now.present[k] for now in world.record]),
        )
    return tuple(  # type: ignore[return-value]
        np.concatenate(pair) for pair in zip((xy, heading, there), driven, strict=True)
    )


def _convert_to_points(xy: FloatArray) -> tuple[Point, ...]:
    x, y = xy.round(3).T.tolist()
    return tuple(zip(x, y, strict=True))


def _cut_signals(drive: Drive) -> Any:
    """The rows of the lights up to the end of the drive."""
    end = round(drive.world.step * drive.scenario.step, 3)
    rows = drive.scenario.record.signals
    return tuple(
        row.model_copy(update={"end": min(row.end, end)}) for row in rows if row.start < end
    )


def _write_events(record: SceneRecord, proof: Proof) -> SceneRecord:
    """The scene with the events found; where there are none one row says so."""
    rows = [
        EventRecord.model_validate(event.model_dump(by_alias=True, exclude={"evidence"}))
        for event in proof.events
    ] or [
        EventRecord.model_validate(
            {"type": "normal", "from": None, "to": None, "time": None, "location": None}
        )
    ]
    return record.model_copy(update={"events": tuple(rows)})
