"""The page: only its own token and address, whole turns, one clear line for bad requests."""

from __future__ import annotations

import asyncio
import json
import re
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from starlette.requests import Request
from starlette.testclient import TestClient

from inline_jobs import run_jobs_inline
from scenewright import verify
from scenewright.backends import load_backend
from scenewright.cli.batch import RunOptions
from scenewright.cli.main import main
from scenewright.cli.options import SessionOptions
from scenewright.cli.page.routes import read_bytes
from scenewright.cli.page.server import Page, build_app
from scenewright.errors import InputError
from scenewright.intersections import load_map
from scenewright.scene.record import SceneRecord

HOST = "127.0.0.1:8765"
TOKEN = "a-token-of-this-test"
YIELD = "A car yields to a pedestrian at 5 am"


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    file = str(tmp_path_factory.mktemp("page") / "threads.sqlite")
    options = SessionOptions(threads=file, seed=1)
    page = Page(options, load_backend("builtin"), tmp_path_factory.mktemp("data"))
    app = build_app(page, token=TOKEN, hosts=frozenset({HOST}))
    with TestClient(app, base_url=f"http://{HOST}", headers={"x-token": TOKEN}) as opened:
        yield opened
    page.close()


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
    assert (last["reply"]["kind"], last["reply"]["caveat"]) == ("made", "")
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


def test_what_cannot_be_shown_is_left_out_by_a_button_and_the_log_survives(
    client: TestClient,
) -> None:
    name = client.post("/api/threads", json={}).json()["thread"]
    words = "A taxi yields to a juggling pedestrian at 5 am"
    refused = take_turn(client, name, "say", words)[-1]["reply"]
    assert "--lenient" not in " ".join(refused["lines"])
    without, plain = refused["choices"]
    assert without == {"label": "Leave it out", "action": "say_without", "argument": words}
    assert (plain["action"], plain["label"]) == ("make", plain["argument"])
    made = take_turn(client, name, without["action"], without["argument"])[-1]["reply"]
    assert (made["kind"], made["caveat"]) == ("made", "'juggling' not shown")
    assert "the taxi" in " ".join(made["lines"])
    assert "vehicle-1" not in " ".join(made["lines"])
    later = take_turn(client, name, "say", "make the taxi a van")[-1]["reply"]
    assert (later["kind"], later["caveat"]) == ("made", "'juggling' not shown")
    take_turn(client, name, "undo", "")
    asked = take_turn(client, name, "say", "how fast is the taxi?")[-1]["reply"]
    compared = client.get(f"/api/threads/{name}/compare?first=1&second=1").json()["lines"]
    assert not re.search(r"_|(?:vehicle|pedestrian)-1\b", " ".join(compared))
    turns = client.get(f"/api/threads/{name}/log").json()["turns"]
    said = [words, "Leave it out", "make the taxi a van", "how fast is the taxi?"]
    log = [each for each in turns if each.pop("words") in said]
    assert log == [refused, made, later, asked]


def test_a_refusal_is_in_words_of_people_before_there_is_a_scene_and_after_a_reload(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = client.post("/api/threads", json={}).json()["thread"]
    with monkeypatch.context() as limited:
        limited.setattr("scenewright.graph.run.MOST_WORK", 1000)
        words = "A left-turning taxi hits a pedestrian at 19 m/s."
        refused = take_turn(client, name, "make", words)[-1]["reply"]
    told = " ".join([*refused["lines"], *refused["why"]])
    assert refused["kind"] == "refused"
    assert "the taxi" in told
    assert not re.search(r"_|(?:vehicle|pedestrian)-\d|because: ", told)
    take_turn(client, name, "make", YIELD)
    first = client.get(f"/api/threads/{name}/log").json()["turns"][0]
    assert first == {"words": words, **refused}


def test_a_branch_takes_any_text_but_a_number(client: TestClient, thread: str) -> None:
    for text, said in (("später: <b>x</b> & y", "später: <b>x</b> & y"), ("12", "no number")):
        reply = take_turn(client, thread, "branch", text)[-1]["reply"]
        assert said in reply["lines"][0]
    assert "später: <b>x</b> & y" in client.get(f"/api/threads/{thread}").json()["branches"]
    take_turn(client, thread, "branch", "main")


def test_a_version_is_saved_in_every_form(client: TestClient, thread: str) -> None:
    picture = client.get(f"/api/threads/{thread}/scene.png?version=1")
    assert picture.content.startswith(b"\x89PNG")
    packed = client.get(f"/api/threads/{thread}/export.zip?version=1&format=csv")
    with zipfile.ZipFile(BytesIO(packed.content)) as archive:
        assert any(each.endswith(".csv") for each in archive.namelist())
    unknown = client.get(f"/api/threads/{thread}/export.zip?format=../etc")
    assert (unknown.status_code, "no format" in unknown.json()["reason"]) == (400, True)


def test_examples_are_of_the_place(client: TestClient) -> None:
    facts = client.get("/api/start").json()
    assert {"taxi", "rear-ends"} <= set(facts["words"])
    assert "csv" in facts["formats"]
    for place in facts["intersections"]:
        found = load_map(place["name"])
        legs = {each.name for each in found.legs}
        assert len(place["examples"]) >= 3
        for example in place["examples"]:
            assert set(re.findall(r"from the (\w+)|the (\w+) crosswalk", example)) <= {
                *((leg, "") for leg in legs), *(("", walk.leg) for walk in found.crosswalks)
            }  # fmt: skip


def test_a_conversation_goes_on_after_the_server_was_stopped(
    client: TestClient, thread: str
) -> None:
    names = client.get("/api/start").json()["threads"]
    assert thread in names


def test_a_change_by_hand_is_solved_and_verified_like_words(client: TestClient) -> None:
    name = client.post("/api/threads", json={}).json()["thread"]
    take_turn(client, name, "say", YIELD)
    handles = client.get(f"/api/threads/{name}/handles").json()["handles"]
    vehicle = next(each for each in handles if each["agent"] == "vehicle-1")
    assert sum(way["now"] for way in vehicle["ways"]) == 1
    assert vehicle["stop"] is None or len(vehicle["stop"]["line"]) > 2
    change = [{"edit": "come_later", "agent": "pedestrian-1", "seconds": 0.5}]
    last = take_turn(client, name, "edit", json.dumps(change))[-1]["reply"]
    assert last["kind"] in ("made", "refused")
    if last["kind"] == "made":
        overlaid = client.get(f"/api/threads/{name}/page.html?version=1&over=2").text
        assert '"over":[{' in overlaid
    nonsense = take_turn(client, name, "edit", "[{")[-1]["reply"]
    assert nonsense["kind"] == "refused"


def make_in_this_process(folder: Path, run: RunOptions) -> subprocess.Popen[bytes]:
    """What the process of a batch does, without starting one."""
    rows, out = str(folder / "rows.jsonl"), str(folder / "out")
    assert main(["batch", rows, "--out", out, "--quiet", *run.list_words()]) == 0
    return subprocess.Popen([sys.executable, "-c", ""])


def test_the_plan_of_words_is_changed_made_and_changed_in_words(client: TestClient) -> None:
    read = client.post("/api/plan", json={"words": "A truck turning left yields to a pedestrian"})
    plan = read.json()["plan"]
    assert [each["id"] for each in plan["agents"]] == ["vehicle-1", "pedestrian-1"]
    assert client.post("/api/plan", json={"plan": plan}).json() == read.json()
    plan["agents"][0]["subtype"] = "bus"
    plan["measures"] = [{"kind": "speed", "agent": "vehicle-1", "value": "30 km/h"}]
    found = client.post("/api/plan", json={"plan": plan}).json()
    assert found["words"].startswith("A bus turns left.")
    assert "The bus drives at 30 km/h" in found["words"]
    assert "read_as" not in found["plan"]
    name = client.post("/api/threads", json={}).json()["thread"]
    *_, last = take_turn(client, name, "plan", json.dumps(plan))
    assert last["reply"]["kind"] == "made"
    record = SceneRecord.model_validate(client.get(f"/api/threads/{name}/scene.json").json())
    assert record.meta.plan is not None
    assert verify(record).verified
    shown = client.post("/api/plan", json={"thread": name}).json()
    assert shown["plan"]["agents"][0]["subtype"] == "bus"
    assert shown["words"] == found["words"]
    *_, last = take_turn(client, name, "say", "Make it night")
    assert last["reply"]["kind"] == "made", last
    record = SceneRecord.model_validate(client.get(f"/api/threads/{name}/scene.json").json())
    assert record.meta.user_prompt == f"{found['words']}; then: Make it night"


@pytest.mark.parametrize(
    ("body", "reason"),
    [({"plan": {"agents": [{"id": "tram-1"}]}}, "plan, agents[0].id: a name such as vehicle-1"),
     ({"plan": {"agents": [{"id": "vehicle-1", "entry": "northwest"}]}}, "northwest"),
     ({"plan": 3}, "a plan is an object"), ({"words": "a pig flies"}, ""),
     ({"words": 3}, "words: Input should be a valid string"),
     ({"thread": "none"}, "no conversation"), ({}, "name words, a plan or a thread")],
    ids=range(7),
)  # fmt: skip
def test_a_plan_that_is_none_names_its_field(
    client: TestClient, body: dict[str, object], reason: str
) -> None:
    answer = client.post("/api/plan", json=body)
    assert answer.status_code == 400
    assert reason in answer.json()["reason"]


def test_dropped_rows_are_made_and_opened_one_by_one(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_jobs_inline(monkeypatch)
    monkeypatch.setattr("scenewright.cli.page.batches._launch", make_in_this_process)
    rows = [{"id": "a", "text": YIELD, "seed": 1}, {"id": "b", "text": "a pig flies", "seed": 1}]
    body = "\n".join(map(json.dumps, rows))
    name = client.post("/api/batches/new", content=body).json()["batch"]
    for _ in range(600):
        state = client.get(f"/api/batches/{name}").json()
        if not state["running"]:
            break
        time.sleep(0.1)
    assert state["error"] == ""
    assert (state["rows"], state["done"]) == (2, 2)
    made, refused = sorted(state["scenes"], key=lambda row: row["number"])
    assert (made["id"], made["status"], made["events"][0]["type"]) == ("a", "made", "yielding")
    assert (refused["status"], refused["reason"] != "") == ("refused", True)
    assert "scene-data" in client.get(f"/api/batches/{name}/{made['place']}/page.html").text
    assert client.get(f"/api/batches/{name}/{refused['place']}/page.html").status_code == 400
    assert name in client.get("/api/batches").json()["batches"]


def test_rows_that_are_none_are_refused_with_their_line(client: TestClient) -> None:
    before = client.get("/api/batches").json()
    answer = client.post("/api/batches/new", content='{"id": "a"}')
    assert answer.status_code == 400
    assert "the rows, line 1" in answer.json()["reason"]
    assert client.get("/api/batches").json() == before


def test_a_dropped_map_that_is_none_is_one_line_and_left_nowhere(client: TestClient) -> None:
    for name, body in (("x.osm", b"<osm"), ("x.exe", b""), ("../../x.osm", b"<a/>")):
        answer = client.post("/api/maps", params={"name": name}, content=body)
        assert answer.status_code == 400
        assert "\n" not in answer.json()["reason"]
    gone = client.post("/api/maps/0123456789abcdef.osm/import", json={"name": "x"})
    assert gone.status_code == 400


def test_keys_are_never_shown(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-a-secret")
    answer = client.get("/api/settings")
    assert answer.json()["keys"]["OPENAI_API_KEY"] is True
    assert "sk-a-secret" not in answer.text
    for name in ("nonsense", "recorded:/etc/passwd", "vllm:x"):
        assert client.post("/api/settings/backend", json={"backend": name}).status_code == 400
    assert client.get("/api/settings").json()["backend"] == "builtin"


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


def test_the_schema_is_of_the_routes_and_says_what_they_are_asked_with(client: TestClient) -> None:
    document = client.get("/api/openapi.json").json()
    routes = {
        (each.path.replace(":int}", "}"), method.lower())
        for each in client.app.routes
        for method in each.methods - {"HEAD"}
        if each.path.startswith("/api/")
    }
    facts = {(path, method) for path, each in document["paths"].items() for method in each}
    assert facts == routes
    assert all(each["summary"] for path in document["paths"].values() for each in path.values())
    turn = document["paths"]["/api/threads/{thread}/turn"]["post"]
    schema = turn["requestBody"]["content"]["application/json"]["schema"]
    assert schema["required"] == ["action"]
    named = client.post("/api/threads", json={}).json()["thread"]
    for action in schema["properties"]["action"]["enum"]:
        reply = take_turn(client, named, action, "x")[-1]["reply"]
        assert "there is no action" not in reply["lines"][0]
    assert "there is no action" in take_turn(client, named, "other")[-1]["reply"]["lines"][0]


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
     "/api/threads/page-1/../../etc/passwd", "/api/threads/page-1/handles?version=x",
     "/api/batches/new?intersection=x", "/api/batches/x", "/api/batches/batch-1?after=-1",
     "/api/batches/batch-1/99999/page.html", "/api/batches/x/go", "/api/maps?name=x.osm",
     "/api/maps/x/import", "/api/settings", "/api/settings/backend",
     "/api/intersections/..%2f..%2fx.png", "/nothing"]
)  # fmt: skip


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(place=PLACES, body=BODIES, method=st.sampled_from(["GET", "POST", "PUT"]))
def test_no_request_brings_the_server_down(
    client: TestClient, thread: str, place: str, body: bytes, method: str
) -> None:
    answer = client.request(method, place, content=body)
    assert answer.status_code < 500, answer.text


def test_a_body_that_is_cut_short_is_no_fault() -> None:
    async def hang_up() -> dict[str, str]:
        return {"type": "http.disconnect"}

    request = Request({"type": "http", "method": "POST", "headers": []}, hang_up)
    with pytest.raises(InputError, match="ended before its body"):
        asyncio.run(read_bytes(request, 10))


def test_the_command_prints_its_address_and_ends_with_ctrl_c(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "scenewright", "serve", "--port", "0"]
    command += ["--threads", str(tmp_path / "threads.sqlite")]
    with subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # noqa: PLW1509 -- no thread runs yet
    ) as served:
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
