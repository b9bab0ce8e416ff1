"""No network, no learned refiner unless a test names it, and the same examples on every machine."""

from __future__ import annotations

import gc
import os
import socket
from typing import Any

import pytest
from hypothesis import settings

# Most tests are about what comes before the refiner, which takes longer than all of it.
os.environ["SCENEWRIGHT_REFINER"] = "none"

# Nor are most about full streets, whose every agent is solved for and checked.
os.environ["SCENEWRIGHT_MAX_AGENTS"] = "12"

# Matrices here are small: threads spin while they wait for each other, which costs the tests of
# the planner seven times the processor time. Read when numpy and torch are loaded.
os.environ |= {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}

# What is imported lives to the end: looking through it took a fifth of the time of collecting.
gc.disable()


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


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
