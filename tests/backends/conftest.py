"""Here tests may reach servers of their own on this machine, and nothing else."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import Any

import pytest

from backends.misbehaving import KEY, Server, serving
from scenewright.backends.chat import retry

_CONNECT, _LOOK_UP = socket.socket.connect, socket.getaddrinfo


class _LoopbackSocket(socket.socket):
    def connect(self, address: Any, /) -> None:
        if self.family != socket.AF_UNIX and address[0] != "127.0.0.1":
            raise RuntimeError(f"tests must not use the network, {address!r} was asked for")
        _CONNECT(self, address)


def _look_up(host: object, *more: Any, **kinds: Any) -> Any:
    if host not in ("127.0.0.1", b"127.0.0.1"):
        raise RuntimeError(f"tests must not use the network, the name {host!r} was looked up")
    return _LOOK_UP(str(host), *more, **kinds)


@pytest.fixture(autouse=True)
def _no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "socket", _LoopbackSocket)
    monkeypatch.setattr(socket, "getaddrinfo", _look_up)
    for name in ("http_proxy", "https_proxy", "all_proxy", "OPENAI_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.upper(), raising=False)
    monkeypatch.setenv("SCENEWRIGHT_API_KEY", KEY)


@pytest.fixture
def server() -> Iterator[Server]:
    with serving() as state:
        yield state


@pytest.fixture
def pauses(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The pauses between attempts, which are not waited for."""
    found: list[float] = []
    monkeypatch.setattr(retry.time, "sleep", found.append)
    return found
