"""The strict paper profile: Listing 1 of the paper and nothing else."""

from __future__ import annotations

import json

import pytest

from scenewright import synthesize

META = {"scene_id", "map_id", "timestamp", "user_prompt"}
AGENT = {"id", "type", "spawn_time", "goal", "trajectory"}
EVENT = {"type", "from", "to", "time", "location"}


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("A car yields to a pedestrian.", "yielding"),
        ("A car follows a bus.", "normal"),
        ("Ordinary traffic, nothing happens.", "normal"),
    ],
)
def test_the_paper_profile_holds_listing_1_alone(tmp_path, text, seen):
    scene = synthesize(text, seed=3)
    scene.save(tmp_path, profile="paper")
    written = json.loads((tmp_path / "scene.json").read_text("utf-8"))
    assert set(written) == {"meta", "agents", "events"}
    assert set(written["meta"]) == META
    assert {frozenset(agent) for agent in written["agents"]} == {frozenset(AGENT)}
    assert [set(event) for event in written["events"]] == [EVENT]
    (event,) = written["events"]
    ids = {agent["id"] for agent in written["agents"]}
    assert event["type"] == seen
    assert {event["from"], event["to"]} <= ids
    assert written["agents"][0]["trajectory"] == [
        list(point) for point in scene.record.agents[0].trajectory
    ]
