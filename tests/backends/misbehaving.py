"""An OpenAI-compatible server that misbehaves as it is told, one way per request."""

from __future__ import annotations

import gzip
import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from leaving import Leaving
from scenewright.backends import Question

KEY = "sk-test-0123456789abcdef"
Fault = Callable[["Handler", str], None]


@dataclass
class Server:
    """What the server does next, and what it has been sent.

    Attributes:
        faults: what to do instead of answering, in order; then it answers.
        forever: the last fault is repeated.
        good: task -> the right reply, as text.
    """

    faults: list[Fault] = field(default_factory=list)
    forever: bool = False
    good: dict[str, str] = field(default_factory=dict)
    requests: list[dict[str, Any]] = field(default_factory=list)
    headers: list[dict[str, str]] = field(default_factory=list)
    url: str = ""
    at_once: int = 0
    most_at_once: int = 0

    def next_fault(self) -> Fault | None:
        if not self.faults:
            return None
        return self.faults[0] if self.forever and len(self.faults) == 1 else self.faults.pop(0)


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Any

    def do_POST(self) -> None:
        state: Server = self.server.state
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        state.requests.append(body)
        state.headers.append({k.lower(): v for k, v in self.headers.items()})
        state.at_once += 1
        state.most_at_once = max(state.most_at_once, state.at_once)
        form = body.get("response_format")
        task = form["json_schema"]["name"] if form and "json_schema" in form else ""
        fault = state.next_fault()
        try:
            if fault is None:
                self.say(state.good.get(task, "{}"))
            else:
                fault(self, state.good.get(task, "{}"))
        except OSError:
            self.close_connection = True
        finally:
            state.at_once -= 1

    def say(self, text: str | None, *, ended: str = "stop", **more: Any) -> None:
        message = {"role": "assistant", "content": text, **more}
        self.complete([{"index": 0, "message": message, "finish_reason": ended}])

    def say_as_anthropic(self, text: str, *, ended: str = "end_turn") -> None:
        head = {"id": "x", "type": "message", "role": "assistant", "model": "m"}
        usage = {"input_tokens": 650, "output_tokens": 80}
        content = [{"type": "text", "text": text}] if text else []
        reply = {"content": content, "stop_reason": ended, "stop_sequence": None, "usage": usage}
        self.send(200, json.dumps(head | reply))

    def complete(self, choices: list[Any]) -> None:
        usage = {"prompt_tokens": 700, "completion_tokens": 90, "total_tokens": 790}
        head = {"id": "x", "object": "chat.completion", "created": 1, "model": "m"}
        self.send(200, json.dumps(head | {"choices": choices, "usage": usage}))

    def send(self, status: int, text: str, **headers: str) -> None:
        data = text.encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(data)))
        for name, value in headers.items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: Any) -> None:
        pass


@contextmanager
def serving() -> Iterator[Server]:
    state = Server()
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    server.state = state  # type: ignore[attr-defined]
    state.url = f"http://127.0.0.1:{server.server_address[1]}/v1"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield state
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class Prompted:
    """A backend whose server is told the right answers beforehand, by rule: one to every task."""

    deterministic = False

    def __init__(self, backend: Any, server: Server) -> None:
        self.name = backend.name
        self._backend, self._server, self._rule = backend, server, Leaving()

    def answer(self, question: Question) -> dict[str, Any]:
        right = self._rule.answer(question)
        self._server.good[question.task] = json.dumps(right)
        return dict(self._backend.answer(question))


def status(code: int, message: str = "no", **headers: str) -> Fault:
    text = json.dumps({"error": {"message": message, "type": "x", "code": str(code)}})
    return lambda handler, _: handler.send(code, text, **headers)


def said(change: Callable[[str], str | None], **more: Any) -> Fault:
    return lambda handler, good: handler.say(change(good), **more)


def _wait(seconds: float) -> None:
    """Unlike `time.sleep`, which tests replace."""
    threading.Event().wait(seconds)


def hangs(handler: Handler, good: str) -> None:
    _wait(0.9)
    handler.close_connection = True


def closes(handler: Handler, good: str) -> None:
    handler.close_connection = True
    handler.connection.close()


def closes_within(handler: Handler, good: str) -> None:
    handler.send_response(200)
    handler.send_header("Content-Length", "5000")
    handler.end_headers()
    handler.wfile.write(b'{"id": "x", "choi')
    handler.wfile.flush()
    closes(handler, good)


def drips(handler: Handler, good: str) -> None:
    """One byte now and then, each within the time that a read may take."""
    handler.send_response(200)
    handler.send_header("Content-Length", "100000")
    handler.end_headers()
    for _ in range(60):
        handler.wfile.write(b" ")
        handler.wfile.flush()
        _wait(0.05)
    handler.close_connection = True


def packs(handler: Handler, good: str) -> None:
    """A few kilobytes that are a thousand times as many once they are unpacked."""
    data = gzip.compress(b" " * 10**7)
    handler.send_response(200)
    handler.send_header("Content-Encoding", "gzip")
    handler.send_header("Content-Length", str(len(data)))
    handler.end_headers()
    handler.wfile.write(data)


def floods(handler: Handler, good: str) -> None:
    """More than anybody can read."""
    handler.send_response(200)
    handler.send_header("Content-Length", str(10**9))
    handler.end_headers()
    for _ in range(400):
        handler.wfile.write(b" " * 10**5)
    handler.close_connection = True


def not_json(handler: Handler, good: str) -> None:
    handler.send(200, "<html>Welcome to the hotel network</html>")


def no_choices(handler: Handler, good: str) -> None:
    handler.complete([])


def without(good: str, *, add: dict[str, Any] | None = None) -> str:
    return json.dumps({**json.loads(good), **(add or {})})


def tool_call(handler: Handler, good: str) -> None:
    function = {"name": "run_shell", "arguments": '{"cmd": "rm -rf /"}'}
    call = {"id": "c", "type": "function", "function": function}
    handler.say(None, ended="tool_calls", tool_calls=[call])


PASSING: dict[str, Fault] = {
    "500": status(500),
    "503": status(503),
    "529": status(529),
    "429": status(429, "slow down", Retry_After="2"),
    "timeout": hangs,
    "closed socket": closes,
    "closed within the reply": closes_within,
    "drips": drips,
    "floods": floods,
    "packs": packs,
    "not JSON": not_json,
    "empty body": lambda handler, _: handler.send(200, ""),
    "no choices": no_choices,
}
"""Faults that may pass: asked again, in the end a BackendFault."""

STAYING: dict[str, tuple[Fault, str]] = {
    "400": (status(400, "bad request"), "answered 400: bad request"),
    "400 on a key": (status(400, f"bad request for {KEY[:7]}***"), "is not repeated"),
    "400 on headers": (status(400, "Authorization: QmVhcmVyIHNr"), "is not repeated"),
    "400 with a piece": (status(400, f"no user {KEY[5:14]}"), "is not repeated"),
    "401": (status(401, f"wrong key {KEY[:8]}***"), "does not accept the key"),
    "404": (status(404), "no such model or address"),
    "redirect": (status(307, Location="http://127.0.0.1:9/v1"), "redirects elsewhere"),
}
"""Faults that stay: told at once."""

UNREADABLE: dict[str, tuple[Fault, str]] = {
    "empty": (said(lambda _: ""), "the reply is empty"),
    "null": (said(lambda _: None), "the reply is empty"),
    "prose": (said(lambda _: "I am afraid I cannot."), "holds no JSON object"),
    "truncated": (said(lambda good: good[: len(good) // 2], ended="length"), "was cut off"),
    "cut without a word": (said(lambda good: good[: len(good) // 2]), "not JSON"),
    "list": (said(lambda good: f"[{good}]"), "is a JSON list"),
    "two objects": (said(lambda good: good + '\n{"agents": []}'), "holds 2 JSON values"),
    "wrong schema": (said(lambda _: '{"colour": "red"}'), ""),
    "extra keys": (said(lambda good: without(good, add={"note": 1})), "no such key"),
    "unknown ids": (
        said(lambda good: good.replace("-1", "-77", 1)),
        "is not among the agents",
    ),
    "NaN": (said(lambda good: good[:-1] + ', "x": NaN}'), "NaN is no number"),
    "infinity": (said(lambda good: good[:-1] + ', "x": 1e999}'), "1e999 is no number"),
    "twice": (said(lambda good: good[:-1] + ', "x": 1, "x": 2}'), "'x' stands twice"),
    "deep": (said(lambda _: "[" * 50_000), "not JSON"),
    "5 MB": (said(lambda good: good[:-1] + ', "x": "' + "y" * 5_000_000 + '"}'), "characters"),
    "control characters": (said(lambda good: good[:-1] + ', "x": "\x00\x1b[2J"}'), "not JSON"),
    "escaped control characters": (
        said(lambda good: good[:-1] + ', "x": "\\u001b[2J"}'),
        "control character U+001B",
    ),
    "tool call": (tool_call, "calls a tool"),
    "refusal": (said(lambda _: None, refusal="I must not."), "declined to answer (I must not.)"),
    "content filter": (said(lambda _: "", ended="content_filter"), "declined to answer"),
}
"""Replies that are none: refused with a reason, mended or given up."""

HARMLESS: dict[str, Fault] = {
    "prose round JSON": said(lambda good: f"Sure! Here it is:\n{good}\nHope this helps {{x}}."),
    "fenced JSON": said(lambda good: f"```json\n{good}\n```"),
    "fenced in prose": said(lambda good: f"Here:\n```\n{good}\n```\nDone."),
    "thoughts": said(lambda good: f"<think>A car {{maybe}}?</think>\n{good}"),
}
"""Replies that are read as what they mean."""
