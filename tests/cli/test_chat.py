"""The conversation at the command line: scripts, odd input, resuming, saving."""

from __future__ import annotations

import io
import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from scenewright import verify
from scenewright.cli.main import main

YIELD = "A car yields to a pedestrian at 5 am"


@dataclass
class Told:
    stdout: bytes
    stderr: str


Talk = Callable[..., Told]


@pytest.fixture
def talk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]
) -> Talk:
    """A conversation as typed into `scenewright chat`, in this process."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").mkdir()
    monkeypatch.setenv("SCENEWRIGHT_DATA", str(tmp_path / "data"))

    def typed(*lines: str | bytes, options: tuple[str, ...] = (), code: int = 0) -> Told:
        data = b"".join((x if isinstance(x, bytes) else x.encode()) + b"\n" for x in lines)
        with monkeypatch.context() as patched:
            patched.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
            words = (
                list(options) if options[:1] == ("memory",) else ["chat", "--seed", "1", *options]
            )
            done = main(words)
        seen = capfdbinary.readouterr()
        assert done == code, seen.err.decode()
        return Told(seen.out, seen.err.decode())

    return typed


def replies(done: Told) -> list[dict[str, Any]]:
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_a_script_gets_one_object_for_every_line(tmp_path: Path, talk: Talk) -> None:
    lines = (
        YIELD, "make it a near miss", "/undo", "/redo", "/compare 1 2", "/branch x", "/branches",
        "/history", "/show 1", "why?", "/fly", "/compare 1", "/show 9", "remove the bus", "/why",
        "", "/save there", "x" * 20_001, b"\xff\xfe", "/help", "/quit", "never read",
    )  # fmt: skip
    made = replies(talk(*lines, options=("--json", "--thread", "t")))
    kinds = [each["kind"] for each in made]
    assert kinds == [
        "made", "made", "moved_to", "moved_to", "compared", "moved_to", "branches", "history",
        "shown", "answer", "refused", "refused", "refused", "refused", "why", "saved", "refused",
        "refused", "help",
    ]  # fmt: skip
    assert all(each["ok"] is (each["kind"] != "refused") for each in made)
    assert made[1]["moved"] == []
    assert [made[1][key] for key in ("verified", "verdict", "caveat")] == [True, "verified", ""]
    assert {each["turn"] for each in made[1]["account"]} == {0, 1}
    assert made[8]["verdict"] == "verified"
    assert made[4]["changed"] == ["vehicle-1"]
    assert verify(tmp_path / "there").verified
    assert (tmp_path / "there" / "scene.png").is_file()


def test_a_thread_goes_on_where_it_was(tmp_path: Path, talk: Talk) -> None:
    first = talk(YIELD, "add two cars")
    assert b"version 2: verified" in first.stdout
    assert b"to the last bit" in first.stdout or b"new: vehicle" in first.stdout
    again = talk("/show", options=("--thread", "thread-1", "--json", "--no-memory"))
    assert replies(again)[0]["version"] == 2
    assert talk(options=("--list",)).stdout == b"thread-1\n"


def test_what_cannot_be_used_is_said_in_one_line(tmp_path: Path, talk: Talk) -> None:
    bad = talk(options=("--thread", "../x"), code=2)
    assert bad.stderr.count("\n") == 1
    assert "is no name for a thread" in bad.stderr
    (tmp_path / "file").write_text("this is not a database of threads, as anybody can see")
    bad = talk(options=("--threads", "file"), code=2)
    assert "cannot use" in bad.stderr


def test_what_is_saved_is_remembered_and_wiped(tmp_path: Path, talk: Talk) -> None:
    def memory(word: str) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(talk(options=("memory", word, "--json")).stdout)
        return found

    talk(YIELD, "/save a", options=("--no-memory",))
    assert memory("list")["episodes"] == []
    talk(YIELD, "/save b")
    (episode,) = memory("list")["episodes"]
    assert episode["request"] == YIELD
    assert memory("wipe")["forgotten"] == 1
    assert memory("list")["episodes"] == []


def test_a_client_of_the_protocol_makes_and_changes_a_scene(tmp_path: Path) -> None:
    mcp = pytest.importorskip("mcp")
    import anyio

    (tmp_path / "data").mkdir()
    server = mcp.StdioServerParameters(
        command=sys.executable,
        args=["-m", "scenewright", "mcp", "--seed", "1", "--out", str(tmp_path / "kept")],
        env=os.environ | {"SCENEWRIGHT_DATA": str(tmp_path / "data")},
    )

    async def session() -> None:
        async with mcp.Client(server) as client:
            names = {each.name for each in (await client.list_tools()).tools}
            assert {"edit_scene", "verify_scene", "ground_plan", "solve", "record_scene"} <= names

            async def call(name: str, **arguments: Any) -> dict[str, Any]:
                found: dict[str, Any] = (await client.call_tool(name, arguments)).structured_content
                return found

            assert not (await call("show_scene"))["ok"]
            made = await call("make_scene", instruction=YIELD)
            assert (made["verified"], made["verdict"]) == (True, "verified")
            assert {each["state"] for each in made["account"]} == {"seen"}
            hit = await call("edit_scene", words="now have it be a collision")
            assert [each["type"] for each in hit["events"]] == ["collision"]
            assert not (await call("edit_scene", words="remove the bus"))["ok"]
            assert (await call("explain_refusal"))["lines"]
            scene = (await call("scene_json"))["scene"]
            assert (await call("verify_scene", scene=scene))["verdict"] == "verified"
            scene["agents"][0]["trajectory"] = scene["agents"][0]["trajectory"][::-1]
            assert (await call("verify_scene", scene=scene))["verdict"] == "not verified"
            assert not (await call("verify_scene", scene={"meta": 1}))["ok"]
            assert (await call("undo"))["version"] == 1
            picture = await client.read_resource("scene://version/2/picture.png")
            assert picture.contents[0].mime_type == "image/png"
            later = [{"edit": "come_later", "agent": "nobody-1", "seconds": 1}]
            assert not (await call("edit_by_hand", edits=later))["ok"]
            assert len((await call("list_versions"))["versions"]) == 2
            assert (await call("open_thread", thread="other"))["current"] is None
            assert set((await call("list_threads"))["threads"]) == {"mcp"}
            opened = await call("open_thread", thread="mcp")
            assert opened == {"ok": True, "thread": "mcp", "current": 1}
            assert Path((await call("save_scene"))["folder"]).is_dir()
            assert "start_scene first" in (await call("solve"))["detail"]
            assert (await call("start_scene", instruction="There is a vehicle", seed=2))["ok"]
            plan = {"agents": [{"id": "vehicle-1", "type": "vehicle"}]}
            assert (await call("ground_plan", plan=plan))["ok"]
            steps = "draw_candidates", "solve", "edit_segments", "refine", "check_scene"
            results = [await call(step) for step in steps]
            assert all(each["ok"] for each in results), results[1]
            assert Path((await call("record_scene"))["kept"]).is_dir()
            exact = await call("make_planned_scene", plan=plan, seed=1)
            assert (exact["verdict"], exact["account"][0]["words"]) == ("verified", "vehicle-1")
            assert (exact["version"], exact["from"]) == (3, 1)
            assert (Path((await call("save_scene"))["folder"]) / "scene.json").is_file()
            wrong = await call("make_planned_scene", plan={"agents": [{"id": "tram-1"}]})
            assert wrong["detail"].startswith("plan, agents[0].id: a name such as vehicle-1")
            goals = {"dimensions": [{"cover": "event", "values": ["normal"]}]}
            (covered,) = (await call("measure_coverage", goals=goals))["items"]
            assert (covered["name"], covered["gaps"]) == ("event", [])
            assert (
                "dimensions[0].cover"
                in (await call("measure_coverage", goals={"dimensions": [{"cover": "events"}]}))[
                    "detail"
                ]
            )
            tracks = [str(tmp_path / "kept")]
            seen = await call("find_scenarios", query="A car yields to a pedestrian", paths=tracks)
            assert [e["type"] for hit in seen["hits"] for e in hit["events"]] == ["yielding"]
            fields = {"agents": [{"id": "cyclist-1"}]}
            seen = await call("find_scenarios", query=fields, paths=tracks)
            assert (seen["ok"], seen["hits"]) == (True, [])
            wrong = await call("find_scenarios", query="A car", paths=[str(tmp_path / "none")])
            assert not wrong["ok"]
            wrong = await call("find_scenarios", query={"agents": 3}, paths=tracks)
            assert wrong["detail"].startswith("plan, agents: a list")
            assert "ccftap" in (await call("read_catalogue"))["plans"]
            assert "vehicle-2" in (await call("read_catalogue", plan="ccftap"))["plan"]

    anyio.run(session)
