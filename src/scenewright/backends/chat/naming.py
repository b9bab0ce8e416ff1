"""A chat model by its name, over an HTTP client within limits; keys come from the environment,
endpoints from the user alone."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from scenewright.backends.chat.retry import quote
from scenewright.errors import InputError
from scenewright.extras import require_extra

if TYPE_CHECKING:
    from langchain_core.language_models import BaseChatModel

import time
import weakref
from collections.abc import Iterator
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


_PACKAGE = {"openai": "langchain_openai", "anthropic": "langchain_anthropic"}
_KEY = {"openai": "OPENAI_API_KEY", "anthropic": "ANTHROPIC_API_KEY"}
_HOME = {"openai": "https://api.openai.com/v1", "anthropic": "https://api.anthropic.com"}
OWN_KEY = "SCENEWRIGHT_API_KEY"
"""For endpoints that the user names: the keys of the two providers are not sent there."""

_MOST_BYTES = 16_000_000


@dataclass(frozen=True)
class Endpoint:
    """Where a model is reached.

    Attributes:
        key: the secret to hide in whatever is said about it; never printed.
    """

    model: Any
    name: str
    key: str | None = field(default=None, repr=False)


def load_chat_model(
    name: str,
    *,
    base_url: str | None = None,
    timeout: float,
    max_tokens: int,
    most_bytes: int = _MOST_BYTES,
) -> Endpoint:
    """The chat model of that name, ready to be asked; its own retries are off.

    Raises:
        InputError: no such provider, or its package or key is missing, or the URL is none.
    """
    provider, _, model = name.partition(":")
    if not model.strip() or not provider:
        raise InputError(f"a model is named PROVIDER:MODEL, such as openai:MODEL, got {name!r}")
    if base_url is not None:
        base_url = _check_url(base_url)
    if provider not in _PACKAGE:
        key = os.environ.get(f"{provider.upper()}_API_KEY")
        return Endpoint(_load_other(name, provider, base_url, key), name, key)
    if provider == "anthropic" and base_url is not None:
        raise InputError("--base-url is for OpenAI-compatible endpoints; name the model openai:...")
    require_extra("chat", name, _PACKAGE[provider])
    key = _find_key(provider, base_url)
    make = _load_openai if provider == "openai" else _load_anthropic
    made = make(
        model,
        key=key or "none",
        base_url=base_url or _HOME[provider],
        timeout=timeout,
        max_tokens=max_tokens,
        most_bytes=most_bytes,
    )
    return Endpoint(made, name if base_url is None else f"{name} at {base_url}", key)


def _check_url(base_url: str) -> str:
    """The URL, which has no secrets in it."""
    try:
        parts = urlsplit(base_url)
        good = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        good = False
    if not good or any(not c.isprintable() or c.isspace() for c in base_url):
        raise InputError(
            f"--base-url is an http address such as http://localhost:8000/v1, got {base_url[:80]!r}"
        )
    if parts.username or parts.password or parts.query or parts.fragment:
        raise InputError(
            f"--base-url carries no user, password or query; put the key into {OWN_KEY}"
        )
    return base_url.rstrip("/")


def _find_key(provider: str, base_url: str | None) -> str | None:
    """The key; an endpoint of the user's own needs none."""
    variable = _KEY[provider] if base_url is None else OWN_KEY
    key = os.environ.get(variable, "").strip()
    if not key and base_url is None:
        raise InputError(f"{variable} is not set; {provider} models need a key in the environment")
    if key and not (key.isascii() and key.isprintable()):
        raise InputError(f"{variable} is no key: it holds characters that cannot be sent")
    return key or None


def _load_openai(
    model: str, *, key: str, base_url: str, timeout: float, max_tokens: int, most_bytes: int
) -> BaseChatModel:
    from langchain_openai import ChatOpenAI
    from pydantic import SecretStr

    own = base_url != _HOME["openai"]
    # Servers of one's own know `max_tokens`; the name that replaced it is OpenAI's alone.
    limit: dict[str, Any] = (
        {"extra_body": {"max_tokens": max_tokens}} if own else {"max_completion_tokens": max_tokens}
    )
    return ChatOpenAI(
        model=model,
        api_key=SecretStr(key),
        base_url=base_url,
        organization="" if own else None,
        timeout=timeout,
        max_retries=0,
        use_responses_api=False,
        http_client=build_bounded_client(base_url, seconds=timeout, most_bytes=most_bytes),
        **limit,
    )


def _load_anthropic(
    model: str, *, key: str, base_url: str, timeout: float, max_tokens: int, most_bytes: int
) -> BaseChatModel:
    del most_bytes  # its client takes none of ours; it asks at Anthropic's own address alone
    from langchain_anthropic import ChatAnthropic
    from pydantic import SecretStr

    return ChatAnthropic(
        model_name=model,
        api_key=SecretStr(key),
        base_url=base_url,
        timeout=timeout,
        max_retries=0,
        max_tokens_to_sample=max_tokens,
        stop=None,
    )


def _load_other(name: str, provider: str, base_url: str | None, key: str | None) -> BaseChatModel:
    """A model of another provider, if the package `langchain` is there and knows it."""
    if base_url is not None:
        raise InputError("--base-url is for OpenAI-compatible endpoints; name the model openai:...")
    if find_spec("langchain") is None:
        known = ", ".join(sorted(_PACKAGE))
        raise InputError(
            f"there is no backend {name!r}: of the providers of models, {known} come with the "
            f"extra 'chat'; for {provider!r} install langchain and its package as well"
        )
    try:
        made: BaseChatModel = import_module("langchain.chat_models").init_chat_model(name)
    except (ImportError, ValueError) as error:
        raise InputError(f"{name} cannot be used: {quote(error, key)}") from None
    return made
