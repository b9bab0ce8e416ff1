"""The tests themselves cannot reach the network."""

from __future__ import annotations

import asyncio
import socket
from urllib.request import urlopen

import pytest


@pytest.mark.parametrize("url", ["http://127.0.0.1:9/", "http://example.org/"])
def test_network_is_out_of_reach(url: str) -> None:
    with pytest.raises(RuntimeError, match="must not use the network"):
        urlopen(url)


def test_a_socket_connects_nowhere() -> None:
    with socket.socket() as plain, pytest.raises(RuntimeError, match="must not use the network"):
        plain.connect(("127.0.0.1", 9))


def test_event_loops_still_work() -> None:
    assert asyncio.run(asyncio.sleep(0, "done")) == "done"
