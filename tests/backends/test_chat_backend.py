"""A chat model behind a server that misbehaves: every case ends as it should, none in a label that
is false."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("langchain_openai")

from backends.misbehaving import (
    HARMLESS,
    KEY,
    PASSING,
    STAYING,
    UNREADABLE,
    Prompted,
    Server,
    packs,
    said,
    status,
)
from benchmarks.inlined_schema import inline_references
from leaving import YIELD
from scenewright import synthesize, verify
from scenewright.backends import Prompt, Question, load_backend
from scenewright.backends.chat import (
    ChatModel,
    Limits,
    bounded_client,
    load_chat_model,
    naming,
    retry,
)
from scenewright.backends.chat.retry import RetryPolicy
from scenewright.backends.text_backend import TextBackend
from scenewright.cli.main import main
from scenewright.errors import BackendFault, InputError, Rejected
from scenewright.graph.run import Scene

ATTEMPTS = 3
TASKS = ("plan", "constraints", "behavior")
SLOW = ("timeout", "drips")


def model(server: Server, *, at_once: int = 8, timeout: float = 30.0) -> ChatModel:
    limits = Limits(timeout=timeout, at_once=at_once, retries=RetryPolicy(attempts=ATTEMPTS))
    endpoint = load_chat_model(
        "openai:m", base_url=server.url, timeout=timeout, max_tokens=3000, most_bytes=6_000_000
    )
    return ChatModel(endpoint, limits=limits)


def made(server: Server, **limits: Any) -> Scene:
    backend = Prompted(TextBackend(model(server, **limits)), server)
    scene = synthesize(YIELD, backend=backend, seed=3, refiner="none")
    assert scene.proof.verified
    assert verify(scene).verified
    return scene


def asked(server: Server) -> list[str]:
    return [each["response_format"]["json_schema"]["name"] for each in server.requests]


def test_all_questions_are_put_to_the_model(server: Server) -> None:
    scene = made(server)
    assert asked(server) == list(TASKS)
    assert server.requests[0]["model"] == "m"
    assert server.requests[0]["max_tokens"] == 3000
    assert server.requests[0]["temperature"] == 0.0
    assert server.requests[0]["seed"] == 3
    assert server.headers[0]["authorization"] == f"Bearer {KEY}"
    schema = server.requests[0]["response_format"]["json_schema"]["schema"]
    sides = inline_references(schema)["properties"]["agents"]["items"]["properties"]["entry"][
        "enum"
    ]
    assert sides == ["north", "east", "south", "west"]
    paid = scene.provenance["models"]
    assert list(paid) == list(TASKS)
    assert paid["plan"]["model"] == f"openai:m at {server.url}"
    assert (paid["plan"]["input_tokens"], paid["plan"]["output_tokens"]) == (700, 90)
    assert paid["plan"]["requests"] == 1
    assert KEY not in json.dumps(dict(scene.provenance))


@pytest.mark.parametrize("name", PASSING)
def test_a_fault_that_passes_costs_one_more_request(
    server: Server, pauses: list[float], name: str
) -> None:
    server.faults = [PASSING[name]]
    if name in SLOW:  # on a busy machine a good reply may come too late as well
        assert made(server, timeout=0.4).provenance["rejections"] == []
        assert asked(server)[:2] == ["plan", "plan"]
        return
    scene = made(server)
    assert asked(server) == ["plan", *TASKS]
    assert scene.provenance["rejections"] == []
    assert scene.provenance["models"]["plan"]["requests"] == 2
    assert pauses == [2.0 if name == "429" else 1.0]


@pytest.mark.parametrize("name", PASSING)
def test_a_fault_that_never_passes_is_a_fault_of_the_backend(
    server: Server, pauses: list[float], name: str
) -> None:
    server.faults, server.forever = [PASSING[name]], True
    with pytest.raises(BackendFault, match=rf"openai:m at .* \({ATTEMPTS} attempts\)") as caught:
        made(server, **({"timeout": 0.4} if name in SLOW else {}))
    assert KEY not in str(caught.value)
    assert len(server.requests) == ATTEMPTS
    assert sum(pauses) <= 4.0


@pytest.mark.parametrize("name", STAYING)
def test_a_fault_that_stays_is_reported_at_once(
    server: Server, pauses: list[float], name: str
) -> None:
    fault, words = STAYING[name]
    server.faults, server.forever = [fault], True
    with pytest.raises(BackendFault) as caught:
        made(server)
    assert words in str(caught.value)
    assert KEY[:8] not in str(caught.value)
    assert (len(server.requests), pauses) == (1, [])


@pytest.mark.parametrize("name", UNREADABLE)
def test_a_reply_that_is_none_is_shown_why_and_mended(server: Server, name: str) -> None:
    fault, words = UNREADABLE[name]
    server.faults = [fault]
    scene = made(server)
    assert asked(server) == ["plan", *TASKS]
    assert [each["temperature"] for each in server.requests] == [0.0, 0.7, 0.0, 0.0]
    [rejection] = scene.provenance["rejections"]
    assert (rejection["stage"], rejection["code"]) == ("scene_planner", "malformed_reply")
    assert words in rejection["detail"]
    assert len(rejection["detail"]) < 300
    given = server.requests[1]["messages"][1]["content"]
    assert json.dumps(rejection["detail"], ensure_ascii=False) in given


@pytest.mark.parametrize("name", ["wrong schema", "unknown ids", "extra keys", "truncated"])
@pytest.mark.parametrize("task", TASKS[1:])
def test_every_stage_mends_its_own_reply(server: Server, name: str, task: str) -> None:
    fault = UNREADABLE[name][0]
    at = TASKS.index(task)
    good = said(lambda text: text)
    server.faults = [good] * at + [fault]
    scene = made(server)
    rejection, *others = scene.provenance["rejections"]  # others are of samples
    stage = "waypoint_filter" if task == "constraints" else "event_reasoner"
    assert rejection["stage"] == stage
    assert all(each["code"] != rejection["code"] for each in others)
    assert scene.provenance["models"][task]["requests"] == 2


@pytest.mark.parametrize("name", UNREADABLE)
def test_a_reply_that_never_is_one_is_given_up(server: Server, name: str) -> None:
    server.faults, server.forever = [UNREADABLE[name][0]], True
    with pytest.raises(BackendFault, match="no usable answer") as caught:
        made(server)
    assert {each.code for each in caught.value.rejections} == {"malformed_reply"}
    assert asked(server) == ["plan"] * 3
    assert list(caught.value.models) == ["plan"]
    assert caught.value.models["plan"]["requests"] == 3


def test_a_model_that_never_reasons_well_is_given_up_within_the_caps(server: Server) -> None:
    good = said(lambda text: text)
    server.faults, server.forever = [good, good, UNREADABLE["wrong schema"][0]], True
    with pytest.raises(InputError, match="cannot be part of a scene: 'pedestrian'"):
        made(server)
    assert asked(server) == ["plan", "constraints", *["behavior"] * 3]


@pytest.mark.parametrize("name", HARMLESS)
def test_prose_and_fences_are_read_past(server: Server, name: str) -> None:
    server.faults = [HARMLESS[name]] * 3
    assert made(server).provenance["rejections"] == []
    assert asked(server) == list(TASKS)


def test_a_flaky_server_is_got_past(server: Server, pauses: list[float]) -> None:
    flaky = [PASSING["503"], PASSING["closed socket"], said(lambda text: text)]
    server.faults = [*flaky, *flaky, UNREADABLE["cut without a word"][0], *flaky]
    scene = made(server)
    assert sum(each["requests"] for each in scene.provenance["models"].values()) == 10
    assert len(pauses) == 6


def test_a_server_that_knows_no_schemas_is_asked_in_words(server: Server) -> None:
    server.faults = [status(400, "response_format is not supported")] * 2
    backend = TextBackend(model(server))
    server.good[""] = '{"answer": 1}'
    assert backend.answer(question()) == {"answer": 1}
    assert [each.get("response_format", {}).get("type") for each in server.requests] == [
        "json_schema", "json_object", None,
    ]  # fmt: skip
    assert "seed" in server.requests[2]
    assert backend.answer(question(seed=2)) == {"answer": 1}
    assert "response_format" not in server.requests[3]


@pytest.mark.parametrize("code", [422, 500])
def test_a_server_that_knows_schemas_in_the_older_form_alone_is_asked_so(
    server: Server, code: int
) -> None:
    server.faults = [status(code, "body.response_format.type: expected 'text' or 'json_object'")]
    backend = TextBackend(model(server))
    server.good[""] = '{"answer": 1}'
    for seed in (0, 2):
        assert backend.answer(question(seed=seed)) == {"answer": 1}
    older = {"type": "json_object", "schema": {"type": "object"}}
    assert [each["response_format"] == older for each in server.requests] == [False, True, True]


def test_options_that_a_server_refuses_are_left_out(server: Server) -> None:
    server.faults = [
        status(400, "Unsupported value: 'temperature' does not support 0"),
        status(400, "unknown parameter: seed"),
    ]
    server.good["plan"] = "{}"
    assert TextBackend(model(server)).answer(question()) == {}
    assert [len({"temperature", "seed"} & set(each)) for each in server.requests] == [2, 1, 0]
    server.faults = [status(400, "seed")] * 9
    with pytest.raises(BackendFault, match="answered 400: seed"):
        TextBackend(model(server)).answer(question(words="z"))


def question(seed: int = 0, words: str = "x") -> Question:
    prompt = Prompt("You answer.", words, {"type": "object"})
    return Question("plan", {}, seed=seed, prompt=lambda: prompt)


def test_a_key_that_a_server_quotes_is_hidden(server: Server) -> None:
    server.faults = [said(lambda _: json.dumps({"secret": f"Bearer {KEY}"}))]
    assert TextBackend(model(server)).answer(question()) == {"secret": "Bearer [key]"}
    server.faults = [said(lambda _: json.dumps({"secret": f"x{KEY[3:13]}...", "agent": "car"}))]
    assert TextBackend(model(server)).answer(question(words="y")) == {
        "secret": "[key]", "agent": "car",
    }  # fmt: skip


@pytest.mark.usefixtures("pauses")
def test_a_packed_reply_is_not_unpacked(server: Server) -> None:
    server.faults, server.forever = [packs], True
    with pytest.raises(BackendFault, match="sent no reply: the reply is packed"):
        TextBackend(model(server)).answer(question())
    assert server.headers[0]["accept-encoding"] == "identity"


def test_the_same_question_is_put_once(server: Server) -> None:
    backend = TextBackend(model(server))
    server.good["plan"] = '{"a": 1}'
    assert [backend.answer(question()) for _ in range(3)] == [{"a": 1}] * 3
    assert len(server.requests) == 1
    backend.answer(question(words="y"))
    assert len(server.requests) == 2


def test_no_more_requests_at_once_than_allowed(server: Server) -> None:
    server.faults, server.forever = [_slow], True
    backend = TextBackend(model(server, at_once=2))
    threads = [
        threading.Thread(target=backend.answer, args=(question(words=str(n)),)) for n in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(server.requests) == 6
    assert server.most_at_once == 2


def _slow(handler: Any, good: str) -> None:
    threading.Event().wait(0.05)
    handler.say("{}")


def test_one_model_per_stage(server: Server) -> None:
    names = {"planner": Prompted(TextBackend(model(server)), server)}
    scene = synthesize(YIELD, backend=names, seed=1, refiner="none", lenient=True)
    assert asked(server) == ["plan"]
    assert list(scene.provenance["models"]) == ["plan"]
    assert "constraints=builtin" in scene.provenance["backend"]


def test_keys_are_taken_from_the_environment_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="OPENAI_API_KEY is not set"):
        load_backend("openai:m")
    with pytest.raises(InputError, match="ANTHROPIC_API_KEY is not set"):
        load_backend("anthropic:m")
    monkeypatch.setenv("OPENAI_API_KEY", "sk-for-openai")
    monkeypatch.delenv("SCENEWRIGHT_API_KEY")
    endpoint = load_chat_model("openai:m", timeout=1, max_tokens=9)
    assert str(endpoint.model.openai_api_base) == "https://api.openai.com/v1"
    assert "sk-for-openai" not in repr(endpoint) + repr(endpoint.model)
    own = load_chat_model("openai:m", base_url="http://127.0.0.1:9/v1", timeout=1, max_tokens=9)
    assert own.model.openai_api_key.get_secret_value() == "none"


def test_the_endpoint_is_the_one_the_user_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OPENAI_API_BASE", "OPENAI_BASE_URL", "ANTHROPIC_API_URL", "ANTHROPIC_BASE_URL"):
        monkeypatch.setenv(name, "http://127.0.0.1:9/elsewhere")
    monkeypatch.setenv("OPENAI_API_KEY", "sk-for-openai")
    monkeypatch.setenv("ANTHROPIC_API_KEY", "sk-for-anthropic")
    made = load_chat_model("openai:m", timeout=1, max_tokens=9).model
    assert str(made.root_client.base_url) == "https://api.openai.com/v1/"
    other = load_chat_model("anthropic:m", timeout=1, max_tokens=9).model
    assert str(other._client.base_url) == "https://api.anthropic.com"
    assert "sk-for-anthropic" not in repr(other)


@pytest.mark.parametrize(
    ("name", "more", "words"),
    [
        ("openai:", {}, "PROVIDER:MODEL"),
        ("gpt", {}, "there is no backend 'gpt'"),
        ("nobody:m", {}, "nobody"),
        (["openai:a", "openai:b"], {}, "two backends for everything"),
        ("cook=builtin", {}, "there is no stage 'cook'"),
        ("openai:m", {"base_url": "localhost:80"}, "is an http address"),
        ("openai:m", {"base_url": "http://me:secret@host/v1"}, "carries no user"),
        ("openai:m", {"base_url": "http://host/v1?key=1"}, "carries no user"),
        ("anthropic:m", {"base_url": "http://host/v1"}, "--base-url"),
        ("builtin", {"base_url": "http://host/v1"}, "--base-url"),
        ("openai:m", {"base_url": "http://host/v1", "timeout": 0.0}, "0.1 to 3600"),
    ],
)
def test_what_cannot_be_a_backend_is_reported_in_one_line(
    name: Any, more: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError) as caught:
        load_backend(name, **more)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "secret" not in str(caught.value)


def test_a_missing_package_is_reported_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("scenewright.extras.find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install 'scenewright\[chat\]'"):
        load_backend("openai:m", base_url="http://127.0.0.1:9/v1")


def test_a_bug_in_between_is_not_hidden(server: Server) -> None:
    text_model = model(server)
    text_model._model = None
    with pytest.raises(AttributeError):
        text_model.complete(question(), question().prompt())


def test_garbled_numbers_are_no_answers(server: Server) -> None:
    server.faults = [said(lambda _: '{"x": ' + "9" * 5000 + "}")]
    with pytest.raises(Rejected, match="not JSON"):
        TextBackend(model(server)).answer(question())


def anthropic(server: Server) -> ChatModel:
    with pytest.MonkeyPatch.context() as patched:
        patched.setitem(naming._HOME, "anthropic", server.url.removesuffix("/v1"))
        patched.setenv("ANTHROPIC_API_KEY", KEY)
        endpoint = load_chat_model("anthropic:m", timeout=30.0, max_tokens=3000)
    return ChatModel(endpoint, limits=Limits(retries=RetryPolicy(attempts=ATTEMPTS)))


def test_a_model_of_anthropic_is_asked_under_the_same_schema(server: Server) -> None:
    pytest.importorskip("langchain_anthropic")
    server.faults = [status(529), lambda handler, _: handler.say_as_anthropic('{"a": 1}')]
    given: list[Any] = []
    asked = Question("plan", {}, prompt=lambda: PLAIN, account=given.append)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(retry.time, "sleep", lambda _: None)
        assert TextBackend(anthropic(server)).answer(asked) == {"a": 1}
    body = server.requests[1]
    assert body["output_config"]["format"]["type"] == "json_schema"
    assert "properties" in body["output_config"]["format"]["schema"]
    assert (body["system"], body["max_tokens"]) == ("You answer.", 3000)
    assert any(KEY in value for value in server.headers[1].values())
    assert (given[0].asked, given[0].input_tokens, given[0].output_tokens) == (2, 650, 80)


@pytest.mark.parametrize(
    ("ended", "words"), [("max_tokens", "was cut off"), ("refusal", "declined to answer")]
)
def test_a_model_of_anthropic_that_stops_early_is_shown_so(
    server: Server, ended: str, words: str
) -> None:
    pytest.importorskip("langchain_anthropic")
    server.faults = [lambda handler, _: handler.say_as_anthropic("", ended=ended)]
    with pytest.raises(Rejected, match=words):
        TextBackend(anthropic(server)).answer(Question("plan", {}, prompt=lambda: PLAIN))


PLAIN = Prompt(
    "You answer.",
    "x",
    {"type": "object", "properties": {"a": {"type": "integer"}}, "additionalProperties": False},
)


def test_rows_are_planned_by_a_model_several_at_a_time(
    server: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [{"id": str(n), "text": f"Car number {n} turns left from the south"} for n in range(9)]
    (tmp_path / "in.jsonl").write_text("\n".join(map(json.dumps, rows)))
    car = {"id": "vehicle-1", "type": "vehicle", "entry": "south", "movement": "left"}
    server.good["plan"] = json.dumps({"agents": [car], "relations": []})
    words = ["plan", str(tmp_path / "in.jsonl"), "--backend", "planner=openai:m"]
    assert main([*words, "--base-url", server.url, "--timeout", "30"]) == 0
    said = capsys.readouterr()
    found = [json.loads(line) for line in said.out.splitlines()]
    assert [each["id"] for each in found] == [str(n) for n in range(9)]
    assert {each["agents"][0]["exit"] for each in found} == {"west"}
    assert "9 rows, 0 refused, 9 requests, 6300 input tokens, 810 output tokens" in said.err
    assert KEY not in said.out + said.err


def test_what_a_refused_run_has_cost_is_reported(
    server: Server, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    server.faults, server.forever = [said(lambda _: '{"agents": 1}')], True
    who = ["--backend", "openai:m", "--base-url", server.url]
    assert main(["make", YIELD, *who, "--json"]) == 4
    [paid] = json.loads(capsys.readouterr().out)["models"].values()
    assert {key: paid[key] for key in ("model", "answers", "requests")} == {
        "model": f"openai:m at {server.url}", "answers": 3, "requests": 3,
    }  # fmt: skip
    assert (paid["input_tokens"], paid["output_tokens"]) == (2100, 270)
    (tmp_path / "rows.jsonl").write_text(json.dumps({"id": "a", "text": YIELD}))
    folder = tmp_path / "batch"
    main(["batch", str(tmp_path / "rows.jsonl"), "--out", str(folder), *who, "--workers", "1"])
    [row] = (folder / "journal.jsonl").read_text("utf-8").splitlines()[1:]
    given = json.loads(row)
    assert (given["status"], given["paid"]["requests"]) == ("failed", 3)
    assert given["paid"]["input_tokens"] == 2100


def test_what_a_run_has_cost_that_a_model_left_is_reported(
    server: Server, pauses: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    server.good["plan"] = json.dumps(
        {
            "agents": [
                {"id": "vehicle-1", "type": "vehicle"},
                {"id": "pedestrian-1", "type": "pedestrian"},
            ],
            "relations": [{"type": "yield_to", "from": "vehicle-1", "to": "pedestrian-1"}],
            "said": [{"words": "A car", "became": "constraint", "agents": ["vehicle-1"]}],
        }
    )
    server.faults = [said(lambda text: text)] + [status(503, "overloaded")] * 4
    assert main(["make", YIELD, "--backend", "openai:m", "--base-url", server.url, "--json"]) == 4
    found = json.loads(capsys.readouterr().out)
    paid = {task: (each["answers"], each["requests"]) for task, each in found["models"].items()}
    assert (found["code"], paid) == ("backend_failed", {"plan": (1, 1), "constraints": (0, 4)})
    assert found["models"]["plan"]["input_tokens"] == 700
    assert found["models"]["constraints"]["input_tokens"] is None
    assert len(pauses) == 3


def test_what_planning_has_cost_that_a_model_left_is_reported(
    server: Server, pauses: list[float], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    server.faults, server.forever = [status(503, "overloaded")], True
    (tmp_path / "in.jsonl").write_text(json.dumps({"id": "a", "text": YIELD}))
    words = ["plan", str(tmp_path / "in.jsonl"), "--out", str(tmp_path / "out.jsonl"), "--json"]
    assert main([*words, "--backend", "openai:m", "--base-url", server.url]) == 4
    paid = json.loads(capsys.readouterr().out)["models"]["plan"]
    assert (paid["answers"], paid["requests"], len(pauses)) == (0, 4, 3)


def test_a_model_that_cannot_be_reached_is_one_line_and_exit_code_4(
    server: Server, pauses: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    server.faults, server.forever = [status(503, "overloaded")], True
    assert main(["make", YIELD, "--backend", "openai:m", "--base-url", server.url]) == 4
    said = capsys.readouterr()
    assert said.err.splitlines()[-1].endswith("answered 503: overloaded (4 attempts)")
    assert (len(server.requests), pauses, said.out) == (4, [1.0, 2.0, 4.0], "")


@pytest.mark.parametrize(
    ("url", "proxy"),
    [
        ("https://api.openai.com/v1", "http://127.0.0.1:3128"),
        ("http://localhost:8000/v1", None),
        ("https://inside.example/v1", None),
    ],
)
def test_a_proxy_is_the_environments(
    url: str, proxy: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HTTP_PROXY", "HTTPS_PROXY"):
        monkeypatch.setenv(name, "http://127.0.0.1:3128")
    monkeypatch.setenv("NO_PROXY", "inside.example")
    assert bounded_client._find_proxy(url) == proxy
