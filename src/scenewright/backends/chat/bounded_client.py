"""An HTTP client whose replies end within limits of time and size."""

from __future__ import annotations

import time
import weakref
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

import httpx


class _Bounded(httpx.SyncByteStream):
    """A body that ends with an error once it is too long or has taken too long."""

    def __init__(self, body: httpx.SyncByteStream, *, until: float, most_bytes: int) -> None:
        self._body, self._until, self._left = body, until, most_bytes

    def __iter__(self) -> Iterator[bytes]:
        for chunk in self._body:
            self._left -= len(chunk)
            if self._left < 0:
                raise httpx.RemoteProtocolError("the reply has no end")
            if time.monotonic() > self._until:
                raise httpx.ReadTimeout("the reply takes too long")
            yield chunk

    def close(self) -> None:
        self._body.close()


class _BoundedTransport(httpx.HTTPTransport):
    def __init__(self, *, seconds: float, most_bytes: int, proxy: str | None) -> None:
        super().__init__(proxy=proxy)
        self._seconds, self._most_bytes = seconds, most_bytes

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """The response, its body bounded in time and size; a packed one could be of any size."""
        until = time.monotonic() + self._seconds
        request.headers["accept-encoding"] = "identity"
        response = super().handle_request(request)
        packed = response.headers.get("content-encoding", "identity")
        if packed.strip().lower() != "identity":
            response.close()
            raise httpx.RemoteProtocolError("the reply is packed, though it was asked for as it is")
        body: Any = response.stream
        response.stream = _Bounded(body, until=until, most_bytes=self._most_bytes)
        return response


def build_bounded_client(base_url: str, *, seconds: float, most_bytes: int) -> httpx.Client:
    """A client whose replies end within `seconds` and `most_bytes`, and that is never redirected.

    A redirect would carry the prompt to an address that the user has not named. A proxy is taken
    from the environment, as elsewhere.
    """
    transport = _BoundedTransport(
        seconds=seconds, most_bytes=most_bytes, proxy=_find_proxy(base_url)
    )
    client = httpx.Client(transport=transport, timeout=seconds, follow_redirects=False)
    # Models are never closed; their connections close with them.
    weakref.finalize(client, transport.close)
    return client


def _find_proxy(url: str) -> str | None:
    """The HTTP proxy that the environment names for an address; none for this machine's own."""
    parts = urlsplit(url)
    host = parts.hostname or ""
    if host in ("localhost", "127.0.0.1", "::1") or proxy_bypass(host):
        return None
    known = getproxies()
    proxy = known.get(parts.scheme) or known.get("all")
    return proxy if proxy is not None and proxy.startswith("http") else None
