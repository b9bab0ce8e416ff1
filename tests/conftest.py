"""No network, and properties that are tried the same way on every machine."""

from __future__ import annotations

import socket
from typing import Any

import pytest
from hypothesis import settings

settings.register_profile("scenewright", deadline=None, max_examples=30, derandomize=True)
settings.load_profile("scenewright")


class _LocalSocket(socket.socket):
    """A socket that reaches this machine's own processes by file and nothing else."""

    def connect(self, address: Any, /) -> None:
        self._refuse(address)
        super().connect(address)

    def connect_ex(self, address: Any, /) -> int:
        self._refuse(address)
        return super().connect_ex(address)

    def _refuse(self, address: Any) -> None:
        if self.family != socket.AF_UNIX:
            raise RuntimeError(f"tests must not use the network, {address!r} was asked for")


def _resolve_nothing(host: object, *_: object, **__: object) -> Any:
    raise RuntimeError(f"tests must not use the network, the name {host!r} was looked up")


@pytest.fixture(autouse=True)
def _no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "socket", _LocalSocket)
    monkeypatch.setattr(socket, "getaddrinfo", _resolve_nothing)
