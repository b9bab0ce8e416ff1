"""The page: only its own token and address, whole turns, one clear line for bad requests."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from starlette.testclient import TestClient

from scenewright import verify
from scenewright.backends import load_backend
from scenewright.cli.main import main
from scenewright.cli.page.conversations import Conversations
from scenewright.cli.page.server import Page, build_app
from scenewright.scene.record import SceneRecord

HOST = "127.0.0.1:8765"
TOKEN = "a-token-of-this-test"
YIELD = "A car yields to a pedestrian at 5 am"


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    file = str(tmp_path_factory.mktemp("page") / "threads.sqlite")
    conversations = Conversations(file, backend=load_backend("builtin"), seed=1)
    page = Page(conversations, backend="builtin", intersection="amsterdam_120")
    app = build_app(page, token=TOKEN, hosts=frozenset({HOST}))
    with TestClient(app, base_url=f"http://{HOST}", headers={"x-token": TOKEN}) as opened:
        yield opened
    conversations.close()


def take_turn(client: TestClient, thread: str, action: str, argument: str = "") -> list[dict]:
    body = {"action": action, "argument": argument}
    answer = client.post(f"/api/threads/{thread}/turn", json=body)
    assert answer.status_code == 200, answer.text
    return [json.loads(line) for line in answer.text.splitlines()]


@pytest.fixture(scope="module")
def thread(client: TestClient) -> str:
    """A conversation of two versions, the second undone."""
    name = client.post("/api/threads", json={"intersection": "amsterdam_120"}).json()["thread"]
    *stages, last = take_turn(client, name, "say", YIELD)
    assert [each["stage"] for each in stages][-1] == "scene_verifier"
    assert last["reply"]["kind"] == "made"
    (undone,) = take_turn(client, name, "undo")
    assert undone["reply"]["kind"] in ("moved_to", "nothing")
    return str(name)


def test_a_turn_streams_its_stages_and_leaves_a_verified_version(
    client: TestClient, thread: str
) -> None:
    state = client.get(f"/api/threads/{thread}").json()
    assert [each["words"] for each in state["versions"]] == [YIELD]
    assert not state["busy"]
    record = SceneRecord.model_validate(client.get(f"/api/threads/{thread}/scene.json").json())
    assert verify(record).verified
    page = client.get(f"/api/threads/{thread}/page.html?version=1").text
    assert "scene-data" in page


def test_a_refusal_says_why_and_changes_nothing(client: TestClient, thread: str) -> None:
    before = client.get(f"/api/threads/{thread}").json()
    last = take_turn(client, thread, "say", "remove the tram")[-1]
    assert last["reply"]["kind"] == "refused"
    assert "tram" in last["reply"]["lines"][0]
    assert client.get(f"/api/threads/{thread}").json() == before


def test_a_conversation_goes_on_after_the_server_was_stopped(
    client: TestClient, thread: str
) -> None:
    names = client.get("/api/start").json()["threads"]
    assert thread in names


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"x-token": "another"}, 401),
        ({"host": "evil.example:8765"}, 403),
        ({"origin": "http://evil.example"}, 403),
        ({"origin": "null"}, 403),
        ({"origin": f"http://{HOST}"}, 200),
    ],
)
def test_only_this_page_with_its_token_is_answered(
    client: TestClient, headers: dict[str, str], status: int
) -> None:
    assert client.get("/api/start", headers=headers).status_code == status


def test_the_page_may_load_nothing_from_elsewhere(client: TestClient) -> None:
    answer = client.get("/")
    policy = answer.headers["content-security-policy"]
    assert policy.startswith("default-src 'none'")
    assert not re.search(r"https?:|unsafe|\*", policy)
    assert not re.search(r"https?://(?!www\.w3\.org)", answer.text + client.get("/app.js").text)


BODIES = st.one_of(
    st.binary(max_size=60),
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.text(max_size=20),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(["action", "argument", "seed", "x"]), inner, max_size=3
            )
        ),
        max_leaves=6,
    ).map(lambda value: json.dumps(value).encode()),
)
PLACES = st.sampled_from(
    ["/api/threads", "/api/threads/page-1/turn", "/api/threads/nothing/turn", "/api/threads/%2e%2e",
     "/api/threads/page-1/compare?first=x&second=9", "/api/threads/page-1/page.html?version=99",
     "/api/threads/page-1/../../etc/passwd", "/api/intersections/..%2f..%2fx.png", "/nothing"]
)  # fmt: skip


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(place=PLACES, body=BODIES, method=st.sampled_from(["GET", "POST", "PUT"]))
def test_no_request_brings_the_server_down(
    client: TestClient, thread: str, place: str, body: bytes, method: str
) -> None:
    answer = client.request(method, place, content=body)
    assert answer.status_code < 500, answer.text


def test_the_command_prints_its_address_and_ends_with_ctrl_c(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "scenewright", "serve", "--port", "0"]
    command += ["--threads", str(tmp_path / "threads.sqlite")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as served:
        assert served.stderr is not None
        line = served.stderr.readline()
        found = re.fullmatch(r"open (http://127\.0\.0\.1:\d+/\?token=\S+)\n", line)
        assert found is not None, line
        # another process asks, as tests themselves may not use sockets
        fetch = "import sys, urllib.request as r; print(r.urlopen(sys.argv[1]).read().decode())"
        page = subprocess.run(
            [sys.executable, "-c", fetch, found[1]],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        served.send_signal(signal.SIGINT)
        served.communicate(timeout=60)
        assert served.returncode == 130
        assert "<title>scenewright</title>" in page.stdout


def test_a_taken_port_is_one_line(client: TestClient, capsys: pytest.CaptureFixture[str]) -> None:
    import socket

    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert main(["serve", "--port", str(taken.getsockname()[1])]) == 2
    assert "--port 0 takes a free one" in capsys.readouterr().err
