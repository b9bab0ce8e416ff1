"""An observation tells of the past and of nothing else."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from scenewright.errors import InputError
from scenewright.evals.understanding.cases import (
    WINDOWS,
    SceneCase,
    assign_split,
    hash_agents,
    hash_scene,
    observe,
)
from scenewright.scene.record import AgentRecord, EventRecord, SceneRecord


def _bytes(record: SceneRecord, name: str, window: float) -> bytes:
    return json.dumps(observe(record, scene=name, window=window).to_json()).encode()


def _elsewhere(agent: AgentRecord, window: float) -> AgentRecord:
    """The agent with another future: it goes on three times as fast, and a little longer."""
    kept = max(round((window - agent.spawn_time) / 0.1 + 1e-6) + 1, 0)
    if kept >= len(agent.trajectory):
        return agent
    xy = np.array(agent.trajectory)
    ahead = xy[max(kept - 1, 0)] + 3.0 * (xy[kept:] - xy[max(kept - 1, 0)]) + 1.0
    ahead = np.concatenate([ahead, ahead[-1:] + 1.0])
    heading = (*agent.heading[:kept], *(each + 1.0 for each in agent.heading[kept:]), 0.0)
    return agent.model_copy(
        update={"trajectory": (*agent.trajectory[:kept], *map(tuple, ahead.tolist())),
                "heading": heading}
    )  # fmt: skip


@pytest.mark.parametrize("window", WINDOWS)
def test_another_future_leaves_every_byte_as_it_was(
    cases: dict[str, SceneCase], window: float
) -> None:
    for name, case in cases.items():
        record = case.record
        later = tuple(_elsewhere(agent, window) for agent in record.agents)
        lights = tuple(
            each.model_copy(update={"end": 30.0, "colour": each.colour})
            if each.start < window <= each.end
            else each
            for each in record.signals
        )
        changed = record.model_copy(update={"agents": later, "signals": lights})
        assert changed != record
        assert _bytes(changed, name, window) == _bytes(record, name, window)


def test_labels_roles_and_plans_leave_every_byte_as_it_was(cases: dict[str, SceneCase]) -> None:
    for name, case in cases.items():
        record = case.record
        agents = tuple(
            agent.model_copy(
                update={
                    "role": "background", "name": "vehicle-99", "exit": "north", "entry": "south",
                    "movement": "left", "route": "vehicle:south>north:straight", "goal": (1.0, 2.0),
                    "segments": (), "waypoints": (), "crosswalk": None, "violates_signal": True,
                    "subtype": None,
                }
            )
            for agent in record.agents
        )  # fmt: skip
        events = (
            EventRecord.model_validate(
                {"type": "normal", "from": None, "to": None, "time": None, "location": None}
            ),
        )
        meta = record.meta.model_copy(
            update={
                "user_prompt": "?",
                "density": None,
                "seed": 99,
                "scene_id": "?",
                "duration": 9.0,
            }
        )
        bare = record.model_copy(
            update={"agents": agents, "events": events, "relations": (), "ties": (), "meta": meta}
        )
        assert _bytes(bare, name, 4.0) == _bytes(record, name, 4.0)


def test_file_order_and_agents_still_to_come_leave_every_byte_as_it_was(
    cases: dict[str, SceneCase],
) -> None:
    for name, case in cases.items():
        backwards = case.record.model_copy(update={"agents": case.record.agents[::-1]})
        seen = tuple(a for a in case.record.agents if a.spawn_time <= 2.0)
        alone = case.record.model_copy(update={"agents": seen})
        assert _bytes(backwards, name, 2.0) == _bytes(case.record, name, 2.0)
        assert _bytes(alone, name, 2.0) == _bytes(case.record, name, 2.0)


def test_ids_neither_count_nor_rank(cases: dict[str, SceneCase]) -> None:
    ranks = []
    for n in range(400):
        codes = hash_agents(f"scene-{n}", (1, 2, 3, 4))
        ranks.append(sorted(codes.values()).index(codes[1]))
    assert np.bincount(ranks, minlength=4).min() > 70
    one, two = (set(hash_agents(name, (1, 2, 3)).values()) for name in ("x", "y"))
    assert not one & two
    keys: set[str] = set()
    for name, case in cases.items():
        row: dict[str, Any] = observe(case.record, scene=name, window=4.0).to_json()
        keys |= set(row) | {key for agent in row["agents"] for key in agent}
        assert name not in json.dumps(row)
    assert keys == {
        "scene", "window", "intersection", "hour", "agents", "lights", "id", "type", "start",
        "trajectory", "heading", "length", "width", "left",
    }  # fmt: skip


def test_a_longer_window_keeps_what_was_observed(cases: dict[str, SceneCase]) -> None:
    case = cases["struck"]
    short = {a.id: a for a in observe(case.record, scene="struck", window=2.0).agents}
    long = {a.id: a for a in observe(case.record, scene="struck", window=5.0).agents}
    assert set(short) <= set(long)
    for code, agent in short.items():
        assert (long[code].xy[: len(agent.xy)] == agent.xy).all()
        assert agent.start + 0.1 * (len(agent.xy) - 1) <= 2.0 + 1e-6


def test_lights_end_at_the_moment_of_observation(cases: dict[str, SceneCase]) -> None:
    for name, case in cases.items():
        lights = observe(case.record, scene=name, window=3.0).lights
        assert lights
        assert max(each.end for each in lights) <= 3.0


def test_speeds_look_back_only(cases: dict[str, SceneCase]) -> None:
    for agent in observe(cases["plain"].record, scene="plain", window=2.0).agents:
        assert len(agent.speed) == len(agent.xy) == len(agent.moved)
        if len(agent.xy) > 1:
            assert agent.speed[-1] == pytest.approx(np.hypot(*(agent.xy[-1] - agent.xy[-2])) / 0.1)


def test_a_window_must_fit_the_scene(cases: dict[str, SceneCase]) -> None:
    for window in (0.0, 99.0):
        with pytest.raises(InputError, match="window"):
            observe(cases["plain"].record, scene="plain", window=window)


def test_halves_are_fixed_by_the_name_alone() -> None:
    halves = [assign_split(f"scene-{n}") for n in range(1000)]
    assert halves == [assign_split(f"scene-{n}") for n in range(1000)]
    assert 440 < halves.count("test") < 560
    assert (assign_split("scene-0"), assign_split("scene-1")) == (halves[0], halves[1])
    assert len({hash_scene(f"scene-{n}") for n in range(1000)}) == 1000
