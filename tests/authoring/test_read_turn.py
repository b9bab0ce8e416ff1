"""Files that are no scene or no tracks end in one clear line, whatever they are."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from scenewright.errors import InputError
from scenewright.graph.scene_files import load_scene
from scenewright.graph.verify import load_tracks, verify
from scenewright.scene.record import AgentRecord, SceneMeta, SceneRecord
from scenewright.tools.formats import sample_table


def record() -> SceneRecord:
    """One car that drives east for two seconds."""
    meta = SceneMeta(
        scene_id="s", map_id=0, timestamp=0.0, user_prompt="", intersection="amsterdam_120",
        step=0.1, duration=2.0, time_of_day="12:00", seed=0,
    )  # fmt: skip
    car = AgentRecord(
        id=1, type="vehicle", spawn_time=0.0, goal=(0.0, 0.0), role="foreground", name="vehicle-1",
        trajectory=tuple((0.8 * k, 0.0) for k in range(21)), entry="west", exit="east",
        movement="straight", route="r", heading=(0.0,) * 21, length=4.6, width=1.85,
    )  # fmt: skip
    return SceneRecord(meta=meta, agents=(car,), events=())


@pytest.mark.parametrize("load", [load_scene, load_tracks])
@pytest.mark.parametrize("name", ["tracks.csv", "scene.json"])
def test_pipes_and_devices_are_not_read(
    tmp_path: Path, load: Callable[[Path], Any], name: str
) -> None:
    pipe, endless = tmp_path / f"pipe-{name}", tmp_path / f"endless-{name}"
    os.mkfifo(pipe)
    endless.symlink_to("/dev/zero")
    for file in (pipe, endless):
        with pytest.raises(InputError, match="a device or a pipe"):
            load(file)


@pytest.mark.parametrize(("load", "name"), [(load_scene, "scene.json"), (load_tracks, "a.csv")])
def test_no_more_is_read_than_can_be_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, load: Callable[[Path], Any], name: str
) -> None:
    monkeypatch.setattr(sample_table, "MOST_BYTES", 1000)
    (tmp_path / name).write_bytes(b"t,id,class,x,y\n" + b" " * 2000)
    with pytest.raises(InputError, match="at most"):
        load(tmp_path / name)


@pytest.mark.parametrize(
    ("change", "given"),
    [
        ({"spawn_time": 1e9}, "this is no scene"),
        ({"spawn_time": -1e9}, "this is no scene"),
        ({"trajectory": ((0.0, 0.0),) * 50_000, "heading": (0.0,) * 50_000}, "this is no scene"),
        ({"trajectory": ((1e308, 0.0), (-1e308, 0.0)), "heading": (0.0, 0.0)}, "further than"),
        ({"heading": (1e308,) * 21}, "too far off"),
        ({"trajectory": ((0.0, 0.0), (1e7, 0.0)), "heading": (0.0, 0.0)}, "further than"),
    ],
)
def test_scenes_beyond_all_measure(change: dict[str, Any], given: str) -> None:
    scene = record()
    verify(scene)
    odd = scene.agents[0].model_copy(update=change)
    with pytest.raises(InputError, match=given):
        verify(scene.model_copy(update={"agents": (odd,)}))


NEVER = {"type": "collision", "from": 1, "to": 1, "time": -1.0, "location": [0.0, 0.0]}


@pytest.mark.parametrize(
    ("at", "change", "given"),
    [
        ("meta", {"duration": 1e9}, "it would last 1e.09 s in steps of 0.1 s"),
        ("agents", {"spawn_time": -1e9}, "it would last 1e.09 s"),
        ("agents", {"spawn_time": "nan"}, "it would last nan s"),
        ("file", {"events": [NEVER]}, "an event happens at -1 s"),
        ("meta", {"step": 0.0}, "meta.step must be 0.001 to 1 seconds, not 0"),
        ("agents", {"heading": [0.0]}, "1 headings; give one each"),
        ("agents", {"waypoints": [[1e7, 0.0]] * 10}, "agent 1 has a position further than 20000 m"),
    ],
)
def test_files_that_would_fill_the_memory_of_a_reader(
    tmp_path: Path, at: str, change: dict[str, Any], given: str
) -> None:
    content = json.loads(record().model_dump_json(by_alias=True))
    {"file": content, "meta": content["meta"], "agents": content["agents"][0]}[at].update(change)
    (tmp_path / "scene.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=given):
        load_scene(tmp_path)


def test_more_agents_than_a_scene_holds() -> None:
    scene = record()
    many = tuple(scene.agents[0].model_copy(update={"id": n}) for n in range(3000))
    with pytest.raises(InputError, match="3000 agents are too many"):
        verify(scene.model_copy(update={"agents": many}))


def test_a_scene_of_the_paper_profile_says_why_it_cannot_be_proven(tmp_path: Path) -> None:
    file = tmp_path / "scene.json"
    file.write_text(json.dumps(record().to_paper()))
    with pytest.raises(InputError, match=r"paper profile .* verify the full scene\.json"):
        verify(file, intersection="amsterdam_120")
    file.write_text(json.dumps({"meta": {}, "agents": [], "events": []}))
    with pytest.raises(InputError, match="Field required"):
        load_scene(file)
