"""Sends malformed requests to a page's server: python benchmarks/malformed.py [--requests 1000].

Bodies that are no JSON or the wrong JSON, addresses that are none, methods, headers and tokens that
are wrong, lines that are no HTTP. Says how often each status was answered, and fails on any 5xx,
any traceback, and any answer to a request without the token or from another site.
"""

from __future__ import annotations

import argparse
import collections
import json
import random
import re
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

ADDRESSES = (
    "/", "/app.js", "/api/start", "/api/threads", "/api/threads/page-1", "/api/threads/page-1/turn",
    "/api/threads/page-1/compare?first=1&second=x", "/api/threads/page-1/made?version=-1",
    "/api/threads/page-1/handles?version=9", "/api/threads/page-1/page.html?version=1&over=77",
    "/api/threads/page-1/scene.json?version=%00", "/api/threads/%2e%2e%2f/turn", "/api/threads/",
    "/api/intersections/..%2f..%2fetc%2fpasswd.png", "/api/batches", "/api/batches/new",
    "/api/batches/batch-1", "/api/batches/batch-1/99/page.html", "/api/batches/x/stop",
    "/api/maps?name=x.osm", "/api/maps?name=..%2fx.xodr", "/api/maps/0123456789abcdef.osm/import",
    "/api/settings", "/api/settings/backend", "/api/openapi.json", "/nothing", "//",
    "/api/../app.js",
)  # fmt: skip
VALUES: tuple[object, ...] = (
    None, True, -1, 1e308, 2**70, "", "x" * 3000, "\ud800", "\x00", [], {}, [[[[]]]], {"a": {}},
    "say", "edit", "undo", "../../x", "<script>", "'; drop table", '[{"edit": "nonsense"}]',
)  # fmt: skip
KEYS = ("action", "argument", "intersection", "seed", "backend", "base_url", "name", "junction")
METHODS = ("GET", "POST", "PUT", "DELETE", "PATCH", "HEAD", "OPTIONS", "TRACE", "FOO")
RAW = (
    b"GARBAGE\r\n\r\n",
    b"GET\r\n\r\n",
    b"\x00\xff\x16\x03\x01\r\n\r\n",
    b"GET / HTTP/9.9\r\n\r\n",
)


class Server:
    """`scenewright serve` in a process of its own."""

    def __init__(self, folder: Path) -> None:
        self.errors = folder / "errors.txt"
        command = [sys.executable, "-m", "scenewright", "serve", "--port", "0"]
        command += ["--threads", str(folder / "threads.sqlite")]
        with self.errors.open("w") as errors:
            self.process = subprocess.Popen(command, stderr=errors)
        while (found := re.search(r"127\.0\.0\.1:(\d+)/\?token=(\S+)", self._read())) is None:
            if self.process.poll() is not None:
                raise SystemExit(self._read())
        self.port, self.token = int(found[1]), found[2]

    def _read(self) -> str:
        return self.errors.read_text(errors="replace")

    def send(self, data: bytes, *, cut: bool) -> int | None:
        """The status that is answered; None where the connection is closed without one.

        Args:
            cut: hang up before the body is as long as was said.
        """
        with socket.create_connection(("127.0.0.1", self.port), timeout=300) as line:
            line.sendall(data)
            if cut:
                line.shutdown(socket.SHUT_WR)
            answer = b""
            while b"\r\n" not in answer and (part := line.recv(4096)):
                answer += part
        found = re.match(rb"HTTP/1\.1 (\d{3})", answer)
        return None if found is None else int(found[1])

    def end(self) -> str:
        """Stops it; what it has said."""
        self.process.terminate()
        self.process.wait(600)  # it may still be warming up
        return self._read()


def write_request(draw: random.Random, server: Server) -> tuple[bytes, bool]:
    """A request, and whether it must be refused for its token, host or origin."""
    if draw.random() < 0.1:
        return draw.choice(RAW), False
    host, own = f"127.0.0.1:{server.port}", True
    headers = {"Host": host, "X-Token": server.token, "Connection": "close"}
    wrong = draw.choice([{}, {}, {}, {"X-Token": "x"}, {"Host": "evil"}, {"Origin": "http://evil"}])
    headers |= wrong
    own = not wrong
    body = write_body(draw)
    length = draw.choice([len(body)] * 6 + [-1, 10**12])
    headers["Content-Length"] = str(length)
    lines = [f"{draw.choice(METHODS)} {draw.choice(ADDRESSES)} HTTP/1.1"]
    lines += [f"{name}: {value}" for name, value in headers.items()]
    return "\r\n".join([*lines, "", ""]).encode() + body, not own


def write_body(draw: random.Random) -> bytes:
    """Bytes, broken JSON, or JSON of the wrong kind."""
    kind = draw.randrange(4)
    if kind == 0:
        return draw.randbytes(draw.randrange(60))
    made = {draw.choice(KEYS): draw.choice(VALUES) for _ in range(draw.randrange(4))}
    text = json.dumps(made if kind > 1 else draw.choice(VALUES)).encode()
    return text[: draw.randrange(len(text) + 1)] if kind == 3 else text


def main() -> int:
    """Send them; 0 where all was as it must be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requests", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    draw, counts, let_in = random.Random(asked.seed), collections.Counter[str](), 0
    with tempfile.TemporaryDirectory() as folder:
        server = Server(Path(folder))
        for _ in range(asked.requests):
            data, foreign = write_request(draw, server)
            status = server.send(data, cut=b": 1000000000000" in data or b"HTTP/1.1" not in data)
            counts[str(status)] += 1
            shown = b" /app.js " in data or b"/api/../app.js " in data
            let_in += foreign and not shown and status is not None and status < 400
        alive = server.process.poll() is None
        said = server.end()
    faults = sum(count for status, count in counts.items() if status.startswith("5"))
    faulty = [line for line in said.splitlines() if "fault in scenewright" in line]
    print(*faulty[:3], sep="\n", file=sys.stderr)
    traces = said.count("Traceback") + said.count("a fault in scenewright")
    told = ", ".join(f"{status}: {count}" for status, count in sorted(counts.items()))
    print(f"{asked.requests} requests: {told}")
    print(f"5xx: {faults}, tracebacks: {traces}, let in wrongly: {let_in}, still serving: {alive}")
    return int(bool(faults or traces or let_in or not alive))


if __name__ == "__main__":
    sys.exit(main())
