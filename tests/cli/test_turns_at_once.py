"""One turn of a conversation at a time, whoever asks: no version is lost, each reply is its own."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from scenewright.authoring.session import Session
from scenewright.authoring.thread_state import ThreadSetting
from scenewright.authoring.versions import EditResult, Make, begin
from scenewright.backends import load_backend
from scenewright.cli.mcp import build_server
from scenewright.cli.options import SessionOptions
from scenewright.cli.page.asked import NewThread
from scenewright.cli.page.conversations import Conversations
from scenewright.errors import BusyError
from scenewright.graph.run import synthesize
from scenewright.memory.threads import Threads

CALLS = 40
BACKEND = load_backend("builtin")
SETTING: ThreadSetting = {"intersection": "amsterdam_120", "seed": 1, "refiner": "none"}


@pytest.fixture
def _made_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes that take no time, so that many turns are entered close together."""
    make = partial(synthesize, backend=BACKEND, seed=1, refiner="none")
    made = begin("A car yields to a pedestrian at 5 am", make)

    def begin_at_once(_text: str, _make: Make) -> EditResult:
        return made

    monkeypatch.setattr("scenewright.authoring.session.begin", begin_at_once)


@pytest.mark.usefixtures("_made_at_once")
def test_calls_of_a_client_that_does_not_wait_lose_no_version(tmp_path: Path) -> None:
    mcp = pytest.importorskip("mcp")
    import anyio

    options = SessionOptions(threads=str(tmp_path / "t.sqlite"), seed=1)
    server = build_server(options, thread="mcp", out=None)
    replies: dict[str, dict[str, Any]] = {}

    async def session() -> None:
        async with mcp.Client(server) as client:

            async def make(words: str) -> None:
                answer = await client.call_tool("make_scene", {"instruction": words})
                replies[words] = answer.structured_content

            async with anyio.create_task_group() as group:
                for number in range(CALLS):
                    group.start_soon(make, f"a car yields to pedestrian number {number}")
            listed = (await client.call_tool("list_versions", {})).structured_content
            versions = {each["words"]: each["version"] for each in listed["versions"]}
            assert sorted(versions.values()) == list(range(1, CALLS + 1))
            assert {words: each["version"] for words, each in replies.items()} == versions
            assert all(each["kind"] == "made" for each in replies.values())

    anyio.run(session)


@pytest.mark.usefixtures("_made_at_once")
def test_two_sessions_of_one_thread_lose_no_version(tmp_path: Path) -> None:
    opened = [Threads(tmp_path / "t.sqlite") for _ in range(2)]
    sessions = [Session(each, "t", backend=BACKEND, setting=SETTING) for each in opened]
    with ThreadPoolExecutor(4) as pool:
        turns = [pool.submit(sessions[n % 2].make, f"scene {n}") for n in range(8)]
    assert sorted(each.result()["version"] for each in turns) == list(range(1, 9))
    assert len(sessions[0].state["versions"]) == 8
    for each in opened:
        each.close()


@pytest.mark.parametrize("name", [":memory:", "t.sqlite"])
def test_a_turn_is_taken_again_within_and_by_nobody_else(tmp_path: Path, name: str) -> None:
    threads = Threads(name if name == ":memory:" else tmp_path / name)

    def take() -> None:
        with threads.take_turn("t", wait=False):
            pass

    with ThreadPoolExecutor(1) as pool, threads.take_turn("t"):
        take()
        with pytest.raises(BusyError):
            pool.submit(take).result()
        with threads.take_turn("other", wait=False):
            pass
    take()
    threads.close()


def _is_free(file: str) -> bool:
    threads = Threads(file)
    try:
        with threads.take_turn("t", wait=False):
            return True
    except BusyError:
        return False
    finally:
        threads.close()


def test_another_process_waits_as_well(tmp_path: Path) -> None:
    file = str(tmp_path / "t.sqlite")
    threads = Threads(file)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        with threads.take_turn("t"):
            assert not pool.apply(_is_free, (file,))
        assert pool.apply(_is_free, (file,))
    threads.close()


def test_the_page_refuses_a_turn_while_another_is_worked_on(tmp_path: Path) -> None:
    opened = Conversations(SessionOptions(threads=str(tmp_path / "t.sqlite"), seed=1), BACKEND)
    found = opened.create(NewThread("amsterdam_120"))
    with ThreadPoolExecutor(1) as pool, found.session.take_turn():
        second = pool.submit(found.act, "undo", "", lambda _stage, _line: None)
        with pytest.raises(BusyError, match="still being worked on"):
            second.result()
    assert found.act("undo", "", lambda _stage, _line: None)["kind"] == "nothing"
    opened.close()
