"""A chat model by its name; keys come from the environment, endpoints from the user alone."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from typing import Any
from urllib.parse import urlsplit

from pydantic import SecretStr

from scenewright.backends.chat.bounded_client import build_bounded_client
from scenewright.backends.chat.retry import quote
from scenewright.errors import InputError
from scenewright.extras import require_extra

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
    key, url = _find_key(provider, base_url), base_url or _HOME[provider]
    usual = {"api_key": SecretStr(key or "none"), "base_url": url, "timeout": timeout,
             "max_retries": 0}  # fmt: skip
    package = import_module(_PACKAGE[provider])
    if provider == "anthropic":  # its client takes none of ours; it asks at its own address alone
        made = package.ChatAnthropic(
            model_name=model, max_tokens_to_sample=max_tokens, stop=None, **usual
        )
    else:
        own = url != _HOME["openai"]
        # Servers of one's own know `max_tokens`; the name that replaced it is OpenAI's alone.
        made = package.ChatOpenAI(
            model=model,
            organization="" if own else None,
            use_responses_api=False,
            http_client=build_bounded_client(url, seconds=timeout, most_bytes=most_bytes),
            **(
                {"extra_body": {"max_tokens": max_tokens}}
                if own
                else {"max_completion_tokens": max_tokens}
            ),
            **usual,
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


def _load_other(name: str, provider: str, base_url: str | None, key: str | None) -> Any:
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
        return import_module("langchain.chat_models").init_chat_model(name)
    except (ImportError, ValueError) as error:
        raise InputError(f"{name} cannot be used: {quote(error, key)}") from None
