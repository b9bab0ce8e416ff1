"""A drive as a scene: the motion of all agents, with the relation checker's proof of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenewright.driving.single_drive import Drive
from scenewright.driving.world import list_ego_points
from scenewright.errors import InputError
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

    Raises:
        InputError: the drive was one on tracks without a scene.
    """
    scenario = drive.scenario
    if scenario.record is None:
        raise InputError("a drive on recorded tracks has no scene to write")
    meta, end = scenario.record.meta, round(drive.world.step * scenario.step, 3)
    agents = [each for k in range(len(scenario.record.agents)) if (each := _drive_agent(drive, k))]
    there = {agent.id for agent in agents}
    kept = [
        relation for relation in scenario.record.relations if {relation.from_, relation.to} <= there
    ]
    record = scenario.record.model_copy(update={
        "meta": meta.model_copy(update={
            "scene_id": f"{meta.scene_id}-{drive.policy}"[:80].replace(":", "-"),
            "driven_by": drive.policy,
            "duration": end,
        }),
        "agents": tuple(agents),
        "events": (),
        "relations": tuple(kept),
        "ties": tuple(t for t in scenario.record.ties if {t.agent, t.of} <= there),
        "measures": tuple(
            m for m in scenario.record.measures if {m.agent, m.other or m.agent} <= there
        ),
        "sights": tuple(s for s in scenario.record.sights if {s.observer, s.subject} <= there),
        "encounters": tuple(e for e in scenario.record.encounters if e.agent in there),
        "said": (),
        "signals": tuple(
            row.model_copy(update={"end": min(row.end, end)})
            for row in scenario.record.signals if row.start < end
        ),
    })  # fmt: skip
    record = _write_events(record, check(record, scenario.intersection_map))
    proof = check(record, scenario.intersection_map, labelled=True)
    proof = proof.model_copy(update={"scene_digest": digest_scene(record)})
    dropped = tuple(relation for relation in scenario.record.relations if relation not in kept)
    return DrivenScene(record, proof, dropped)


def _drive_agent(drive: Drive, k: int) -> AgentRecord | None:
    """The agent with its driven track; None if it was never there."""
    scenario, world = drive.scenario, drive.world
    if k == scenario.ego:
        points = list_ego_points(world.history)
        driven = [points[:, :2], points[:, 2], np.ones(len(points), dtype=bool)]
    else:
        names = ("xy", "heading", "present")
        driven = [np.array([getattr(now, name)[k] for now in world.record]) for name in names]
    before = (scenario.xy, scenario.heading, scenario.present)
    xy, heading, there = (
        np.concatenate([early[k, : scenario.start], late])
        for early, late in zip(before, driven, strict=True)
    )
    steps = np.flatnonzero(there)
    if not len(steps):
        return None
    part = slice(steps[0], steps[-1] + 1)
    return scenario.record.agents[k].model_copy(update={  # type: ignore[union-attr]
        "spawn_time": round(float(steps[0]) * scenario.step, 3),
        "trajectory": tuple(map(tuple, xy[part].round(3).tolist())),
        "heading": tuple(np.unwrap(heading[part]).round(4).tolist()),
        "waypoints": (),
        "segments": (),
    })  # fmt: skip


def _write_events(record: SceneRecord, proof: Proof) -> SceneRecord:
    """The scene with the events found; where there are none one row says so."""
    rows = [
        EventRecord.model_validate(
            event.model_dump(by_alias=True, include=set(EventRecord.model_fields))
        )
        for event in proof.events
    ] or [
        EventRecord.model_validate(
            {"type": "normal", "from": None, "to": None, "time": None, "location": None}
        )
    ]
    return record.model_copy(update={"events": tuple(rows)})
